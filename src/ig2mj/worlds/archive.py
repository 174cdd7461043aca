"""Pytrees of arrays in `.npz` files: one array per leaf under its path, a JSON header, no pickle."""

from __future__ import annotations

import dataclasses
import io
import os
import pathlib
import typing
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import jax
import msgspec
import numpy as np

from ig2mj.errors import InputError
from ig2mj.files.content import decode_struct
from ig2mj.files.npz import read_npz, refuse_nonfinite, write_npz
from ig2mj.files.unfinished import replacing

HEADER = "header"

Tree = TypeVar("Tree")


def save_tree(file: str | os.PathLike, tree: Any, header: dict[str, Any]) -> None:
    """Writes all leaves of a pytree and a header; the file appears only when it is complete.

    Raises:
      InputError: it cannot be written there.
    """
    path = pathlib.Path(file)
    packed = pack(tree, header)
    try:
        with replacing(path) as part:
            part.write_bytes(packed)
    except OSError as e:
        raise InputError(path, f"cannot be written: {e.strerror or e}", fix="choose another place") from e


def pack(tree: Any, header: dict[str, Any]) -> bytes:
    """What `save_tree` would write, for `unpack`."""
    with io.BytesIO() as out:
        arrays = {name_of(keys): np.asarray(leaf) for keys, leaf in jax.tree_util.tree_flatten_with_path(tree)[0]}
        arrays[HEADER] = np.frombuffer(msgspec.json.encode(header), np.uint8)
        write_npz(out, arrays)
        return out.getvalue()


