"""Pytrees of arrays in `.npz` files: one array per leaf under its path, a JSON header, no pickle."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import os
import pathlib
import typing
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import jax
import msgspec
import numpy as np

from ig2mj.errors import InputError

HEADER = "header"

Tree = TypeVar("Tree")


def save_tree(file: str | os.PathLike, tree: Any, header: dict[str, Any]) -> None:
    """Writes all leaves of a pytree and a header; the file appears only when it is complete.

    Raises:
      InputError: it cannot be written there.
    """
    path = pathlib.Path(file)
    packed = pack(tree, header)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        unfinished.write_bytes(packed)
        unfinished.replace(path)
    except OSError as e:
        unfinished.unlink(missing_ok=True)
        raise InputError(path, f"cannot be written: {e.strerror or e}", fix="choose another place") from e


def pack(tree: Any, header: dict[str, Any]) -> bytes:
    """What `save_tree` would write, for `unpack`."""
    with io.BytesIO() as out:
        arrays = {_name(keys): np.asarray(leaf) for keys, leaf in jax.tree_util.tree_flatten_with_path(tree)[0]}
        arrays[HEADER] = np.frombuffer(msgspec.json.encode(header), np.uint8)
        np.savez_compressed(out, allow_pickle=False, **arrays)
        return out.getvalue()


def unpack(packed: bytes) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays by path, and the header, of what `pack` gave. Raises InputError."""
    with _open(packed) as archive:
        header = _header(archive, "packed arrays")
        return {name: archive[name] for name in archive.files if name != HEADER}, header


def read_header(file: str | os.PathLike) -> dict[str, Any]:
    """The header of a file that `save_tree` wrote. Raises InputError."""
    with _open(file) as archive:
        return _header(archive, file)


def load_tree(file: str | os.PathLike, like: Tree) -> tuple[Tree, dict[str, Any]]:
    """Reads a pytree of the structure, leaf ranks and dtypes of `like`, and the header.

    The leading axis may differ from that of `like`.

    Raises:
      InputError: the file is missing, no such archive, or of another structure.
    """
    with _open(file) as archive:
        header = _header(archive, file)

        def leaf(keys: Any, wanted: Any) -> np.ndarray:
            name = _name(keys)
            if name not in archive.files:
                raise InputError(file, "is missing", element=name, fix="make the file again with this version")
            try:
                array = archive[name]
            except (ValueError, OSError, zipfile.BadZipFile, zlib.error) as e:
                raise InputError(file, f"is damaged: {e}", element=name) from e
            if array.ndim != wanted.ndim or array.shape[1:] != wanted.shape[1:]:
                raise InputError(
                    file,
                    f"has shape {array.shape}, the scene needs (any, {', '.join(map(str, wanted.shape[1:]))})",
                    element=name,
                    fix="make the file again for this scene",
                )
            return array.astype(wanted.dtype)

        return jax.tree_util.tree_map_with_path(leaf, like), header


def read_arrays(file: str | os.PathLike, prefix: str) -> dict[str, np.ndarray]:
    """The arrays of a file that `save_tree` wrote whose paths begin with `prefix`, which is taken off. Raises
    InputError."""
    with _open(file) as archive:
        _header(archive, file)
        try:
            return {n.removeprefix(prefix): archive[n] for n in archive.files if n.startswith(prefix)}
        except (ValueError, OSError, zipfile.BadZipFile, zlib.error) as e:
            raise InputError(file, f"is damaged: {e}") from e


def build(kind: type[Tree], arrays: Mapping[str, np.ndarray], file: str | os.PathLike, prefix: str = "") -> Tree:
    """A dataclass of arrays and of such dataclasses, from arrays by path.

    Raises:
      InputError: an array is missing.
    """
    hints, fields = typing.get_type_hints(kind), {}
    for field in dataclasses.fields(typing.cast(Any, kind)):
        name, hint = prefix + field.name, hints[field.name]
        if dataclasses.is_dataclass(hint):
            fields[field.name] = build(typing.cast(type, hint), arrays, file, f"{name}.")
        elif name in arrays:
            fields[field.name] = arrays[name]
        elif field.default is not None:  # one whose default is None may be left out
            raise InputError(file, "is missing", element=name, fix="make the file again with this version")
    return kind(**fields)


def _name(keys: Any) -> str:
    return jax.tree_util.keystr(keys, simple=True, separator=".")


@contextlib.contextmanager
def _open(file: str | os.PathLike | bytes) -> Iterator[Any]:
    """The archive, closed afterwards. Raises InputError."""
    named = "packed arrays" if isinstance(file, bytes) else file
    try:
        stream = io.BytesIO(file if isinstance(file, bytes) else pathlib.Path(file).read_bytes())
    except OSError as e:
        raise InputError(str(file), f"cannot be read: {e.strerror or e}") from e
    try:
        archive = np.load(stream, allow_pickle=False)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as e:
        raise InputError(named, "is not an npz archive, or broken") from e
    if not hasattr(archive, "files"):  # a single array
        raise InputError(named, "is not an npz archive")
    with archive:
        yield archive


def _header(archive: Any, file: str | os.PathLike) -> dict[str, Any]:
    if HEADER not in archive.files:
        raise InputError(file, "is not an archive of this project", element=HEADER)
    try:
        return msgspec.json.decode(archive[HEADER].tobytes(), type=dict)
    except (msgspec.DecodeError, ValueError, OSError, zipfile.BadZipFile, zlib.error) as e:
        raise InputError(file, f"is damaged: {e}", element=HEADER) from e
