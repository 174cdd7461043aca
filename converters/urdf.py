"""Object URDF -> `ObjectModel`."""

from __future__ import annotations

import os
import pathlib

from .description import ObjectModel


def read_urdf(
    file: str | os.PathLike,
    category: str,
    model: str,
    root: pathlib.Path | None = None,
    *,
    mesh_folder: pathlib.Path | None = None,
    allow_outside: bool = False,
) -> ObjectModel:
    """Reads an object's URDF and its meshes (unscaled, link frames); metadata is left empty.

    Args:
      file: the URDF. If `<stem>_simplified.urdf` stands beside it, that one is read (dataset_format.md section 4).
      category, model: what the object is called.
      root: the dataset root (dataset mode): every mesh must lie below it, absolute paths are refused.
        None (plain URDF): meshes may lie below the URDF's folder or its package's root.
      mesh_folder: what relative mesh paths start from; default the URDF's folder.
      allow_outside: plain URDF only: read meshes from anywhere.

    Raises:
      InputError: naming the file and the element.
    """
    raise NotImplementedError
