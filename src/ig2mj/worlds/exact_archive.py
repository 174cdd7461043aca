"""Reads an archive of `ig2mj.worlds.archive` whose arrays are known beforehand, by shape and kind of number.

Nothing is allocated for what the file says of itself: sizes are compared before an array is read.
"""

from __future__ import annotations

import os
import pathlib
import zipfile
import zlib
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import jax
import msgspec
import numpy as np

from ig2mj.errors import InputError
from ig2mj.worlds.archive import HEADER

Tree = TypeVar("Tree")

HEADER_LIMIT = 1 << 20
"""Bytes of the header, at most."""

SLACK = 1 << 12
"""Bytes that an array's own header, and a file's entry for it, take at most."""

_DAMAGE = (ValueError, OSError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error)
"""What reading a damaged, encrypted or strangely compressed archive raises."""


def read_exactly(
    file: str | os.PathLike,
    like: Tree,
    check: Callable[[dict[str, Any]], None],
    more: Mapping[str, Any] | None = None,
) -> tuple[Tree, dict[str, np.ndarray]]:
    """A pytree of arrays of the shapes and dtypes of `like`.

    Args:
      check: of the header, before anything else is read; raises InputError where the file is no such archive.
      more: arrays by path that may be missing, and then are so together.

    Returns:
      The pytree, and those of `more`.

    Raises:
      InputError: the file is missing, damaged, larger than such a pytree can be, or of other arrays.
    """
    path, more = pathlib.Path(file), dict(more or {})
    leaves, structure = jax.tree_util.tree_flatten_with_path(like)
    wanted = {jax.tree_util.keystr(keys, simple=True, separator="."): leaf for keys, leaf in leaves}
    most = HEADER_LIMIT + sum(_most(leaf) for leaf in (*wanted.values(), *more.values()))
    try:
        if not path.is_file():
            raise InputError(file, "is no file" if path.exists() else "does not exist")
        if path.stat().st_size > most:
            raise InputError(file, f"has {path.stat().st_size:,} bytes, and what it should hold takes {most:,} at most")
        with zipfile.ZipFile(path) as archive:
            entries = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            check(_header(file, archive, entries))
            found = [_read(file, archive, entries, name, leaf) for name, leaf in wanted.items()]
            there = [name for name in more if name in entries]
            extra = {name: _read(file, archive, entries, name, more[name]) for name in more} if there else {}
    except _DAMAGE as e:
        raise InputError(file, f"is damaged, or no archive of arrays: {e}") from e
    return jax.tree.unflatten(structure, found), extra


def _most(leaf: Any) -> int:
    """Bytes that an array may take in a file."""
    return 8 * int(np.prod(np.shape(leaf))) + SLACK


def _header(file: str | os.PathLike, archive: zipfile.ZipFile, entries: dict[str, zipfile.ZipInfo]) -> dict[str, Any]:
    if HEADER not in entries:
        raise InputError(file, "is not an archive of this project", element=HEADER)
    if entries[HEADER].file_size > HEADER_LIMIT:
        raise InputError(file, f"has more than {HEADER_LIMIT:,} bytes", element=HEADER)
    with archive.open(entries[HEADER]) as stream:
        shape, _, dtype = _described(stream)
        if len(shape) != 1 or dtype != np.uint8:
            raise InputError(file, "is damaged", element=HEADER)
        try:
            return msgspec.json.decode(stream.read(), type=dict)
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as e:
            raise InputError(file, f"is damaged: {e}", element=HEADER) from e


def _read(
    file: str | os.PathLike, archive: zipfile.ZipFile, entries: dict[str, zipfile.ZipInfo], name: str, like: Any
) -> np.ndarray:
    info, wanted, kind = entries.get(name), tuple(np.shape(like)), np.dtype(like.dtype)
    if info is None:
        raise InputError(file, "is missing", element=name, fix="write the file again with this version")
    if info.file_size > _most(like):
        raise InputError(file, f"has {info.file_size:,} bytes, too many for its shape {wanted}", element=name)
    with archive.open(info) as stream:
        shape, in_columns, dtype = _described(stream)
        if shape != wanted or dtype.kind != kind.kind or dtype.itemsize > 8:
            said = f"is {dtype}{list(shape)}, and must be {kind}{list(wanted)}"
            raise InputError(file, said, element=name, fix="write the file again with this version")
        raw = stream.read()
    array = np.frombuffer(raw, dtype).reshape(shape, order="F" if in_columns else "C")
    if kind.kind in "iu" and array.size and not np.can_cast(dtype, kind):
        limits = np.iinfo(kind)
        if array.min() < limits.min or array.max() > limits.max:
            raise InputError(file, "is damaged: it has numbers that are out of range", element=name)
    return np.array(array, kind)


def _described(stream: Any) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order and dtype, read from the beginning of an array's file."""
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(stream)
    if version == (2, 0):
        return np.lib.format.read_array_header_2_0(stream)
    raise ValueError(f"version {version} of NumPy's format")
