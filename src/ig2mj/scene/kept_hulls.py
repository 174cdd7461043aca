"""Cache of convex hulls of a household's meshes on disk.

Hulls depend on the meshes alone, and importing SciPy, which computes them, takes 0.2 s: most of the time of loading a
home.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import pathlib
from collections.abc import Callable, Sequence

import numpy as np

from ig2mj.errors import InputError
from ig2mj.files.npz import read_npz
from ig2mj.files.unfinished import replacing
from ig2mj.process.compilation import cache_folder

Hull = tuple[np.ndarray, np.ndarray]
"""Half-spaces [m, 4] and corners [k, 3]."""

FOLDER = "pieces"
"""Below ig2mj's cache folder."""


def hulls_of(meshes: Sequence[np.ndarray], make: Callable[[np.ndarray], Hull], source: pathlib.Path) -> list[Hull]:
    """`make` of each mesh, or what an earlier process kept of the same meshes.

    Args:
      meshes: points [n, 3] of each.
      source: the file with `make`; with another text hulls are made again, and so they are with other versions of SciPy
        and NumPy.
    """
    if not meshes:
        return []
    file = cache_folder() / FOLDER / f"{_key(meshes, source)}.npz"
    kept = _read(file, len(meshes))
    if kept is None:
        kept = [make(mesh) for mesh in meshes]
        _write(file, kept)
    return kept


def _key(meshes: Sequence[np.ndarray], source: pathlib.Path) -> str:
    text = hashlib.sha256(source.read_bytes())
    for name in ("numpy", "scipy"):
        text.update(f"{name} {importlib.metadata.version(name)}\n".encode())
    for mesh in meshes:
        text.update(f"{mesh.dtype} {mesh.shape}\n".encode())
        text.update(np.ascontiguousarray(mesh).tobytes())
    return text.hexdigest()


def _read(file: pathlib.Path, count: int) -> list[Hull] | None:
    """None: there is no such file, or not with so many hulls."""
    try:
        arrays = read_npz(file)
        planes, corners, numbers = arrays["planes"], arrays["corners"], arrays["numbers"]
    except (InputError, KeyError):  # it was not written to its end, or somebody changed it
        return None
    if planes.shape[1:] != (4,) or corners.shape[1:] != (3,) or {planes.dtype.kind, corners.dtype.kind} != {"f"}:
        return None
    if numbers.shape != (count, 2) or numbers.dtype.kind != "i" or (numbers < 0).any():
        return None
    if tuple(numbers.sum(0)) != (len(planes), len(corners)):
        return None
    ends = np.cumsum(numbers, 0)[:-1]
    return list(zip(np.split(planes, ends[:, 0]), np.split(corners, ends[:, 1]), strict=True))


def _write(file: pathlib.Path, hulls: list[Hull]) -> None:
    """Nothing, where nothing can be written."""
    arrays = {
        "planes": np.concatenate([planes for planes, _ in hulls]),
        "corners": np.concatenate([corners for _, corners in hulls]),
        "numbers": np.array([(len(planes), len(corners)) for planes, corners in hulls]),
    }
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as part, part.open("wb") as opened:
            np.savez(opened, allow_pickle=False, **arrays)
