"""Mesh files of every kind URDFs name -> triangles in metres, Z up, as the URDF's own tools see them.

- OBJ, STL, PLY: numbers as they stand (no unit, no axis convention); a URDF's mesh `scale` is the caller's.
- DAE (COLLADA): `<unit meter>` is applied and `<up_axis>` is turned to Z up: Y_UP (x, y, z) -> (x, -z, y),
  X_UP (x, y, z) -> (-y, x, z) after the unit, as Gazebo does (RViz leaves the axis alone).
- GLB, glTF: Y up by its standard, turned to Z up the same way, as Drake and Blender do. Metres.

Textures are named only where they are image files on disk; an image packed into a GLB gives its mean colour.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import logging
import pathlib
import warnings as python_warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from trimesh.resolvers import Resolver
from trimesh.visual.material import SimpleMaterial

from ig2mj.errors import InputError

from ..base import inputs
from ..base.description import Mesh
from ..base.file_access import FileGuard
from .mesh_limits import MAX_FACES, MAX_MESH_BYTES, MeshError, check_vertices, too_many_faces
from .obj_files import Material, ObjFile, group_meshes, material_meshes, read_mtl, read_obj
from .xml_reader import decode_xml, parse_number, parse_strictly, read_bytes

MAX_PIXELS = 16384 * 16384
MAX_SCENE_FILE_BYTES = 128 * 2**20  # DAE and glTF
FORMATS = (".obj", ".stl", ".dae", ".glb", ".gltf", ".ply")
_IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff")

Y_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
X_UP = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@dataclasses.dataclass
class MeshPart:
    """Triangles with one look. uv: [n, 2] of the one mesh, origin at the image's lower left, as in OBJ."""

    meshes: list[Mesh]
    rgba: tuple[float, float, float, float] | None = None
    texture: pathlib.Path | None = None
    uv: list[np.ndarray] | None = None


def is_encrypted(file: pathlib.Path) -> bool:
    """A BEHAVIOR file that only iGibson's renderer may open: name `*.encrypted.*`."""
    return ".encrypted." in file.name.lower()


def encrypted_twin(file: pathlib.Path) -> pathlib.Path | None:
    """The `x.encrypted.obj` that stands where `x.obj` is named and missing."""
    twin = file.with_name(f"{file.stem}.encrypted{file.suffix}")
    return twin if not inputs.is_file(file) and inputs.is_file(twin) else None


def read_collision(file: pathlib.Path, guard: FileGuard) -> tuple[list[Mesh], bool]:
    """(meshes, grouped) of a collision file: one mesh per `o`/`g` group of an OBJ, else one per piece of the file.

    Raises:
      MeshError: missing, unreadable, empty, over `MAX_FACES`, or a vertex that is not finite.
      OutsideError: it refers to a file outside the guard's folders.
    """
    if _suffix(file) == ".obj":
        obj = read_obj(_existing(file))
        meshes = group_meshes(obj)
        if not meshes:
            raise MeshError(file, "is empty: all its faces are degenerate")
        return meshes, obj.grouped
    return [mesh for part in _read_with_trimesh(file, guard) for mesh in part.meshes], False


def read_visual(file: pathlib.Path, guard: FileGuard, element: str, warnings: list[str]) -> list[MeshPart]:
    """One part per material of a visual file. Raises as `read_collision`; lost materials are warnings."""
    if _suffix(file) == ".obj":
        obj = read_obj(_existing(file))
        return _obj_parts(obj, file, guard, element, warnings)
    return _read_with_trimesh(file, guard)


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


def _obj_parts(obj: ObjFile, file: pathlib.Path, guard: FileGuard, element: str, warnings: list[str]) -> list[MeshPart]:
    materials: dict[str, Material] = {}
    for library in obj.libraries:
        try:
            materials |= read_mtl(guard.resolve(library, element, base=file.parent))
        except InputError as e:
            warnings.append(f"materials of {file.name} are left out: {e}")
    parts = []
    for name, mesh, uv in material_meshes(obj):
        look = materials.get(name, Material())
        texture = _texture(look.texture, file.parent, guard, element, warnings) if look.texture else None
        usable = uv if texture is not None else None
        parts.append(
            MeshPart([mesh], look.rgba, texture if usable is not None else None, None if usable is None else [usable])
        )
    if not parts:
        raise MeshError(file, "is empty: all its faces are degenerate")
    return parts