def unpack(packed: bytes) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays by path, and the header, of what `pack` gave. Raises InputError."""
    return _read(packed)


def read_header(file: str | os.PathLike) -> dict[str, Any]:
    """The header of a file that `save_tree` wrote. Raises InputError."""
    return _read(file, lambda name: False)[1]


def load_tree(file: str | os.PathLike, like: Tree, rows: str = "") -> tuple[Tree, dict[str, Any]]:
    """Reads a pytree of the structure, leaf ranks and dtypes of `like`, and the header.

    The leading axis may differ from that of `like`, and is the same in all arrays whose paths begin with `rows`.

    Raises:
      InputError: the file is missing, no such archive, or of another structure.
    """
    arrays, header = _read(file)
    wanted_names = [name_of(keys) for keys, _ in jax.tree_util.tree_leaves_with_path(like)]
    check_lengths({n: arrays[n] for n in wanted_names if n.startswith(rows) and n in arrays}, file)

    def leaf(keys: Any, requested: Any) -> np.ndarray:
        name = name_of(keys)
        if name not in arrays:
            raise InputError(file, "is missing", element=name, fix="make the file again with this version")
        check_array(arrays[name], requested, file, name)
        return arrays[name].astype(requested.dtype)

    return jax.tree_util.tree_map_with_path(leaf, like), header


def load_exactly(
    file: str | os.PathLike,
    like: Tree,
    optional: Mapping[str, Any] | None = None,
    defaults: Mapping[str, np.ndarray] | None = None,
) -> tuple[Tree, dict[str, np.ndarray]]:
    """Reads a pytree of exactly the structure, shapes and dtypes of `like`; nothing else in the file is unpacked.

    Args:
      optional: arrays by path, with examples of their shapes and dtypes, that may be missing, all or none.
      defaults: arrays of `like` that the file may lack, by path.

    Returns:
      The pytree, and the optional arrays that are there.

    Raises:
      InputError: the file is missing, no such archive, damaged, or of other arrays.
    """
    leaves, structure = jax.tree_util.tree_flatten_with_path(like)
    requested, optional = {name_of(keys): leaf for keys, leaf in leaves}, dict(optional or {})
    arrays, _ = _read(file, lambda name: name in requested or name in optional)
    there = optional if any(name in arrays for name in optional) else {}
    found = {}
    for name, example in {**requested, **there}.items():
        if name not in arrays and name in (defaults or {}):
            arrays[name] = (defaults or {})[name]
        if name not in arrays:
            raise InputError(file, "is missing", element=name, fix="make the file again with this version")
        array, shape = arrays[name], np.shape(example)
        if array.shape != shape:
            raise InputError(file, f"has shape {array.shape}, and {shape} is needed", element=name)
        check_array(array, example, file, name)
        with np.errstate(all="ignore"):
            found[name] = array.astype(example.dtype)
        if array.dtype.kind in "iu" and (found[name] != array).any():
            raise InputError(file, "holds numbers that are out of range", element=name)
    return jax.tree.unflatten(structure, [found[name] for name in requested]), {name: found[name] for name in there}


def check_array(array: np.ndarray, requested: Any, file: str | os.PathLike, name: str) -> None:
    """Raises InputError where an array is not of the kind, rank or the inner shape of `requested`, another array."""
    if array.ndim != requested.ndim or array.shape[1:] != requested.shape[1:]:
        raise InputError(
            file,
            f"has shape {array.shape}, the scene needs (any, {', '.join(map(str, requested.shape[1:]))})",
            element=name,
            fix="make the file again for this scene",
        )
    if not np.can_cast(array.dtype, requested.dtype, "same_kind"):
        raise InputError(file, f"is of type {array.dtype}, and {requested.dtype} is needed", element=name)


def check_lengths(arrays: Mapping[str, np.ndarray], file: str | os.PathLike) -> None:
    """Raises InputError where arrays do not all have the same number of rows, at least one."""
    lengths = {len(array) if array.ndim else 0 for array in arrays.values()}
    if len(lengths) != 1:
        raise InputError(file, f"has arrays of different lengths: {', '.join(map(str, sorted(lengths)))}")
    if not max(lengths):
        raise InputError(file, "has no rows")


def check_finite(tree: Any, file: str | os.PathLike) -> None:
    """Raises InputError, with the name of the array, where a leaf of a pytree holds NaN or an infinity."""
    for keys, leaf in jax.tree_util.tree_leaves_with_path(tree):
        refuse_nonfinite(leaf, file, name_of(keys))


def read_arrays(file: str | os.PathLike, prefix: str) -> dict[str, np.ndarray]:
    """The arrays of a file that `save_tree` wrote whose paths begin with `prefix`, which is taken off. Raises
    InputError."""
    arrays, _ = _read(file, lambda name: name.startswith(prefix))
    return {name.removeprefix(prefix): array for name, array in arrays.items()}


def build(kind: type[Tree], arrays: Mapping[str, np.ndarray], file: str | os.PathLike, prefix: str = "") -> Tree:
    """A dataclass of arrays and of such dataclasses, from arrays by path.

    Raises:
      InputError: an array is missing, or one that should be of numbers is of text.
    """
    hints, fields = typing.get_type_hints(kind), {}
    for field in dataclasses.fields(typing.cast(Any, kind)):
        name, hint = prefix + field.name, hints[field.name]
        if dataclasses.is_dataclass(hint):
            fields[field.name] = build(typing.cast(type, hint), arrays, file, f"{name}.")
        elif name in arrays:
            array = arrays[name]
            if array.dtype.kind not in "biuf":
                raise InputError(file, f"is of type {array.dtype}, not of numbers", element=name)
            if not any(isinstance(array, kind) for kind in typing.get_args(hint) or (hint,)):
                raise InputError(file, f"has {array.ndim} axes of {array.dtype}, which do not fit", element=name)
            fields[field.name] = array
        elif field.default is not None:  # one whose default is None may be left out
            raise InputError(file, "is missing", element=name, fix="make the file again with this version")
    return kind(**fields)


def name_of(keys: Any) -> str:
    """Of a leaf of a pytree in a file, by its path."""
    return jax.tree_util.keystr(keys, simple=True, separator=".")


def _read(
    file: str | os.PathLike | bytes, requested: Callable[[str], bool] = lambda name: True
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The requested arrays without the header, and the header. Raises InputError."""
    said = "packed arrays" if isinstance(file, bytes) else file
    arrays = read_npz(file, lambda name: name == HEADER or requested(name))
    if HEADER not in arrays:
        raise InputError(said, "is not an archive of this project", element=HEADER)
    return arrays, decode_struct(arrays.pop(HEADER).tobytes(), dict, said)
