"""`make`: environments by name.

    env = ig2mj.make("CookingMeat", robot="humanoid", worlds=4096)

`CookingMeat`, `ig2mj/CookingMeat` and `ig2mj/CookingMeat-v0` are the same.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.agents.grasping import MODES, Grasping
from ig2mj.engine.registry import make_engine
from ig2mj.envs.environment import Environment
from ig2mj.envs.names import NAMES, NAMESPACE, short_name
from ig2mj.envs.observations import Observer
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.tasks.actions import hand_actions
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.activity_objective import ActivityObjective
from ig2mj.tasks.pools import pool_of
from ig2mj.tasks.task import ROBOTS, Task, make_robot
from ig2mj.worlds.core import Core
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.rules import Rules

VECTORS = ("proprioception", "privileged_state")
"""Observations that every engine can make."""

PAPER_RL_STAINS = 0.75
"""Share of the stains that may stay in the paper's runs (spec/robots_tasks_sensors.md section 0.1)."""


def list_envs() -> list[str]:
    """Names of all environments, as `make` takes them."""
    return list(NAMES)


def find_task(name: str) -> Task:
    """The task of an environment's name. Raises UnknownNameError, with near matches."""
    short = short_name(name)
    if short is None:
        raise UnknownNameError("environment", name.removeprefix(f"{NAMESPACE}/"), NAMES)
    return ACTIVITIES[short]


def make(
    name: str | Task,
    robot: str = "humanoid",
    worlds: int = 1,
    engine: str | None = None,
    grasping: str = "mitten",
    *,
    observations: Sequence[str] = VECTORS,
    paper_rl: bool = False,
    pool: Pool | None = None,
    split: str = "train",
    pool_size: int | None = None,
    image_size: int = 128,
    **options: Any,
) -> Environment:
    """Makes an environment.

    Args:
      name: of a task (`list_envs`), or a task of your own.
      robot: "humanoid" or "fetch".
      worlds: how many step together.
      engine: "native", "warp" or "jax"; None: "warp" where JAX has a GPU, else "native".
      grasping: "mitten" (sticks to the task's first object at the first touch, as in the paper's experiments),
        "assisted", "sticky" or "physical"; with the last three an action closes hands, too.
      observations: see `ig2mj.envs.observations`; pictures need the warp engine.
      paper_rl: the thresholds that the paper's runs had: any force cuts, and three quarters of the stains may stay.
      pool: start states; None: the task's own, of which `split` is "train" or "held_out" and `pool_size` the number of
        rows; sampled on first use and kept (`ig2mj sample-task`).
      image_size: pixels, height and width of pictures.
      options: go to the engine.

    Raises:
      UnknownNameError: no such environment, robot, mode, observation, engine or split.
      EngineError: the engine cannot do what is asked.
    """
    task = name if isinstance(name, Task) else find_task(name)
    if grasping not in MODES:
        raise UnknownNameError("grasping mode", grasping, MODES)
    if robot not in ROBOTS:
        raise UnknownNameError("robot", robot, ROBOTS)
    if worlds < 1:
        raise EngineError(f"worlds = {worlds}: an environment has at least one")
    body = make_robot(task, robot)
    scene = load_scene(task.home, agents=[body], objects=task.objects)
    if engine is None:
        engine = "warp" if jax.default_backend() == "gpu" else "native"
    physics = make_engine(engine, scene, worlds, **options)
    rules = rules_of(task, scene, paper_rl)
    controller = body.controller(scene.tables, 0)
    rows = pool if pool is not None else pool_of(task, split, pool_size)
    hands = Grasping(scene, grasping, task.objects_of_interest[:1])
    core = Core(physics, rules, rows, [controller], hands)
    closing = grasping != "mitten"
    objective = ActivityObjective(task, robot, scene, rules.model)
    observer = Observer(observations, objective, scene, rules.model, controller, physics, image_size)
    actions = hand_actions(controller.action_names, task.acts(robot).hands, closing)
    return Environment(task, robot, scene, core, actions, objective, observer, grasping)


def rules_of(task: Task, scene: Scene, paper_rl: bool = False) -> Rules:
    """The states' rules with the task's goal; `paper_rl`: see `make`."""
    rules = Rules.of_scene(scene)
    if paper_rl:
        p = rules.model.parameters
        force = np.where(np.isfinite(p.slice_force), 0.0, p.slice_force).astype(p.slice_force.dtype)
        stains = np.where(np.isfinite(p.stained_threshold), PAPER_RL_STAINS, p.stained_threshold)
        eased = dataclasses.replace(p, slice_force=force, stained_threshold=stains.astype(p.stained_threshold.dtype))
        rules = Rules(dataclasses.replace(rules.model, parameters=eased), initial=rules.initial)
    return rules.with_goal(task.goal)
