"""`EnvConfig`: every setting of an environment in one frozen object.

    config = ig2mj.default_config("CookingMeat")
    env = ig2mj.make("CookingMeat", config, worlds=16)
    env = ig2mj.make("CookingMeat", {"robot": "fetch", "sensors": {"width": 64, "height": 64}})
    env = ig2mj.make("CookingMeat", robot="fetch", worlds=16, threads=2)

Overrides are by name. Those of `sensors` and `engine_options` are merged into what is there, and options of the engine
may stand next to the others. A name that does not exist is refused with near matches.
"""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict, TypeVar

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.process.deprecation import warn_renamed
from ig2mj.scene.scene import Objects
from ig2mj.sensors.base import SensorOptions
from ig2mj.tasks.task import TaskLike
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.randomize import Randomize

if TYPE_CHECKING:
    from ig2mj.engine.snapshot import Snapshot
    from ig2mj.engine.warp.profile import EngineProfile

VECTORS = ("proprioception", "privileged_state")
"""Observations that every engine and every task can make."""

RENAMED = {"paper_rl": "relaxed_thresholds", "mixed": "augment_starts"}
"""Old names of settings, which work until version 0.3, and their new ones."""


_MEANT = {"num_envs": "worlds", "n_envs": "worlds", "num_worlds": "worlds"}
"""Names that other libraries have for a setting."""

Config = TypeVar("Config")


class EngineOptions(TypedDict, total=False):
    """Options of engines; what is absent has the engine's default. An option of another engine is refused.

    Of every engine: see `ig2mj.engine.native.NativeEngine`. `threads` and `incremental` are the native engine's;
    `initial` is of the warp and the jax engine; the others are the warp engine's.
    """

    substeps: int
    timestep: float
    touch_tolerance: float
    boxes: str
    model_fields: Sequence[str]
    threads: int | None
    incremental: bool
    initial: Snapshot | None
    profile: EngineProfile | None
    iterations: int | None
    ls_iterations: int | None
    print_overflow: bool
    graph_mode: str | None
    compile_beforehand: bool | Literal["meanwhile"]


class Overrides(EngineOptions, total=False):
    """What `make` takes by name: fields of `EnvConfig`, and options of the engine."""

    robot: str | TaskRobot | None
    worlds: int
    engine: str | None
    grasping: str | None
    observations: str | Sequence[str | Callable[..., Any]]
    reward: Callable[..., Any] | None
    terminated: Callable[..., Any] | None
    relaxed_thresholds: bool
    pool: Pool | None
    split: str
    pool_size: int | None
    augment_starts: int
    doors: str
    image_size: int | None
    looks: str | None
    sensors: SensorOptions | Mapping[str, Any] | None
    whole_actions: bool
    period: float
    horizon: int | None
    variant: int
    home: str | os.PathLike | Sequence[str | os.PathLike] | None
    homes: str | Sequence[str] | None
    objects: Objects
    randomize: Randomize | Mapping[str, Any] | None
    engine_options: EngineOptions


def _checks_names(config: type[Config]) -> type[Config]:
    """Lets a class of settings be made with old names, with a FutureWarning; its errors name near matches."""
    make = config.__init__

    @functools.wraps(make)
    def init(self: Any, *values: Any, **named: Any) -> None:
        named = current_names(named, warn=True)
        for name in named:
            if name in ENGINE_OPTIONS:
                fix = f"engine_options={{'{name}': ...}}"
                raise EngineError(f"{name} is an option of the engine: EnvConfig({fix}), or make(..., {name}=...)")
            if name not in FIELDS:
                raise UnknownNameError("setting of EnvConfig", name, FIELDS, meant=_MEANT.get(name))
        make(self, *values, **named)

    config.__init__ = init  # pyright: ignore[reportAttributeAccessIssue]
    return config


