"""Mesh files of every kind URDFs name -> triangles in metres, Z up, as the URDF's own tools see them.

- OBJ, STL, PLY: numbers as they stand (no unit, no axis convention); a URDF's mesh `scale` is the caller's.
- DAE (COLLADA): `<unit meter>` is applied and `<up_axis>` is turned to Z up: Y_UP (x, y, z) -> (x, -z, y),
  X_UP (x, y, z) -> (-y, x, z) after the unit, as Gazebo does (RViz leaves the axis alone).
- GLB, glTF: Y up by its standard, turned to Z up the same way, as Drake and Blender do. Metres.

Images that the files name or hold are opened by `looks` alone, never by the libraries that read the geometry.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import logging
import pathlib
import warnings as python_warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import trimesh
from trimesh.resolvers import Resolver

from ig2mj.errors import InputError

from ..base import inputs
from ..base.description import Mesh, Rgba
from ..base.file_access import FileGuard
from ..base.read_limits import check_limit, limits
from ..base.text import without_mark
from ..base.xml_reader import read_bytes
from .collada import Y_UP, read_collada
from .geometry_parts import Geometry, MeshPart, Placed, parts_of
from .gltf import read_gltf
from .looks import Look, TextureReader, mean_vertex_colour
from .mesh_limits import MeshError, check_faces
from .obj_files import Material, ObjFile, group_meshes, material_meshes, read_mtl, read_obj

FORMATS = (".obj", ".stl", ".dae", ".glb", ".gltf", ".ply")


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
    materials: dict[str, Material] = {}
    complete = True
    for library in obj.libraries[:MAX_LIBRARIES]:
        try:
            materials |= read_mtl(textures.guard.resolve(library, textures.element, base=file.parent))
        except InputError as e:
            textures.warn(f"materials of {file.name} are left out: {e}")
            complete = False
    if (unknown := [name for name in obj.materials[1:] if name not in materials]) and complete:
        textures.warn(f"{file.name} uses materials that no MTL file defines: {', '.join(unknown[:5])[:200]}")
    images: dict[str, pathlib.Path | None] = {}
    parts = []
    for name, mesh, uv, vertices in material_meshes(obj):
        material = materials.get(name, Material())
        look = Look(material.rgba)
        if material.texture:
            if material.texture not in images:
                images[material.texture] = textures.file(material.texture)
            if (image := images[material.texture]) is not None:
                look = Look(material.rgba, image) if uv is not None else textures.flat(Look(material.rgba, image))
        if look == Look() and obj.colours is not None:
            look = Look(_vertex_colour(obj.colours[vertices], file, textures))
        parts.append(MeshPart([mesh], look.rgba, look.texture, None if uv is None else [uv]))
    if not parts:
        raise MeshError(file, "is empty: all its faces are degenerate")
    return parts


def _vertex_colour(colours: np.ndarray, file: pathlib.Path, textures: TextureReader) -> Rgba:
    rgba, vary = mean_vertex_colour(colours)
    if vary:
        textures.warn(f"{file.name} has colours per vertex: their mean is drawn")
    return rgba


class _Files(Resolver):
    """Gives trimesh an image of one pixel for whatever a PLY names, so that it keeps texture coordinates and opens
    nothing that a stranger made."""

    def __init__(self):
        self.image: str | None = None

    def get(self, key: str) -> bytes:  # pyright: ignore[reportIncompatibleMethodOverride]
        self.image = str(key)
        return _PIXEL

    def keys(self) -> list[str]:
        return []

    def write(self, name: str, data: Any) -> None:
        raise NotImplementedError("meshes are only read")

    def namespaced(self, namespace: str) -> _Files:
        raise NotImplementedError("meshes have no namespaces")


_PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63f8ffff3f0005fe02fe0def46b8"
    "0000000049454e44ae426082"
)
"""A PNG of one white pixel."""

MAX_LIBRARIES = 20
"""MTL files that an OBJ may name."""


def _read_scene_file(
    file: pathlib.Path, guard: FileGuard, textures: TextureReader | None, warnings: list[str]
) -> list[MeshPart]:
    """Parts of a DAE, GLB, glTF, STL or PLY; textures: None for a collision file."""
    suffix = _suffix(file)
    raw = read_bytes(_existing(file), "scene_bytes" if suffix in (".dae", ".glb", ".gltf") else "mesh_bytes")
    if raw.startswith(b"version https://git-lfs"):
        raise MeshError(file, "is a Git LFS pointer, not the mesh", fix="run git lfs pull")
    turn = np.eye(4)
    try:
        with python_warnings.catch_warnings(), _quiet_trimesh(), np.errstate(all="ignore"):
            python_warnings.simplefilter("ignore")
            if suffix == ".dae":
                found = read_collada(raw, file, textures)
                placed, turn = found.placed, found.turn
                if placed and found.lost:
                    warnings.append(f"parts of {file.name} cannot be read: {found.lost[0]}"[:300])
            elif suffix in (".glb", ".gltf"):
                turn[:3, :3] = Y_UP

                def load(uri: str) -> bytes:
                    path = guard.resolve(uri, file.name, base=file.parent)
                    return read_bytes(path, "scene_bytes")

                placed = read_gltf(raw, file, load, textures)
            else:
                placed = _with_trimesh(raw, file, suffix, textures)
            return parts_of(placed, turn, file, textures)
    except (InputError, MemoryError):
        raise
    except Exception as e:  # the readers behind trimesh and pycollada raise whatever the broken file leads them to
        raise MeshError(file, f"cannot be read as {suffix[1:].upper()}: {type(e).__name__}: {e}"[:500]) from e


def _with_trimesh(raw: bytes, file: pathlib.Path, suffix: str, textures: TextureReader | None) -> list[Placed]:
    """STL and PLY."""
    raw = without_mark(raw)
    if suffix == ".stl":
        # Three words in four of an ASCII facet are numbers; in binary a facet takes 50 bytes.
        ascii_ = raw.lstrip()[:5].lower() == b"solid" and b"facet" in raw[:4096].lower()
        check_faces(raw.lower().count(b"endfacet") if ascii_ else (len(raw) - 84) // 50, file)
    else:
        _check_ply(raw, file)
    files = _Files()
    loaded = trimesh.load_scene(io.BytesIO(raw), file_type=suffix[1:], resolver=files, process=False)
    placed = []
    for name in sorted(loaded.geometry):
        geometry: Any = loaded.geometry[name]
        if not isinstance(geometry, trimesh.Trimesh) or not len(geometry.faces):
            continue  # points and lines
        visual: Any = geometry.visual
        uv = colours = None
        if textures is not None and visual.kind == "texture":
            uv = visual.uv
        elif textures is not None and visual.kind in ("vertex", "face"):
            colours = np.asarray(visual.vertex_colors, dtype=float) / 255.0
        image = None if textures is None or files.image is None else textures.file(files.image)
        found = Geometry(np.asarray(geometry.vertices), np.asarray(geometry.faces), uv, colours)
        placed.append(Placed(found, np.eye(4), Look(None, image)))
    return placed


def _check_ply(raw: bytes, file: pathlib.Path) -> None:
    """The counts that a PLY's header declares."""
    head = raw[: max(raw.find(b"end_header"), 0)].split(b"\n")
    if not head or head == [b""]:
        raise MeshError(file, "cannot be read as PLY: its header does not end")
    for line in head:
        words = line.split()
        if len(words) == 3 and words[0] == b"element" and words[2].isdigit():
            if int(words[2][:18]) > len(raw):
                raise MeshError(file, f"declares more elements ({words[2][:18].decode()}) than it has bytes")
            if words[1] == b"face":
                check_faces(int(words[2][:18]), file)


@contextlib.contextmanager
def _quiet_trimesh() -> Iterator[None]:
    """Keeps trimesh's log messages about broken textures off the screen."""
    level = trimesh.util.log.level
    trimesh.util.log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        trimesh.util.log.setLevel(level)
