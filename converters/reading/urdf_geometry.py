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
from ..base.xml_reader import Element, local_name, number, numbers, shortened, where
from .geometry_parts import MeshPart
from .looks import SurfaceLook, TextureReader, encrypted_twin, is_encrypted
from .mesh_files import read_collision, read_visual
from .mesh_limits import MeshError
from .urdf_materials import UrdfMaterials

CONVEX_ENOUGH = 0.9
"""A group of a plain URDF's OBJ counts as a convex piece if it fills this much of its hull."""


@dataclasses.dataclass
class GeometryReader:
    """Reads the shapes of one URDF, each mesh file once.

    Attributes:
      materials: of the whole file.
      warnings: gets what was left out.
    """

    guard: FileGuard
    materials: UrdfMaterials
    warnings: list[str]
    _collisions: dict[pathlib.Path, tuple[list[Mesh], bool]] = dataclasses.field(default_factory=dict)
    _visuals: dict[pathlib.Path, list[MeshPart]] = dataclasses.field(default_factory=dict)

    def collision(self, element: Element) -> Shape | None:
        """None (and a warning) for a shape of size zero, which Bullet leaves out, too.

        Raises:
          InputError: whatever else is wrong with it.
        """
        shape, mesh = self._primitive(element)
        if self._is_nothing(shape, mesh, element):
            return None
        if mesh is None:
            return shape
        path, named = self._mesh_path(mesh)
        if is_encrypted(path):
            raise MeshError(path, "is an encrypted collision mesh", element=where(element))
        try:
            if path not in self._collisions:
                self._collisions[path] = read_collision(path, self.guard, self.warnings)
        except MeshError as e:
            raise _in_urdf(e, self.guard, mesh, named) from e
        meshes, grouped = self._collisions[path]
        grouped = grouped and (self.guard.dataset or all(map(_is_convex, meshes)))
        return dataclasses.replace(shape, meshes=list(meshes), grouped=grouped, scale=self._scale(mesh), file=path)

    def visual(self, element: Element) -> list[Shape]:
        """One shape per material. A geometry that cannot be used is a warning and no shape; so is a material.

        Raises:
          InputError: numbers or file names that no URDF may have.
        """
        look = self.materials.look(element)
        try:
            shape, mesh = self._primitive(element)
        except MeshError as e:
            self.warnings.append(f"a visual is left out: {e}")
            return []
        if self._is_nothing(shape, mesh, element):
            return []
        textures = TextureReader(self.guard, where(element), self.guard.folder, self.warnings)
        if mesh is None:
            return [dataclasses.replace(shape, rgba=textures.flat(look).rgba)]
        scale = self._scale(mesh)
        path, _ = self._mesh_path(mesh)
        if is_encrypted(path):
            if not inputs.is_file(path):
                self.warnings.append(f"{where(element)}: the encrypted visual {path.name} does not exist")
            return [dataclasses.replace(shape, scale=scale, file=path, encrypted=True, rgba=look.rgba)]
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
                rgba=drawn.rgba,
                texture=drawn.texture,
                uv=part.uv if drawn.texture is not None else None,
            )
            for part in self._visuals[path]
            for drawn in [_drawn(part, look, textures)]
        ]

    def _is_nothing(self, shape: Shape, mesh: Element | None, element: Element) -> bool:
        """A primitive or a mesh scaled to size zero, with a warning; a visual also where it is flat."""
        text = "" if mesh is None else (mesh.get("scale") or "")
        scale = () if mesh is None else numbers(mesh, "scale", len(text.split()) or 3, self.guard.file, (1.0,) * 3)
        enough = np.all if local_name(element) == "visual" else np.any
        if all(shape.size) and (mesh is None or enough(np.asarray(scale) != 0)):
            return False
        kind = f"its {shape.kind} has" if mesh is None else f"scale='{shortened(text, 40)}' gives its mesh"
        self.warnings.append(f"{where(element)} is left out: {kind} no size")
        return True

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
        if np.any(size < 0):
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


def _drawn(part: MeshPart, look: SurfaceLook, textures: TextureReader) -> SurfaceLook:
    """What a part of a mesh file is drawn in: its own look, else the URDF's."""
    if part.rgba is not None or part.texture is not None:
        return SurfaceLook(part.rgba, part.texture)
    if look.texture is not None and part.uv is None:
        return textures.flat(look)
    return look


def _in_urdf(error: MeshError, guard: FileGuard, mesh: Element, named: str) -> InputError:
    """The error of a mesh file, seen from the URDF that names it if the file does not exist."""
    if error.problem == "mesh does not exist":
        near = [path.name for path in inputs.namesakes(pathlib.Path(error.file))]
        fix = f"the file is called '{near[0]}'" if near else ""
        return InputError(guard.file, f"its mesh '{shortened(named)}' does not exist", element=where(mesh), fix=fix)
    return error


def _is_convex(mesh: Mesh) -> bool:
    """The mesh fills its hull (see `CONVEX_ENOUGH`)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
    try:
        return abs(volume) >= CONVEX_ENOUGH * ConvexHull(mesh.vertices).volume
    except (QhullError, ValueError):
        return False  # flat: no piece of its own
