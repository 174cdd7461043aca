"""Vertical columns through pieces agree with MuJoCo's own rays, and levels with what stands where."""

from __future__ import annotations

import dataclasses
import functools

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ig2mj.sampling.columns import CELL, ColumnMap, ColumnWindow, piece_columns
from ig2mj.scene.convex_pieces import make_convex_pieces
from ig2mj.scene.scene import load_scene
from ig2mj.scene.tables import SceneTables


@pytest.fixture(scope="module")
def home():
    scene = load_scene("small_home")
    data = scene.start_data()
    columns = ColumnMap(scene.tables)
    columns.update(np.array(data.xpos), np.array(data.xmat).reshape(-1, 3, 3))
    return scene, data, columns


def test_columns_of_pieces_begin_and_end_where_rays_of_mujoco_do(home):
    scene, data, columns = home
    tables, model = scene.tables, scene.model
    rng = np.random.default_rng(0)
    compared = 0
    for piece in rng.choice(len(tables.piece_geom), 60, replace=False).tolist():
        found, geom = columns.of_piece(piece), int(tables.piece_geom[piece])
        xs, ys = found.window.centres()
        hits = np.argwhere(np.isfinite(found.high))
        for row, col in hits[rng.permutation(len(hits))[:5]]:
            for start, direction, height in ((50.0, -1.0, found.high[row, col]), (-50.0, 1.0, found.low[row, col])):
                point, along = np.array([xs[col], ys[row], start]), np.array([0.0, 0.0, direction])
                if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
                    distance = mujoco.mj_rayMesh(model, data, geom, point, along, None)
                else:
                    size, kind = model.geom_size[geom], model.geom_type[geom]
                    pose = data.geom_xpos[geom], data.geom_xmat[geom]
                    distance = mujoco.mju_rayGeom(*pose, size, point, along, kind, None)
                if distance >= 0:
                    assert start + direction * distance == pytest.approx(height, abs=2e-3)
                    compared += 1
    assert compared > 100


@given(
    kind=st.sampled_from(["sphere", "capsule", "cylinder", "box"]),
    quat=st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1),
    place=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-1, 1)),
)
@settings(max_examples=300, deadline=None)
def test_columns_of_turned_primitives_agree_with_rays(kind, quat, place):
    size = {"sphere": "0.07", "capsule": "0.03 0.08", "cylinder": "0.06 0.05", "box": "0.05 0.08 0.02"}[kind]
    tables, model = one_geom(bare_tables(), kind, size)
    quat = np.array(quat) / np.linalg.norm(quat)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, quat)
    turn = rotation.reshape(3, 3)
    found = piece_columns(tables, 0, np.array(place), turn)
    xs, ys = found.window.centres()
    for row in range(0, found.window.rows, 5):
        for col in range(0, found.window.cols, 5):
            down, around = np.array([0.0, 0.0, -1.0]), []
            for dx, dy in ((0, 0), (1e-5, 1e-5), (-1e-5, 1e-5), (1e-5, -1e-5), (-1e-5, -1e-5)):
                point = np.array([xs[col] + dx, ys[row] + dy, 5.0])
                pose = np.array(place), rotation
                around.append(mujoco.mju_rayGeom(*pose, model.geom_size[0], point, down, model.geom_type[0], None))
            if np.ptp(around) > 1e-3:
                continue  # a ray that grazes: rounding decides
            if around[0] < 0:
                assert np.isnan(found.high[row, col])
            else:
                assert found.high[row, col] == pytest.approx(5.0 - around[0], abs=1e-4)


@functools.cache
def bare_tables() -> SceneTables:
    """Tables whose pieces are replaced; not a fixture, which hypothesis would print."""
    return load_scene("small_home").tables


def one_geom(tables: SceneTables, kind: str, size: str) -> tuple[SceneTables, mujoco.MjModel]:
    """Tables whose only piece is one primitive."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><geom type="{kind}" size="{size}"/></body></worldbody></mujoco>'
    )
    (piece,) = make_convex_pieces(model, np.array([0]))
    only = dataclasses.replace(
        tables,
        piece_geom=np.array([0]),
        piece_object=np.array([0]),
        piece_body=np.array([1]),
        piece_pos=np.zeros((1, 3)),
        piece_quat=np.array([[1.0, 0.0, 0.0, 0.0]]),
        piece_kind=np.array([int(piece.kind)]),
        piece_size=np.array(model.geom_size[:1]),
        piece_planes=piece.planes[None],
        piece_vertices=piece.vertices[None],
    )
    return only, model


def test_a_level_tells_surface_owner_and_ceiling(home):
    scene, _data, columns = home
    table = scene.object_index("breakfast_table_0")
    low, high = columns.box(table)
    middle = ColumnWindow.around((low + high) / 2 - 0.05, (low + high) / 2 + 0.05)
    others = [o for o in range(scene.tables.num_objects) if o not in (table, scene.object_index("floors"))]
    above = columns.level(middle, high[2] + 0.01, without=others)
    assert (above.owner == table).all()
    assert np.allclose(above.surface, high[2], atol=2e-3)
    assert not above.blocked.any()
    below = columns.level(middle, low[2] + 0.01, without=others)
    assert (below.owner == scene.object_index("floors")).all()
    assert (below.ceiling < high[2]).all()
    within = columns.level(middle, high[2] - 0.005, without=others)
    assert within.blocked.all()


def test_only_pieces_that_moved_are_computed_again(home):
    scene, data, _ = home
    columns = ColumnMap(scene.tables)
    pos, turn = np.array(data.xpos), np.array(data.xmat).reshape(-1, 3, 3)
    columns.update(pos, turn)
    kept = [columns.of_piece(p) for p in range(len(scene.tables.piece_geom))]
    moved = scene.object_index("apple_0")
    pos[scene.tables.object_root[moved]] += [0.5, 0.0, 0.0]
    columns.update(pos, turn)
    for piece, before in enumerate(kept):
        same = columns.of_piece(piece) is before
        assert same == (scene.tables.piece_object[piece] != moved)


def test_windows_cover_their_boxes_and_meet_where_they_overlap():
    window = ColumnWindow.around(np.array([-0.004, 0.011]), np.array([0.021, 0.03]))
    assert (window.row, window.col, window.rows, window.cols) == (1, -1, 2, 4)
    rows, cols, own_rows, own_cols = window.slices_in(ColumnWindow(2, 0, 5, 5))
    assert (rows, cols, own_rows, own_cols) == (slice(0, 1), slice(0, 3), slice(1, 2), slice(1, 4))
    assert window.slices_in(ColumnWindow(10, 10, 2, 2)) is None
    assert window.centres()[0][0] == pytest.approx(-CELL / 2)
