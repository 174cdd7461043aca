"""Where the converter keeps results between runs, and how much of them."""

from __future__ import annotations

import contextlib
import os
import pathlib
import time

import platformdirs

ENVIRONMENT = "IG2MJ_CACHE_DIR"
"""Environment variable that names another folder."""

ABANDONED = 24 * 3600.0
"""Seconds after which a half-written file is abandoned."""


def cache_folder(kind: str) -> pathlib.Path:
    """Folder for one kind of results. Not made until the first is stored."""
    root = os.environ.get(ENVIRONMENT) or platformdirs.user_cache_dir("ig2mj")
    return pathlib.Path(root) / kind


def prune(folder: pathlib.Path, suffix: str, limit: int) -> None:
    """Removes the files of `<folder>/*/*<suffix>` that were not used for longest, until all have `limit` bytes."""
    files = []
    now = time.time()
    for file in folder.glob("*/*"):
        with contextlib.suppress(OSError):  # another process may remove it at the same time
            facts = file.stat()
            if file.suffix == suffix:
                files.append((facts.st_mtime, facts.st_size, file))
            elif now - facts.st_mtime > ABANDONED:
                file.unlink()
    total = sum(size for _, size, _ in files)
    for _, size, file in sorted(files):
        if total <= limit:
            return
        with contextlib.suppress(OSError):
            file.unlink()
        total -= size
