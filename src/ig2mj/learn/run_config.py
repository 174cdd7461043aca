"""A run of `ig2mj train` as a file: TOML that names the environment, the algorithm and every setting.

    env = "CookingMeat"
    robot = "fetch"
    obs = "rgbd"
    worlds = 1024

    [settings]
    engine = "warp"
    gamma = 0.98

The keys at the top are options of the command (`RunOptions`). `[settings]` holds those of `RunSettings`, of the
algorithm and of `ig2mj.learn.occlusion.OcclusionConfig`; `--set name=value` changes each of them. What a file leaves
out has its default. `policies/*.toml` are the runs that the policies that ship come from.
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
from typing import Any

import msgspec

from ig2mj.envs.several_homes import HOMES
from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
from ig2mj.learn.algorithms import config_of
from ig2mj.learn.bc import BCConfig
from ig2mj.learn.occlusion import OcclusionConfig
from ig2mj.learn.run_files import FIX, run_table, shipped_runs
from ig2mj.learn.settings import configure_all, written
from ig2mj.learn.shipped import find_policy
from ig2mj.scene.paths import shipped_homes
from ig2mj.scene.scene import check_looks
from ig2mj.sensors.base import CAMERA_LOOKS
from ig2mj.tasks.spots import home_and_place
from ig2mj.worlds.randomize import Randomize


def _checked_home(name: str) -> str:
    """A home's name or folder, or a place there. Raises UnknownNameError: there is no such home."""
    home, _ = home_and_place(name)
    if home not in (homes := shipped_homes()) and not pathlib.Path(home).exists():
        raise UnknownNameError("home or set of homes", name, (*HOMES, *homes))
    return name


@dataclasses.dataclass(frozen=True)
class RunOptions:
    """Options of a run that the command has, too; `ig2mj train --help` says what they mean."""

    env: str = ""
    algo: str = "sac"
    robot: str | None = None
    grasping: str | None = None
    obs: str = "state"
    worlds: int = 0
    minutes: float = 10.0
    seed: int = 0
    devices: str = "1"
    demos: str | None = None
    init_from: str | None = None
    stop_at_success: float | None = None
    videos: float = 0.0
    objects: tuple[str, ...] = ()


ALGORITHMS = ("sac", "ppo", "bc", "dagger")


def _axes(text: str) -> Randomize | None:
    """What `RunSettings.randomize` says. Raises Ig2mjError: it is no JSON; UnknownNameError, EngineError."""
    if text == "all":
        return Randomize.every()
    if not text.lstrip().startswith("{"):
        return Randomize.of([part.strip() for part in text.split(",")])
    try:
        return Randomize.of(json.loads(text))
    except json.JSONDecodeError as e:
        example = '{"objects": true, "robot_start": {"shift": 0.2}}'
        raise Ig2mjError(f"randomize={text}: no JSON ({e}); axes with commas, or such as {example}") from None


@dataclasses.dataclass(frozen=True)
class RunSettings:
    """Settings of a run that belong to no algorithm.

    Attributes:
      engine: native, warp or jax; "": warp on a GPU, else native.
      image_size: height and width that the 128x128 images are averaged down to.
      image_rows: of these the first that the networks see and the first below those, e.g. 80,128; (): all.
      depth_range: m, that a byte of depth covers; 0: as the environment says.
      looks: how cameras see the home, "day", "night" or "plain" (`ig2mj.load_scene`).
      pool_size: number of start states; 0: all of the split.
      augment_starts: train on this many start states made of those: every object lies where it does in one, turned as
        in another; 0: on those themselves.
      doors: whether doors between rooms stand "open" or "shut" at the start of episodes.
      horizon: agent steps of an episode; 0: those of the demonstrations, else the task's.
      relaxed_thresholds: the success thresholds of the paper's experiments.
      homes: "train", or names of homes with commas, also with the number of a place ("birch:1"): worlds are shared out
        over them; "": the task's own.
      homes_in_turn: an iteration steps the worlds of one of several homes, in turn (sac and dagger, where worlds divide
        evenly over homes); false: of all of them.
      randomize: axes of `ig2mj.Randomize` with commas, "all", or axes with their settings as JSON, such as
        {"objects": true, "robot_start": {"shift": 0.2}}; "": nothing differs between episodes.
      expert: for SAC: the task's scripted expert begins episodes and labels states.
      save_buffer: checkpoints hold the replay buffer; without it a resumed run first refills it.
      programs: compiled programs of an iteration: 2, which are compiled side by side and timed separately, or 1, whose
        iterations are some 2 % faster.
    """

    engine: str = ""
    image_size: int = 32
    image_rows: tuple[int, ...] = ()
    depth_range: float = 0.0
    looks: str = CAMERA_LOOKS
    pool_size: int = 0
    augment_starts: int = 0
    doors: str = "shut"
    horizon: int = 0
    relaxed_thresholds: bool = False
    homes: str = ""
    homes_in_turn: bool = True
    randomize: str = ""
    expert: bool = False
    save_buffer: bool = False
    programs: int = 2

    @property
    def varied(self) -> dict[str, Any]:
        """Options of `make` for `homes` and `randomize`. Raises UnknownNameError: no such home or axis; Ig2mjError."""
        found: dict[str, Any] = {}
        if self.homes:
            names = [name for part in self.homes.split(",") if (name := part.strip())]
            if not names:
                raise Ig2mjError(f"homes={self.homes!r} names no home")
            whole = len(names) == 1 and names[0] in HOMES
            found["homes"] = names[0] if whole else [_checked_home(name) for name in names]
        if self.randomize:
            found["randomize"] = _axes(self.randomize)
        return found

    @property
    def rows(self) -> tuple[int, int] | None:
        """`image_rows` as `Perception` takes them. Raises Ig2mjError."""
        if not self.image_rows:
            return None
        if len(self.image_rows) != 2 or not self.image_rows[0] < self.image_rows[1] <= self.image_size:
            raise Ig2mjError(f"image_rows={written(self.image_rows)}: {self._why_no_rows()}")
        return self.image_rows[0], self.image_rows[1]

    def _why_no_rows(self) -> str:
        if len(self.image_rows) == 2 and self.image_rows[0] < self.image_rows[1]:
            least = next((size for size in (32, 64, 128) if size >= self.image_rows[1]), None)
            fix = f" (set image_size={least})" if least else ""
            return f"images of image_size={self.image_size} have {self.image_size} rows{fix}"
        example = f"{self.image_size // 2},{self.image_size}"
        return f"two numbers, the first row and the first below the last, such as image_rows={example}"


