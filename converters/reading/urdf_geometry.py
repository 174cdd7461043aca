"""One `<visual>` or `<collision>` of an URDF -> `Shape`s."""

from __future__ import annotations

import dataclasses
import pathlib

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ig2mj.errors import InputError

from ..base import inputs
from ..base.description import Mesh, Shape
from ..base.file_access import FileGuard
from ..base.transforms import read_origin
from .mesh_files import MeshPart, encrypted_twin, is_encrypted, read_collision, read_visual
from .mesh_limits import MeshError
from .xml_reader import Element, local_name, number, numbers, shortened, where

Rgba = tuple[float, float, float, float]
CONVEX_ENOUGH = 0.9
"""A group of a plain URDF's OBJ counts as a convex piece if it fills this much of its hull."""


@dataclasses.dataclass
class GeometryReader:
    """Reads the shapes of one URDF, each mesh file once.

    Attributes:
      materials: colours and textures of the robot's top-level `<material>`s.
      warnings: gets what was left out.
    """

    guard: FileGuard
    materials: dict[str, Rgba | None]
    warnings: list[str]
    _collisions: dict[pathlib.Path, tuple[list[Mesh], bool]] = dataclasses.field(default_factory=dict)
    _visuals: dict[pathlib.Path, list[MeshPart]] = dataclasses.field(default_factory=dict)

    def collision(self, element: Element) -> Shape:
        """Raises InputError: whatever is wrong with it."""
        shape, mesh = self._primitive(element)
        if mesh is None:
            return shape
        path, named = self._mesh_path(mesh)
        if is_encrypted(path):
            raise MeshError(path, "is an encrypted collision mesh", element=where(element))
        try:
            if path not in self._collisions:
                self._collisions[path] = read_collision(path, self.guard)
        except MeshError as e:
            raise _in_urdf(e, self.guard, mesh, named) from e
        meshes, grouped = self._collisions[path]
        grouped = grouped and (self.guard.dataset or all(map(_is_convex, meshes)))
        return dataclasses.replace(shape, meshes=list(meshes), grouped=grouped, scale=self._scale(mesh), file=path)

    def visual(self, element: Element) -> list[Shape]:
        """One shape per material. A geometry that cannot be used is a warning and no shape.

        Raises:
          InputError: numbers or file names that no URDF may have.
        """
        rgba = self._colour(element)
        try:
            shape, mesh = self._primitive(element)
        except MeshError as e:
            self.warnings.append(f"a visual is left out: {e}")
            return []
        shape.rgba = rgba
        if mesh is None:
            return [shape]
        scale = self._scale(mesh)
        path, _ = self._mesh_path(mesh)
        if is_encrypted(path):
            if not inputs.is_file(path):
                self.warnings.append(f"{where(element)}: the encrypted visual {path.name} does not exist")
            return [dataclasses.replace(shape, scale=scale, file=path, encrypted=True)]
        try:
            if path not in self._visuals:
                self._visuals[path] = read_visual(path, self.guard, where(mesh), self.warnings)
        except MeshError as e:
            self.warnings.append(f"a visual of {where(element)} is left out: {e}")
            return []
        return [
            dataclasses.replace(
                shape,
                meshes=list(part.meshes),
                scale=scale,
                file=path,
                rgba=part.rgba or rgba,
                texture=part.texture,
                uv=part.uv,
            )
            for part in self._visuals[path]
        ]

    def _primitive(self, element: Element) -> tuple[Shape, Element | None]:
        """The shape without meshes, and the <mesh> element where it is one."""
        file = self.guard.file
        geometry = element.find("geometry")
        kinds = [] if geometry is None else [c for c in geometry if isinstance(c.tag, str)]
        if len(kinds) != 1:
            raise MeshError(file, f"has {len(kinds)} geometries instead of one", element=where(element))
        kind = kinds[0]
        shape = Shape(local_name(kind), read_origin(element, file), name=element.get("name") or "")
        if shape.kind == "mesh":
            return shape, kind
        if shape.kind == "box":
            size = numbers(kind, "size", 3, file)
        elif shape.kind in ("cylinder", "capsule"):
            size = np.array([number(kind, "radius", file), number(kind, "length", file)])
        elif shape.kind == "sphere":
            size = np.array([number(kind, "radius", file)])
        else:
            raise MeshError(
                file,
                f"geometry <{shape.kind}> is not supported",
                element=where(element),
                fix="use mesh, box, cylinder, sphere or capsule",
            )
        if np.any(size <= 0):
            raise MeshError(file, f"a size of the {shape.kind} is not positive", element=where(kind))
        shape.size = tuple(float(v) for v in size)
        return shape, None

    def _mesh_path(self, mesh: Element) -> tuple[pathlib.Path, str]:
        named = mesh.get("filename")
        if named is None:
            raise InputError(self.guard.file, "attribute 'filename' is missing", element=where(mesh))
        path = self.guard.resolve(named, where(mesh))
        return encrypted_twin(path) or path, named

    def _scale(self, mesh: Element) -> tuple[float, float, float]:
        text = mesh.get("scale")
        count = 1 if text is not None and len(text.split()) == 1 else 3
        s = numbers(mesh, "scale", count, self.guard.file, (1.0, 1.0, 1.0))
        if np.any(s == 0):
            raise InputError(self.guard.file, f"scale='{text}' makes the mesh flat", element=where(mesh))
        if np.any(s < 0):
            self.warnings.append(f"{where(mesh)}: scale='{text}' mirrors the mesh")
        x, y, z = np.broadcast_to(s, 3)
        return float(x), float(y), float(z)

    def _colour(self, element: Element) -> Rgba | None:
        material = element.find("material")
        if material is None:
            return None
        colour = read_colour(material, self.guard.file)
        return colour if colour is not None else self.materials.get(material.get("name") or "")


def read_colour(material: Element, file: object) -> Rgba | None:
    """<color rgba> of a <material>, clipped to 0..1; an alpha of 0 is drawn as 1."""
    colour = material.find("color")
    if colour is None:
        return None
    count = 3 if len((colour.get("rgba") or "").split()) == 3 else 4
    r, g, b, a = (float(v) for v in np.append(np.clip(numbers(colour, "rgba", count, file), 0, 1), 1.0)[:4])
    return r, g, b, a or 1.0


def _in_urdf(error: MeshError, guard: FileGuard, mesh: Element, named: str) -> InputError:
    """The error of a mesh file, seen from the URDF that names it if the file does not exist."""
    if error.problem == "mesh does not exist":
        return InputError(guard.file, f"its mesh '{shortened(named)}' does not exist", element=where(mesh))
    return error


def _is_convex(mesh: Mesh) -> bool:
    """The mesh fills its hull (see `CONVEX_ENOUGH`)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
    try:
        return abs(volume) >= CONVEX_ENOUGH * ConvexHull(mesh.vertices).volume
    except (QhullError, ValueError):
        return False  # flat: no piece of its own
