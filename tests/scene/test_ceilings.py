"""Homes have a solid ceiling that nothing flies past, and that neither pictures nor rays nor start states know of."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import solid_homes

from ig2mj.sampling.probe import cast_rays
from ig2mj.scene.ceilings import CEILING, CLEARANCE, add_ceiling
from ig2mj.scene.floors import DEPTH, TIME_CONSTANT
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest, ObjectEntry
from ig2mj.scene.scene import Scene
from ig2mj.viewer.offscreen import render
from ig2mj.viewer.overview import home_overview

WALLS = "".join(
    f'<geom type="box" size="{x} {y} 1.25" pos="{at}"/>'
    for x, y, at in ((2, 0.1, "0 1.9 1.25"), (2, 0.1, "0 -1.9 1.25"), (0.1, 2, "1.9 0 1.25"), (0.1, 2, "-1.9 0 1.25"))
)
FLOOR = '<geom type="box" size="2 2 0.1" pos="0 0 -0.1"/>'
PORCH = '<geom type="box" size="1 1 0.1" pos="3 0 -0.1"/>'
RAIL = '<geom type="box" size="0.05 1 0.5" pos="4 0 0.5"/>'


def closed(walls: str = WALLS, floors: str = FLOOR, ceilings: str = "", cupboard: str = "") -> mujoco.MjModel:
    """A building of these geoms, and something of 0.4 m that can move, at `cupboard`."""
    entries, bodies = [], ""
    for name, geoms in (("walls", walls), ("floors", floors), ("ceilings", ceilings)):
        if geoms:
            entries.append(ObjectEntry(name, name, "made", [name], True, (1, 1, 1), 1.0))
            bodies += f'<body name="{name}">{geoms}</body>'
    if cupboard:
        entries.append(ObjectEntry("box", "box", "made", ["box"], False, (0.4, 0.4, 0.4), 1.0))
        bodies += f'<body name="box" pos="{cupboard}"><freejoint/><geom type="box" size="0.2 0.2 0.2"/></body>'
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    add_ceiling(spec, Manifest(FORMAT_VERSION, "made", entries))
    return spec.compile()


def box_of(model: mujoco.MjModel) -> list[list[float]]:
    """Low and high corner of the ceiling; empty: there is none."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{CEILING}/collision_0")
    if number < 0:
        return []
    pos, half = model.geom_pos[number], model.geom_size[number]
    return [(pos - half).round(9).tolist(), (pos + half).round(9).tolist()]


def test_it_lies_on_the_walls_over_the_floors_between_them_and_leaves_a_porch_free():
    over = [[-2, -2, 2.5], [2, 2, 2.5 + DEPTH]]
    assert box_of(closed()) == over
    assert box_of(closed(WALLS + RAIL, FLOOR + PORCH)) == over
    assert closed().geom(f"{CEILING}/collision_0").solref[0] == TIME_CONSTANT


def test_there_is_none_without_walls_or_floors_or_where_the_home_has_its_own():
    own = '<geom type="box" size="2 2 0.05" pos="0 0 2.55"/>'
    seen = '<geom type="box" size="2 2 0.05" pos="0 0 2.55" contype="0" conaffinity="0"/>'
    assert box_of(closed(walls="")) == box_of(closed(floors="")) == box_of(closed(floors=PORCH)) == []
    assert box_of(closed(ceilings=own)) == [] and box_of(closed(ceilings=seen)) == box_of(closed())


@pytest.mark.parametrize(("place", "under"), [("0 0 2.2", 2.5), ("0 0 2.6", 2.8 + CLEARANCE), ("9 0 2.6", 2.5)])
def test_it_is_raised_over_what_can_move_and_is_higher_than_the_walls(place, under):
    assert box_of(closed(cupboard=place))[0][2] == pytest.approx(under)


@pytest.fixture(scope="module")
def with_and_without() -> tuple[Scene, Scene]:
    return solid_homes.with_and_without("add_ceiling")


def test_a_bowl_thrown_up_comes_back_and_without_the_ceiling_does_not(with_and_without):
    ends = []
    for scene in with_and_without:
        data, joint = scene.start_data(), scene.model.joint("bowl_0/free")
        data.qpos[joint.qposadr[0] :][:7] = [0.0, 0.0, 1.2, 1, 0, 0, 0]
        data.qvel[joint.dofadr[0] :][:3] = [0.0, 5.0, 7.0]
        heights = []
        for _ in range(240):
            mujoco.mj_step(scene.model, data)
            heights.append(data.body("bowl_0").xipos[2])
        ends.append((max(heights), *data.body("bowl_0").xipos))
    inside, outside = ends
    assert inside[0] < 2.5 and abs(inside[2]) < 2.3 and 0 < inside[3] < 2.5
    assert outside[0] > 3 and outside[2] > 2.3 and outside[3] < 0


def test_start_states_and_what_follows_are_the_same_bit_for_bit(with_and_without):
    ends = []
    for scene in with_and_without:
        data = scene.start_data()
        data.qvel[:] = np.random.default_rng(0).normal(0, 0.3, scene.model.nv)
        for _ in range(60):
            mujoco.mj_step(scene.model, data)
        ends.append(data.qpos.tobytes() + data.qvel.tobytes())
    assert ends[0] == ends[1]
    assert with_and_without[0].digest == with_and_without[1].digest


def test_tables_do_not_know_it(with_and_without):
    scene, without = with_and_without
    number = scene.model.body(CEILING).id
    assert scene.tables.body_object[number] == scene.tables.body_agent[number] == -1
    assert scene.object_names == without.object_names
    assert len(scene.tables.piece_geom) == len(without.tables.piece_geom)
    assert (scene.tables.room_map == without.tables.room_map).all()
    assert home_overview(scene, scene.start_data()) == home_overview(without, without.start_data())


def test_rays_pass_it(with_and_without):
    directions = np.random.default_rng(0).normal(size=(500, 3))
    distances, owners = zip(
        *(
            cast_rays(s.model, s.start_data(), s.tables.geom_object, np.array([0.0, 0.0, 1.2]), directions)
            for s in with_and_without
        ),
        strict=True,
    )
    assert (distances[0] == distances[1]).all() and (owners[0] == owners[1]).all()
    assert np.isinf(distances[0][directions[:, 2] > 4 * np.abs(directions[:, :2]).max(1)]).any()


def test_pictures_are_the_same_though_they_show_what_collides(with_and_without):
    for groups in ((0, 1, 2), (3,)):
        pictures = [
            [render(scene.model, scene.start_data(), view, width=160, height=120, groups=groups) for view in views]
            for scene in with_and_without
            for views in [(home_overview(scene, scene.start_data()), "living_room_0")]
        ]
        for here, there in zip(*pictures, strict=True):
            assert (here == there).all() and here.std() > 5
