"""Distances to pieces, and taken cells of the floor, against MuJoCo's distances of geoms: random boxes, and a home."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ig2mj
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.planning.clearance import FAR, Obstacles, PlacedPieces
from ig2mj.planning.footprint import BaseFootprint, Disc
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.occupancy import CLEARANCE, RESOLUTION
from ig2mj.sampling.query import SceneQuery


@pytest.fixture(scope="module")
def query(tiny_home_folder):
    return SceneQuery(ig2mj.load_scene(tiny_home_folder, agents=[TurtleBot().at(-1.5, -1.5, 0.0)]))


def distance_of_balls(query, points, radius, objects):
    """m from balls to the nearest geom of some objects, by MuJoCo."""
    model, tables = query.scene.model, query.scene.tables
    data = mujoco.MjData(model)
    data.qpos[:] = query._data.qpos
    mujoco.mj_kinematics(model, data)
    ball = next(g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_SPHERE)
    size, model.geom_size[ball, 0] = float(model.geom_size[ball, 0]), radius
    geoms = [int(g) for g in tables.piece_geom[np.isin(tables.piece_object, objects)]]
    found = []
    for point in points:
        data.geom_xpos[ball] = point
        found.append(min(mujoco.mj_geomDistance(model, data, ball, g, 2 * FAR, None) for g in geoms))
    model.geom_size[ball, 0] = size
    return np.array(found)


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 2**31))
def test_distances_are_at_most_those_of_mujoco_and_not_much_less(query, seed):
    rng = np.random.default_rng(seed)
    scene = query.scene
    box = scene.object_index("box")
    quat = rng.normal(size=4)
    query.place(box, rng.uniform((-1, -1, 1.0), (1, 1, 1.5)), quat / np.linalg.norm(quat))
    others = [o for o in range(len(scene.object_names)) if o != box]
    obstacles = Obstacles(scene, query.view, 0, others)
    low, high = query.box(box)
    points = rng.uniform(low - 0.25, high + 0.25, (30, 3))
    own, true = obstacles.distance(points), distance_of_balls(query, points, 0.001, [box]) + 0.001
    outside = true > 0.005
    assert (own[outside] <= np.minimum(true[outside], FAR) + 1e-3).all()
    assert (own[outside] >= true[outside] / np.sqrt(3) - 1e-3).all()
    clear = [obstacles.clear(np.array([[*p, 0.03]])) for p in points]
    assert all(t > 0.03 - 1e-3 for t, c in zip(true, clear, strict=True) if c)


def test_pieces_that_moved_are_placed_again_and_the_same_as_at_first(query):
    pieces, scene = PlacedPieces(query.scene), query.scene
    points = np.random.default_rng(0).uniform((-1, -1, 0), (1, 1, 1), (200, 3))
    for place in ((0.6, 0.6, 0.3), (-0.6, 0.2, 0.7)):
        query.place(scene.object_index("ball"), np.array(place), np.array([1.0, 0.0, 0.0, 0.0]))
        kept = Obstacles(scene, query.view, 0, (), pieces).distance(points)
        np.testing.assert_array_equal(kept, Obstacles(scene, query.view).distance(points))


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 2**31))
def test_free_cells_have_room_and_taken_ones_have_not(query, seed):
    """A disc of the footprint as a ball at its height: cells are rounded, so that a cell's diagonal is left open."""
    rng = np.random.default_rng(seed)
    scene = query.scene
    box, radius = scene.object_index("box"), 0.2
    turn = rng.uniform(0, np.pi)
    query.place(box, np.array([*rng.uniform(-1, 1, 2), 1.0]), np.array([np.cos(turn / 2), 0, 0, np.sin(turn / 2)]))
    planner = MotionPlanner(scene)
    footprint = BaseFootprint((Disc(0.96, 1.04, radius),))
    others = [o for o in range(len(scene.object_names)) if o != box]
    floor = planner.floor(query.view, footprint, without=others)
    low, high = query.box(box)
    cells = rng.integers(0, floor.free.shape, (400, 2))
    xy = floor.occupancy.middles(cells)
    near = (np.abs(xy - (low + high)[:2] / 2) < 0.6).all(1) & floor.occupancy.floor[tuple(cells.T)]
    cells, xy = cells[near], xy[near]
    if not len(cells):
        return
    away = distance_of_balls(query, np.column_stack([xy, np.full(len(xy), 1.0)]), 0.001, [box]) + 0.001
    free = floor.free[tuple(cells.T)]
    assert (away[free] >= radius).all()
    assert (away[~free] <= radius + CLEARANCE + 2 * RESOLUTION).all()


def test_many_places_at_once_are_as_clear_as_one_after_another(query):
    rng = np.random.default_rng(3)
    obstacles = Obstacles(query.scene, query.view, 0).about((-0.5, 0.2), 0.3, 1.5)
    spheres = np.array([[0.0, 0.0, 0.0, 0.03], [0.1, 0.0, 0.02, 0.03], [0.0, 0.15, 0.0, 0.012]])
    points = rng.uniform((-2.0, -2.0, 0.0), (2.0, 2.0, 1.2), (150, 3))
    each = [obstacles.clear(spheres + np.array([*p, 0.0])) for p in points]
    assert obstacles.clear_at(spheres, points).tolist() == each
    assert 0 < sum(each) < len(each)
    nothing = np.zeros((0, 4))  # what was carried was lost on the way
    assert obstacles.clear(nothing) and obstacles.clear_along(nothing, points[0], np.eye(3)[0], np.zeros(1))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31))
def test_places_along_a_line_are_as_clear_as_one_after_another(query, seed):
    rng = np.random.default_rng(seed)
    quat = rng.normal(size=4)
    query.place(query.scene.object_index("box"), rng.uniform((-1, -1, 0.2), (1, 1, 0.8)), quat / np.linalg.norm(quat))
    obstacles = Obstacles(query.scene, query.view, 0).about((-0.5, 0.2), 0.3, 1.5)
    obstacles = obstacles.with_carried(np.column_stack([rng.uniform(-1, 1, (5, 3)), np.full(5, 0.03)]))
    spheres = np.array([[0.0, 0.0, 0.0, 0.03], [0.1, 0.0, 0.02, 0.03], [0.0, 0.15, 0.0, 0.012]])
    for level in (False, True) * 5:
        start, ahead = rng.uniform((-1.5, -1.5, 0.0), (1.5, 1.5, 1.2)), rng.normal(size=3) * (1.0, not level, not level)
        ahead /= np.linalg.norm(ahead)
        along = np.linspace(0.0, rng.uniform(0.05, 1.0), rng.integers(1, 30))
        each = [obstacles.clear(spheres + np.array([*(start + t * ahead), 0.0])) for t in along]
        assert obstacles.clear_along(spheres, start, ahead, along) == all(each)
