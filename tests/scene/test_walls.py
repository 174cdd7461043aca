"""Outer walls are a metre deep to the outside, windows are closed there, and nothing else of a home is different."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import solid_homes

from ig2mj.sampling.probe import cast_rays
from ig2mj.scene.floors import DEPTH, TIME_CONSTANT
from ig2mj.scene.manifest import FORMAT_VERSION, JointEntry, Manifest, ObjectEntry
from ig2mj.scene.scene import Scene
from ig2mj.scene.walls import PANES, deepen_walls
from ig2mj.viewer.offscreen import render
from ig2mj.viewer.overview import home_overview

FLOOR = '<geom type="box" size="2 2 0.5" pos="0 0 -0.5"/>'


def wall(x: float, y: float, z: float, at: str, more: str = "") -> str:
    return f'<geom type="box" size="{x} {y} {z}" pos="{at}" {more}/>'


SILL, LINTEL = wall(0.5, 0.1, 0.45, "0 2.1 0.45"), wall(0.5, 0.1, 0.25, "0 2.1 2.25")


def built(walls: str, floors: str = FLOOR, turned: str = "1 0 0 0") -> mujoco.MjModel:
    entries = [ObjectEntry(n, n, "made", [n], True, (1, 1, 1), 1.0) for n in ("walls", "floors")]
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><worldbody><body name="walls" quat="{turned}">{walls}</body>'
        f'<body name="floors">{floors}</body></worldbody></mujoco>'
    )
    deepen_walls(spec, Manifest(FORMAT_VERSION, "made", entries))
    return spec.compile()


def boxes_of(model: mujoco.MjModel, body: str) -> list[list[list[float]]]:
    """Low and high corners of a body's geoms, world frame."""
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body) < 0:
        return []
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for geom in np.flatnonzero(model.geom_bodyid == model.body(body).id):
        half = np.abs(data.geom_xmat[geom].reshape(3, 3)) @ model.geom_size[geom]
        found.append([(data.geom_xpos[geom] + side * half).round(9).tolist() for side in (-1, 1)])
    return found


def test_an_outer_wall_is_deep_on_the_outside_and_an_inner_one_as_it_was():
    model = built(wall(2, 0.1, 1.25, "0 2.1 1.25") + wall(2, 0.1, 1.25, "0 0 1.25"))
    assert boxes_of(model, "walls") == [
        [[-2, 2.0, 0], [2, 2.2 + DEPTH, 2.5]],
        [[-2, -0.1, 0], [2, 0.1, 2.5]],
    ]
    assert model.geom_solref[:2, 0].tolist() == [TIME_CONSTANT, 0.02]


def test_a_wall_between_a_room_and_a_porch_is_as_it_was():
    porch = '<geom type="box" size="0.5 0.5 0.1" pos="0 3 -0.1"/>'
    assert boxes_of(built(wall(2, 0.1, 1.25, "0 2.1 1.25"), FLOOR + porch), "walls") == [[[-2, 2, 0], [2, 2.2, 2.5]]]


@pytest.mark.parametrize("turned", ["1 0 0 0", "0.7071067811865476 0 0 0.7071067811865476", "0 0 0 1"])
def test_however_its_body_and_it_are_turned(turned):
    frame = np.zeros(9)
    mujoco.mju_quat2Mat(frame, np.array(turned.split(), float))
    frame = frame.reshape(3, 3)
    half, at = np.abs(frame.T @ [2, 0.1, 1.25]), frame.T @ [0, 2.1, 1.25]
    as_text = " ".join(map(str, at))
    assert boxes_of(built(wall(*half, as_text), turned=turned), "walls") == [[[-2, 2, 0], [2, 2.2 + DEPTH, 2.5]]]


@pytest.mark.parametrize("case", ["turned by 20 degrees", "a pillar", "a cylinder", "no floor"])
def test_what_is_not_along_the_axes_or_thick_or_no_box_keeps_its_shape(case):
    shapes = {
        "turned by 20 degrees": wall(2, 0.1, 1.25, "0 2.1 1.25", 'euler="0 0 20"'),
        "a pillar": wall(0.3, 0.3, 1.25, "0 2.3 1.25"),
        "a cylinder": '<geom type="cylinder" size="0.1 1.25" pos="0 2.1 1.25"/>',
        "no floor": wall(2, 0.1, 1.25, "0 2.1 1.25"),
    }
    floors = "" if case == "no floor" else FLOOR
    before = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body name="walls">{shapes[case]}</body></worldbody></mujoco>'
    )
    assert boxes_of(built(shapes[case], floors), "walls") == boxes_of(before, "walls")


def test_a_window_is_closed_where_the_wall_is_deeper_and_a_door_is_not():
    model = built(SILL + LINTEL)
    assert boxes_of(model, PANES) == [[[-0.5, 2.2, 0.9], [0.5, 2.2 + DEPTH, 2.0]]]
    pane = model.geom(f"{PANES}/collision_0")
    assert pane.rgba[3] == 0 and pane.contype[0] and pane.solref[0] == TIME_CONSTANT
    assert boxes_of(built(LINTEL), PANES) == []


