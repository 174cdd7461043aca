"""Files of an environment's state: all its worlds in one `.npz` (arrays only, no pickle).

A file is read only where it fits the environment: what it is of is in its header, which is read first, and every array
must have the shape and the kind of number that the environment's own states have.

Axis: W worlds.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
from typing import TYPE_CHECKING, Any

import jax
import mujoco
import numpy as np
from flax import struct

from ig2mj.engine.saved import SavedPhysics
from ig2mj.engine.snapshot import FULLY_AWAKE
from ig2mj.envs.state import EnvState
from ig2mj.errors import InputError
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates, WorldState
from ig2mj.worlds.archive import load_exactly, read_header, save_tree
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.guards import Flag

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
    """What a file holds: everything of an `EnvState`, with physics in arrays. `batch`: fields of `Batch` that are
    arrays, and of its `WorldState`."""

    physics: SavedPhysics
    states: ExtendedStates
    batch: dict[str, Any]
    state: dict[str, Any]


_OF_WORLD = ("key", "step", "time")
_OF_BATCH = tuple(field.name for field in dataclasses.fields(Batch) if field.name != "world")
_OF_STATE = tuple(field.name for field in dataclasses.fields(EnvState) if field.name != "batch")


def save_state(env: Environment, state: EnvState, file: str | os.PathLike) -> None:
    """Writes a state of the environment.

    Raises:
      StaleStateError: the state is stale. InputError: it cannot be written there.
    """
    env.check(state)
    save_tree(file, _saved(env, state), {"kind": KIND, "version": FORMAT_VERSION, **_fit(env)})


def load_state(env: Environment, file: str | os.PathLike) -> EnvState:
    """Reads a state of the environment.

    Raises:
      InputError: the file is missing or damaged, or does not fit the environment.
    """
    _check_fit(file, read_header(file), _fit(env))
    like = _saved(env, env.reset(0))
    more = {f"state.info.{FINAL}.{name}": array for name, array in like.state["obs"].items()}
    saved, extra = load_exactly(file, like, more)
    _check_numbers(file, env, saved)
    if extra:
        saved.state["info"][FINAL] = {name: extra[f"state.info.{FINAL}.{name}"] for name in like.state["obs"]}
    return _state_of(env, saved)


def _check_fit(file: str | os.PathLike, header: dict[str, Any], own: dict[str, Any]) -> None:
    if header.get("kind") != KIND or header.get("version") != FORMAT_VERSION:
        raise InputError(
            file, f"is not a state of an environment of format {FORMAT_VERSION}", fix="write it by env.save"
        )
    for name, fix in _FIT.items():
        if header.get(name) != own[name]:
            said = "" if name == "layout" else f": {name} = {str(header.get(name))[:200]!r}, here {str(own[name])!r}"
            raise InputError(file, f"is of another environment{said}", fix=fix)


def _saved(env: Environment, state: EnvState) -> _Saved:
    batch, world = state.batch, state.batch.world
    return _Saved(
        physics=env.core.engine.saved(world.physics),
        states=world.states,
        batch={name: getattr(batch, name) for name in _OF_BATCH} | {n: getattr(world, n) for n in _OF_WORLD},
        state={name: getattr(state, name) for name in _OF_STATE},
    )


def _state_of(env: Environment, saved: _Saved) -> EnvState:
    core = env.core
    physics = core.engine.restored(saved.physics)
    view = core.engine.restored_view(physics, saved.physics)
    states, batch, state = core.engine.constants((saved.states, saved.batch, saved.state))
    parts = dict(batch)
    clocks = {name: parts.pop(name) for name in _OF_WORLD}
    view = core.cameras.placed(view, parts["controllers"])
    world = WorldState(physics=physics, view=view, states=states, **clocks)
    return EnvState(batch=Batch(world=world, **parts), **state)


def _fit(env: Environment) -> dict[str, Any]:
    """What a file of the environment says of itself."""
    return {
        "scene": env.scene.name,
        "task": env.task.name,
        "robot": env.robot,
        "grasping": env.grasping,
        "worlds": env.num_worlds,
        "observations": {name: [*space.shape] for name, space in env.observation_spaces.items()},
        "period": round(env.period, 9),
        "layout": _layout(env.scene),
    }


def _layout(scene: Scene) -> str:
    """Tells apart scenes in which a number of a state belongs to something else; not those that look otherwise."""
    model = scene.model
    names = [[model.body(b).name for b in range(model.nbody)], [model.joint(j).name for j in range(model.njnt)]]
    names += [[model.actuator(a).name for a in range(model.nu)], [model.equality(e).name for e in range(model.neq)]]
    names += [list(scene.object_names)]
    return hashlib.sha256(repr(names).encode()).hexdigest()[:16]


def _check_numbers(file: str | os.PathLike, env: Environment, saved: _Saved) -> None:
    """Raises InputError where a number is none that a state can have. Worlds that are flagged as not finite may be."""
    flags = np.asarray(saved.batch["flags"])
    lost = (flags & int(Flag.NOT_FINITE)) != 0
    for keys, leaf in jax.tree_util.tree_flatten_with_path(saved)[0]:
        array = np.asarray(leaf)
        name = jax.tree_util.keystr(keys, simple=True, separator=".")
        if array.dtype.kind != "f" or not array.size:
            continue
        rows = array[~lost] if array.ndim and len(array) == len(lost) else array
        if np.isnan(rows).any() or (name.startswith("physics.") and not (np.abs(rows) < mujoco.mjMAXVAL).all()):
            raise InputError(file, "holds numbers that are not finite", element=name)
    asleep = np.asarray(saved.physics.snapshot.tree_asleep)
    known = {
        "physics.snapshot.tree_asleep": (asleep >= FULLY_AWAKE) & (asleep < max(env.scene.model.ntree, 1)),
        "batch.flags": (flags >= 0) & (flags < 2 * max(Flag)),
        **{f"states.{n}.body": getattr(saved.states, n).body < env.scene.model.nbody for n in ("dust", "stain")},
        **{f"batch.{name}": np.asarray(saved.batch[name]) >= 0 for name in ("step", "number", "episode", "time")},
    }
    for name, space in env.observation_spaces.items():
        seen = np.asarray(saved.state["obs"][name])
        known[f"state.obs.{name}"] = (seen >= space.low) & (seen <= space.high)
    for name, fine in known.items():
        if not np.all(fine):
            raise InputError(file, "holds numbers that are out of range", element=name)
