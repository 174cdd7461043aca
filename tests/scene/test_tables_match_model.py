"""SceneTables against the compiled model: owners, joints, links, and the half-spaces of convex pieces."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ig2mj
from ig2mj.scene.convex_pieces import hull_planes
from ig2mj.scene.tables import LinkKind, PieceKind


def index(scene: ig2mj.Scene, name: str) -> int:
    return scene.object_index(name)


def test_every_body_and_geom_of_an_object_is_its_own(tiny_home):
    tables, model = tiny_home.tables, tiny_home.model
    for number, entry in enumerate(tiny_home.manifest.objects):
        bodies = {model.body(b).name for b in np.flatnonzero(tables.body_object == number)}
        assert bodies == set(entry.bodies)
    assert tables.body_object[0] == -1
    assert tables.geom_object[model.geom("parking").id] == -1
    assert tables.geom_object[model.geom("cabinet_door/collision_0").id] == index(tiny_home, "cabinet")


def test_bodies_rest_where_no_joint_holds_them(tiny_home):
    tables, model = tiny_home.tables, tiny_home.model
    data = mujoco.MjData(model)
    data.qpos[:] += 0.2
    mujoco.mj_kinematics(model, data)
    own = tables.body_object >= 0
    stays = np.linalg.norm(data.xpos - tables.body_rest_pos, axis=1) < 1e-9
    np.testing.assert_array_equal(tables.body_rests, own & stays & (model.body_weldid == 0))
    assert not tables.body_rests[model.body("cabinet_door").id], "a door is no part that rests"
    assert 0 < tables.body_rests.sum() < own.sum()


def test_openable_joints_carry_addresses_and_ends(tiny_home):
    tables, model = tiny_home.tables, tiny_home.model
    names = ["cabinet_drawer_slide", "cabinet_door_hinge"]
    assert tables.openable_qposadr.tolist() == [model.joint(n).qposadr[0] for n in names]
    assert tables.openable_closed.tolist() == [0, 0]
    assert tables.openable_open.tolist() == [0.3, 1.6]
    assert set(tables.openable_object) == {index(tiny_home, "cabinet")}


def test_annotated_links_are_sites_or_geoms(tiny_home):
    tables, model = tiny_home.tables, tiny_home.model
    slicer = tables.link_kind.tolist().index(LinkKind.SLICER)
    assert tables.link_geom[slicer] == model.geom("knife/slicer").id
    assert tables.link_half[slicer] == pytest.approx([0.06, 0.002, 0.015])
    heat = tables.link_kind.tolist().index(LinkKind.HEAT_SOURCE)
    assert tables.link_geom[heat] == -1
    assert tables.link_pos[heat] == pytest.approx([0, 0, 0.85])
    assert (tables.link_half[heat] == 0).all()
    assert len(tables.link_kind) == 6


def test_parts_know_their_whole_and_where_they_start(tiny_home):
    tables = tiny_home.tables
    half = index(tiny_home, "apple_half_0")
    assert tables.object_part_of[half] == index(tiny_home, "apple")
    assert tables.object_parked[half] and not tables.object_parked[index(tiny_home, "apple")]
    assert tables.object_is_floor.sum() == 1


def test_one_piece_per_collision_geom_and_none_for_visuals(tiny_home):
    tables, model = tiny_home.tables, tiny_home.model
    named = [model.geom(g).name for g in tables.piece_geom]
    assert not any("visual" in n for n in named)
    expected = [g for g in range(model.ngeom) if model.geom_contype[g] and tables.geom_object[g] >= 0]
    assert tables.piece_geom.tolist() == expected


def test_pieces_hold_their_corners_and_touch_each_half_space(tiny_home):
    tables = tiny_home.tables
    hulls = tables.piece_kind == PieceKind.POLYHEDRON
    assert hulls.sum() > 30
    outside = (
        np.einsum("knc,kvc->knv", tables.piece_planes[..., :3], tables.piece_vertices) - tables.piece_planes[..., 3:]
    )
    assert outside[hulls].max() < 1e-9
    real = np.linalg.norm(tables.piece_planes[..., :3], axis=-1) > 0.5
    assert np.abs(outside.max(-1)[real & hulls[:, None]]).max() < 1e-9, "a half-space that no corner touches is slack"
    assert (tables.piece_planes[~real] == [0, 0, 0, 1]).all()


def test_an_icosahedron_has_twenty_sides_and_a_box_six(tiny_home):
    tables = tiny_home.tables
    sides = (np.linalg.norm(tables.piece_planes[..., :3], axis=-1) > 0.5).sum(1)
    assert sides[tables.piece_object == index(tiny_home, "apple")] == [20]
    assert sides[tables.piece_object == index(tiny_home, "box")] == [6]
    assert sides[tables.piece_object == index(tiny_home, "ball")] == [0]


def test_mesh_pieces_are_where_mujoco_collides_with_them(tiny_home):
    """The compiler recentres meshes: rays from outside must hit the surface that the half-spaces describe."""
    tables, model = tiny_home.tables, tiny_home.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rng = np.random.default_rng(0)
    for name in ("apple", "apple_half_0"):
        (piece,) = np.flatnonzero(tables.piece_object == index(tiny_home, name))
        geom = tables.piece_geom[piece]
        body = tables.piece_body[piece]
        pos, quat = np.zeros(3), np.zeros(4)
        mujoco.mju_mulPose(
            pos, quat, data.xpos[body], data.xquat[body], tables.piece_pos[piece], tables.piece_quat[piece]
        )
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, quat)
        rotation = rotation.reshape(3, 3)
        for _ in range(20):
            direction = rng.normal(size=3)
            direction /= np.linalg.norm(direction)
            start = pos - 0.3 * direction
            hit = mujoco.mj_rayMesh(model, data, int(geom), start, direction)
            planes = tables.piece_planes[piece]
            local, aim = rotation.T @ (start - pos), rotation.T @ direction
            speed = planes[:, :3] @ aim
            entering = speed < -1e-9
            entry = ((planes[:, 3] - planes[:, :3] @ local)[entering] / speed[entering]).max()
            assert hit == pytest.approx(entry, abs=1e-4)


@given(st.integers(0, 10_000), st.integers(5, 40))
def test_hull_planes_contain_all_points(seed: int, count: int):
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [1, 0.1, 3]
    planes, corners = hull_planes(points)
    assert np.allclose(np.linalg.norm(planes[:, :3], axis=1), 1)
    assert (planes[:, :3] @ points.T <= planes[:, 3:] + 1e-9).all()
    assert len(corners) <= count


def test_flat_sides_are_one_half_space_however_they_are_triangulated():
    grid = np.linspace(-1, 1, 4)
    cube = np.array(np.meshgrid(grid, grid, grid)).reshape(3, -1).T
    planes, _ = hull_planes(cube)
    assert len(planes) == 6


def test_nearly_flat_points_still_have_a_hull():
    points = np.random.default_rng(1).normal(size=(12, 3))
    points[:, 2] = 0.0
    planes, _ = hull_planes(points)
    assert (planes[:, :3] @ points.T <= planes[:, 3:] + 1e-6).all()
