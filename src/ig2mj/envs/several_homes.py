"""`HomesEnvironment`: one task in several homes at once, each with its share of the worlds.

    env = ig2mj.make("CookingMeat", home=["birch", "willow"], worlds=1024)
    env = ig2mj.make("CookingMeat", homes="train", worlds=1024)

Each home is an environment of its own (`envs`), with a compiled program of its own; arrays of the whole are those of
the homes, one after the other. Observations have the same shapes in all homes: ground truth is by the part that an
object plays, so that its names are those of the task's own home.

Axes: W worlds, H homes.
"""

from __future__ import annotations

import dataclasses
import itertools
import os
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.envs.config import EnvConfig
from ig2mj.envs.environment import Environment
from ig2mj.envs.state import EnvState, metrics_of
from ig2mj.errors import ActionError, EngineError, UnknownNameError
from ig2mj.process import entry_point
from ig2mj.tasks.homes import AnyTask
from ig2mj.tasks.relocation import reason_against, renamed
from ig2mj.tasks.splits import HELD_OUT_HOMES, TRAIN_HOMES, Split
from ig2mj.tasks.spots import home_and_place
from ig2mj.tasks.task import Task
from ig2mj.worlds.random_streams import LARGEST

STRIDE = 104_729
"""Between the seeds of two homes, so that their worlds draw differently."""

HOMES = {"train": TRAIN_HOMES, "held_out": HELD_OUT_HOMES}
"""Sets of homes by name."""


@struct.dataclass
class HomesState:
    """All worlds of all homes; fields as of `EnvState`. Attributes: parts: the state of each home."""

    parts: tuple[EnvState, ...]
    obs: dict[str, Array]
    reward: Float[Array, "W"]
    terminated: Bool[Array, "W"]
    truncated: Bool[Array, "W"]
    info: dict[str, Any]

    @property
    def done(self) -> Bool[Array, "W"]:
        """The episode is over."""
        return self.terminated | self.truncated

    @property
    def metrics(self) -> dict[str, Array]:
        """See `EnvState.metrics`."""
        return metrics_of(self.info)


_OWN = ("task", "robot", "grasping", "scene", "core", "config", "made_with", "default_config", "sensor_options")
_OWN += ("action_space", "action_names", "action_map", "observation_spaces", "period", "objective", "mj_model")
_OWN += ("proprioception_names",)


@entry_point
class HomesEnvironment:
    """See the module's text. Other attributes are those of the first home's environment
    (`task`, `robot`, `action_space`, ...).

    Attributes:
      envs: of the homes. homes: their names, with the number of the place where it is not the first. num_worlds: W.
      privileged_names: of ground truth.
    """

    def __init__(self, envs: Sequence[Environment]):
        """Raises EngineError: there is no home, or actions or observations differ between two homes."""
        if not envs:
            raise EngineError("homes: name at least one")
        self.envs, self.homes = tuple(envs), tuple(map(_label, envs))
        first = envs[0]
        for env in envs[1:]:
            for what, mine, other in (
                ("actions", first.action_names, env.action_names),
                ("observations", first.observation_spaces, env.observation_spaces),
            ):
                if mine != other:
                    raise EngineError(f"{what} differ between '{first.scene.name}' and '{env.scene.name}'")
        self.num_worlds = sum(env.num_worlds for env in envs)
        self.privileged_names = _role_names(first)
        counts = np.cumsum([0, *(env.num_worlds for env in envs)])
        self.rows = [slice(int(a), int(b)) for a, b in itertools.pairwise(counts)]
        self._join = jax.jit(lambda *states: _joined(states)) if self.pure else lambda *states: _joined(states)

    def __repr__(self) -> str:
        return f"HomesEnvironment('{self.task.name}', {self.num_worlds} worlds in {', '.join(self.homes)})"

    def __getattr__(self, name: str) -> Any:
        if name in _OWN:
            return getattr(self.envs[0], name)
        raise AttributeError(f"'HomesEnvironment' object has no attribute '{name}'")

    @property
    def pure(self) -> bool:
        """See `Environment.pure`."""
        return self.envs[0].pure

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """See `Environment.prepare_devices`."""
        for env in self.envs:
            env.prepare_devices(devices)

    def home_of(self, world: int) -> str:
        """The home that a world is in."""
        return next(home for home, rows in zip(self.homes, self.rows, strict=True) if rows.start <= world < rows.stop)

    def reset(self, seed: int | HomesState = 0, mask: Bool[Array, "W"] | None = None) -> HomesState:
        """All worlds at the start of an episode; or a new episode in the masked worlds of a state."""
        if isinstance(seed, HomesState):
            masks = [None if mask is None else np.asarray(mask)[rows] for rows in self.rows]
            return self._with([e.reset(p, m) for e, p, m in zip(self.envs, seed.parts, masks, strict=True)])
        if mask is not None:
            raise EngineError("a mask resets worlds of a state: reset(state, mask); a seed starts all of them")
        return self._with([env.reset(self.seed_of(k, seed)) for k, env in enumerate(self.envs)])

    def seed_of(self, home: int, seed: int) -> int:
        """The seed of the worlds of a home, by its number."""
        return (int(seed) + STRIDE * home) % LARGEST

    def step(self, state: HomesState, action: Float[Array, "W n"]) -> HomesState:
        """One agent step of every world. Raises ActionError: the action has another shape."""
        return self._each(lambda env: env.step, state, action)

    def step_autoreset(self, state: HomesState, action: Float[Array, "W n"]) -> HomesState:
        """See `Environment.step_autoreset`."""
        return self._each(lambda env: env.step_autoreset, state, action)

    def step_fn(self, state: HomesState, action: Float[Array, "W n"]) -> HomesState:
        """`step`, neither checked nor compiled."""
        parts = zip(self.envs, state.parts, self.rows, strict=True)
        return _joined([env.step_fn(part, action[rows]) for env, part, rows in parts])

    def step_autoreset_fn(self, state: HomesState, action: Float[Array, "W n"]) -> HomesState:
        """`step_autoreset`, neither checked nor compiled."""
        parts = zip(self.envs, state.parts, self.rows, strict=True)
        return _joined([env.step_autoreset_fn(part, action[rows]) for env, part, rows in parts])

    def _each(
        self, verb: Callable[[Environment], Callable[..., EnvState]], state: HomesState, action: Any
    ) -> HomesState:
        size = self.envs[0].action_space.shape
        if tuple(np.shape(action)) != (self.num_worlds, *size):
            raise ActionError(f"an action has shape {(self.num_worlds, *size)}, not {tuple(np.shape(action))}")
        parts = zip(self.envs, state.parts, self.rows, strict=True)
        return self._with([verb(env)(part, action[rows]) for env, part, rows in parts])

    def _with(self, parts: Sequence[EnvState]) -> HomesState:
        return HomesState(tuple(parts), *self._join(*(_seen(part) for part in parts)))

    def close(self) -> None:
        """See `Environment.close`."""
        for env in self.envs:
            env.close()


