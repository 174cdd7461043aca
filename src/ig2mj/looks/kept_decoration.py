"""Cache of decoration on disk: meshes and materials of a home depend on its plan, the light and this package alone.

Making them takes 0.4 s of a processor, reading them 0.02 s.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import json
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np

from ig2mj.errors import InputError
from ig2mj.files.npz import read_npz
from ig2mj.files.unfinished import replacing
from ig2mj.looks.materials import Material, texels
from ig2mj.looks.mesh import Triangles
from ig2mj.process.compilation import cache_folder

Decoration = list[tuple[Material, Triangles]]

FOLDER = "decoration"
"""Below ig2mj's cache folder."""

KEPT = 32
"""Files that are kept, the last ones written: each has up to 10 MB."""

_ARRAYS = {"vertices": 3, "normals": 3, "uv": 2, "faces": 3}
"""Arrays of `Triangles`, and the length of their rows."""


def decoration_of(make: Callable[[], Decoration], *depends: Any) -> Decoration:
    """`make()` with textures as bytes (`texels`), or what an earlier process kept of the same.

    Args:
      depends: what the decoration depends on, besides this package's code: data classes, arrays, and what `repr` tells
        apart.
    """
    file = cache_folder() / FOLDER / f"{_key(depends)}.npz"
    kept = _read(file)
    if kept is None:
        kept = [(dataclasses.replace(m, image=texels(m.image)), mesh) for m, mesh in make()]
        _write(file, kept)
    return kept


def _key(depends: Any) -> str:
    found = _code().copy()
    _add(found, depends)
    return found.hexdigest()


@functools.cache
def _code() -> Any:
    """A hash of the files of this package and of NumPy's version, whose random numbers and rounding count."""
    found = hashlib.sha256(np.__version__.encode())
    for file in sorted(pathlib.Path(__file__).parent.glob("*.py")):
        found.update(file.read_bytes())
    return found


def _add(found: Any, value: Any) -> None:
    """Adds a value to a hash, with its type and its length."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = [type(value).__name__, *(getattr(value, field.name) for field in dataclasses.fields(value))]
    if isinstance(value, np.ndarray):
        found.update(f"{value.dtype} {value.shape} ".encode())
        found.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, list | tuple):
        found.update(f"{len(value)} [".encode())
        for part in value:
            _add(found, part)
    else:
        found.update(f"{value!r} ".encode())


def _read(file: pathlib.Path) -> Decoration | None:
    """None: there is no such file, or it is not as `_write` leaves it."""
    try:
        arrays = read_npz(file)
        materials = [Material(**{**v, "rgba": tuple(v["rgba"])}) for v in json.loads(str(arrays["materials"]))]
        shapes, numbers = arrays["shapes"], arrays["numbers"]
        rows = {name: arrays[name] for name in _ARRAYS}
        images = arrays["images"]
    except (InputError, KeyError, TypeError, ValueError):  # not written to its end, or changed since
        return None
    count = len(materials)
    if shapes.shape != (count, 2) or numbers.shape != (count, 2) or images.dtype != np.uint8:
        return None
    if any(rows[name].ndim != 2 or rows[name].shape[1] != width for name, width in _ARRAYS.items()):
        return None
    sizes, ends = 3 * shapes.prod(1), np.cumsum(numbers, 0)
    whole = all(len(rows[name]) == numbers[:, int(name == "faces")].sum() for name in _ARRAYS)
    if not whole or images.shape != (sizes.sum(),):
        return None
    parts = {name: np.split(rows[name], ends[:-1, int(name == "faces")]) for name in _ARRAYS}
    found = []
    for k, (material, image) in enumerate(zip(materials, np.split(images, np.cumsum(sizes)[:-1]), strict=True)):
        shown = image.reshape(*shapes[k], 3) if len(image) else None
        found.append((dataclasses.replace(material, image=shown), Triangles(**{n: parts[n][k] for n in _ARRAYS})))
    return found


def _write(file: pathlib.Path, decoration: Decoration) -> None:
    """Nothing, where nothing can be written."""
    if not decoration:
        return
    images = [m.image if m.image is not None else np.zeros((0, 0, 3), np.uint8) for m, _ in decoration]
    materials = [dataclasses.asdict(dataclasses.replace(m, image=None)) for m, _ in decoration]
    arrays = {
        "materials": np.array(json.dumps(materials)),
        "shapes": np.array([image.shape[:2] for image in images]),
        "images": np.concatenate([image.ravel() for image in images]),
        "numbers": np.array([(len(mesh.vertices), len(mesh.faces)) for _, mesh in decoration]),
        **{name: np.concatenate([getattr(mesh, name) for _, mesh in decoration]) for name in _ARRAYS},
    }
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as part, part.open("wb") as opened:
            np.savez(opened, allow_pickle=False, **arrays)
        old = sorted(file.parent.glob("*.npz"), key=lambda other: other.stat().st_mtime)[:-KEPT]
        for other in old:
            other.unlink(missing_ok=True)
