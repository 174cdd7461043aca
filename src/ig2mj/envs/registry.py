"""`make`: environments by name.

    env = ig2mj.make("CookingMeat", robot="humanoid", worlds=4096)
    env = ig2mj.make("PointNavigation", worlds=16)
    env = ig2mj.make("activity/cleaning_up_after_a_meal", robot="fetch")

`CookingMeat`, `ig2mj/CookingMeat` and `ig2mj/CookingMeat-v0` are the same.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from typing import Any

import jax

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.grasping import MODES, Grasping
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.engine.base import whole_number
from ig2mj.engine.registry import check_options, make_engine
from ig2mj.envs.environment import Environment
from ig2mj.envs.names import NAMES, NAMESPACE, activity_name, short_name
from ig2mj.envs.observations import Observer, check_names
from ig2mj.envs.setups import Control, setup_activity, setup_bddl, setup_navigation
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.process import entry_point, run_programs_inline
from ig2mj.sensors.base import SensorOptions
from ig2mj.sensors.suite import SensorSuite
from ig2mj.tasks.bddl.task import BddlTask, bddl_task
from ig2mj.tasks.homes import AnyTask, in_home
from ig2mj.tasks.mixing import mixed_pool
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.registry import TASKS as TASK_NAMES
from ig2mj.tasks.registry import load_task
from ig2mj.tasks.task import Task
from ig2mj.tasks.variants import variant as task_variant
from ig2mj.worlds.core import Core
from ig2mj.worlds.pool import Pool

VECTORS = ("proprioception", "privileged_state")
"""Observations that every engine and every task can make."""

TASKS: dict[str, Task | NavigationTask] = {name: load_task(name) for name in TASK_NAMES}
"""By name, in the order of `list_envs`."""


def list_envs() -> list[str]:
    """Names of all environments, as `make` takes them."""
    return list(NAMES)


def find_task(name: str) -> AnyTask:
    """The task of an environment's name: of `list_envs`, or "activity/" and one of BEHAVIOR-100's.

    Raises:
      UnknownNameError: with near matches. For activities also what `bddl_task` raises.
    """
    activity = activity_name(name)
    if activity is not None:
        return bddl_task(activity)
    short = short_name(name)
    if short is None:
        raise UnknownNameError("environment", name.removeprefix(f"{NAMESPACE}/"), NAMES)
    return TASKS[short]


@entry_point
def make(
    name: str | AnyTask,
    robot: str | TaskRobot | None = None,
    worlds: int = 1,
    engine: str | None = None,
    grasping: str | None = None,
    *,
    observations: str | Sequence[str] = VECTORS,
    paper_rl: bool = False,
    pool: Pool | None = None,
    split: str = "train",
    pool_size: int | None = None,
    mixed: int = 0,
    image_size: int | None = None,
    sensors: SensorOptions | Mapping[str, Any] | None = None,
    whole_actions: bool = False,
    period: float = ACTION_PERIOD,
    variant: int = 0,
    home: str | os.PathLike | None = None,
    **options: Any,
) -> Environment:
    """Makes an environment.

    Args:
      name: of a task (`list_envs`), "activity/" and the name of an activity of BEHAVIOR-100, or a task of your own.
      robot: a name of `ig2mj.agents.registry` ("humanoid", "fetch", "turtlebot", or one that you have registered), or
        a robot itself, as one from a URDF (`ig2mj.agents.urdf`), whose actions have every number of its controller;
        None: the first that the task lists. One that an activity does not list stands where the listed one with the
        lowest base would.
      worlds: how many step together.
      engine: "native", "warp" or "jax"; None: "warp" where JAX has a GPU, else "native".
      grasping: "mitten" (sticks to the task's first object at the first touch, as in the paper's experiments),
        "assisted", "sticky" or "physical"; with the last three an action of an activity closes hands, too. None:
        "mitten" for the paper's activities, "assisted" for others, "physical" for navigation.
      observations: names of sensors and of the task's own vectors, or a single one, see `ig2mj.envs.observations`;
        images and laser scans need the native or the warp engine.
      paper_rl: the thresholds that the paper's runs had: any force cuts, and three quarters of the stains may stay.
      pool: start states of an activity; None: the task's own, of which `split` is "train" or "held_out" and `pool_size`
        the number of rows; sampled on first use and kept (`ig2mj sample-task`). Navigation makes its own each time.
      mixed: so many start states instead, made of those (`ig2mj.tasks.mixing`); 0: they are as they are.
      image_size: pixels, height and width of pictures; None: those of `sensors`, by default 128.
      sensors: settings of the sensors, or a mapping of them.
      whole_actions: an action has every number of the robot's controller, 1 being its limit, not only the hands that
        the task moves: for people and their devices.
      period: seconds of an agent step, a whole number of control steps of 1/30 s. An episode is as long in seconds as
        with the usual 1/10 s.
      variant: of an activity's objects: other models of the same categories (`ig2mj.tasks.variants`); 0: its own. Each
        has pools of start states of its own.
      home: another home than the task's, by name or folder: any with a map of its floor for navigation, any that an
        activity of BDDL can be bound in, and for the paper's activities one with the furniture that they name.
      options: go to the engine.

    Raises:
      UnknownNameError: no such environment, robot, mode, observation, engine, option or split.
      EngineError: the engine cannot do what is asked, the home lacks what the task names, or the robot would start
        outside of it. InputError: there is no such home. BindingError: the activity does not fit into it.
    """
    task = name if isinstance(name, AnyTask) else find_task(name)
    if home is not None:
        task = in_home(task, home)
    if isinstance(observations, str):
        observations = (observations,)
    mode = task.grasping if grasping is None else grasping
    if mode not in MODES:
        raise UnknownNameError("grasping mode", mode, MODES)
    if isinstance(task, Task):
        task = task_variant(task, variant, mode)
    elif variant:
        raise EngineError(f"variant {variant} of {task.name}: only the paper's activities have variants")
    elif paper_rl:
        raise EngineError(f"paper_rl for {task.name}: only the paper's activities have thresholds of the paper's runs")
    if isinstance(task, NavigationTask) and pool is not None:
        raise EngineError(f"a pool for {task.name}: navigation draws its own start states")
    robot = next(iter(task.robots)) if robot is None else robot
    whole_number("worlds", worlds)
    for argument, given in (("pool_size", pool_size), ("image_size", image_size)):
        if given is not None:
            whole_number(argument, given)
    whole_number("mixed", mixed, least=0)
    if mixed and not isinstance(task, Task):
        raise EngineError(f"mixed = {mixed} for {task.name}: only start states of the paper's activities are mixed")
    if engine in (None, "native"):
        run_programs_inline()
    if engine is None:
        engine = "warp" if jax.default_backend() == "gpu" else "native"
    check_options(f"make with the {engine} engine", options, engine, make)
    if isinstance(period, str) or not 0 < period < float("inf"):
        raise EngineError(f"period = {period!r}: seconds of an agent step, a whole number of control steps of 1/30 s")
    if period != ACTION_PERIOD:
        task = dataclasses.replace(task, horizon=max(1, round(task.horizon * ACTION_PERIOD / period)))
    control = Control(whole_actions, period)
    if isinstance(task, NavigationTask):
        setup = setup_navigation(task, robot, split, pool_size, control)
    elif isinstance(task, BddlTask):
        setup = setup_bddl(task, robot, pool, split, pool_size, control)
    else:
        setup = setup_activity(task, robot, mode, pool, split, pool_size, paper_rl, control)
    scene, rules, controllers = setup.scene, setup.rules, setup.controllers
    chosen = check_names(observations, setup.objective)
    starts = setup.pool()  # may take minutes: everything that has a name is known by now
    rows = starts.size
    if mixed and isinstance(task, Task):
        starts = mixed_pool(task, scene, starts, mixed)
    physics = make_engine(engine, scene, worlds, **options)
    hands = None if mode == "physical" else Grasping(scene, mode, setup.mittens)
    core = Core(physics, rules, starts, controllers, hands, hand_resets=whole_actions or None)
    settings = SensorOptions.of(sensors or {}) if isinstance(sensors, Mapping | None) else sensors
    if not isinstance(settings, SensorOptions):
        raise EngineError(f"sensors = {sensors!r}: a mapping of settings, or SensorOptions")
    if image_size is not None:
        settings = dataclasses.replace(settings, width=image_size, height=image_size)
    perceived = SensorSuite(physics, scene, rules.model, controllers[0], chosen, settings)
    observer = Observer(observations, setup.objective, perceived)
    who = robot if isinstance(robot, str) else robot.name
    env = Environment(task, who, scene, core, setup.actions, setup.objective, observer, mode, setup.companions, period)
    # Of a BDDL activity fewer rows than asked for may be good, and its robot stands where the first row wants it.
    size = pool_size if isinstance(task, BddlTask) else rows
    env.made_with = {"paper_rl": paper_rl, "split": split, "pool_size": size, **options}
    if control != Control():
        env.made_with |= {"whole_actions": whole_actions, "period": period}
    if mixed:
        env.made_with["mixed"] = mixed
    if variant:
        env.made_with["variant"] = variant
    if home is not None:
        env.made_with["home"] = task.home
    return env
