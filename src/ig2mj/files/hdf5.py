"""`Hdf5File`: an HDF5 file of which nothing is read before its place, type and size are what they may be.

Only what is in this very file is read: no soft or external links, no external storage, no virtual datasets. Arrays are
plain or packed by deflate or LZF; the rows that they claim are there, and no chunk unpacks to more than it should.

    with Hdf5File("demos.h5", fix="`ig2mj demos collect` writes such files") as file:
        action = file.read("run_000000/action", kinds="f", ndim=2)
"""

from __future__ import annotations

import math
import os
import pathlib
import struct
import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from ig2mj.errors import InputError
from ig2mj.files.content import regular_file
from ig2mj.files.limits import refuse_bomb, refuse_more

LARGEST_CHUNK = 2**26
"""Bytes that are unpacked at a time."""

LARGEST_ATTRIBUTE = 2**24
"""Bytes of one attribute."""

LARGEST_HEAP = 2**28
"""Bytes of a heap of texts."""

_BLOCK = 2**24
_DEFLATE, _SHUFFLE, _CHECKSUM, _LZF = 1, 2, 3, 32000
"""HDF5's numbers of filters."""
_HARMLESS_INPUT = 2**18
"""Packed bytes that unpack to at most 270 MB, whatever they are."""


class Hdf5File:
    """An open file; a context manager. Attributes: file: its path. root: h5py's object."""

    def __init__(self, file: str | os.PathLike, *, fix: str = ""):
        """Opens it. `fix`: of errors.

        Raises:
          InputError: it is missing or no HDF5 file. MissingDependencyError: h5py is not installed.
        """
        import h5py

        self.file, self._fix, self._bytes_read = pathlib.Path(file), fix, 0
        self._size = regular_file(file, fix=fix)
        if not _heaps_end(self.file):
            raise InputError(file, "is a broken HDF5 file: a heap of texts has no end", fix=fix)
        try:
            self.root: Any = h5py.File(self.file, "r")
        except Exception as e:  # h5py names no types for what a broken file makes it raise
            raise InputError(file, "is not an HDF5 file, or a broken one", fix=fix) from e

    def close(self) -> None:
        """May be called twice."""
        if self.root:
            self.root.close()

    def __enter__(self) -> Hdf5File:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def broken(self, element: str, problem: object) -> InputError:
        """The error that names an element of this file."""
        return InputError(self.file, " ".join(str(problem).split()), element=element, fix=self._fix)

    def names(self, path: str = "") -> list[str]:
        """What is in the group of this path, sorted. Raises InputError: there is no such group."""
        group = self.group(path)
        try:
            return sorted(_text(name) for name in group)
        except (OSError, RuntimeError, ValueError) as e:
            raise self.broken(path or "/", f"cannot be read: {e}") from e

    def arrays_below(self, path: str, depth: int = 4, whole: bool = False) -> list[str]:
        """Paths of the arrays below a group, sorted, at most so many groups down: hard links can make circles.

        Raises:
          InputError: there is no such group, or it holds too many arrays, or, for `whole`, groups further down.
        """
        import h5py

        found: list[str] = []
        for name in self.names(path):
            inner = f"{path}/{name}"
            if not isinstance(self._find(inner), h5py.Group):
                found.append(inner)
            elif depth:
                found += self.arrays_below(inner, depth - 1, whole)
            elif whole:
                raise self.broken(inner, "is a group in too many others")
            refuse_more("ARRAYS", len(found), "holds", self.file, path, unit=" arrays")
        return found

    def group(self, path: str = "") -> Any:
        """The group of this path. Raises InputError: there is none in this file."""
        import h5py

        found = self._find(path)
        if not isinstance(found, h5py.Group):
            raise self.broken(path, "is missing, or no group of this file")
        return found

    def attributes(self, path: str = "") -> dict[str, Any]:
        """Attributes of a group: numbers, texts and small arrays of numbers. Raises InputError: others, or none."""
        import h5py

        group, found, name = self.group(path), {}, ""
        try:
            for name in list(group.attrs):
                name = _text(name)
                identifier = h5py.h5a.open(group.id, name.encode())
                space, dtype = identifier.get_space(), identifier.dtype
                count = space.get_simple_extent_npoints()
                is_text = h5py.check_string_dtype(dtype) is not None
                if count * dtype.itemsize > LARGEST_ATTRIBUTE:
                    raise ValueError(f"has {count} elements")
                if dtype.kind not in ("OS" if is_text else "biuf") or (is_text and count != 1):
                    raise ValueError("is neither a text nor numbers")
                value = group.attrs[name]
                if is_text and not isinstance(value, (str, bytes)):
                    value = np.asarray(value).reshape(-1)[0]
                found[name] = _text(value) if is_text else value.item() if isinstance(value, np.generic) else value
        except (OSError, RuntimeError, ValueError, TypeError, KeyError) as e:
            raise self.broken(f"{path or '/'}: attribute {name!a}", e) from e
        return found

    def is_of(self, kind: str, version: int) -> bool:
        """Whether its attributes `format` and `version` are these. Raises as `attributes`."""
        header = self.attributes()
        found = header.get("format"), header.get("version")
        return isinstance(found[0], str) and isinstance(found[1], int) and found == (kind, version)

    def has(self, path: str) -> bool:
        """Whether there is something of this path in this very file."""
        return self._find(path) is not None

    def array(self, path: str, *, kinds: str = "biuf", ndim: int | None = None) -> Any:
        """h5py's dataset of this path, of which all is there; slices of it can be read.

        Args:
          kinds: of dtypes. ndim: number of axes; None: at least one.

        Raises:
          InputError: there is none in this file, or it is another kind of array, or claims what is not there.
        """
        import h5py

        array = self._find(path)
        if not isinstance(array, h5py.Dataset):
            raise self.broken(path, "is missing, or no array of this file")
        try:
            if array.dtype.kind not in kinds or array.dtype.hasobject:
                raise self.broken(path, f"is of type {array.dtype}")
            if array.ndim != ndim if ndim is not None else array.ndim < 1:
                raise self.broken(path, f"has {array.ndim} axes" + ("" if ndim is None else f", and must have {ndim}"))
            if array.is_virtual or array.external:
                raise self.broken(path, "lies in another file, and only what is in this one is read")
            self._check_storage(path, array)
        except (OSError, RuntimeError, ValueError, TypeError, zlib.error) as e:
            raise self.broken(path, f"cannot be read: {e}") from e
        return array

    def claim(self, paths: Iterable[str]) -> None:
        """Refuses a file of which these arrays, all together, claim more than one reads (`ig2mj.files.limits`)."""
        refuse_bomb(sum(self._claimed(path) for path in paths), self._size, self.file)

    def _claimed(self, path: str) -> int:
        try:
            return int(getattr(self._find(path), "nbytes", 0))
        except (OSError, RuntimeError, ValueError, TypeError) as e:  # of a type that NumPy does not know
            raise self.broken(path, f"cannot be read: {e}") from e

    def copy(self, name: str, into: Any, under: str = "") -> None:
        """Copies a group of the root into another HDF5 file, as it is packed.

        Args:
          into: h5py's file or group. under: its name there; "": the same.

        Raises:
          InputError: below it is something else than groups and arrays of this very file (`array`, `arrays_below`).
        """
        self.attributes(name)
        for path in self.arrays_below(name, whole=True):
            self.array(path)
        try:
            self.root.copy(self.group(name), into, under or name)
        except (OSError, RuntimeError, ValueError) as e:
            raise self.broken(name, f"cannot be copied: {e}") from e

    def read(self, path: str, *, kinds: str = "biuf", ndim: int | None = None) -> np.ndarray:
        """All of an array; what is read of a file counts together (`ig2mj.files.limits`). Raises as `array`."""
        array = self.array(path, kinds=kinds, ndim=ndim)
        self._bytes_read += array.nbytes
        refuse_bomb(self._bytes_read, self._size, self.file)
        try:
            return np.asarray(array[()])
        except (OSError, RuntimeError, ValueError) as e:
            raise self.broken(path, f"cannot be read: {e}") from e

    def _find(self, path: str) -> Any:
        """What has this path in this very file, or None."""
        import h5py

        found: Any = self.root
        try:
            for part in path.split("/") if path else ():
                if not isinstance(found, h5py.Group):
                    return None
                link = found.get(part, getlink=True) if part not in ("", ".", "..") else None
                found = found[part] if isinstance(link, h5py.HardLink) else None
        except (OSError, RuntimeError, ValueError, KeyError, TypeError) as e:
            raise self.broken(path, f"cannot be read: {e}") from e
        return found

    def _check_storage(self, path: str, array: Any) -> None:
        if not array.size:
            return
        if array.chunks is None:
            offset = array.id.get_offset()
            inside = offset is None or offset + array.nbytes <= self._size
            if array.id.get_storage_size() != array.nbytes or not inside:
                raise self.broken(path, f"claims {array.shape[0]} rows that are not there")
            return
        size = math.prod(array.chunks) * array.dtype.itemsize
        if size > LARGEST_CHUNK:
            raise self.broken(path, f"has chunks of {size} bytes, and the limit is {LARGEST_CHUNK}")
        filters = _filters(array)
        if filters != [f for f in (_SHUFFLE, _DEFLATE, _LZF, _CHECKSUM) if f in filters] or {_DEFLATE, _LZF} <= {
            *filters
        }:
            raise self.broken(path, f"is packed in a way that is not read (filters {filters})")
        needed = math.prod(-(-length // chunk) for length, chunk in zip(array.shape, array.chunks, strict=True))
        chunks = _chunks(array, needed)
        if len(chunks) < needed:
            raise self.broken(path, f"claims {array.shape[0]} rows that are not there")
        for chunk in chunks:
            if not _unpacks_to(array, chunk, filters, size):
                raise self.broken(path, "has a chunk that unpacks to more than it should have")


def _heaps_end(file: pathlib.Path) -> bool:
    """Whether every heap of texts has objects of some size: HDF5 never ends at free space of size 0.

    A heap is "GCOL", version 1, three zeros and its size; then objects: number, count of references, four zeros, size,
    and content that fills up eight bytes. Number 0 is free space, whose size includes these sixteen bytes.
    """
    mark, before = b"GCOL\x01\0\0\0", b""
    with file.open("rb") as stream:
        at = 0
        while block := stream.read(_BLOCK):
            text, start, found = before + block, at - len(before), -1
            while (found := text.find(mark, found + 1)) >= 0:
                if not _heap_ends(file, start + found):
                    return False
            at += len(block)
            before = text[-len(mark) + 1 :]
    return True


def _heap_ends(file: pathlib.Path, start: int) -> bool:
    with file.open("rb") as stream:
        stream.seek(start)
        (size,) = struct.unpack("<8xQ", stream.read(16).ljust(16, b"\0"))
        if size > LARGEST_HEAP:
            return False
        heap = stream.read(max(size - 16, 0))
    at = 0
    while len(heap) - at >= 16:
        number, length = struct.unpack_from("<H6xQ", heap, at)
        needed = 16 + (length + 7) // 8 * 8 if number else length
        if needed < 16:
            return False
        at += needed
    return True


def _filters(array: Any) -> list[int]:
    """Numbers of the filters that were applied when it was written, in that order."""
    properties = array.id.get_create_plist()
    return [int(properties.get_filter(k)[0]) for k in range(properties.get_nfilters())]


def _chunks(array: Any, most: int) -> list[Any]:
    """h5py's `StoreInfo` of the chunks that are stored, at most so many."""
    found: list[Any] = []

    def take(chunk: Any) -> bool | None:
        found.append(chunk)
        return True if len(found) == most else None

    array.id.chunk_iter(take)
    return found


def _unpacks_to(array: Any, chunk: Any, filters: list[int], size: int) -> bool:
    """Whether a chunk has no more than `size` bytes when it is unpacked: its filters go on until their input ends."""
    spare = 8 + size // 64  # of a checksum, and of data that cannot be packed
    if chunk.size > size + spare:
        return False
    if chunk.size <= _HARMLESS_INPUT or _DEFLATE not in filters or chunk.filter_mask >> filters.index(_DEFLATE) & 1:
        return True
    _, packed = array.id.read_direct_chunk(chunk.chunk_offset)
    unpacker = zlib.decompressobj()
    return len(unpacker.decompress(packed, size + 1)) <= size


def _text(value: Any) -> str:
    """A text that can be written to a terminal. Raises ValueError: it is none."""
    text = value if isinstance(value, str) else bytes(value).decode("utf-8")
    text.encode()  # h5py reads bytes that are no text as lone surrogates
    return text
