"""`task_hash`: hash of the values that define a task, by their names.

Names of classes do not count, nor do names of task and home, the task's sentence, and values that are a field's
default. Names of objects count as indices of the scene's objects, so renaming an object changes nothing.
"""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import json
import re
from collections.abc import Mapping, Sequence, Set
from typing import Any

import numpy as np

from ig2mj.predicates import logic
from ig2mj.tasks import points
from ig2mj.tasks.custom.code import TaskCode
from ig2mj.tasks.task import TaskLike

KINDS: dict[type, str] = {
    points.Hand: "hand",
    points.At: "at",
    points.Water: "water",
    points.Heat: "heat",
    points.NearestStain: "nearest_stain",
    logic.Atom: "atom",
    logic.And: "and",
    logic.Or: "or",
    logic.Not: "not",
    logic.ForAll: "for_all",
    logic.Exists: "exists",
    logic.ForN: "for_n",
    logic.ForPairs: "for_pairs",
    logic.ForNPairs: "for_n_pairs",
    logic.Exactly: "exactly",
    logic.Pairing: "pairing",
}
"""What distinguishes classes with the same fields, whatever they are called."""

NAMES = ("name", "summary", "home")
"""Fields that name or describe."""

ELSEWHERE = ("objects", "added", "horizon", "grasping", "physical", "expert", "start", "near", "flat", "upright", "fit")
"""Fields of a task that a recording has elsewhere: added objects are part of the scene's hash, what differs with
physical grasping is in the task that `variant` makes of it, and of the sampled start states it has its own."""


def task_hash(task: TaskLike, robot: str = "", objects: Sequence[str] = ()) -> str:
    """Hash of a task.

    Args:
      robot: the robot in use; values of the task for other robots do not count.
      objects: names of the scene's objects, in the order of the O axis.
    """
    places = {name: f"#{place}" for place, name in enumerate(objects)}
    fields = [f for f in dataclasses.fields(task) if f.name not in ELSEWHERE and _counts(f, task)]
    if task.code is not None and task.code.file.endswith(".bddl"):  # all of it is in the binding
        fields = [f for f in fields if f.name != "code"]
    values = {f.name: getattr(task, f.name) for f in fields}
    robots = values.pop("robots", None)
    if isinstance(robots, Mapping):
        values["robots"] = robots.get(robot, robots)
    text = json.dumps(_named(values, places), sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def whole_task_hash(task: TaskLike) -> str:
    """Of the task's text, names of classes included: the `task_hash` of recordings of format 2."""
    return hashlib.blake2b(repr(task).encode(), digest_size=16).hexdigest()


def _named(value: Any, places: Mapping[str, str]) -> Any:
    """A value as JSON has it."""
    if isinstance(value, str):
        return re.sub(r"[\w.-]+", lambda word: places.get(word[0], word[0]), value)
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int | float | np.integer | np.floating):
        return float(value)
    if isinstance(value, enum.Enum):
        return _named(value.value, places)
    if isinstance(value, np.ndarray):
        return _named(value.tolist(), places)
    if isinstance(value, Mapping):
        return {str(_named(k, places)): _named(v, places) for k, v in value.items()}
    if isinstance(value, Set):
        return sorted((_named(v, places) for v in value), key=json.dumps)
    if isinstance(value, Sequence):
        return [_named(v, places) for v in value]
    if isinstance(value, TaskCode):
        return value.digest
    if dataclasses.is_dataclass(value):
        own = {f.name: getattr(value, f.name) for f in dataclasses.fields(value) if _counts(f, value)}
        return {"kind": KINDS.get(type(value), ""), **_named(own, places)}
    return getattr(value, "__qualname__", "")  # of a function


def _counts(field: dataclasses.Field, value: Any) -> bool:
    """Whether a field of this value is no name, and differs from its default."""
    default = field.default
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    given = getattr(value, field.name)
    same = type(default) is type(given) and not isinstance(given, np.ndarray) and default == given
    return field.name not in NAMES and default is not given and not same
