"""Mesh files of every kind URDFs name -> triangles in metres, Z up, as the URDF's own tools see them.

- OBJ, STL, PLY: numbers as they stand (no unit, no axis convention); a URDF's mesh `scale` is the caller's.
- DAE (COLLADA): `<unit meter>` is applied and `<up_axis>` is turned to Z up: Y_UP (x, y, z) -> (x, -z, y),
  X_UP (x, y, z) -> (-y, x, z) after the unit, as Gazebo does (RViz leaves the axis alone).
- GLB, glTF: Y up by its standard, turned to Z up the same way, as Drake and Blender do. Metres.

Images that the files name or hold are opened by `looks` alone, never by the libraries that read the geometry.
"""

from __future__ import annotations

import dataclasses
import pathlib
import warnings as python_warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from ig2mj.errors import InputError

from ..base import inputs
from ..base.description import Mesh, Rgba
from ..base.file_access import FileGuard
from ..base.read_limits import check_limit, limits
from ..base.text import LFS_FIX, LFS_POINTER
from ..base.xml_reader import read_bytes
from .collada import read_collada
from .geometry_parts import MeshContent, MeshPart, MeshSource, parts_of
from .gltf import read_gltf
from .looks import SurfaceLook, TextureReader, mean_vertex_colour
from .mesh_limits import MeshError
from .obj_files import ObjFile, ObjMaterial, group_meshes, material_meshes, read_mtl, read_obj
from .trimesh_files import read_ply, read_stl

READERS: dict[str, Callable[[MeshSource], MeshContent]] = {
    ".stl": read_stl,
    ".dae": read_collada,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".ply": read_ply,
}
"""Readers by the end of a file's name: one line for each format. A reader takes the bytes of the file and gives its
triangles; OBJ, whose groups are collision meshes of their own, is read apart."""

WITH_IMAGES = (".dae", ".glb", ".gltf")
"""Formats whose files hold whole scenes, with images: they may be larger (`ReadLimits.scene_bytes`)."""

FORMATS = (".obj", *READERS)


def read_collision(file: pathlib.Path, guard: FileGuard, warnings: list[str] | None = None) -> tuple[list[Mesh], bool]:
    """(meshes, grouped) of a collision file: one mesh per `o`/`g` group of an OBJ, else one per piece of the file.

    warnings: gets what of the file cannot be read while the rest can.

    Raises:
      MeshError: missing, unreadable, empty, over a limit, or a vertex that is not finite.
      OutsideError: it refers to a file outside the guard's folders.
    """
    if _suffix(file) == ".obj":
        obj = read_obj(_existing(file))
        check_limit("mesh_groups", obj.group_count, file, "groups", error=MeshError)
        meshes = group_meshes(obj)
        if not meshes:
            raise MeshError(file, "is empty: all its faces are degenerate")
        return meshes, obj.grouped
    parts = _read_scene_file(file, guard, None, [] if warnings is None else warnings)
    return [mesh for part in parts for mesh in part.meshes], False


def read_visual(file: pathlib.Path, guard: FileGuard, element: str, warnings: list[str]) -> list[MeshPart]:
    """One part per material of a visual file. Raises as `read_collision`; lost materials are warnings."""
    suffix = _suffix(file)
    textures = TextureReader(guard, element, file.parent, warnings)
    if suffix == ".obj":
        parts = _obj_parts(read_obj(_existing(file)), file, textures)
    else:
        parts = _read_scene_file(file, guard, textures, warnings)
    return _few(parts, file, warnings)


def _few(parts: list[MeshPart], file: pathlib.Path, warnings: list[str]) -> list[MeshPart]:
    """Parts of equal looks joined, and all in one colour, where there are more than `ReadLimits.mesh_materials`."""
    most = limits().mesh_materials
    if len(parts) <= most:
        return parts
    looks: dict[Any, MeshPart] = {}
    for part in parts:
        key = (part.rgba, part.texture, part.uv is None)
        uv: list[np.ndarray] | None = None if part.uv is None else []
        joined = looks.setdefault(key, MeshPart([], part.rgba, part.texture, uv))
        joined.meshes += part.meshes
        if joined.uv is not None and part.uv is not None:
            joined.uv += part.uv
    if len(looks) <= most:
        return list(looks.values())
    warnings.append(_one_colour(file, len(looks)))
    return [MeshPart([mesh for part in parts for mesh in part.meshes], parts[0].rgba)]