@pytest.mark.parametrize(("way", "closed"), [("0 0 1", 0), ("0 0 -1", 1)])
def test_no_pane_is_where_a_sash_opens_to_the_outside(way, closed):
    sash = (
        f'<body name="sash" pos="-0.5 2.1 1.45"><joint name="sash" type="hinge" axis="{way}" range="0 90"/>'
        '<geom type="box" size="0.5 0.02 0.5" pos="0.5 0 0" mass="1"/></body>'
    )
    window = ObjectEntry("window", "window", "made", ["window", "sash"], True, (1, 1, 1), 1.0)
    window.joints = [JointEntry("sash", "hinge")]
    walls, floors = (ObjectEntry(n, n, "made", [n], True, (1, 1, 1), 1.0) for n in ("walls", "floors"))
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><worldbody><body name="walls">{SILL}{LINTEL}</body><body name="floors">{FLOOR}</body>'
        f'<body name="window">{sash}</body></worldbody></mujoco>'
    )
    deepen_walls(spec, Manifest(FORMAT_VERSION, "made", [walls, floors, window]))
    assert len(boxes_of(spec.compile(), PANES)) == closed


@pytest.mark.parametrize(("y", "fixed", "side"), [(2.6, False, 2.2), (2.6, True, 3.2), (3.6, False, 3.2)])
def test_a_wall_is_as_it_was_where_something_loose_stands_outside(y, fixed, side):
    bin_ = ObjectEntry("bin", "trash_can", "made", ["bin"], fixed, (0.4, 0.4, 0.4), 1.0)
    walls, floors = (ObjectEntry(n, n, "made", [n], True, (1, 1, 1), 1.0) for n in ("walls", "floors"))
    outer = wall(2, 0.1, 1.25, "0 2.1 1.25")
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><worldbody><body name="walls">{outer}</body><body name="floors">{FLOOR}</body>'
        f'<body name="bin" pos="0 {y} 0.2"/></worldbody></mujoco>'
    )
    deepen_walls(spec, Manifest(FORMAT_VERSION, "made", [walls, floors, bin_]))
    assert boxes_of(spec.compile(), "walls") == [[[-2, 2, 0], [2, side, 2.5]]]


@pytest.mark.parametrize("deep", [True, False])
def test_what_is_thrown_out_of_a_window_stays_only_where_it_has_a_pane(deep):
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><worldbody><body name="walls">{SILL}{LINTEL}</body><body name="floors">{FLOOR}</body>'
        '<body name="ball" pos="0 0 1.5"><freejoint/><geom type="sphere" size="0.1"/></body></worldbody></mujoco>'
    )
    if deep:
        entries = [ObjectEntry(n, n, "made", [n], True, (1, 1, 1), 1.0) for n in ("walls", "floors")]
        deepen_walls(spec, Manifest(FORMAT_VERSION, "made", entries))
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[1] = 8.0
    for _ in range(240):
        mujoco.mj_step(model, data)
    assert (data.qpos[1] < 2.2) == deep


@pytest.fixture(scope="module")
def with_and_without() -> tuple[Scene, Scene]:
    return solid_homes.with_and_without("deepen_walls")


def test_tables_do_not_know_of_it(with_and_without):
    scene, thin = with_and_without
    number = scene.model.body(PANES).id
    assert scene.tables.body_object[number] == scene.tables.body_agent[number] == -1
    assert scene.object_names == thin.object_names and scene.digest == thin.digest
    assert len(scene.tables.piece_geom) == len(thin.tables.piece_geom)


def test_start_states_and_what_follows_are_the_same(with_and_without):
    ends = []
    for scene in with_and_without:
        data = scene.start_data()
        data.qvel[:] = np.random.default_rng(0).normal(0, 0.3, scene.model.nv)
        for _ in range(60):
            mujoco.mj_step(scene.model, data)
        ends.append(data.qpos.copy())
    assert np.abs(ends[0] - ends[1]).max() < 1e-6


def test_rays_inside_and_through_windows_are_the_same(with_and_without):
    rng = np.random.default_rng(0)
    for origin in rng.uniform([-2.4, -1.9, 0.3], [2.4, 1.9, 2.2], (8, 3)):
        directions = rng.normal(size=(100, 3))
        (far, owner), (thin_far, thin_owner) = (
            cast_rays(s.model, s.start_data(), s.tables.geom_object, origin, directions) for s in with_and_without
        )
        through = far > 3.5  # out of a window one may meet the deeper side of its opening
        assert (owner == thin_owner)[~through].all() and np.allclose(far[~through], thin_far[~through])


def test_pictures_are_the_same(with_and_without):
    for view in (home_overview(with_and_without[1], with_and_without[1].start_data()), "living_room_0"):
        here, there = (
            render(scene.model, scene.start_data(), view, width=160, height=120, groups=(0, 1, 2))
            for scene in with_and_without
        )
        assert (here == there).all() and here.std() > 5
