"""Homes have solid ground below their floors: what is pressed into a floor next to its edge does not sink there."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import solid_homes

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.scene.floors import DEPTH, deepen_floors
from ig2mj.scene.ground import BELOW, BESIDE, GROUND, add_ground
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest, ObjectEntry
from ig2mj.scene.scene import Scene

FLOORS = '<geom type="box" size="1 2 0.1" pos="-1 0 -0.1"/><geom type="box" size="1 2 0.1" pos="1 0 -0.1"/>'
STEP = '<geom type="box" size="1 2 0.1" pos="3 0 -0.3"/>'
THING = '<freejoint/><geom type="box" size="0.03 0.05 0.015" mass="0.08"/>'


def built(floors: str = FLOORS, things: str = "", ground: bool = True) -> mujoco.MjModel:
    """A building of these floors; `things`: heights of boxes of 0.1 x 0.1 x 0.4 m."""
    entries = [ObjectEntry("floors", "floors", "made", ["floors"], True, (1, 1, 1), 1.0)] if floors else []
    bodies = f'<body name="floors">{floors}</body>' if floors else ""
    for number, height in enumerate(things.split()):
        entries.append(ObjectEntry(f"t{number}", "post", "made", [f"t{number}"], True, (0.1, 0.1, 0.4), 1.0))
        bodies += f'<body name="t{number}" pos="0 0 {height}"><geom size="0.05 0.05 0.2" type="box"/></body>'
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><worldbody>{bodies}<body name="thing" pos="0 5 1">{THING}</body></worldbody></mujoco>'
    )
    manifest = Manifest(FORMAT_VERSION, "made", entries)
    deepen_floors(spec, manifest)
    if ground:
        add_ground(spec, manifest)
    return spec.compile()


def box_of(model: mujoco.MjModel) -> list[list[float]]:
    """Low and high corner of the ground; empty: there is none."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{GROUND}/collision_0")
    if number < 0:
        return []
    pos, half = model.geom_pos[number], model.geom_size[number]
    return [(pos - half).round(9).tolist(), (pos + half).round(9).tolist()]


def test_it_is_just_below_the_lowest_floor_and_reaches_below_the_walls_around_all():
    low, high = np.array([-2.0, -2.0]) - BESIDE, np.array([2.0, 2.0]) + BESIDE
    assert box_of(built()) == [[*low, -BELOW - DEPTH], [*high, -BELOW]]
    assert box_of(built(FLOORS + STEP))[1] == pytest.approx([5.0, 3.0, -0.2 - BELOW])
    assert box_of(built("")) == []


@pytest.mark.parametrize(("things", "top"), [("0.2", -BELOW), ("0.1", -0.1 - BELOW), ("0.1 -0.2", -0.4 - BELOW)])
def test_it_is_lower_where_an_object_reaches_deeper(things, top):
    assert box_of(built(things=things))[1][2] == pytest.approx(top)


def test_objects_far_below_that_wait_to_be_used_do_not_lower_it():
    assert box_of(built(things="-5"))[1][2] == pytest.approx(-BELOW)


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.02, 1.0), (2.03, 0.0), (-1.0, -2.04)])
def test_what_is_pressed_into_a_floor_next_to_its_edge_is_pushed_out_and_without_ground_sinks(place):
    ends = []
    for ground in (True, False):
        model = built(ground=ground)
        data = mujoco.MjData(model)
        data.qpos[:3] = [*place, -0.1]
        for _ in range(2000):
            mujoco.mj_step(model, data)
        ends.append(float(data.qpos[2]))
    assert ends[0] > -BELOW and ends[1] < -0.05


@pytest.fixture(scope="module")
def with_and_without() -> tuple[Scene, Scene]:
    return solid_homes.with_and_without("add_ground")


def test_nothing_that_rests_in_a_home_touches_it_and_no_object_contains_it(with_and_without):
    solid, plain = with_and_without
    body = solid.model.body(GROUND).id
    data = solid.start_data()
    for _ in range(100):
        mujoco.mj_step(solid.model, data)
    assert not (solid.model.geom_bodyid[data.contact.geom] == body).any()
    assert (solid.tables.geom_object[solid.model.geom_bodyid == body] == -1).all()
    other = plain.start_data()
    for _ in range(100):
        mujoco.mj_step(plain.model, other)
    assert (data.qpos == other.qpos).all(), "the same to the bit"


def test_what_passes_through_floors_passes_through_it():
    """The humanoid's body, which a crouch lowers below the floor's surface."""
    model = ig2mj.load_scene("small_home", [Humanoid()]).model
    body, ground = model.body("humanoid").id, model.body(GROUND).id
    assert ((min(body, ground) << 16) + max(body, ground)) in model.exclude_signature
