"""Files of a batch: all its worlds in one `.npz` (arrays only, no pickle), for any engine and machine.

A file names what it is of in its header, which is read first. Every array must have the shape and the type that the
core's own batches have.

Axis: W worlds.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import mujoco
import numpy as np
from flax import struct

from ig2mj.engine.saved import SavedPhysics
from ig2mj.engine.snapshot import FULLY_AWAKE
from ig2mj.errors import InputError
from ig2mj.scene.scene import Scene
from ig2mj.states.world import WorldState
from ig2mj.worlds.archive import load_exactly, read_header, save_tree
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.core import Core
from ig2mj.worlds.guards import Flag
from ig2mj.worlds.plugin_states import plugin_defaults, plugin_header, refuse_foreign

KIND = "batch of worlds"

FORMAT_VERSION = 1

FIXES = {
    "scene": "make the worlds of that home",
    "grasping": "make them with grasping=",
    "worlds": "make that many",
    "layout": "the home, its objects or its robot have changed since",
}
"""What a file must have in common with the core, and what to do otherwise."""


@struct.dataclass
class SavedBatch:
    """A batch with its physics in arrays. `batch`: fields of `Batch` that are arrays, and of its `WorldState`."""

    physics: SavedPhysics
    states: Any
    batch: dict[str, Any]


_OF_WORLD = ("key", "step", "time")
_OF_BATCH = tuple(field.name for field in dataclasses.fields(Batch) if field.name != "world")


def save_batch(core: Core, batch: Batch, file: str | os.PathLike) -> None:
    """Writes a batch of the core.

    Raises:
      StaleStateError: the batch was consumed. InputError: it cannot be written there.
    """
    save_parts(core, [batch], file)


def load_batch(core: Core, file: str | os.PathLike) -> Batch:
    """Reads a batch that `save_batch` wrote, which continues as it would have.

    Raises:
      InputError: the file is missing or damaged, or of another scene, number of worlds or mode of grasping.
    """
    return restored_batch(core, load_parts(core, 1, file)[0])


def save_parts(core: Core, parts: Sequence[Batch], file: str | os.PathLike) -> None:
    """`save_batch` of worlds in several batches of the core, one after the other."""
    for part in parts:
        core.check(part)
    saved = [saved_batch(core, part) for part in parts]
    whole = jax.tree.map(lambda *arrays: _joined([np.asarray(array) for array in arrays]), *saved)
    header = {"kind": KIND, "version": FORMAT_VERSION, **_fit(core, len(parts)), **plugin_header(whole.states)}
    save_tree(file, whole, header)


def load_parts(core: Core, count: int, file: str | os.PathLike) -> list[SavedBatch]:
    """Reads the worlds of `count` batches of the core. Raises InputError."""
    header = read_header(file)
    check_fit(file, header, _fit(core, count), FIXES)
    like = saved_batch(core, core.start(0))
    refuse_foreign(header, like.states, file)
    defaults = plugin_defaults(_initial(core), core.engine.num_worlds * count)
    whole, _ = load_exactly(
        file, jax.tree.map(lambda array: _joined([np.asarray(array)] * count), like), defaults=defaults
    )
    check_numbers(file, core.engine.scene, whole)
    return [jax.tree.map(lambda array, k=k: _part(array, k, count), whole) for k in range(count)]


def _initial(core: Core) -> Any:
    """States of a world at its start; None where only physics is stepped."""
    return None if core.rules is None else core.rules.initial


def _joined(arrays: list[np.ndarray]) -> np.ndarray:
    """One array of all worlds; what has no world axis is the same in all parts."""
    return np.concatenate(arrays) if arrays[0].ndim else arrays[0]


def _part(array: np.ndarray, k: int, count: int) -> np.ndarray:
    return np.split(array, count)[k] if array.ndim else array


def saved_batch(core: Core, batch: Batch) -> SavedBatch:
    """A batch in arrays."""
    world = batch.world
    arrays = {name: getattr(batch, name) for name in _OF_BATCH} | {name: getattr(world, name) for name in _OF_WORLD}
    return SavedBatch(core.engine.saved(world.physics), world.states, arrays)


def restored_batch(core: Core, saved: Any) -> Batch:
    """A batch that continues from a saved one, or from what has its fields."""
    physics = core.engine.restored(saved.physics)
    view = core.engine.restored_view(physics, saved.physics)
    states, parts = core.engine.constants((saved.states, saved.batch))
    clocks = {name: parts.pop(name) for name in _OF_WORLD}
    view = core.cameras.placed(view, parts["controllers"])
    return Batch(world=WorldState(physics=physics, view=view, states=states, **clocks), **parts)


def layout_of(scene: Scene) -> str:
    """Differs between scenes in which a number of a state belongs to different things; not where only looks differ."""
    model = scene.model
    names = [[model.body(b).name for b in range(model.nbody)], [model.joint(j).name for j in range(model.njnt)]]
    names += [[model.actuator(a).name for a in range(model.nu)], [model.equality(e).name for e in range(model.neq)]]
    names += [list(scene.object_names)]
    return hashlib.sha256(repr(names).encode()).hexdigest()[:16]


def check_fit(
    file: str | os.PathLike,
    header: Mapping[str, Any],
    own: Mapping[str, Any],
    fixes: Mapping[str, str],
    kind: tuple[str, int] = (KIND, FORMAT_VERSION),
    other: str = "other worlds",
) -> None:
    """Raises InputError where a file does not fit.

    Args:
      own: what a file must have in common. fixes: what to do otherwise. kind: kind and version of files that are read.
      other: what the file is of otherwise.
    """
    if (header.get("kind"), header.get("version")) != kind:
        raise InputError(file, f"holds no {kind[0]} of format {kind[1]}", fix="write it with `save`")
    for name, fix in fixes.items():
        if header.get(name) != own[name]:
            found = "" if name == "layout" else f": {name} = {str(header.get(name))[:200]!r}, here {str(own[name])!r}"
            raise InputError(file, f"is of {other}{found}", fix=fix)


def check_numbers(file: str | os.PathLike, scene: Scene, saved: Any, known: Mapping[str, Any] | None = None) -> None:
    """Raises InputError where a number is none that a batch can have. Worlds flagged as not finite may have such.

    Args:
      saved: a `SavedBatch`, or what has its fields. known: more truth values, by the name of an array.
    """
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
    particles = () if saved.states is None else ("dust", "stain")
    fine = {
        "physics.snapshot.tree_asleep": (asleep >= FULLY_AWAKE) & (asleep < max(scene.model.ntree, 1)),
        "batch.flags": (flags >= 0) & (flags < 2 * max(Flag)),
        **{f"states.{n}.body": getattr(saved.states, n).body < scene.model.nbody for n in particles},
        **{f"batch.{name}": np.asarray(saved.batch[name]) >= 0 for name in ("step", "number", "episode", "time")},
        **(known or {}),
    }
    for name, sound in fine.items():
        if not np.all(sound):
            raise InputError(file, "holds numbers that are out of range", element=name)


def _fit(core: Core, count: int = 1) -> dict[str, Any]:
    scene = core.engine.scene
    grasping = "physical" if core.grasping is None else core.grasping.mode
    return {
        "scene": scene.name,
        "grasping": grasping,
        "worlds": core.engine.num_worlds * count,
        "layout": layout_of(scene),
    }
