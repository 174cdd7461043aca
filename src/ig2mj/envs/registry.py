"""`make`: environments by name.

    env = ig2mj.make("CookingMeat", robot="humanoid", worlds=4096)
    env = ig2mj.make("PointNavigation", {"worlds": 16, "sensors": {"scan_rays": 64}})
    env = ig2mj.make("activity/cleaning_up_after_a_meal", ig2mj.EnvConfig(robot="fetch"))
    env = ig2mj.make("goal/small_home (inside apple_0 fridge_0)", robot="humanoid")
    env = ig2mj.make("my_tasks.py:MugToTable", worlds=64)

`CookingMeat`, `ig2mj/CookingMeat` and `ig2mj/CookingMeat-v0` are the same. `my_tasks.py:MugToTable` imports the file,
which runs its code (`ig2mj.CustomTask`).
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, Unpack, cast, overload

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.grasping import MODES, Grasping
from ig2mj.agents.registry import find_robot, is_robot_folder
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.engine.base import whole_number
from ig2mj.engine.registry import check_options, choose_engine, made_together, make_engine
from ig2mj.envs.config import VECTORS, EnvConfig, Overrides, default_of
from ig2mj.envs.environment import Environment
from ig2mj.envs.names import NAMES, activity_name, short_name, unknown_environment
from ig2mj.envs.observations import Observer, check_names
from ig2mj.envs.setups import Control, EnvSetup, setup_activity, setup_bddl, setup_navigation
from ig2mj.envs.several_homes import HomesEnvironment, requested_homes
from ig2mj.envs.start_choices import (
    DOORS,
    augmented,
    moving_fields,
    named_objects,
    start_part,
    varied_models,
    varied_poses,
    with_open_doors,
)
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.process import entry_point
from ig2mj.sensors.registry import SENSORS
from ig2mj.sensors.suite import SensorSuite
from ig2mj.tasks.added_objects import object_texts, with_objects
from ig2mj.tasks.bddl.task import PREFIX, BddlTask, bddl_task
from ig2mj.tasks.custom.checks import checked_names
from ig2mj.tasks.custom.code import TaskCode
from ig2mj.tasks.custom.definition import Definition, task_of
from ig2mj.tasks.custom.files import import_files, task_of_file
from ig2mj.tasks.custom.objective import CustomObjective
from ig2mj.tasks.homes import AnyTask, in_home, written_home
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.objective import Objective
from ig2mj.tasks.own_goal import goal_task, split_goal_name
from ig2mj.tasks.registry import REGISTERED, load_task, split_reference
from ig2mj.tasks.registry import TASKS as TASK_NAMES
from ig2mj.tasks.task import Task
from ig2mj.tasks.variants import variant as task_variant
from ig2mj.worlds.core import Core

__all__ = ["TASKS", "VECTORS", "default_config", "find_task", "list_envs", "make"]

TASKS: dict[str, Task | NavigationTask] = {name: load_task(name) for name in TASK_NAMES}
"""By name, in the order of `list_envs`."""


def list_envs() -> list[str]:
    """Names of all environments, as `make` takes them, those of `ig2mj.register_task` last."""
    import_files()
    return [*NAMES, *REGISTERED]


def is_environment(name: str) -> bool:
    """Whether `make` takes a text for the name of an environment, without a look at what it names."""
    import_files()
    known = (short_name, activity_name, split_goal_name, split_reference)
    return any(read(name) is not None for read in known)


def find_task(name: str) -> AnyTask:
    """The task of an environment's name: of `list_envs`, "activity/" and one of BEHAVIOR-100's, "goal/HOME GOAL", or
    "FILE.py:NAME".

    Raises:
      UnknownNameError: with near matches. For activities also what `bddl_task` raises. InputError: the file cannot be
        imported, or its task is not sound.
    """
    if (own := split_goal_name(name)) is not None:
        return goal_task(*own)
    if split_reference(name) is not None:
        return task_of_file(name)
    import_files()
    activity = activity_name(name)
    if activity is not None and (known := REGISTERED.get(f"{PREFIX}{activity}")) is not None:
        return known.task
    if activity is not None:
        return bddl_task(activity)
    short = short_name(name)
    if short is None:
        raise unknown_environment(name, list_envs())
    return REGISTERED[short].task if short in REGISTERED else TASKS[short]


def task_named(name: str | Definition) -> AnyTask:
    """The task of a name, or of what defines one. Raises as `find_task`."""
    return find_task(name) if isinstance(name, str) else task_of(name)


@entry_point
def default_config(name: str | Definition) -> EnvConfig:
    """The settings that `make` uses for an environment where nothing else is asked for.

    Args:
      name: as of `make`.

    Raises:
      UnknownNameError: no such environment, with near matches.
    """
    return default_of(task_named(name))


@overload
def make(
    name: str | Definition,
    config: EnvConfig | Mapping[str, Any] | None = None,
    *,
    config_overrides: Mapping[str, Any] | None = None,
    **overrides: Unpack[Overrides],
) -> Environment: ...


@overload
def make(
    name: str | Definition,
    config: str | TaskRobot | None,
    worlds: int = 1,
    engine: str | None = None,
    grasping: str | None = None,
    *,
    config_overrides: Mapping[str, Any] | None = None,
    **overrides: Any,
) -> Environment: ...


@overload
def make(name: str, *, action_space: Literal["primitives"], **options: Any) -> Any: ...


@entry_point
def make(
    name: str | Definition,
    config: EnvConfig | Mapping[str, Any] | str | TaskRobot | None = None,
    worlds: int | None = None,
    engine: str | None = None,
    grasping: str | None = None,
    *,
    config_overrides: Mapping[str, Any] | None = None,
    action_space: str = "continuous",
    **overrides: Any,
) -> Any:
    """Makes an environment.

    Args:
      name: of a task (`list_envs`), "activity/" and the name of an activity of BEHAVIOR-100, "goal/HOME GOAL" for a
        goal in a home (`ig2mj.tasks.own_goal`), "FILE.py:NAME" for a task of a file of yours, or the task itself: its
        class, function or object.
      config: all settings, or a mapping of those that differ from the task's (`default_config`). A name in this place
        is that of the robot: `make("CookingMeat", "fetch", 16, "native", "mitten")` is short for `robot`, `worlds`,
        `engine` and `grasping`.
      worlds, engine, grasping: see `EnvConfig`.
      config_overrides: settings by name, in place of those of `config`.
      overrides: the same as keyword arguments: fields of `EnvConfig`, options of engines (`EngineOptions`), `homes`.
      action_space: "continuous", or "primitives": a `ig2mj.envs.primitives.PrimitiveEnv`, a Gymnasium environment whose
        arguments the overrides then are.

    `homes`: "train" or "held_out", the homes of that set that the task fits into (`ig2mj.tasks.splits`), or a list, in
    which "birch:1" is the second place in birch where one of the paper's activities can be done.
    With several homes, also as `home=[...]`, worlds are shared out evenly, and the result is a `HomesEnvironment`.

    Returns:
      An `Environment`, a `HomesEnvironment`, or what the action space says.

    Raises:
      UnknownNameError: no such environment, robot, mode, observation, engine, setting or split; with near matches.
      EngineError: the engine cannot do what is asked, the home lacks what the task names, or the robot would start
        outside of it. InputError: there is no such home. BindingError: the activity does not fit into it.
    """
    given = {"worlds": worlds, "engine": engine, "grasping": grasping}
    if action_space not in ACTION_SPACES:
        raise UnknownNameError("action space", action_space, ACTION_SPACES)
    if ACTION_SPACES[action_space]:
        others = {**given, "config": config, "config_overrides": config_overrides}
        return _make_other(action_space, name, overrides, others)
    overrides = {**{k: value for k, value in given.items() if value is not None}, **overrides}
    homes = overrides.pop("homes", None)
    task = task_named(name)
    if isinstance(config, EnvConfig):
        chosen = config
    elif isinstance(config, Mapping | None):
        chosen = EnvConfig().override(config)
    else:
        chosen = EnvConfig().override(robot=config)
    chosen = chosen.override(config_overrides, **overrides)
    requested = requested_homes(task, chosen, homes)
    if requested is not None:
        return _make_several(task, chosen, requested)
    with made_together():
        return _make(task, chosen)


def _make_several(task: AnyTask, config: EnvConfig, homes: tuple[str, ...]) -> HomesEnvironment:
    """A task in several homes, worlds shared out evenly.

    Raises:
      EngineError: there are fewer worlds than homes. All that `in_home` raises of one of them.
    """
    whole_number("worlds", config.worlds)
    if config.pool is not None:
        raise EngineError("a pool is of one home: several homes have start states of their own")
    if config.worlds < len(homes):
        raise EngineError(f"{config.worlds} worlds in {len(homes)} homes: give each home at least one (worlds=...)")
    for home in homes:  # all are checked before the first takes the time of its start states
        in_home(task, home)
    shares = [config.worlds // len(homes) + (k < config.worlds % len(homes)) for k in range(len(homes))]
    with made_together():
        made = [
            _make(task, dataclasses.replace(config, home=home, worlds=share))
            for home, share in zip(homes, shares, strict=True)
        ]
    return HomesEnvironment(made)


ACTION_SPACES = {"continuous": "", "primitives": "ig2mj.envs.primitives:PrimitiveEnv"}
"""Action spaces of `make`, and the class of the environments of each where that is not `Environment`."""


def _make_other(action_space: str, name: Any, options: Mapping[str, Any], others: Mapping[str, Any]) -> Any:
    """An environment of a class of `ACTION_SPACES`. Raises UnknownNameError: an option that it does not have."""
    module, _, kind = ACTION_SPACES[action_space].partition(":")
    made = getattr(importlib.import_module(module), kind)
    if not isinstance(name, str):
        raise EngineError(f"an environment with action_space='{action_space}' is made by its name")
    known = inspect.getfullargspec(inspect.unwrap(made.__init__)).kwonlyargs
    for option in [*options, *(k for k, value in others.items() if value is not None)]:
        if option not in known:
            raise UnknownNameError(f"option with action_space='{action_space}'", option, known)
    return made(name, **options)


def _make(task: AnyTask, config: EnvConfig) -> Environment:
    if config.home is not None:
        assert isinstance(config.home, str | os.PathLike), "several homes are made one by one"
        task = in_home(task, config.home)
    objects = object_texts(config.objects)
    single = isinstance(config.observations, str) or callable(config.observations)
    if not single and not isinstance(config.observations, Iterable):
        raise EngineError(f"observations = {config.observations!r}: names of observations, or a single one")
    observations = cast("tuple[Any, ...]", (config.observations,) if single else tuple(config.observations))
    mode = task.grasping if config.grasping is None else config.grasping
    if mode not in MODES:
        raise UnknownNameError("grasping mode", mode, MODES)
    if isinstance(task, Task):
        task = task_variant(task, config.variant, mode)
    elif config.variant:
        raise EngineError(f"variant {config.variant} of {task.name}: only the paper's activities have variants")
    elif config.relaxed_thresholds:
        raise EngineError(f"relaxed_thresholds for {task.name}: only the paper's activities have them")
    task = with_objects(task, objects)
    if isinstance(task, Task) and task.code is not None:
        task = checked_names(task)
    if isinstance(task, NavigationTask) and config.pool is not None:
        raise EngineError(f"a pool for {task.name}: navigation draws its own start states")
    robot = next(iter(task.robots)) if config.robot is None else config.robot
    if isinstance(robot, str) and is_robot_folder(robot):
        robot = os.path.realpath(robot)  # what recordings are made with
    who, acting = find_robot(robot)
    body = robot if isinstance(robot, str) and robot == who else acting
    whole_number("worlds", config.worlds)
    for argument in ("pool_size", "image_size", "horizon"):
        if (given := getattr(config, argument)) is not None:
            whole_number(argument, given)
    settings = config.sensor_options()
    whole_number("augment_starts", config.augment_starts, least=0)
    if config.augment_starts and not isinstance(task, Task):
        raise EngineError(f"augment_starts for {task.name}: only start states of the paper's activities are augmented")
    if config.doors not in DOORS:
        raise UnknownNameError("setting of doors", config.doors, DOORS)
    engine = choose_engine(config.engine)
    check_options(f"make with the {engine} engine", config.engine_options, engine, EnvConfig)
    task = dataclasses.replace(task, horizon=_horizon(task, config))
    whole = config.whole_actions or (isinstance(task, Task) and task.whole_actions)
    control = Control(whole, config.period)
    split, pool_size = start_part(config.split), config.pool_size
    differs = config.randomize
    choices = None if differs is None else varied_models(task, differs, config.split)
    if isinstance(task, NavigationTask):
        setup = setup_navigation(task, body, split, pool_size, control)
    elif isinstance(task, BddlTask):
        setup = setup_bddl(task, body, config.pool, split, pool_size, control)
    else:
        setup = setup_activity(
            *(task, body, mode, config.pool, split, pool_size, config.relaxed_thresholds, control),
            tried=lambda setup: _with_functions(setup, task, config, observations),
            chosen=choices,
        )
    scene, rules, controllers = setup.scene, setup.rules, setup.controllers
    objective = _with_functions(setup, task, config, observations)
    names = tuple(one if isinstance(one, str) else one.__name__ for one in observations)
    known = check_names(names, objective, settings, scene, controllers[0])
    starts = setup.pool()  # may take minutes: everything that has a name is known by now
    rows = starts.size
    if config.augment_starts and isinstance(task, Task):
        starts = augmented(task, setup, starts, config.augment_starts)
    options, poses = config.engine_options, None
    if differs is not None:
        poses = varied_poses(task, setup, differs, split)
        own = (*differs.model_fields, *moving_fields(task, setup, differs))
        options = {**options, "model_fields": (*options.get("model_fields", ()), *own)}
    if config.doors == "open":
        starts = with_open_doors(scene, starts, named_objects(task))
        poses = None if poses is None else with_open_doors(scene, poses, named_objects(task))
    physics = make_engine(engine, scene, config.worlds, **options)
    hands = None if mode == "physical" else Grasping(scene, mode, setup.mittens)
    every_number = whole or isinstance(task, BddlTask)  # of the action; some ask hands back
    core = Core(
        *(physics, rules, starts, controllers, hands),
        hand_resets=every_number,
        randomize=differs,
        swaps=setup.swaps,
        poses=poses,
        about=task.objects_of_interest if isinstance(task, Task) else (),
    )
    varied = () if differs is None else differs.axes
    perceived = SensorSuite(physics, scene, rules.model, controllers[0], known, settings, varied=varied)
    observer = Observer(names, objective, perceived, None if differs is None else differs.settings("sensor_noise"))
    resolved = dataclasses.replace(
        config,
        robot=robot,
        engine=engine,
        grasping=mode,
        observations=observations,
        sensors=settings,
        image_size=None,
        looks=None,
        whole_actions=whole,
        # Of a BDDL activity fewer rows than asked for may be good, and its robot stands where the first row wants it.
        pool_size=pool_size if isinstance(task, BddlTask) else rows,
        home=None if config.home is None else written_home(task, config.home),
        objects=objects,
    )
    return Environment(
        task,
        who,
        scene,
        core,
        setup.actions,
        objective,
        observer,
        mode,
        setup.companions,
        config.period,
        resolved,
    )


def _with_functions(setup: EnvSetup, task: AnyTask, config: EnvConfig, observations: Sequence[Any]) -> Objective:
    """The objective of a task, with what it and the settings say in functions.

    Raises:
      EngineError: a setting is no function, or a function has no name of its own. InputError: see `CustomObjective`.
    """
    vectors = {}
    for one in observations:
        if isinstance(one, str):
            continue
        name = getattr(one, "__name__", "")
        if not callable(one) or not name.isidentifier():
            raise EngineError(f"observations: {one!r} is neither a name nor a function with a name (def, not lambda)")
        if name in SENSORS or name in setup.objective.vectors or name in vectors:
            raise EngineError(f"observations: '{name}' is the name of another observation: rename the function")
        vectors[name] = one
    functions = {"reward": config.reward, "terminated": config.terminated}
    for name, function in functions.items():
        if function is not None and not callable(function):
            raise EngineError(f"{name} = {function!r}: a function of a TaskView is expected (ig2mj.CustomTask)")
    code = (task.code or TaskCode(name=task.name)).with_functions(**functions, observations=vectors or None)
    if not code.has_functions:
        return setup.objective
    return CustomObjective(setup.objective, code, setup.scene, setup.rules, setup.acting_hands, setup.actions.size)


def _horizon(task: AnyTask, config: EnvConfig) -> int:
    """Agent steps of an episode. Raises EngineError: `period` is none."""
    period = config.period
    if isinstance(period, str) or not 0 < period < float("inf"):
        raise EngineError(f"period = {period!r}: seconds of an agent step, a whole number of control steps of 1/30 s")
    if config.horizon is not None:
        return config.horizon
    return max(1, round(task.horizon * ACTION_PERIOD / period))
