"""`Pool`: many settled initial states of a scene. A batched reset gathers its rows; nothing is solved on the device.

A pool of the bare scene serves the scene with any robot (`ig2mj.engine.snapshot`). `ig2mj.sampling.settled` makes pools
with the native engine; the file is an npz archive.

Axis: P rows.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
from flax import struct
from jaxtyping import Int

from ig2mj.engine.layout import make_layout
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array, counted, length
from ig2mj.errors import InputError
from ig2mj.process.user_warning import warn_user
from ig2mj.scene.found_again import AdditionEntry, entries_of, find_again
from ig2mj.scene.paths import shipped_homes
from ig2mj.scene.scene import Agent, Scene, load_scene
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates, added_fields
from ig2mj.worlds.archive import build, check_array, check_finite, name_of, read_arrays, read_header, save_tree
from ig2mj.worlds.plugin_states import foreign_fields, plugin_defaults, plugin_header

FORMAT_VERSION = 2
"""1: scene and agents were not separate (`ig2mj.engine.snapshot`)."""


_FIX = "make a pool of this scene with `ig2mj sample`"


@struct.dataclass
class Pool:
    """Rows of initial states: physics, and extended states. Every array begins with the row axis.

    Attributes:
      digest: of the scene that it belongs to (`Scene.owns` knows it), where that is known.
      starts: hash of what determines its rows, of a task in a user's code (`ig2mj.tasks.pools.starts_digest`).
    """

    physics: Snapshot
    states: ExtendedStates
    digest: str | None = struct.field(pytree_node=False, default=None)
    starts: str | None = struct.field(pytree_node=False, default=None)

    def __repr__(self) -> str:
        return counted(self, rows=length(self.physics.time))

    @property
    def size(self) -> int:
        return self.physics.time.shape[0]

    def rows(self, index: Int[Array, "W"]) -> Pool:
        """The rows of these numbers, in that order. On the host for numpy's numbers, else it may be traced."""
        read = np.asarray if isinstance(index, np.ndarray) else jnp.asarray
        return jax.tree.map(lambda a: read(a)[index], self)


def stack(pools: list[Pool]) -> Pool:
    """One pool of the rows of several."""
    return jax.tree.map(lambda *rows: np.concatenate([np.asarray(r) for r in rows]), *pools)


def states_like(scene: Scene) -> ExtendedStates | None:
    """States of one world of a scene, of the kind that its rows have; None: those that every scene has."""
    if not scene.substances and not scene.manifest.extras:
        return None
    return initial_states(StateModel.of_manifest(scene.tables, scene.manifest), 1)


def pool_of_arrays(arrays: Mapping[str, np.ndarray], like: ExtendedStates | None, name: str) -> Pool:
    """The pool of packed arrays. `like`: see `states_like`. Raises InputError: an array is missing."""
    pool = build(Pool, arrays, name)
    return pool if like is None else dataclasses.replace(pool, states=build(type(like), arrays, name, "states."))


def save_pool(pool: Pool, file: str | os.PathLike, scene: Scene, note: dict[str, Any] | None = None) -> None:
    """Writes a pool of the scene, with the objects that were added to it. `note`: how it was made, for people."""
    header = {
        "kind": "pool",
        "format_version": FORMAT_VERSION,
        "scene": scene.name,
        "digest": scene.digest,
        "additions": entries_of(scene.additions),
        "changes": scene.changes_as_text,
        **plugin_header(pool.states),
    }
    save_tree(file, pool, {**header, **(note or {})})


def load_pool_scene(
    file: str | os.PathLike, scene: str | os.PathLike | None = None, agents: Sequence[Agent] = ()
) -> Scene:
    """The scene that a pool was made in: the home with the same additions, and whatever agents.

    Args:
      scene: the home, as of `load_scene`; None: the shipped one of the name that the pool says.

    Raises:
      InputError: the file is not a pool, or is one of another home, or an object that was added is missing, or differs
        in more than its looks. UnknownNameError: the library that ships has no such model.
    """
    header = _pool_header(file)
    entries = msgspec.convert(header["additions"], list[AdditionEntry])
    additions = find_again([entry.addition() for entry in entries], file)
    changed = [f"{a.category}/{a.model}" for a in additions if a.find().sha256 != a.sha256]
    if scene is None and header["scene"] not in shipped_homes():
        raise InputError(file, f"is of the home '{header['scene'][:60]}', which does not ship", fix="name its folder")
    objects = [*header["changes"], *(a.requested for a in additions)]
    found = load_scene(header["scene"] if scene is None else scene, agents, objects)
    if changed and not found.owns(header.get("digest")):
        raise InputError(file, f"was made with another '{changed[0]}' added", fix=_FIX)
    return found


def scene_name(file: str | os.PathLike) -> str:
    """Name of the home that a pool belongs to. Raises InputError: the file is not a pool."""
    return _pool_header(file)["scene"]


