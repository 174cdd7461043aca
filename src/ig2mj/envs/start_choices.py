"""What start states of an environment are taken from: parts of a split, other models and poses, augmentation, doors."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

import numpy as np

from ig2mj.engine.model_fields import POSES
from ig2mj.engine.snapshot import woken
from ig2mj.envs.setups import EnvSetup
from ig2mj.errors import EngineError
from ig2mj.planning.starts import open_doors
from ig2mj.scene.scene import Scene
from ig2mj.tasks.bddl.task import BddlTask
from ig2mj.tasks.homes import AnyTask
from ig2mj.tasks.mixing import mixed_pool
from ig2mj.tasks.model_choices import ModelChoices, choices_of, widened
from ig2mj.tasks.object_poses import spread_starts
from ig2mj.tasks.pools import bare_scene
from ig2mj.tasks.splits import Split
from ig2mj.tasks.task import Task
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.randomize import Randomize
from ig2mj.worlds.robot_starts import is_pinned


def augmented(task: Task, setup: EnvSetup, starts: Pool, count: int) -> Pool:
    """Start states, and others that are made of them (`ig2mj.tasks.mixing`). Raises EngineError: they cannot be."""
    if setup.swaps is not None:
        raise EngineError("augment_starts and randomize: objects: augmented start states have the usual models only")
    return mixed_pool(task, setup.scene, starts, count)


DOORS = ("shut", "open")
"""Settings of `ig2mj.make(doors=...)`."""


def named_objects(task: AnyTask) -> tuple[str, ...]:
    """Objects and rooms that a task names."""
    if isinstance(task, BddlTask):
        return tuple(task.binding.objects.values())
    return task.objects_of_interest if isinstance(task, Task) else ()


def with_open_doors(scene: Scene, starts: Pool, named: Collection[str]) -> Pool:
    """Start states in which doors between rooms stand wide open, but for some objects. What sleeps goes on sleeping,
    but for the doors and what sleeps with them: Warp's buffers do not hold a home in which everything is awake.

    Args:
      scene: of the environment, with its robots. named: objects that the task names.
    """
    write = open_doors(scene, named)
    if write is None or write.qpos is None:
        return starts
    mask, values = np.asarray(write.qpos_mask)[0], np.asarray(write.qpos)[0]
    count = np.shape(starts.physics.scene.qpos)[-1]  # robots come after everything else
    opened = np.where(mask[:count], values[:count], np.asarray(starts.physics.scene.qpos))
    model, asleep = scene.model, np.asarray(starts.physics.scene.tree_asleep)
    doors = np.unique(model.body_treeid[model.jnt_bodyid[mask[model.jnt_qposadr]]])
    part = dataclasses.replace(
        starts.physics.scene, qpos=opened.astype(starts.physics.scene.qpos.dtype), tree_asleep=woken(asleep, doors)
    )
    return dataclasses.replace(starts, physics=dataclasses.replace(starts.physics, scene=part))


def start_part(split: str) -> str:
    """Which start states a split takes. Raises UnknownNameError: there is no such split; with near matches."""
    return Split.of(split).starts


def varied_models(task: AnyTask, randomize: Randomize, split: str) -> ModelChoices | None:
    """Models of a task's objects that differ between episodes; None: none do. Raises EngineError: they cannot."""
    varied = randomize.settings("objects")
    if varied is None:
        return None
    if not isinstance(task, Task) or task.code is not None:
        raise EngineError(f"randomize: objects of {task.name}: only the paper's activities have several models")
    return choices_of(task, Split.of(split).models, varied.count, varied.models)


def varied_poses(task: AnyTask, setup: EnvSetup, randomize: Randomize, split: str) -> Pool | None:
    """Start states with the task's objects elsewhere; None: they are where they usually are. `split`: as `start_part`.

    Raises EngineError: they cannot be sampled.
    """
    varied = randomize.settings("object_poses")
    if varied is None:
        return None
    if not isinstance(task, Task) or task.code is not None:
        raise EngineError(f"randomize: object_poses of {task.name}: only start states of the paper's activities differ")
    found = spread_starts(task, split, varied.count)
    return found if setup.swaps is None else widened(found, bare_scene(task), setup.scene)


def moving_fields(task: AnyTask, setup: EnvSetup, randomize: Randomize) -> tuple[str, ...]:
    """Fields of the model by which the robot starts elsewhere. Raises EngineError: it cannot."""
    if randomize.settings("robot_start") is None:
        return ()
    if not isinstance(task, Task) or task.code is not None:
        raise EngineError(
            f"randomize: robot_start of {task.name}: only robots of the paper's activities start elsewhere (leave the "
            "axis out)"
        )
    return POSES if is_pinned(setup.scene) else ()