@_checks_names
@dataclasses.dataclass(frozen=True, kw_only=True)
class EnvConfig:
    """Settings of an environment; `ig2mj.make` checks them.

    Attributes:
      robot: a name of `ig2mj.agents.registry` ("humanoid", "fetch", "turtlebot", or one that you have registered), a
        folder that `ig2mj convert robot` wrote, or a robot itself (`ig2mj.agents.UrdfRobot`). Actions of a converted
        robot have every number of its controller. None: the first that the task lists. In an activity that does not
        list it, it stands where the listed one with the lowest base would.
      worlds: how many step together.
      engine: "native", "warp" or "jax"; None: "warp" where JAX has a GPU, else "native".
      grasping: "mitten" (a hand holds the task's first object from the first touch on, as in the paper's experiments),
        "assisted", "sticky" or "physical"; with the last three an action of an activity also closes hands. None:
        "mitten" for the paper's activities, "assisted" for others, "physical" for navigation.
      observations: names of sensors and of the task's own vectors, or a single one (`ig2mj.envs.observations`). Images
        and laser scans need the native or the warp engine. A function of a `ig2mj.TaskView` that gives [W, n] is an
        observation of its own name.
      reward: function of a `ig2mj.TaskView` that gives the step's reward, [W], or its terms by name, in place of the
        task's. terminated: likewise, in which worlds the episode ends, in place of the task's ends; `info["success"]`
        stays the task's. Both are pure (`ig2mj.CustomTask`).
      relaxed_thresholds: the success thresholds of the paper's experiments: any force slices, and three quarters of
        the stains may remain. Only of the paper's activities.
      pool: start states of an activity; None: the task's own.
      split: "train", "held_out" (start states), "held_out:objects", "held_out:homes" or "held_out:all"
        (`ig2mj.tasks.splits`).
      pool_size: number of the task's own start states; None: all. They are sampled on first use and cached
        (`ig2mj sample-task`); navigation makes its own each time.
      augment_starts: number of start states made from those (`ig2mj.tasks.mixing`): each object lies as in one of
        them, turned as in another. 0: none, start states are used as they are.
      doors: whether doors between rooms that the task does not name stand "open" at the start of episodes, or "shut",
        as homes have them.
      image_size: height and width of images in pixels; None: those of `sensors`.
      looks: how the robot's cameras see the home: "day", "night" or "plain" (`ig2mj.load_scene`); None: as `sensors`
        says, which is plain.
      sensors: settings of the sensors; by default images of 128 x 128 pixels.
      whole_actions: an action has every number of the robot's controller, 1 being its limit, and not only the hands
        that the task moves. For people and their devices.
      period: seconds of an agent step, a whole number of control steps of 1/30 s.
      horizon: agent steps until an episode is truncated; None: the task's, scaled so that an episode lasts as many
        seconds as with the default period.
      variant: which models the activity's objects have (`ig2mj.tasks.variants`); 0: the task's own. Each variant has
        its own start states.
      home: a home in place of the task's, by name or folder: any with a floor map for navigation, any that the
        activity can be bound in for BDDL, and one with the furniture that the task needs for the paper's activities
        (`ig2mj.tasks.relocation`), which may have several places there: "birch:1" is the second. A list: several at
        once (`ig2mj.make`).
      objects: what is added to the home, folders that `ig2mj convert object` wrote or names of the object library, each
        with a place if it has one (`ig2mj.load_scene`). In the paper's activities and in tasks of your own,
        "obj/mug@on_top:breakfast_table_0" is a further condition of the start states: the mug is in another place in
        each of them. They are sampled on first use.
      randomize: what differs between episodes, axis by axis (`ig2mj.Randomize`); None: nothing.
      engine_options: see `EngineOptions`.
    """

    robot: str | TaskRobot | None = None
    worlds: int = 1
    engine: str | None = None
    grasping: str | None = None
    observations: str | Sequence[str | Callable[..., Any]] = VECTORS
    reward: Callable[..., Any] | None = None
    terminated: Callable[..., Any] | None = None
    relaxed_thresholds: bool = False
    pool: Pool | None = None
    split: str = "train"
    pool_size: int | None = None
    augment_starts: int = 0
    doors: str = "shut"
    image_size: int | None = None
    looks: str | None = None
    sensors: SensorOptions = dataclasses.field(default_factory=SensorOptions)
    whole_actions: bool = False
    period: float = ACTION_PERIOD
    horizon: int | None = None
    variant: int = 0
    home: str | os.PathLike | Sequence[str | os.PathLike] | None = None
    objects: Objects = ()
    randomize: Randomize | None = None
    engine_options: EngineOptions = dataclasses.field(default_factory=lambda: EngineOptions())

    def override(self, overrides: Mapping[str, Any] | None = None, **more: Any) -> EnvConfig:
        """The same settings with others in place of some. See the module's text.

        Raises:
          UnknownNameError: no such setting, with near matches. EngineError: `sensors` or `engine_options` are none.
        """
        values = current_names({**(overrides or {}), **more}, warn=True)
        if "sensors" in values:
            values["sensors"] = _sensors(self.sensors, values["sensors"])
        if "randomize" in values:
            values["randomize"] = Randomize.of(values["randomize"])
        options = _mapping("engine_options", values.pop("engine_options", {}))
        options = {**options, **{name: values.pop(name) for name in list(values) if name in ENGINE_OPTIONS}}
        for name in values:
            if name not in FIELDS:
                raise UnknownNameError("option of make", name, (*FIELDS, *ENGINE_OPTIONS), meant=_MEANT.get(name))
        if options:
            values["engine_options"] = {**self.engine_options, **options}
        return dataclasses.replace(self, **values)

    def by_name(self) -> dict[str, Any]:
        """What differs from the defaults: arguments of `make`, those of the engine among them."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        default, options = EnvConfig(), values.pop("engine_options")
        own = {name: value for name, value in values.items() if _differs(value, getattr(default, name))}
        return {**own, **options}

    def sensor_options(self) -> SensorOptions:
        """`sensors`, with `image_size` and `looks`. Raises UnknownNameError: there are no such looks."""
        options = self.sensors
        if self.image_size is not None:
            options = dataclasses.replace(options, width=self.image_size, height=self.image_size)
        if self.looks is not None:
            options = dataclasses.replace(options, looks=SensorOptions.of({"looks": self.looks}).looks)
        return options

    def kept_in_files(self) -> dict[str, Any]:
        """Of `by_name` what files of an environment keep together; each of the rest they keep by its own name."""
        always = {name: getattr(self, name) for name in ("relaxed_thresholds", "split", "pool_size")}
        own = {name: value for name, value in self.by_name().items() if name not in _KEPT_APART}
        return always | own | ({} if self.randomize is None else {"randomize": self.randomize.as_dict()})


_KEPT_APART = (
    *("robot", "worlds", "engine", "grasping", "observations", "sensors", "image_size", "looks"),
    *("pool", "pool_size", "horizon"),
)

FIELDS = tuple(f.name for f in dataclasses.fields(EnvConfig))
ENGINE_OPTIONS = tuple(EngineOptions.__annotations__)


def default_of(task: TaskLike) -> EnvConfig:
    """The settings of a task where nothing else is asked for, with its robot and its way of grasping."""
    return EnvConfig(robot=next(iter(task.robots)), grasping=task.grasping)


class Configured:
    """Part of `Environment`.

    Attributes:
      config: the settings that it was made with, each of them resolved: `ig2mj.make(env.task.name, env.config)` makes
        it again. task: what is done.
    """

    config: EnvConfig
    task: TaskLike

    @property
    def default_config(self) -> EnvConfig:
        """The settings of its task where nothing else is asked for."""
        return default_of(self.task)

    @property
    def made_with(self) -> dict[str, Any]:
        """The settings that files of an environment keep together (`EnvConfig.kept_in_files`)."""
        return self.config.kept_in_files()


def current_names(values: Mapping[str, Any], warn: bool = False) -> dict[str, Any]:
    """Settings by their names of today. `warn`: about each old name, as its user typed it; files may have them."""
    for old in values.keys() & RENAMED.keys() if warn else ():
        warn_renamed(old, RENAMED[old])
    return {RENAMED.get(name, name): value for name, value in values.items()}


def _sensors(before: SensorOptions, given: Any) -> SensorOptions:
    if isinstance(given, SensorOptions):
        return given
    if not isinstance(given, Mapping | None):
        raise EngineError(f"sensors = {given!r}: a mapping of settings, or SensorOptions")
    return SensorOptions.of({**dataclasses.asdict(before), **(given or {})})


def _differs(value: Any, default: Any) -> bool:
    return value is not default and (isinstance(value, Pool) or value != default)


def _mapping(name: str, given: Any) -> dict[str, Any]:
    if not isinstance(given, Mapping):
        raise EngineError(f"{name} = {given!r}: a mapping of options by name")
    return dict(given)
