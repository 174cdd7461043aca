"""Dragging by a spring."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ig2mj.viewer.mouse import MAX_FORCE
from ig2mj.web.spring import Drag, felt_mass, grabbed_at, pull, release

WORLD = """<mujoco><option timestep="0.00833333"/><worldbody><geom type="plane" size="5 5 1"/>
<body name="box" pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="2"/></body>
<body name="stick" pos="1 0 0.02"><freejoint/><geom type="box" size="0.4 0.02 0.02" mass="0.1"/></body>
<body name="door" pos="2 0 0.5"><joint type="hinge" axis="0 0 1" range="-90 90" limited="true" damping="0.1"/>
<geom type="box" size="0.3 0.02 0.4" pos="0.3 0 0" mass="8"/></body></worldbody></mujoco>"""


@pytest.fixture
def world() -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(WORLD)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def hold(model, data, drag: Drag, seconds: float) -> None:
    for _ in range(round(seconds * 30)):  # a force stays for a control step, as in the viewer
        pull(model, data, drag)
        mujoco.mj_step(model, data, nstep=4)


def test_an_object_comes_to_the_pointer_and_stays_there(world):
    model, data = world
    drag = Drag(model.body("box").id, np.zeros(3), np.array([0.3, -0.2, 0.6]))
    hold(model, data, drag, 3.0)
    np.testing.assert_allclose(grabbed_at(data, drag), drag.target, atol=0.005)
    assert np.linalg.norm(data.cvel[drag.body]) < 0.05


def test_a_light_stick_held_at_its_end_does_not_shake(world):
    model, data = world
    drag = Drag(model.body("stick").id, np.array([0.39, 0.0, 0.0]), np.array([1.4, 0.0, 0.8]))
    hold(model, data, drag, 6.0)
    assert np.isfinite(data.qpos).all()
    np.testing.assert_allclose(grabbed_at(data, drag), drag.target, atol=0.05)


def test_a_door_turns_on_its_hinge(world):
    model, data = world
    drag = Drag(model.body("door").id, np.array([0.6, 0.0, 0.0]), np.array([2.4, 0.45, 0.5]))
    hold(model, data, drag, 3.0)
    assert data.joint(2).qpos[0] == pytest.approx(np.arctan2(0.45, 0.4), abs=0.03)


def test_the_spring_is_no_stronger_than_a_hand_and_lets_go(world):
    model, data = world
    drag = Drag(model.body("box").id, np.zeros(3), np.array([0.0, 0.0, 1000.0]))
    pull(model, data, drag)
    assert np.linalg.norm(data.xfrc_applied[drag.body, :3]) == pytest.approx(MAX_FORCE)
    release(data, drag)
    assert not data.xfrc_applied.any()


def test_a_point_off_the_centre_feels_lighter(world):
    model, data = world
    body = model.body("stick").id
    middle, end = (felt_mass(model, data, body, data.xpos[body] + [x, 0, 0]) for x in (0.0, 0.4))
    assert middle == pytest.approx(0.1, rel=0.01)
    assert end == pytest.approx(0.1 / 4, rel=0.05)