def _texture(
    name: str, folder: pathlib.Path, guard: FileGuard, element: str, warnings: list[str]
) -> pathlib.Path | None:
    """Path of a texture that opens as an image; None (with a warning unless it is encrypted) otherwise."""
    try:
        path = guard.resolve(name, element, base=folder)
    except InputError as e:
        warnings.append(f"a texture is left out: {e}")
        return None
    if is_encrypted(path) or encrypted_twin(path):
        return None
    try:
        if path.suffix.lower() not in _IMAGES:
            raise OSError("not an image format that is read")
        with Image.open(io.BytesIO(inputs.content(path))) as image:
            if image.size[0] * image.size[1] > MAX_PIXELS:
                raise OSError(f"{image.size[0]} x {image.size[1]} pixels are too many")
            image.verify()
    except Exception as e:  # Pillow raises many kinds for broken images
        warnings.append(f"texture {path.name} is left out: {e}")
        return None
    return path


class _GuardedFiles(Resolver):
    """Gives trimesh the files that a DAE or glTF names, and remembers the images among them."""

    def __init__(self, file: pathlib.Path, guard: FileGuard):
        self.file, self.guard = file, guard
        self.images: list[pathlib.Path] = []
        self.refused: InputError | None = None

    def get(self, key: str) -> bytes:  # pyright: ignore[reportIncompatibleMethodOverride]
        try:
            path = self.guard.resolve(str(key), self.file.name, base=self.file.parent)
        except InputError as e:
            self.refused = e
            raise
        if path.suffix.lower() in _IMAGES:
            self.images.append(path)
        return read_bytes(path, MAX_SCENE_FILE_BYTES)

    def keys(self) -> list[str]:
        return []

    def write(self, name: str, data: Any) -> None:
        raise NotImplementedError("meshes are only read")

    def namespaced(self, namespace: str) -> _GuardedFiles:
        raise NotImplementedError("meshes have no namespaces")