def _label(env: Environment) -> str:
    """The name of an environment's home, with the number of the place there."""
    home = env.config.home
    place = home_and_place(home)[1] if isinstance(home, str) else 0
    return f"{env.scene.name}:{place}" if place else env.scene.name


def _seen(state: EnvState) -> tuple[Any, ...]:
    return state.obs, state.reward, state.terminated, state.truncated, state.info


def _joined(states: Sequence[Any]) -> Any:
    """Arrays of all homes, one after the other. `states`: states, whose parts are kept, or what `_seen` gives."""
    if isinstance(states[0], EnvState):
        return HomesState(tuple(states), *_joined([_seen(state) for state in states]))
    whole = jax.tree.map(lambda *arrays: jnp.concatenate([jnp.asarray(a) for a in arrays]), *states)
    return whole


def _role_names(env: Environment) -> tuple[str, ...]:
    """Names of ground truth with the names that objects have in the task's own home."""
    if not isinstance(env.task, Task) or not env.task.roles:
        return env.privileged_names
    own = {here: at_home for at_home, here in env.task.roles.items()}
    return tuple(_in_role(name, own) for name in env.privileged_names)


def _in_role(name: str, own: dict[str, str]) -> str:
    for here, at_home in own.items():
        if name.startswith(f"{here}_"):
            return renamed(here, {here: at_home}) + name[len(here) :]
    return name


def requested_homes(task: AnyTask, config: EnvConfig, homes: Any) -> tuple[str, ...] | None:
    """Several homes that are asked for; None: one. Raises UnknownNameError, EngineError: these cannot be."""
    split = Split.of(config.split)
    if homes is not None and config.home is not None:
        raise EngineError("home= and homes=: give one of them")
    if config.home is not None and not isinstance(config.home, str | os.PathLike | Sequence):
        raise EngineError(f"home = {config.home!r}: a home's name or folder, or a list of these")
    if config.home is not None and not isinstance(config.home, str | os.PathLike):
        for home in config.home:
            split.check_home(home)
        return tuple(os.fspath(home) for home in config.home)
    split.check_home(config.home)
    if homes is None and (split.homes == "train" or config.home is not None):
        return None
    part = split.homes if homes is None else homes
    if not isinstance(part, str):
        return requested_homes(task, dataclasses.replace(config, home=part), None)
    if part not in HOMES:
        raise UnknownNameError("set of homes", str(part), HOMES)
    if part == "train" and split.homes == "held_out":
        raise EngineError(f"homes='train' and split='{split.name}': this split takes held-out homes")
    if not isinstance(task, Task):
        return HOMES[part]
    fitting = tuple(home for home in HOMES[part] if not reason_against(task, home))
    if not fitting:
        reasons = "; ".join(reason_against(task, home) for home in HOMES[part])
        raise EngineError(f"{task.name} fits into none of the homes {', '.join(HOMES[part])}: {reasons}")
    return fitting
