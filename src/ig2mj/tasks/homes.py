"""Tasks in other homes than their own, and whether a home has what a task names.

env = ig2mj.make("PointNavigation", home="elm")
env = ig2mj.make("activity/cleaning_windows", home="my_homes/loft")
"""

from __future__ import annotations

import dataclasses
import os

import numpy as np

from ig2mj.errors import EngineError
from ig2mj.sampling.conditions import read_conditions
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder
from ig2mj.scene.scene import Scene
from ig2mj.tasks.bddl.binding import bind
from ig2mj.tasks.bddl.task import BddlTask
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.task import Task

DOORWAY = 0.3
"""m around a robot in which there must be a room: between two rooms the map has none."""

AnyTask = Task | NavigationTask | BddlTask


def in_home(task: AnyTask, home: str | os.PathLike) -> AnyTask:
    """The task in another home: a folder of a converted scene, or the name of a home that ships.

    Navigation goes into any home with a map of its floor. What BDDL defines is bound to the home's objects again. An
    activity of the paper names furniture and positions of its own home, so that the other one must have them, too.

    Raises:
      InputError: there is no such home. BindingError: it lacks what the activity needs.
    """
    folder, name = scene_folder(home), os.fspath(home)
    if isinstance(task, BddlTask):
        binding = bind(task.binding.activity, load_manifest(folder))
        return dataclasses.replace(task, binding=dataclasses.replace(binding, home=name))
    return dataclasses.replace(task, home=name)


def check_objects(task: Task, scene: Scene) -> None:
    """Raises EngineError where a start condition is about an object or a room that the scene lacks."""
    known = {*scene.object_names, *scene.tables.room_names, *scene.tables.room_types}
    wanted = [a for condition in read_conditions(task.start) for a in condition.arguments]
    missing = [name for name in dict.fromkeys([*wanted, *task.objects_of_interest]) if name not in known]
    if missing:
        raise EngineError(
            f"{task.name} cannot take place in '{task.home}': it has no {', '.join(missing)} (what BDDL defines goes "
            'into any home that has what it needs: ig2mj.make("activity/...", home=...))'
        )


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
    reach = np.where(model.geom_type[fixed] == 0, 0.0, model.geom_rbound[fixed])[:, None]
    low, high = (data.geom_xpos[fixed] - reach).min(0), (data.geom_xpos[fixed] + reach).max(0)
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
