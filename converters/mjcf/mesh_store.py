"""The folder `meshes/` of an output: each distinct mesh once, as OBJ, under a name no file system objects to.

Equal meshes share one file and one MJCF asset, so ten chairs of one model and scale cost one chair. The name holds a
content hash: it does not depend on the order of conversion, and two models cannot overwrite each other's files.
"""

from __future__ import annotations

import hashlib
import pathlib

import mujoco
import numpy as np

from ..base.naming import file_slug
from ..base.output import put_shared_file

#: Vertices are written in steps of 0.1 micrometre: far below any fit, and equal on every machine.
_DECIMALS = 7


class MeshStore:
    """Writes meshes below `folder` and registers them as assets of `spec`.

    Args:
      spec: the model being built; its `meshdir` must be the name of `folder`.
      folder: where the OBJ files go; made when the first mesh is added.
    """

    def __init__(self, spec: mujoco.MjSpec, folder: pathlib.Path):
        self._spec, self._folder = spec, folder
        self._names: dict[str, str] = {}

    def __len__(self) -> int:
        return len(self._names)

    @property
    def files(self) -> list[str]:
        """Names of the files written so far, sorted."""
        return sorted(f"{name}.obj" for name in self._names.values())

    def add(
        self,
        vertices: np.ndarray,
        faces: np.ndarray,
        label: str,
        *,
        uv: np.ndarray | None = None,
        surface: bool = False,
    ) -> str:
        """Registers a mesh and returns the name of its asset.

        Args:
          vertices: [n, 3], metres, in the frame of the geom that will show it.
          faces: [m, 3] vertex indices, counter-clockwise from outside.
          label: what it is, for the file's name (category, model, link).
          uv: [n, 2] texture coordinates, or None.
          surface: a visual mesh, maybe open: its inertia is that of its surface (MuJoCo refuses volumes near zero).
        """
        text = _obj_text(vertices, faces, uv)
        key = hashlib.sha256(text + (b"surface" if surface else b"solid")).hexdigest()
        name = self._names.get(key)
        if name is None:
            name = f"{file_slug(label)}-{key[:12]}"
            put_shared_file(self._folder / f"{name}.obj", text)
            asset = self._spec.add_mesh(name=name, file=f"{name}.obj")
            kinds = mujoco.mjtMeshInertia
            asset.inertia = kinds.mjMESH_INERTIA_SHELL if surface else kinds.mjMESH_INERTIA_CONVEX
            self._names[key] = name
        return name


def _obj_text(vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray | None) -> bytes:
    """A mesh as OBJ text, without names, materials or comments: the same mesh gives the same bytes."""
    rounded = np.round(np.asarray(vertices, dtype=np.float64), _DECIMALS) + 0.0  # + 0.0 turns -0.0 into 0.0
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in rounded.tolist()]
    indices = (np.asarray(faces, dtype=np.int64) + 1).tolist()
    if uv is None:
        lines += [f"f {a} {b} {c}" for a, b, c in indices]
    else:
        lines += [f"vt {u:.6g} {v:.6g}" for u, v in (np.round(np.asarray(uv, dtype=np.float64), 6) + 0.0).tolist()]
        lines += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in indices]
    return ("\n".join(lines) + "\n").encode("ascii")
