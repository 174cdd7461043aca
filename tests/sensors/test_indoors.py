"""Boxes indoors: nothing of the garden is in them, they cover rooms, and images by day do not depend on them."""

from __future__ import annotations

import jax
import mujoco
import numpy as np
import pytest

from ig2mj import load_scene
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.rooms import Rooms
from ig2mj.sensors import merged_meshes
from ig2mj.sensors.batch_camera import BatchCamera
from ig2mj.sensors.indoors import indoor_boxes
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel

HOUSE = np.array([[-4.0, -4.0, -0.2], [4.0, 4.0, 2.5]])
"""Corners of a home with three rooms in the shape of an L; its fourth quarter, x and y above 0, is garden. m."""


@pytest.fixture(scope="module")
def rooms() -> Rooms:
    cells = np.zeros((100, 100), np.int16)  # of 0.1 m
    cells[10:50, 10:50], cells[10:50, 50:90], cells[50:90, 10:50] = 1, 2, 3
    return Rooms(("a", "b", "c"), ("room",) * 3, cells, 0.1)


def _with_eye(spec: mujoco.MjSpec) -> AgentEntry:
    eye = spec.worldbody.add_body(name="eye")
    eye.add_camera(name="eye/eye", fovy=75.0)
    return AgentEntry(name="eye", body="eye", camera="eye/eye")


def _triangles(*corners: tuple[tuple[float, float, float], tuple[float, float, float]]) -> np.ndarray:
    """A triangle for each pair of corners of its box."""
    return np.array([[low, high, (low[0], high[1], low[2])] for low, high in corners])


def test_nothing_of_the_garden_is_in_a_box_and_every_room_is_in_one(rooms):
    lawn = (-20.0, -20.0, -0.08), (20.0, 20.0, -0.08)
    bush, branch = ((0.3, 0.2, -0.1), (3.0, 3.0, 0.5)), ((-1.0, -1.0, 2.6), (5.0, 5.0, 3.0))
    garden = _triangles(lawn, bush, branch)
    boxes = indoor_boxes(rooms, HOUSE, garden)
    assert len(boxes) == 2  # two arms of an L
    for low, high in boxes:
        assert not ((garden.min(axis=1) < high) & (garden.max(axis=1) > low)).all(axis=1).any()
        assert (low > HOUSE[0]).all() and (high < HOUSE[1]).all()
        assert low[2] == pytest.approx(-0.08, abs=0.01), "a hit on the floor is in the box"
    for x, y in ((-2.0, -2.0), (2.0, -2.0), (-2.0, 2.0)):
        assert any((low < (x, y, 1.0)).all() and (high > (x, y, 1.0)).all() for low, high in boxes)


def test_a_room_with_a_bush_in_it_has_no_box(rooms):
    boxes = indoor_boxes(rooms, HOUSE, _triangles(((-2.0, -2.0, 0.5), (-1.0, -1.0, 1.0))))
    point = (-1.5, -1.5, 0.7)
    assert len(boxes) and not any((low < point).all() and (high > point).all() for low, high in boxes)


@pytest.mark.slow
def test_images_by_day_are_those_of_rays_that_always_look_for_the_garden(monkeypatch):
    scene = load_scene("small_home", [_with_eye])
    model, engine = StateModel.of_manifest(scene.tables, scene.manifest), WarpEngine(scene, 3)
    physics = engine.reset()
    view, states = engine.view(physics), initial_states(model, 3)
    middle = scene.rooms.centre(scene.rooms.names[0])
    place = np.array([[*middle, 1.4], [*middle, 1.6], [9.0, 9.0, 2.0]], np.float32)  # the last from the garden
    turn = np.array([[0.5, 0.5, -0.5, -0.5], [0.65, 0.27, 0.27, 0.65], [0.27, 0.27, 0.65, 0.65]], np.float32)
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    found = []
    for searched in (False, True):
        if searched:
            monkeypatch.setattr(merged_meshes, "indoor_boxes", lambda *_: np.zeros((0, 2, 3)))
        camera = BatchCamera(engine, model, ["eye/eye"], width=64, height=64, depth=True, looks="day")
        assert camera._merged is not None and bool(len(camera._merged.indoors)) == (not searched)
        shoot = jax.jit(lambda *of, camera=camera: camera(*of, {"eye/eye": (place, turn)}))
        found.append(jax.tree.map(np.asarray, shoot(physics, view, states)))
    np.testing.assert_array_equal(found[0].rgb, found[1].rgb)
    np.testing.assert_array_equal(found[0].depth, found[1].depth)
    assert len(np.unique(found[0].rgb[2].reshape(-1, 3), axis=0)) > 50
