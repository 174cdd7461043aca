"""`whole_output`: a file or a folder that is complete or not there."""

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
    """A place next to `path` to write to, which gets its name when the block is left without an error.

    Whatever ends the block otherwise, an interrupt among it, removes what was written. A file of that name is replaced.

    Args:
      folder: it is a folder, which is made; there must be none of that name yet.

    Raises:
      InputError: the folder is there already, or nothing can be written there.
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