def load_pool(file: str | os.PathLike, scene: Scene | None = None) -> Pool:
    """Reads a pool.

    Args:
      scene: what it is for, with whatever agents: in all that determines physics it must be the scene that the pool
        was made in; looks and the home's name may differ. None: unchecked.

    Raises:
      InputError: the file is missing, broken, of another scene, or of another format.
    """
    header = _pool_header(file)
    fix = _FIX
    if scene is not None and not scene.owns(header.get("digest")):
        if header.get("scene") != scene.name:
            raise InputError(file, f"is a pool of scene '{header.get('scene')}', not of '{scene.name}'", fix=fix)
        if [a["name"] for a in header["additions"]] != [a.name for a in scene.additions]:
            raise InputError(file, "was made with other objects added", fix="load the scene with `load_pool_scene`")
        if header["changes"] != scene.changes_as_text:
            raise InputError(file, "was made with other changes", fix="load the scene with `load_pool_scene`")
        raise InputError(file, f"was made with another version of the physics of '{scene.name}'", fix=fix)
    arrays = read_arrays(file, "")
    lengths = {len(array) if array.ndim else 0 for array in arrays.values()}
    if len(lengths) != 1:
        raise InputError(file, f"has arrays of different lengths: {', '.join(map(str, sorted(lengths)))}", fix=fix)
    initial = None
    if scene is not None:
        initial = initial_states(StateModel.of_manifest(scene.tables, scene.manifest), 1)
        _check_widths(arrays, scene, initial, file)
    pool = _built(arrays, header, initial, file)
    if not pool.size:
        raise InputError(file, "has no rows", fix=fix)
    check_values(pool.physics, pool.states, file)
    return dataclasses.replace(pool, digest=header.get("digest"), starts=header.get("starts"))


def check_values(physics: Snapshot, states: ExtendedStates, file: str | os.PathLike) -> None:
    """Refuses what is not finite, which a world would start with unnoticed; what has never been warm has no maximum.

    Raises:
      InputError: it names the array.
    """
    check_finite({"physics": physics}, file)
    warmest = np.asarray(states.max_temperature)
    known = np.where(np.isneginf(warmest), warmest.dtype.type(0), warmest)
    check_finite({"states": dataclasses.replace(states, max_temperature=known)}, file)


def check_numbers(arrays: Mapping[str, np.ndarray], counts: Mapping[str, int], file: str | os.PathLike) -> None:
    """Raises InputError where an array names one of more things than there are (`counts`, by the array's name)."""
    for name, count in counts.items():
        if name in arrays and arrays[name].size and int(arrays[name].max()) >= count:
            raise InputError(file, f"names number {int(arrays[name].max())} of {count}", element=name, fix=_FIX)


def _built(
    arrays: Mapping[str, np.ndarray], header: Mapping[str, Any], initial: ExtendedStates | None, file: str | os.PathLike
) -> Pool:
    """The pool of a file's arrays, with states of plug-ins that it lacks as in `initial`. Raises InputError.

    Values of other states of plug-ins are left out, with a warning: nothing that reads them is there.
    """
    pool = build(Pool, arrays, file)
    if initial is not None and added_fields(initial):
        lacking = {name: rows for name, rows in plugin_defaults(initial, pool.size).items() if name not in arrays}
        pool = dataclasses.replace(pool, states=build(type(initial), {**arrays, **lacking}, file, "states."))
    if foreign := foreign_fields(header, pool.states):
        named = ", ".join(f"'{field}' of {source}" for field, source in foreign.items())
        warn_user(f"{file}: states of plug-ins that are not here are left out: {named}", UserWarning)
    return pool


def _check_widths(
    arrays: Mapping[str, np.ndarray], scene: Scene, states: ExtendedStates, file: str | os.PathLike
) -> None:
    """Refuses arrays of other kinds and widths than the scene's, and numbers of trees and bodies that it has not."""
    layout = make_layout(scene.model, scene.tables)
    units, sizes = layout.num_object_units, dict(layout.scene_sizes)
    inner = {"eq_data": (12,), "mocap_pos": (3,), "mocap_quat": (4,)}
    shapes = {name: (1, size, *inner.get(name, ())) for name, size in sizes.items()} | {"touching": (1, units, units)}
    kinds = {"eq_active": np.bool_, "tree_asleep": np.int32, "touching": np.bool_}
    requested = {f"physics.scene.{n}": np.empty(shape, kinds.get(n, np.float64)) for n, shape in shapes.items()}
    requested |= {f"states.{name_of(keys)}": leaf for keys, leaf in jax.tree_util.tree_leaves_with_path(states)}
    for name, like in requested.items():
        if name in arrays:
            check_array(arrays[name], like, file, name)
    counts = {"physics.scene.tree_asleep": sizes["tree_asleep"]}
    counts |= {f"states.{name}.body": scene.model.nbody for name in ("dust", "stain")}
    check_numbers(arrays, counts, file)


def _pool_header(file: str | os.PathLike) -> dict[str, Any]:
    """The header, in which "scene" is a text and "additions" are whole. Raises InputError."""
    header = read_header(file)
    if header.get("kind") != "pool" or header.get("format_version") != FORMAT_VERSION:
        raise InputError(file, f"is not a pool of format {FORMAT_VERSION}", fix=_FIX)
    try:
        known = msgspec.convert(header, _Header)
    except (msgspec.ValidationError, RecursionError) as e:
        raise InputError(file, str(e), element="header", fix=_FIX) from e
    return {**header, "additions": msgspec.to_builtins(known.additions), "changes": known.changes}


class _Header(msgspec.Struct):
    """What must be in a header."""

    scene: str
    digest: str | None = None
    starts: str | None = None
    additions: list[AdditionEntry] = []
    changes: list[str] = []
