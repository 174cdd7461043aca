"""Output folders that are either complete or not there at all."""

from __future__ import annotations

import contextlib
import os
import pathlib
import re
import shutil
import tempfile
from collections.abc import Iterator

from ig2mj.errors import InputError

#: A folder that holds this file is an earlier output and may be replaced.
MARK = "manifest.json"


@contextlib.contextmanager
def replaced_folder(out: str | os.PathLike) -> Iterator[pathlib.Path]:
    """A temporary folder beside `out` that takes its place when the block ends well, and vanishes when it does not.

    A run that is killed leaves the old output or none, and at worst a hidden folder that the next run removes.

    Raises:
      InputError: `out` is a file, or a folder with something else in it; or the disk is full.
    """
    target = pathlib.Path(out).absolute()
    _check(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    _remove_leftovers(target)
    folder = pathlib.Path(tempfile.mkdtemp(prefix=f"{_prefix(target)}{os.getpid()}-", dir=target.parent))
    try:
        folder.chmod(0o755)
        yield folder
        _move_into_place(folder, target)
    except OSError as e:
        if e.filename is not None:
            raise
        raise InputError(target, f"cannot be written: {e.strerror or e}", element="--out") from e
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _check(target: pathlib.Path) -> None:
    if target.exists() and not target.is_dir():
        raise InputError(target, "is a file", element="--out", fix="name a folder")
    if target.is_dir() and any(target.iterdir()) and not (target / MARK).is_file():
        problem = "is a folder with other things in it, and is not overwritten"
        raise InputError(target, problem, element="--out", fix="name a new or empty folder")


def _prefix(target: pathlib.Path) -> str:
    return f".{target.name}.ig2mj-"


def _move_into_place(folder: pathlib.Path, target: pathlib.Path) -> None:
    if target.exists():
        old = folder.with_name(f"{folder.name}-old")
        target.rename(old)
        folder.rename(target)
        shutil.rmtree(old, ignore_errors=True)
    else:
        folder.rename(target)


def _remove_leftovers(target: pathlib.Path) -> None:
    """Removes temporary folders of runs that are no longer alive."""
    pattern = re.compile(re.escape(_prefix(target)) + r"(\d+)-")
    for entry in target.parent.iterdir():
        match = pattern.match(entry.name)
        if match and entry.is_dir() and not _alive(int(match.group(1))):
            shutil.rmtree(entry, ignore_errors=True)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
