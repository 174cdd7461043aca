"""Households of navigation tasks: what is opened or put down at random moves nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.sampling.bystanders import MOVED
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.navigation.floor import FloorMap
from ig2mj.tasks.navigation.starts import _Households
from ig2mj.tasks.registry import load_task


@pytest.mark.slow
@pytest.mark.parametrize("name", ["RoomRearrangement", "InteractiveNavigation"])
def test_furniture_that_is_opened_and_things_on_the_floor_move_nothing_else(name):
    task = load_task(name)
    scene = load_scene(task.home, objects=task.objects)
    households, tables = _Households(task, scene), scene.tables
    assert scene.rooms is not None and scene.rooms.traversable is not None
    floor = FloorMap.of_cells(np.asarray(scene.rooms.traversable), scene.rooms.trav_resolution)
    query, rng = households._query, np.random.default_rng(5)
    query.load(households.still)
    start, closed = np.array(query.view.object_com[0]), np.array(query.view.joint_pos[0])
    in_a_drawer = scene.object_index("saucepan_0")
    drawers = [j for j, o in enumerate(tables.openable_object) if scene.object_names[o] == "bottom_cabinet_2"]
    own = [a.name in scene.object_names and scene.object_index(a.name) for a in scene.additions]
    pulled = set()
    for _ in range(6):
        household = households.draw(rng, floor, floor.cells, np.zeros((1, 2)))
        assert household is not None
        query.load(household)
        way = np.linalg.norm(np.array(query.view.object_com[0]) - start, axis=1)
        opening = np.abs(np.array(query.view.joint_pos[0]) - closed)[drawers]
        assert np.abs(way[in_a_drawer] - np.append(opening, 0.0)).min() <= MOVED  # it goes along with its drawer
        pulled.add(bool(way[in_a_drawer] > MOVED))
        way[[in_a_drawer, *own]] = 0.0
        assert way.max() <= MOVED, scene.object_names[int(way.argmax())]
    assert (True in pulled) == (name == "RoomRearrangement")
