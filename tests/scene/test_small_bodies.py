"""What is small in all directions falls to the floor without gaining energy; other objects keep their inertia."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest, ObjectEntry
from ig2mj.scene.small_bodies import SMALLEST_GYRATION, steady_small_bodies

TIMESTEP = 1 / 120
FROM_FRAME = 0.0232
"""m from the frame of half a strawberry to its centre of mass."""


def built(inertial: str, fixed: bool = False, steady: bool = True) -> mujoco.MjModel:
    """A thing as large as half a strawberry above a floor as homes have it; its frame is at its end, as that of half a
    strawberry is."""
    points = np.random.default_rng(3).normal(size=(40, 3))
    points *= np.array([0.0115, 0.0172, 0.0236]) / np.linalg.norm(points, axis=1, keepdims=True)
    corners = " ".join(map(str, points.ravel()))
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><option timestep="{TIMESTEP}" integrator="implicitfast"/>'
        f'<asset><mesh name="hull" vertex="{corners}"/></asset><worldbody>'
        '<geom type="box" size="9 9 0.5" pos="0 0 -0.5" solref="0.04 1" friction="0.25"/>'
        f'<body name="thing">{"" if fixed else "<freejoint/>"}{inertial}'
        f'<geom type="mesh" mesh="hull" pos="0 0 {FROM_FRAME}" friction="0.25" margin="0.003"/></body>'
        "</worldbody></mujoco>"
    )
    entry = ObjectEntry("thing", "thing", "made", ["thing"], fixed, (1, 1, 1), 1.0)
    if steady:
        steady_small_bodies(spec, Manifest(FORMAT_VERSION, "made", [entry]))
    return spec.compile()


def inertial(mass: float, *moments: float) -> str:
    return f'<inertial pos="0 0 {FROM_FRAME}" mass="{mass}" diaginertia="{" ".join(map(str, moments))}"/>'


SMALL = inertial(0.0104, 1.03e-6, 7.4e-7, 5.6e-7)


def gains(model: mujoco.MjModel, falls: int = 40) -> float:
    """The most energy, as a share of that at the start, that it has in falls from 1 m, turned at random."""
    data, random, most = mujoco.MjData(model), np.random.default_rng(0), 0.0
    for _ in range(falls):
        mujoco.mj_resetData(model, data)
        turn = random.normal(size=4)
        data.qpos[:] = [0, 0, 1, *(turn / np.linalg.norm(turn))]
        data.qvel[3:] = 4 * random.normal(size=3)
        for _ in range(240):
            mujoco.mj_step(model, data)
            velocity = data.cvel[1, 3:]
            most = max(most, (velocity @ velocity / 2 + 9.81 * data.xipos[1, 2]) / 9.81)
    return most


def test_half_a_strawberry_that_falls_gains_no_energy():
    assert gains(built(SMALL, steady=False)) > 2.0  # as the file has it
    assert gains(built(SMALL)) < 1.2


@pytest.mark.parametrize(
    ("stated", "fixed"),
    [
        (inertial(0.016, 1.0e-4, 1.0e-4, 1.0e-7), False),  # long and thin
        (inertial(0.1, 6e-5, 5e-5, 4e-5), False),  # as large as an apple
        (SMALL, True),
    ],
)
def test_what_is_long_or_large_or_fixed_keeps_its_inertia(stated: str, fixed: bool):
    assert (built(stated, fixed).body_inertia == built(stated, fixed, steady=False).body_inertia).all()


def test_only_small_objects_of_a_home_change_and_keep_their_mass():
    scene = ig2mj.load_scene("small_home", objects=["strawberry/strawberry_00", "plate/plate_00"])
    model = scene.model
    halves = [n for n in scene.object_names if n.startswith("strawberry_0_part")]
    assert len(halves) == 2
    for name in (*halves, "plate_0"):
        body = model.body(scene.object(name).bodies[0]).id
        gyration = np.sqrt(model.body_inertia[body] / model.body_mass[body])
        assert model.body_mass[body] == pytest.approx(scene.object(name).mass, rel=1e-3)
        assert np.allclose(gyration, SMALLEST_GYRATION) == (name in halves)
