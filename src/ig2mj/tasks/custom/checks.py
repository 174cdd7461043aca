"""Whether what a user's task names exists, before anything is sampled; errors name the task's file and setting."""

from __future__ import annotations

import dataclasses
import re

import numpy as np

from ig2mj.errors import StateError, UnknownNameError
from ig2mj.sampling.conditions import bind, read_conditions
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import MANIFEST_FILE, scene_folder
from ig2mj.scene.scene import Scene
from ig2mj.tasks.custom.code import blamed
from ig2mj.tasks.pools import bare_scene
from ig2mj.tasks.task import Task


def checked_names(task: Task) -> Task:
    """The task, with its objects of interest those of the scene, loose ones first.

    Raises:
      InputError: the home, an object, a condition or a name of the task's does not exist.
    """
    code = task.code
    with blamed(code, "start"):
        if code is not None and code.start is not None and task.start:
            raise StateError(f"the method makes start states: write home.sample('{task.start[0]}') in it")
    with blamed(code, "home"):
        load_manifest(scene_folder(task.home) / MANIFEST_FILE)
    with blamed(code, "objects"):
        scene = bare_scene(task)
    with blamed(code, "start"):
        bind(read_conditions(task.start), scene.tables, np.random.default_rng(0))
    named = {"near": [near.object for near in task.near], "flat": task.flat, "upright": task.upright}
    for part, names in named.items():
        with blamed(code, part):
            for name in names:
                scene.object_index(name)
    with blamed(code, "objects_of_interest"):
        return dataclasses.replace(task, objects_of_interest=_interesting(task, scene))


def _interesting(task: Task, scene: Scene) -> tuple[str, ...]:
    """Objects of interest. Names of rooms and groups may stand in a goal; all others must be objects."""
    words = set(re.findall(r"[^\s()]+", task.goal))
    for name in task.objects_of_interest:
        if name not in scene.object_names and name not in words:
            raise UnknownNameError("object", name, scene.object_names)
    there = [name for name in task.objects_of_interest if name in scene.object_names]
    fixed = scene.tables.object_fixed
    return tuple(sorted(there, key=lambda name: bool(fixed[scene.object_index(name)])))
