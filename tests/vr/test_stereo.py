"""Pictures for two eyes: what is left out because nobody can see it changes no pixel."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.process.opengl import GL_BACKENDS, probe_gl
from ig2mj.vr.frames import Pose
from ig2mj.vr.stereo import HEIGHT, WIDTH, Eye, StereoImages

pytestmark = pytest.mark.skipif(all(probe_gl(b) for b in GL_BACKENDS), reason="no OpenGL draws on this machine")


def eyes_of(head: Pose, apart: float = 0.063, across: float = math.radians(98)) -> tuple[Eye, Eye]:
    """Two eyes `apart` m from each other, with an angle of view of `across` rad."""
    half = across / 2
    high = math.atan(math.tan(half) * HEIGHT / WIDTH)
    left, right = (Pose.of(head.pos + head.turn.apply((0.0, y, 0.0)), head.turn) for y in (apart / 2, -apart / 2))
    return Eye(left, -half, half, high, -high), Eye(right, -half, half, high, -high)


@pytest.fixture(scope="module")
def home():
    return ig2mj.load_scene("small_home", agents=[Humanoid()])


@pytest.fixture(scope="module")
def poses(home):
    data = home.start_data()
    mujoco.mj_forward(home.model, data)
    return np.concatenate([data.xpos, data.xquat], axis=1)


@pytest.fixture(scope="module")
def pictures(home):
    made = StereoImages(home, 64, 72, 0)
    yield made
    made.close()


@pytest.mark.parametrize("seed", range(6))
def test_geoms_outside_of_both_views_are_left_out_without_a_trace(pictures, poses, seed, monkeypatch):
    rng = np.random.default_rng(seed)
    head = Pose.of(
        rng.uniform([-1, -1, 0.3], [3, 2, 2.0]), Rotation.from_euler("zyx", rng.uniform(-0.9, 0.9, 3) * [3, 1, 1])
    )
    eyes = eyes_of(head)
    pictures.draw(poses, eyes)
    seen, drawn = pictures.read(), pictures._scene.ngeom
    monkeypatch.setattr(pictures, "_seen", lambda eye: np.ones(len(pictures._geoms), bool))
    pictures.draw(poses, eyes)
    assert np.array_equal(seen, pictures.read())
    assert drawn < pictures._scene.ngeom and seen.std() > 5
