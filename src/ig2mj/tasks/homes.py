"""Tasks in other homes than their own, and whether robots start in the house.

env = ig2mj.make("PointNavigation", home="elm")
env = ig2mj.make("activity/cleaning_windows", home="my_homes/loft")
"""

from __future__ import annotations

import dataclasses
import os
import pathlib

import numpy as np

from ig2mj.errors import EngineError
from ig2mj.sampling.conditions import read_conditions
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import SHIPPED_HOMES, scene_folder
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.tasks.bddl.binding import bind
from ig2mj.tasks.bddl.task import BddlTask
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.relocation import relocated
from ig2mj.tasks.task import Task

DOORWAY = 0.3
"""m around a robot in which there must be a room: between two rooms the map has none."""

ELSEWHERE = 0.3
"""m by which furniture may stand elsewhere than in an activity's own home: hands still reach it."""

AnyTask = Task | NavigationTask | BddlTask


def in_home(task: AnyTask, home: str | os.PathLike) -> AnyTask:
    """The task in another home: a folder of a converted scene, or the name of a home that ships.

    Navigation goes into any home with a map of its floor. What BDDL defines is bound to the home's objects again. An
    activity of the paper goes where it finds the furniture that it needs (`ig2mj.tasks.relocation`); one without
    `Task.fit` needs the furniture that it names at the places of its own home.

    Raises:
      InputError: there is no such home. BindingError: it lacks what the activity needs. EngineError: the activity's
        furniture is not there, or elsewhere.
    """
    folder, name = scene_folder(home), os.fspath(home)
    if folder.parent != SHIPPED_HOMES:
        name = str(folder.resolve())
    if isinstance(task, BddlTask):
        binding = bind(task.binding.activity, load_manifest(folder))
        return dataclasses.replace(task, binding=dataclasses.replace(binding, home=name))
    if isinstance(task, Task) and scene_folder(task.home) != folder:
        if task.fit is not None and not _has_furniture(task, folder):
            return relocated(task, home)
        _check_furniture(task, folder)
    return dataclasses.replace(task, home=name)


def _has_furniture(task: Task, folder: pathlib.Path) -> bool:
    """What the task names of its home is there, where it is at home."""
    try:
        _check_furniture(task, folder)
    except EngineError:
        return False
    return True


def _check_furniture(task: Task, folder: pathlib.Path) -> None:
    """Raises EngineError where what the task names of its home is not there, or elsewhere."""
    own, other = load_scene(task.home), load_scene(folder)
    arguments = [a for condition in read_conditions(task.start) for a in condition.arguments]
    named = [name for name in dict.fromkeys([*arguments, *task.objects_of_interest]) if name in own.object_names]
    missing = [name for name in named if name not in other.object_names]
    hint = 'ig2mj.make("activity/...", home=...) goes into any home that has what it needs'
    if missing:
        raise EngineError(f"{task.name} cannot be done in '{other.name}': it has no {', '.join(missing)} ({hint})")
    if all(acts.pos is None for acts in task.robots.values()) and not task.near:
        return  # it goes wherever its furniture stands
    both = [(scene, scene.start_data()) for scene in (own, other)]
    for name in named:
        here, there = (data.xpos[scene.tables.object_root[scene.object_index(name)]] for scene, data in both)
        apart = float(np.linalg.norm(here - there))
        if apart > ELSEWHERE:
            raise EngineError(
                f"{task.name} cannot be done in '{other.name}': its {name} is {apart:.1f} m from its position in "
                f"'{own.name}', which the activity needs ({hint})"
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
