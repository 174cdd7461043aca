"""What start states of an environment are taken from: parts of a split, models that differ, augmented rows."""

from __future__ import annotations

from ig2mj.envs.setups import EnvSetup
from ig2mj.errors import EngineError
from ig2mj.tasks.homes import AnyTask
from ig2mj.tasks.mixing import mixed_pool
from ig2mj.tasks.model_choices import ModelChoices, choices_of
from ig2mj.tasks.splits import Split
from ig2mj.tasks.task import Task
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.randomize import Randomize


def augmented(task: Task, setup: EnvSetup, starts: Pool, count: int) -> Pool:
    """Start states, and others that are made of them (`ig2mj.tasks.mixing`). Raises EngineError: they cannot be."""
    if setup.swaps is not None:
        raise EngineError("augment_starts and randomize: objects: augmented start states have the usual models only")
    return mixed_pool(task, setup.scene, starts, count)


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
    return choices_of(task, Split.of(split).models, varied.count)
