"""`read_npz`: arrays of an npz archive, whose declared sizes are checked before anything is unpacked; `write_npz`.

No pickle: arrays are of numbers, truth values or text. What is unpacked is what the archive's directory declares, and
that is what each array's own header says.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import pathlib
import struct
import zipfile
from collections.abc import Callable, Container, Mapping
from typing import IO, Any

import numpy as np

from ig2mj.errors import Ig2mjError, InputError
from ig2mj.files.content import regular_file
from ig2mj.files.limits import is_bomb, limit, refuse_bomb, refuse_more

KINDS = "biufUS"
"""Kinds of dtypes that are read: truth values, whole numbers, floating-point numbers, text."""

LONGEST_HEADER = 10_000
"""Bytes of an array's header (NumPy's own limit)."""

LONGEST_DIRECTORY = 4 * 2**20
"""Bytes of the archive's directory: 10,000 arrays with long names need a quarter of it."""

_BLOCK = 2**20
_END, _END64, _LOCATOR64 = b"PK\5\6", b"PK\6\6", b"PK\6\7"


def read_npz(
    file: str | os.PathLike | bytes,
    requested: Callable[[str], bool] = lambda name: True,
    *,
    named: object = None,
    fix: str = "",
) -> dict[str, np.ndarray]:
    """Arrays by name, in the file's order, in this machine's byte order, writeable.

    Args:
      file: a path, or an archive's bytes.
      requested: says of a name whether that array is read.
      named: what errors name instead of the path.

    Raises:
      InputError: it is missing, no such archive, damaged, or claims more than the limits (`ig2mj.files.limits`) allow.
    """
    said = named or ("packed arrays" if isinstance(file, bytes) else file)
    size = len(file) if isinstance(file, bytes) else regular_file(file, fix=fix)
    try:
        with io.BytesIO(file) if isinstance(file, bytes) else pathlib.Path(file).open("rb") as stream:
            _check_directory(stream, size, said)
            with zipfile.ZipFile(stream) as archive:
                entries = [e for e in _entries(archive, said) if requested(e.filename.removesuffix(".npy"))]
                refuse_bomb(sum(e.file_size for e in entries), size, said)
                return {e.filename.removesuffix(".npy"): _read(archive, e, said) for e in entries}
    except InputError as e:
        if fix and not e.fix:
            raise type(e)(e.file, e.problem, element=e.element, fix=fix) from e
        raise
    except Ig2mjError:
        raise
    except OSError as e:
        raise InputError(said, f"cannot be read: {e.strerror or e}", fix=fix) from e
    except Exception as e:  # zipfile, zlib and NumPy raise whatever a damaged archive makes them stumble over
        raise InputError(said, f"is not an npz archive, or a damaged one: {e or type(e).__name__}", fix=fix) from e


