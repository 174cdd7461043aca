"""Paths that a file names: relative, and below a folder, also when symbolic links are followed."""

from __future__ import annotations

import os
import pathlib
import re
from collections.abc import Sequence

from ig2mj.errors import InputError

_ABSOLUTE = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:|[/\\]")
"""Of a drive, of an address or of the file system's root."""


class OutsideError(InputError):
    """A file names a path outside of the folders that may be read."""


def inside(
    name: str, folder: str | os.PathLike, file: object, element: str, roots: Sequence[pathlib.Path] = ()
) -> pathlib.Path:
    """The path that `name` means, resolved. It need not exist.

    Args:
      name: as `file` says it, from `folder` on. roots: resolved folders below which it may lie; none: `folder`.

    Raises:
      OutsideError: it is absolute, or lies elsewhere. InputError: it is no name of a file.
    """
    said = ascii(name if len(name) < 120 else f"{name[:117]}...")
    if not name.strip() or any(ord(letter) < 32 for letter in name):
        raise InputError(file, f"{said} is not a file name", element=element)
    fix = "name it relative to the scene's folder, and keep it inside"
    if _ABSOLUTE.match(name):
        raise OutsideError(file, f"{said} is absolute", element=element, fix=fix)
    try:
        root, real = pathlib.Path(folder).resolve(), (pathlib.Path(folder) / name.replace("\\", "/")).resolve()
    except (OSError, RuntimeError, ValueError) as e:  # links in a circle
        raise InputError(file, f"{said} cannot be resolved: {e}", element=element) from e
    if not any(real.is_relative_to(r) for r in roots or (root,)):
        raise OutsideError(file, f"{said} lies outside {folder}", element=element, fix=fix)
    return real