def read_run_file(file: str | os.PathLike) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Reads a file; see the module's text. The name of a policy that ships stands for its file.

    Returns:
      Options by the names of `RunOptions`, and settings as "name=value".

    Raises:
      InputError: no such file, no TOML, or a value of another type. UnknownNameError: an option that does not exist.
    """
    found = run_table(file)
    settings = found.pop("settings")
    for name, value in settings.items():
        if not isinstance(value, str | int | float | list) or any(isinstance(v, dict | list) for v in _items(value)):
            raise InputError(file, f"has a value of type {type(value).__name__}", element=f"settings.{name}", fix=FIX)
    known = {field.name for field in dataclasses.fields(RunOptions)}
    for name in found:
        if name not in known:
            raise UnknownNameError("option of a training file", name, (*known, "settings"))
    try:
        options = msgspec.convert(found, RunOptions)
    except msgspec.ValidationError as e:
        raise InputError(file, str(e), fix=FIX) from e
    return {name: getattr(options, name) for name in found}, tuple(f"{n}={written(v)}" for n, v in settings.items())


def initial_policy(name: str) -> pathlib.Path:
    """The file of the policy that a run begins with; as `find_policy`, whose errors name the run that makes it."""
    try:
        return find_policy(name)
    except InputError as e:
        stage = pathlib.PurePath(name).name
        if pathlib.Path(name).exists() or stage not in shipped_runs():
            raise
        fix = f"the first stage makes it: `ig2mj train --config {stage} --out {name}`"
        raise InputError(name, e.problem, fix=fix) from e


def _items(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def settings_of(
    algo: str, changes: tuple[str, ...], on_gpu: bool = False, quiet: bool = False
) -> tuple[RunSettings, Any, OcclusionConfig]:
    """The settings of a run.

    Args:
      algo: name of the algorithm. changes: "name=value", the last of a name counts. on_gpu: the default engine is warp.
      quiet: old names are not reported, since an earlier call with the same changes has.

    Returns:
      Those of the run, of the algorithm (defaults for its engine), and of learning under occlusion.

    Raises:
      UnknownNameError: no such algorithm or setting, with near matches. Ig2mjError: a value that cannot be, or the
        setting of another algorithm.
    """
    if algo not in ALGORITHMS:
        raise UnknownNameError("algorithm", algo, ALGORITHMS)
    run = RunSettings(engine="warp" if on_gpu else "native")
    own = [c for c in changes if c.partition("=")[0] == "engine"]
    small = configure_all([run], own)[0].engine == "native"
    configs = [run, _algorithm(algo, small), OcclusionConfig()]
    run, algorithm, occlusion = configure_all(configs, changes, _elsewhere(algo), quiet)
    if run.programs not in (1, 2):
        raise Ig2mjError(f"programs={run.programs}: 1 or 2 are possible")
    check_looks(run.looks)
    return run, algorithm, occlusion


def _algorithm(algo: str, small: bool = False) -> Any:
    return BCConfig() if algo == "bc" else config_of(algo, small=small)


def _elsewhere(algo: str) -> dict[str, str]:
    """Names that are no settings of an algorithm, and what they are: of other algorithms, or options of the command."""
    owners: dict[str, list[str]] = {}
    for other in ALGORITHMS:
        for field in dataclasses.fields(_algorithm(other)):
            owners.setdefault(field.name, []).append(other)
    found = {name: f"{name} is a setting of {', '.join(of)}, not of {algo}" for name, of in owners.items()}
    options = [field.name for field in dataclasses.fields(RunOptions)]
    return found | {name: f"{name} is an option, --{name.replace('_', '-')}" for name in options if name != "env"}
