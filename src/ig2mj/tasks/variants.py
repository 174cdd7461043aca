"""`variant`: an activity with other models of its objects, as in the paper's runs with *different object*.

    env = ig2mj.make("CookingMeat", variant=1)

All worlds of an environment are one compiled scene, so that they share their models: a policy that is to work with
several is trained in several environments, or judged in one whose variant it has not seen.

With "physical" grasping some activities have objects of their own, which fit between two fingers (`Task.physical`).
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from typing import Any

from ig2mj.errors import EngineError
from ig2mj.scene.additions import name_additions
from ig2mj.scene.library import library
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder
from ig2mj.tasks.task import Task

MOST = 3
"""Variants of a task, its own objects included. Further models of the library are not counted."""


def variants(task: Task) -> int:
    """How many variants a task has, its own objects included: as many as there are models of each category."""
    categories = _categories(task)
    return min((MOST, *(len(library().get(category, ())) for category in categories))) if categories else 1


def variant(task: Task, number: int, grasping: str = "mitten") -> Task:
    """The task with the models of this number of all that was added to the home for it; 0: the task as it is.

    Where the task is about an object of the home's own, another model is added that takes its part; the home's stays
    where it is, since nothing is removed from homes. What has a fixed place stays, too.

    Args:
      grasping: mode; with "physical" the objects are those of `Task.physical`, where the task has such.

    Raises:
      EngineError: it has no such variant.
    """
    whole = isinstance(number, int) and not isinstance(number, bool)
    if not whole or (number and not 0 < number < variants(task)):
        raise EngineError(f"variant {number!r} of {task.name}: there are 0 to {variants(task) - 1}")
    if grasping == "physical" and task.physical is not None:
        other, robots = task.physical, {**task.robots, **task.physical.robots}
        return dataclasses.replace(task, objects=other.objects[number], near=other.near, robots=robots)
    if number == 0:
        return task

    def model(category: str) -> str:
        return f"{category}/{list(library()[category])[number]}"

    if task.objects:
        return dataclasses.replace(task, objects=tuple(name if "@" in name else model(name) for name in task.objects))
    own, (category,) = task.objects_of_interest[0], _categories(task)
    taken = [entry.name for entry in load_manifest(scene_folder(task.home)).objects]
    ((new, _),) = name_additions(taken, (model(category),))
    return dataclasses.replace(_renamed(task, own, new), objects=(model(category),))


def _categories(task: Task) -> list[str]:
    """Of the objects that vary."""
    loose = [name for name in task.objects if "@" not in name]
    return loose or [name.rsplit("_", 1)[0] for name in task.objects_of_interest[:1]]


def _renamed(value: Any, old: str, new: str) -> Any:
    """A task, or a part of one, in which an object has another name."""
    if isinstance(value, str):
        return re.sub(rf"\b{old}\b", new, value)
    if isinstance(value, tuple):
        return tuple(_renamed(part, old, new) for part in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        return dataclasses.replace(
            value, **{k: _renamed(v, old, new) for k, v in fields.items() if not isinstance(v, Mapping)}
        )
    return value
