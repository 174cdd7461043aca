"""Tasks in other homes than their own, and whether robots start in the house.

env = ig2mj.make("PointNavigation", home="elm")
env = ig2mj.make("activity/cleaning_windows", home="my_homes/loft")
"""

from __future__ import annotations

import dataclasses
import os

import numpy as np

from ig2mj.errors import EngineError
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder
from ig2mj.scene.scene import Scene
from ig2mj.tasks.bddl.binding import bind
from ig2mj.tasks.bddl.task import BddlTask
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.relocation import home_name, relocated
from ig2mj.tasks.spots import home_and_place
from ig2mj.tasks.task import Task

DOORWAY = 0.3
"""m around a robot in which there must be a room: between two rooms the map has none."""

AnyTask = Task | NavigationTask | BddlTask


def in_home(task: AnyTask, home: str | os.PathLike) -> AnyTask:
    """The task in another home: a folder of a converted scene, or the name of a home that ships.

    Activities of the paper also at another place of it, such as "birch:1" (`ig2mj.tasks.relocation`).

    Navigation goes into any home with a map of its floor. What BDDL defines is bound to the home's objects again.

    Raises:
      InputError: there is no such home. BindingError: it lacks what the activity needs. EngineError: the activity's
        furniture is not there, or elsewhere.
    """
    name, place = home_and_place(home)
    if place and not isinstance(task, Task):
        raise EngineError(f"place {place} of '{name}' for {task.name}: only the paper's activities have several places")
    if isinstance(task, BddlTask):
        binding = bind(task.binding.activity, load_manifest(scene_folder(home)))
        return dataclasses.replace(task, binding=dataclasses.replace(binding, home=home_name(home)))
    if isinstance(task, Task):
        return relocated(task, home)
    return dataclasses.replace(task, home=home_name(home))


def written_home(task: AnyTask, asked: str | os.PathLike) -> str:
    """The home that `in_home` puts a task into, as it takes it. `asked`: what it was given."""
    place = home_and_place(asked)[1]
    return f"{task.home}:{place}" if place else task.home


def check_inside(task: str, scene: Scene) -> None:
    """Whether the scene's robots start in the house. Nothing is known of a house without rooms and floors.

    Raises:
      EngineError: one stands in no room, beyond all floors where there is no map of rooms, or above or below all that
        is fixed.
    """
    data, tables, model = scene.start_data(), scene.tables, scene.model
    fixed = np.flatnonzero((tables.geom_object >= 0) & tables.object_fixed[tables.geom_object])
    if not len(fixed):
        return
    turn = data.geom_xmat[fixed].reshape(-1, 3, 3)
    middle = data.geom_xpos[fixed] + np.einsum("gij,gj->gi", turn, model.geom_aabb[fixed, :3])
    half = np.einsum("gij,gj->gi", np.abs(turn), model.geom_aabb[fixed, 3:])
    low, high = (middle - half).min(0), (middle + half).max(0)
    for name, body in zip(tables.agent_names, tables.agent_body, strict=True):
        place = data.xpos[body]
        around = place[:2] + DOORWAY * np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 2)
        in_a_room = scene.rooms is None or bool((scene.rooms.index_at(around) >= 0).any())
        if not in_a_room or (place < low).any() or (place > high).any():
            x, y, z = (float(v) for v in place)
            raise EngineError(
                f"{task}: robot '{name}' starts at ({x:.2f}, {y:.2f}, {z:.2f}) m, outside of home '{scene.name}' (give "
                "the task a start in one of its rooms)"
            )
