"""`whole_output`: writes a file or a folder that is complete or absent."""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
from collections.abc import Iterator

from ig2mj.errors import InputError
from ig2mj.files.unfinished import unfinished as hidden_name


@contextlib.contextmanager
def whole_output(path: str | os.PathLike, folder: bool = False) -> Iterator[pathlib.Path]:
    """A path next to `path` to write to, which is renamed to it at the end of the block.

    If the block raises, or is interrupted, what was written is removed. An existing file is replaced.

    Args:
      folder: the output is a folder, which must not exist yet.

    Raises:
      InputError: the folder exists, or the path cannot be written to.
    """
    place = pathlib.Path(path)
    if folder and (place.exists() or place.is_symlink()):
        raise InputError(place, "is there already", fix="choose another folder")
    unfinished = hidden_name(place)
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        if folder:
            unfinished.mkdir()
        yield unfinished
        unfinished.replace(place)
    except OSError as e:
        _remove(unfinished)
        problem = f"cannot be written: {e.strerror or ' '.join(str(e).split())}"
        raise InputError(place, problem, fix="choose another place") from e
    except BaseException:
        _remove(unfinished)
        raise


def _remove(path: pathlib.Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink()