def write_npz(stream: IO[bytes], arrays: Mapping[str, np.ndarray]) -> None:
    """Writes a compressed archive that `read_npz` reads under the limits in force.

    Rows of start states that are alike pack to less than `IG2MJ_LIMIT_UNPACKED_RATIO` allows, as archives that are made
    to fill the memory do. The archive then has some arrays, as few bytes as are needed, without compression.

    Args:
      stream: a file that is open for writing and can be searched.
      arrays: by name; of numbers, truth values or text.
    """
    start = stream.tell()
    unpacked = _write(stream, arrays, set())
    if is_bomb(unpacked, stream.tell() - start):
        stream.seek(start)
        stream.truncate()
        _write(stream, arrays, _of_bytes(arrays, -(-unpacked // limit("UNPACKED_RATIO"))))


def _write(stream: IO[bytes], arrays: Mapping[str, np.ndarray], stored: Container[str]) -> int:
    """Writes an archive whose arrays named in `stored` are not compressed. Bytes of what it unpacks to."""
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_STORED if name in stored else zipfile.ZIP_DEFLATED
            array = np.asanyarray(array)
            entry.file_size = array.nbytes + LONGEST_HEADER  # from which zipfile knows whether 64-bit sizes are needed
            with archive.open(entry, "w") as opened:
                np.lib.format.write_array(opened, array, allow_pickle=False)
        return sum(entry.file_size for entry in archive.infolist())


def _of_bytes(arrays: Mapping[str, np.ndarray], needed: int) -> set[str]:
    """Names of arrays that have at least `needed` bytes together: the smallest one that has, else the largest ones."""
    by_size = sorted(arrays, key=lambda name: arrays[name].nbytes)
    alone = next((name for name in by_size if arrays[name].nbytes >= needed), None)
    if alone is not None:
        return {alone}
    chosen: set[str] = set()
    while by_size and needed > 0:
        chosen.add(by_size[-1])
        needed -= arrays[by_size.pop()].nbytes
    return chosen


def _check_directory(stream: Any, size: int, file: object) -> None:
    """Refuses a directory that `zipfile`, which reads all of it at once, would need too much memory for."""
    stream.seek(max(size - 2**16 - 22, 0))
    tail = stream.read()
    at = len(tail) - 22
    if not (tail[at : at + 4] == _END and tail.endswith(b"\0\0")):
        at = tail.rfind(_END)
    if at < 0 or len(tail) < at + 22:
        raise InputError(file, "is not an npz archive, or cut off")
    (length,) = struct.unpack_from("<L", tail, at + 12)
    locator = tail[max(at - 20, 0) : at]
    if locator.startswith(_LOCATOR64):
        (where,) = struct.unpack_from("<Q", locator, 8)
        if where + 56 > size:
            raise InputError(file, "is a damaged npz archive")
        stream.seek(where)
        record = stream.read(56)
        if record.startswith(_END64) and len(record) == 56:
            length = max(length if length != 0xFFFFFFFF else 0, struct.unpack_from("<Q", record, 40)[0])
    if length > LONGEST_DIRECTORY:
        raise InputError(file, f"has a directory of {length} bytes, and the limit is {LONGEST_DIRECTORY}")


def _entries(archive: zipfile.ZipFile, file: object) -> list[zipfile.ZipInfo]:
    entries = archive.infolist()
    refuse_more("ARRAYS", len(entries), "holds", file, unit=" arrays")
    names = [entry.filename for entry in entries]
    if len(set(names)) < len(names):
        raise InputError(file, "holds two arrays of one name")
    for entry in entries:
        if not entry.filename.endswith(".npy"):
            raise InputError(file, "is not an array", element=_shown(entry.filename))
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or entry.flag_bits & 1:
            raise InputError(file, "is packed in a way that is not read", element=_shown(entry.filename))
    return entries


def _read(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, file: object) -> np.ndarray:
    name = _shown(entry.filename)
    try:
        with archive.open(entry) as stream:
            shape, by_columns, dtype = _header(stream)
            if dtype.kind not in KINDS or dtype.hasobject:
                raise InputError(file, f"is not of numbers or text but {dtype}", element=name)
            count = math.prod(shape)
            if min(shape, default=0) < 0 or stream.tell() + count * dtype.itemsize != entry.file_size:
                raise InputError(file, f"claims the shape {_short(shape)}, which it does not have", element=name)
            flat = np.empty(count, dtype)
            _fill(stream, flat)
    except InputError:
        raise
    except Exception as e:  # as above; here the array can be named
        raise InputError(file, f"is damaged: {e or type(e).__name__}", element=name) from e
    if dtype.kind == "U" and flat.nbytes:
        letters = flat.view(np.dtype(np.uint32).newbyteorder(dtype.byteorder))
        if ((letters > 0x10FFFF) | ((letters >= 0xD800) & (letters < 0xE000))).any():
            raise InputError(file, "has text with letters that do not exist", element=name)
    if dtype.kind == "b" and (flat.view(np.uint8) > 1).any():
        raise InputError(file, "has truth values that are neither true nor false", element=name)
    array = flat.reshape(shape, order="F" if by_columns else "C")
    return array.astype(dtype.newbyteorder("="), copy=False)


def _header(stream: Any) -> tuple[tuple[int, ...], bool, np.dtype]:
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(stream, LONGEST_HEADER)
    if version == (2, 0):
        return np.lib.format.read_array_header_2_0(stream, LONGEST_HEADER)
    raise ValueError(f"an array of version {version}")


def _fill(stream: Any, flat: np.ndarray) -> None:
    if not flat.nbytes:
        return
    buffer, at = memoryview(flat.view(np.uint8)), 0  # pyright: ignore[reportArgumentType]
    while at < len(buffer):
        block = stream.read(min(_BLOCK, len(buffer) - at))
        if not block:
            raise ValueError("it is cut off")
        buffer[at : at + len(block)] = block
        at += len(block)
    with contextlib.suppress(EOFError):
        stream.read(1)  # at its end the checksum is compared


def _short(shape: tuple[int, ...]) -> str:
    text = str(shape)
    return text if len(text) < 80 else f"{text[:70]} ..."


def _shown(name: str) -> str:
    return ascii(name.removesuffix(".npy")[:80])[1:-1]


def refuse_nonfinite(array: Any, file: object, element: str, fix: str = "") -> None:
    """Raises InputError where an array of floating-point numbers holds NaN or an infinity."""
    if np.asarray(array).dtype.kind == "f" and not np.isfinite(array).all():
        raise InputError(file, "holds numbers that are not finite", element=element, fix=fix)