def _one_colour(file: pathlib.Path, count: int) -> str:
    most = limits().mesh_materials
    return f"{file.name} has {count} materials, the limit is {most} (--limit mesh-materials=N): drawn in one colour"


def _suffix(file: pathlib.Path) -> str:
    suffix = file.suffix.lower()
    if suffix not in FORMATS:
        raise MeshError(
            file, f"'{suffix or file.name}' is not a supported mesh format", fix=f"use one of {', '.join(FORMATS)}"
        )
    return suffix


def _existing(file: pathlib.Path) -> pathlib.Path:
    if not inputs.is_file(file):
        raise MeshError(file, "mesh does not exist")
    return file


def _obj_parts(obj: ObjFile, file: pathlib.Path, textures: TextureReader) -> list[MeshPart]:
    if (count := len(np.unique(obj.material))) > limits().mesh_materials:
        textures.warn(_one_colour(file, count))
        obj = dataclasses.replace(obj, material=np.zeros_like(obj.material), materials=[""])
    materials: dict[str, ObjMaterial] = {}
    complete = True
    for library in _libraries(obj, file, textures)[:MAX_LIBRARIES]:
        try:
            mtl = textures.find(library)
            found, unread = read_mtl(mtl)
        except InputError as e:
            textures.warn(f"materials of {file.name} are left out: {e}")
            complete = False
            continue
        materials |= {name: dataclasses.replace(m, folder=mtl.parent) for name, m in found.items()}
        if unread:
            textures.warn(f"colours in {mtl.name} that are not read: {unread[0]}")
    if (unknown := [name for name in obj.materials[1:] if name not in materials]) and complete:
        textures.warn(f"{file.name} uses materials that no MTL file defines: {', '.join(unknown[:5])[:200]}")
    images: dict[str, pathlib.Path | None] = {}
    parts = []
    for name, mesh, uv, vertices in material_meshes(obj):
        material = materials.get(name, ObjMaterial())
        look = SurfaceLook(material.rgba)
        if material.texture:
            if material.texture not in images:
                images[material.texture] = textures.file(material.texture, material.folder)
            if (image := images[material.texture]) is not None:
                look = (
                    SurfaceLook(material.rgba, image)
                    if uv is not None
                    else textures.flat(SurfaceLook(material.rgba, image))
                )
        if look == SurfaceLook() and obj.colours is not None:
            look = SurfaceLook(_vertex_colour(obj.colours[vertices], file, textures))
        parts.append(MeshPart([mesh], look.rgba, look.texture, None if uv is None else [uv]))
    if not parts:
        raise MeshError(file, "is empty: all its faces are degenerate")
    return parts


def _libraries(obj: ObjFile, file: pathlib.Path, textures: TextureReader) -> list[str]:
    """Names of MTL files: a line of words is one name with blanks if there is such a file, else several names."""
    names = []
    for line in obj.libraries:
        words = line.split()
        several = len(words) > 1 and all(word.lower().endswith(".mtl") for word in words)
        names += words if several and not inputs.is_file(file.parent / line) else [line]
    return names


def _vertex_colour(colours: np.ndarray, file: pathlib.Path, textures: TextureReader) -> Rgba:
    rgba, vary = mean_vertex_colour(colours)
    if vary:
        textures.warn(f"{file.name} has colours per vertex: their mean colour is used")
    return rgba


MAX_LIBRARIES = 20
"""MTL files that an OBJ may name."""


def _read_scene_file(
    file: pathlib.Path, guard: FileGuard, textures: TextureReader | None, warnings: list[str]
) -> list[MeshPart]:
    """Parts of a file of another format than OBJ; textures: None for a collision file."""
    suffix = _suffix(file)
    raw = read_bytes(_existing(file), "scene_bytes" if suffix in WITH_IMAGES else "mesh_bytes")
    if raw.startswith(LFS_POINTER):
        raise MeshError(file, "is not the mesh", fix=LFS_FIX)
    try:
        with python_warnings.catch_warnings(), np.errstate(all="ignore"):
            python_warnings.simplefilter("ignore")
            found = READERS[suffix](MeshSource(raw, file, guard, textures))
            if found.placed and found.lost:
                warnings.append(f"parts of {file.name} cannot be read: {found.lost[0]}"[:300])
            return parts_of(found.placed, found.turn, file, textures)
    except (InputError, MemoryError):
        raise
    except Exception as e:  # the readers behind trimesh and pycollada raise whatever the broken file leads them to
        raise MeshError(file, f"cannot be read as {suffix[1:].upper()}: {type(e).__name__}: {e}"[:500]) from e
