"""Files of an environment's state: all its worlds in one `.npz` (arrays only, no pickle).

A file must fit the environment: its header, which is read first, names scene, task and settings, and every array must
have the shape and dtype that states of the environment have.

Axis: W worlds.
"""

from __future__ import annotations

import dataclasses
import os
from typing import TYPE_CHECKING, Any

import numpy as np
from flax import struct

from ig2mj.engine.saved import SavedPhysics
from ig2mj.envs.state import EnvState
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.archive import load_exactly, read_header, save_tree
from ig2mj.worlds.batch_files import check_fit, check_numbers, layout_of, restored_batch, saved_batch
from ig2mj.worlds.plugin_states import plugin_defaults, plugin_header, refuse_foreign

if TYPE_CHECKING:
    from ig2mj.envs.environment import Environment

KIND = "environment state"

FORMAT_VERSION = 1

FINAL = "final_obs"
"""Key of `EnvState.info` that only states of `step_autoreset` have."""

_FIT = {
    "scene": "make the environment in that home",
    "task": "make the environment of that task",
    "robot": "make it with robot=",
    "grasping": "make it with grasping=",
    "worlds": "make it with worlds=",
    "observations": "make it with observations=",
    "period": "make it with period=",
    "layout": "the home, its objects or its robot have changed since",
}
"""What a file must have in common with the environment, and what to do otherwise."""


@struct.dataclass
class _Saved:
    """What a file holds: a `SavedBatch`, and the other fields of an `EnvState`."""

    physics: SavedPhysics
    states: ExtendedStates
    batch: dict[str, Any]
    state: dict[str, Any]


_OF_STATE = tuple(field.name for field in dataclasses.fields(EnvState) if field.name != "batch")


def save_state(env: Environment, state: EnvState, file: str | os.PathLike) -> None:
    """Writes a state of the environment.

    Raises:
      StaleStateError: the state is stale. InputError: it cannot be written there.
    """
    env.check(state)
    saved = _saved(env, state)
    save_tree(file, saved, {"kind": KIND, "version": FORMAT_VERSION, **_fit(env), **plugin_header(saved.states)})


def load_state(env: Environment, file: str | os.PathLike) -> EnvState:
    """Reads a state of the environment.

    Raises:
      InputError: the file is missing or damaged, or does not fit the environment.
    """
    header = read_header(file)
    check_fit(file, header, _fit(env), _FIT, (KIND, FORMAT_VERSION), "another environment")
    like = _saved(env, env.reset(0))
    more = {f"state.info.{FINAL}.{name}": array for name, array in like.state["obs"].items()}
    refuse_foreign(header, like.states, file)
    rules = env.core.rules
    defaults = plugin_defaults(None if rules is None else rules.initial, env.num_worlds)
    saved, extra = load_exactly(file, like, more, defaults)
    check_numbers(file, env.scene, saved, _observed(env, saved))
    if extra:
        saved.state["info"][FINAL] = {name: extra[f"state.info.{FINAL}.{name}"] for name in like.state["obs"]}
    return EnvState(batch=restored_batch(env.core, saved), **env.core.engine.constants(saved.state))


def _saved(env: Environment, state: EnvState) -> _Saved:
    batch = saved_batch(env.core, state.batch)
    return _Saved(batch.physics, batch.states, batch.batch, {name: getattr(state, name) for name in _OF_STATE})


def _fit(env: Environment) -> dict[str, Any]:
    """Header of a file of the environment."""
    return {
        "scene": env.scene.name,
        "task": env.task.name,
        "robot": env.robot,
        "grasping": env.grasping,
        "worlds": env.num_worlds,
        "observations": {name: [*space.shape] for name, space in env.observation_spaces.items()},
        "period": round(env.period, 9),
        "layout": layout_of(env.scene),
    }


def _observed(env: Environment, saved: _Saved) -> dict[str, Any]:
    """Whether observations are in their ranges, by the name of the array."""
    seen = {name: np.asarray(saved.state["obs"][name]) for name in env.observation_spaces}
    return {
        f"state.obs.{name}": (seen[name] >= space.low) & (seen[name] <= space.high)
        for name, space in env.observation_spaces.items()
    }
