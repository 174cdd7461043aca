"""The world that `ig2mj view --policy` shows: agent steps in thirds, then the next start state; film strips."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

import ig2mj
from ig2mj.errors import EngineError
from ig2mj.showcase.film_strip import FilmStrip
from ig2mj.viewer.acting import BETWEEN, PAUSE, ActingWorld
from ig2mj.viewer.interactive import World


@pytest.mark.slow
def test_one_agent_step_is_shown_in_thirds_and_the_next_start_follows_an_episode():
    env = ig2mj.make("PointNavigation", worlds=1, engine="native", pool_size=4).with_horizon(2)
    forward = np.array([[1.0, 0.0]], np.float32)
    world = ActingWorld(env, lambda state: forward)
    assert isinstance(world, World)
    start = world.data.qpos.copy()
    world.prepare()
    assert np.array_equal(world.data.qpos, start)
    shown = []
    for _ in range(2 * BETWEEN):
        world.step()
        shown.append(world.data.qpos.copy())
    assert int(world.state.info["steps"][0]) == 2
    moved = [np.linalg.norm(b[:3] - a[:3]) for a, b in zip([start, *shown], shown, strict=False)]
    assert moved[3:] == pytest.approx([moved[3]] * 3, rel=0.01)  # evenly
    for _ in range(PAUSE):
        world.step()
    assert world.episodes == 1 and not np.allclose(world.data.qpos, start)
    first = world.data.qpos.copy()
    world.reset()
    assert not np.allclose(world.data.qpos, first)
    with pytest.raises(EngineError, match="one world"):
        ActingWorld(ig2mj.make("PointNavigation", worlds=2, engine="native", pool_size=4), lambda state: forward)


def test_a_film_strip_has_its_frames_side_by_side(tmp_path):
    strip = FilmStrip(tmp_path / "strip.png", frames=3)
    for value in range(0, 250, 25):
        strip.add(np.full((8, 10, 3), value, np.uint8))
    strip.close()
    picture = np.asarray(Image.open(tmp_path / "strip.png"))
    assert picture.shape == (8, 3 * 10 + 2 * 6, 3)
    assert picture[0, [0, 16, 32], 0].tolist() == [0, 100, 225]
    assert (picture[:, 10:16] == 255).all()
