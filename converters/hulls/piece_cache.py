"""Results of geometry work, kept between runs in the user's cache folder, by content.

A key is a hash of everything the result depends on. Entries are written to a temporary file and moved into place, so
a reader never sees half of one; an entry that does not read is taken as absent.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import pathlib
import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from ig2mj.errors import InputError
from ig2mj.files.content import decode_json
from ig2mj.files.npz import read_npz

from ..base.cache_folder import cache_folder, prune

VERSION = 3
"""Raise it whenever the code that makes the cached results changes what they are."""

LIMIT = 2**30
"""Bytes of all entries together; checked once per process, when the first is stored."""

_pruned: set[pathlib.Path] = set()


def folder() -> pathlib.Path:
    """Where entries are kept. Not made until the first entry is stored."""
    return cache_folder("hulls")


def key_of(*parts: Any) -> str:
    """Hash of arrays, numbers, strings, None, and lists, tuples and dicts of them, in order, with `VERSION`."""
    digest = hashlib.sha256(f"{VERSION}".encode())
    for part in parts:
        _feed(digest, part)
    return digest.hexdigest()


def _feed(digest: Any, part: Any) -> None:
    if isinstance(part, np.ndarray):
        digest.update(f"array {part.dtype.str} {part.shape};".encode())
        digest.update(np.ascontiguousarray(part).tobytes())
    elif isinstance(part, Mapping):
        digest.update(f"dict {len(part)};".encode())
        for name in sorted(part):
            _feed(digest, name)
            _feed(digest, part[name])
    elif isinstance(part, list | tuple):
        digest.update(f"list {len(part)};".encode())
        for item in part:
            _feed(digest, item)
    else:
        digest.update(f"{type(part).__name__} {part!r};".encode())


def load(key: str) -> tuple[dict[str, Any], dict[str, np.ndarray]] | None:
    """The entry's facts and arrays, or None if there is none that reads."""
    try:
        arrays = read_npz(_path(key))
        facts = decode_json(arrays.pop("facts", np.zeros(0)).tobytes(), _path(key), kind=dict)
    except InputError:
        return None
    return (facts, arrays) if facts.get("key") == key else None


def holds(key: str) -> bool:
    """Whether there is an entry, which may still turn out to be broken when it is loaded."""
    return _path(key).is_file()


def store(key: str, facts: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Keeps an entry. A folder that cannot be written is no error: the work is done again next time."""
    path = _path(key)
    text = np.frombuffer(json.dumps({**facts, "key": key}).encode(), np.uint8)
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
            temporary = file.name
            everything: dict[str, Any] = {"facts": text, **arrays}
            np.savez_compressed(file, **everything)
        pathlib.Path(temporary).replace(path)
        if folder() not in _pruned:
            _pruned.add(folder())
            prune(folder(), ".npz", LIMIT)
    except OSError:
        if temporary is not None:
            with contextlib.suppress(OSError):
                pathlib.Path(temporary).unlink()


def _path(key: str) -> pathlib.Path:
    return folder() / key[:2] / f"{key}.npz"