def _read_with_trimesh(file: pathlib.Path, guard: FileGuard) -> list[MeshPart]:
    suffix = _suffix(file)
    raw = read_bytes(_existing(file), MAX_SCENE_FILE_BYTES if suffix in (".dae", ".glb", ".gltf") else MAX_MESH_BYTES)
    if raw.startswith(b"version https://git-lfs"):
        raise MeshError(file, "is a Git LFS pointer, not the mesh", fix="run git lfs pull")
    if suffix == ".stl" and len(raw) > 50 * (MAX_FACES + 100) and not raw.lstrip().startswith(b"solid"):
        raise too_many_faces(file, (len(raw) - 84) // 50)
    turn = np.eye(4)
    if suffix == ".dae":
        turn, raw = _collada_frame(raw, file)
    elif suffix in (".glb", ".gltf"):
        turn[:3, :3] = Y_UP
        if suffix == ".gltf":
            _check_gltf_json(raw, file)
    files = _GuardedFiles(file, guard)
    try:
        with python_warnings.catch_warnings(), _quiet_trimesh(), np.errstate(all="ignore"):
            python_warnings.simplefilter("ignore")
            loaded = trimesh.load_scene(io.BytesIO(raw), file_type=suffix[1:], resolver=files, process=False)
            pieces = [(loaded.geometry[n], m) for m, n in map(loaded.graph.get, sorted(loaded.graph.nodes_geometry))]
    except MemoryError:
        raise
    except Exception as e:  # the readers behind trimesh raise whatever the broken file leads them to
        if files.refused is not None:
            raise files.refused from e
        raise MeshError(file, f"cannot be read as {suffix[1:].upper()}: {type(e).__name__}: {e}") from e
    parts = [_trimesh_part(geometry, turn @ matrix, files, file) for geometry, matrix in pieces]
    parts = [p for p in parts if p is not None]
    if not parts:
        raise MeshError(file, "is empty: it has no faces")
    if (count := sum(len(m.faces) for p in parts for m in p.meshes)) > MAX_FACES:
        raise too_many_faces(file, count)
    return parts


def _trimesh_part(geometry: Any, matrix: np.ndarray, files: _GuardedFiles, file: pathlib.Path) -> MeshPart | None:
    if not isinstance(geometry, trimesh.Trimesh) or not len(geometry.faces):
        return None  # points and lines
    check_vertices(np.asarray(geometry.vertices), file)
    check_vertices(matrix, file)
    if geometry.faces.min() < 0 or geometry.faces.max() >= len(geometry.vertices):
        raise MeshError(file, "a face names a vertex that does not exist")
    with np.errstate(all="ignore"):
        rgba, image = _look(geometry)
    texture = _same_image(image, files) if image is not None else None
    uv = getattr(geometry.visual, "uv", None) if texture is not None else None
    if image is not None and (texture is None or uv is None):
        rgba, texture = _mean_colour(image, rgba), None
    vertices, faces = np.asarray(geometry.vertices, dtype=float), np.asarray(geometry.faces, dtype=np.int64)
    rows = vertices if uv is None else np.column_stack([vertices, uv])
    used, index = np.unique(rows, axis=0, return_inverse=True)  # STL and DAE repeat vertices per face
    faces = index.reshape(-1)[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        return None
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    placed = used[:, :3] @ matrix[:3, :3].T + matrix[:3, 3]
    return MeshPart([Mesh(placed, faces)], rgba, texture, None if texture is None else [used[:, 3:]])


def _look(geometry: trimesh.Trimesh) -> tuple[tuple[float, float, float, float] | None, Any]:
    """(colour or None, PIL image or None) of a trimesh geometry."""
    visual: Any = geometry.visual
    if visual.kind == "texture":
        material = visual.material
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        simple = isinstance(material, SimpleMaterial)
        colour = material.diffuse if simple else material.baseColorFactor
        if colour is None or (simple and image is not None):
            return None, image  # nothing said: the texture alone, or the URDF's colour
    elif visual.kind in ("vertex", "face"):
        image, colour = None, np.mean(visual.vertex_colors, axis=0)
    else:
        return None, None
    values = np.asarray(colour, dtype=float).reshape(-1)
    values = values / 255.0 if np.asarray(colour).dtype.kind in "ui" or np.max(values) > 1.0 else values
    r, g, b, a = (float(v) for v in np.clip(np.append(values, 1.0)[:4], 0.0, 1.0))
    return (r, g, b, a), image


def _same_image(image: Any, files: _GuardedFiles) -> pathlib.Path | None:
    """The file among those read that holds this image."""
    try:
        for path in files.images:
            with Image.open(io.BytesIO(inputs.content(path))) as candidate:
                if candidate.size == image.size and candidate.tobytes() == image.tobytes():
                    return path
    except Exception:  # a broken image is not a texture
        return None
    return None


def _mean_colour(image: Any, rgba: tuple[float, float, float, float] | None) -> tuple[float, float, float, float]:
    factor = rgba or (1.0, 1.0, 1.0, 1.0)
    try:
        r, g, b = (
            float(v) / 255.0 for v in np.asarray(image.convert("RGB").resize((1, 1), Image.Resampling.BOX))[0, 0]
        )
    except Exception:  # a broken image
        return factor
    return (r * factor[0], g * factor[1], b * factor[2], factor[3])


def _collada_frame(raw: bytes, file: pathlib.Path) -> tuple[np.ndarray, bytes]:
    """4x4 from the file's unit and axes to metres and Z up, and the file's text without XML entities."""
    text = decode_xml(raw, file)
    turn = np.eye(4)
    root = parse_strictly(text, file)
    axis = root.findtext("{*}asset/{*}up_axis") or "Y_UP"
    turn[:3, :3] = {"X_UP": X_UP, "Z_UP": np.eye(3)}.get(axis.strip(), Y_UP)
    unit = root.find("{*}asset/{*}unit")
    if unit is not None and unit.get("meter") is not None:
        metres = parse_number(unit.get("meter").strip())
        if metres is None or metres <= 0:
            raise MeshError(file, f"unit meter='{unit.get('meter')}' is not a positive number")
        turn[:3, :3] *= metres
    return turn, text.encode()


def _check_gltf_json(raw: bytes, file: pathlib.Path) -> None:
    try:
        json.loads(raw)
    except (ValueError, RecursionError) as e:
        raise MeshError(file, f"is not a glTF file: {e}") from e


@contextlib.contextmanager
def _quiet_trimesh() -> Iterator[None]:
    """Keeps trimesh's log messages about broken textures off the screen."""
    level = trimesh.util.log.level
    trimesh.util.log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        trimesh.util.log.setLevel(level)
