"""Output folders that are either complete or not there at all."""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
import tempfile
from collections.abc import Iterator

from ig2mj.errors import InputError
from ig2mj.files.heartbeat import Heartbeat, is_alive
from ig2mj.files.unfinished import replacing

#: A folder that holds this file is an earlier output and may be replaced.
MARK = "manifest.json"


@contextlib.contextmanager
def replaced_folder(out: str | os.PathLike) -> Iterator[pathlib.Path]:
    """A temporary folder next to `out` that takes its place when the block ends well, and vanishes when it does not.

    A run that is killed leaves the old output or none, and at worst a hidden folder that the next run removes: at once
    where it can know that the run is dead, else when it has given no sign of life for two minutes
    (`ig2mj.files.heartbeat`).

    Raises:
      InputError: `out` is a file, or a folder with something else in it; or the disk is full.
    """
    target = pathlib.Path(out).absolute()
    _check(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    _remove_leftovers(target)
    folder = pathlib.Path(tempfile.mkdtemp(prefix=_prefix(target), dir=target.parent))
    try:
        folder.chmod(0o755)
        with Heartbeat(_sign(folder)):
            yield folder
            _move_into_place(folder, target)
    except OSError as e:
        if e.filename is not None:
            raise
        raise InputError(target, f"cannot be written: {e.strerror or e}", element="--out") from e
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def put_shared_file(file: pathlib.Path, content: bytes) -> None:
    """Writes a file that other outputs may share; one that has this content already is left alone.

    A process that reads it at the same time finds all of it or nothing.
    """
    try:
        if file.read_bytes() == content:
            return
    except FileNotFoundError:
        file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as part:
        part.write_bytes(content)


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


def _sign(folder: pathlib.Path) -> pathlib.Path:
    """The sign of life of the run that has a temporary folder: next to it, since all that is in it is the output's."""
    return folder.with_name(f"{folder.name.removesuffix('-old')}.alive")


def _remove_leftovers(target: pathlib.Path) -> None:
    """Removes temporary folders of runs that are no longer alive, on this machine or another."""
    for entry in target.parent.iterdir():
        if not entry.name.startswith(_prefix(target)):
            continue
        if entry.is_dir() and not is_alive(_sign(entry), entry):
            shutil.rmtree(entry, ignore_errors=True)
            _sign(entry).unlink(missing_ok=True)
        elif entry.suffix == ".alive" and not entry.with_suffix("").is_dir() and not is_alive(entry):
            entry.unlink(missing_ok=True)
