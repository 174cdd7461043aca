"""JAX's cache of compiled programs stays sound when a disk is full or a process is killed, and says what is wrong.

JAX writes entries in place and never again: one that was cut off fails in every later start, which then compiles. Here
entries are written to another name first, and one that cannot be read is removed and compiled again. Functions of JAX
that it does not export are replaced; where a version has none of these names, nothing is changed.
"""

from __future__ import annotations

import contextlib
import functools
import os
import pathlib
import sys
import threading
from typing import Any

REMEDY = "free some space, or name another folder with IG2MJ_CACHE_DIR"


@functools.cache
def say_not_kept(folder: pathlib.Path, why: str, what: str = "compiled programs") -> None:
    """One line on stderr, once per process and reason."""
    print(f"ig2mj: {what} are not kept in {folder} ({why}): {REMEDY}", file=sys.stderr, flush=True)


@functools.cache
def _say_broken(folder: pathlib.Path, why: str) -> None:
    print(f"ig2mj: broken programs in {folder} are removed and compiled again ({why})", file=sys.stderr, flush=True)


@functools.cache
def keep_entries_sound() -> None:
    """Replaces what reads and writes entries of JAX's cache in this process; once."""
    import jax

    try:
        from jax._src import compilation_cache, lru_cache

        read, write = compilation_cache.get_executable_and_time, lru_cache.LRUCache.put
        suffix: str = lru_cache._CACHE_SUFFIX  # pyright: ignore[reportPrivateUsage]
    except (ImportError, AttributeError):
        return

    def put(self: Any, key: str, value: bytes) -> None:
        folder = pathlib.Path(os.fspath(self.path))
        if self.eviction_enabled or not folder.is_dir():
            return write(self, key, value)
        file = folder / f"{key}{suffix}"
        new = folder / f"{file.name[-80:]}.{os.getpid()}.{threading.get_ident()}.new"
        try:
            if not file.exists():
                new.write_bytes(value)
                new.replace(file)
        except OSError as failure:
            with contextlib.suppress(OSError):
                new.unlink(missing_ok=True)
            say_not_kept(folder, failure.strerror or type(failure).__name__)

    def get(cache_key: str, *arguments: Any, **named: Any) -> Any:
        try:
            return read(cache_key, *arguments, **named)
        except Exception as failure:
            folder = pathlib.Path(str(getattr(jax.config, "jax_compilation_cache_dir", None)))
            file = folder / f"{cache_key}{suffix}"
            if not file.is_file():
                raise
            why = next(iter(str(failure).splitlines()), type(failure).__name__)
            _say_broken(folder, why[:120])
            with contextlib.suppress(OSError):
                file.unlink()
            return None, None

    lru_cache.LRUCache.put = put
    compilation_cache.get_executable_and_time = get
