"""Wavefront OBJ, keeping what trimesh's reader merges: one mesh per `o`/`g` group, or one per material with texture uv.

Bullet makes one convex hull of each `o` or `g` group (iGibson's dataset format), so for collision files the groups
are the decomposition.
"""

from __future__ import annotations

import array
import dataclasses
import math
import pathlib
from collections.abc import Iterator

import numpy as np

from ..base.description import Mesh
from ..base.read_limits import check_limit, limits
from ..base.text import LFS_FIX, LFS_POINTER, decoded, without_mark
from ..base.xml_reader import MAX_NUMBER, parse_number, read_bytes
from .mesh_limits import MeshError, check_faces, check_vertices


@dataclasses.dataclass
class ObjFile:
    """The statements of an OBJ file.

    Attributes:
      vertices: [n, 3]. uv: [k, 2]. colours: [n, 3] of vertices that have some (0..1), or None.
      corners: [m, 3, 2] of triangles (polygons are cut into fans): index of the vertex and of the uv (-1: none).
      group, material: [m] index into `groups` and `materials`.
      groups: names; the first, '', holds faces before any `o` or `g`. materials: names; the first, '', is none.
      libraries: names of MTL files.
    """

    vertices: np.ndarray
    uv: np.ndarray
    corners: np.ndarray
    group: np.ndarray
    material: np.ndarray
    groups: list[str]
    materials: list[str]
    libraries: list[str]
    colours: np.ndarray | None = None

    @property
    def grouped(self) -> bool:
        """Every face stands in an `o` or `g` group."""
        return len(self.group) > 0 and bool(np.all(self.group > 0))

    @property
    def group_count(self) -> int:
        """Groups that have faces."""
        return len(np.unique(self.group))


def read_obj(file: pathlib.Path) -> ObjFile:
    """Reads an OBJ. Raises MeshError: no text, no faces, bad numbers, non-finite vertices, over a limit."""
    raw = without_mark(read_bytes(file, "mesh_bytes"))
    if raw.startswith(LFS_POINTER):
        raise MeshError(file, "is not the mesh", fix=LFS_FIX)
    if b"\0" in raw[:4096]:
        raise MeshError(file, "is not an OBJ file: it is not text")
    for kind, what in ((b"v", "vertices"), (b"vt", "texture coordinates"), (b"f", "faces")):
        name = "mesh_faces" if kind == b"f" else "mesh_vertices"
        check_limit(name, raw.count(b"\n" + kind + b" "), file, what, error=MeshError)
    check_limit("mesh_lines", raw.count(b"\n"), file, "lines", error=MeshError)
    return _Statements(file).read(raw)


class _Statements:
    """Reads an OBJ line by line; numbers go into arrays at once, a list of words takes twenty times their memory."""

    def __init__(self, file: pathlib.Path):
        self._file = file
        self._points, self._uv, self._colours = array.array("d"), array.array("d"), array.array("d")
        self._corners, self._group, self._material = array.array("q"), array.array("q"), array.array("q")
        self._uv_is_broken = False

    def read(self, raw: bytes) -> ObjFile:
        file, corners = self._file, self._corners
        groups, materials, libraries = [""], [""], []
        material_index = {"": 0}
        now_group, now_material, most = 0, 0, 3 * limits().mesh_vertices
        for number, line in _lines(raw):
            words = line.split()
            if not words:
                continue
            kind = words[0]
            if kind == "v":
                self._vertex(words, number)
                if len(self._points) > most:
                    check_limit("mesh_vertices", len(self._points) // 3, file, "vertices", error=MeshError)
            elif kind == "vt":
                self._texture_point(words)
                if len(self._uv) > most:
                    check_limit("mesh_vertices", len(self._uv) // 2, file, "texture coordinates", error=MeshError)
            elif kind == "f":
                if "#" in line:
                    words = line.split("#", 1)[0].split()
                if len(words) < 4:
                    continue  # a point or an edge
                check_faces(len(self._group) + len(words) - 3, file)
                polygon = _polygon(words[1:], len(self._points) // 3, len(self._uv) // 2, file, number)
                for i in range(1, len(polygon) - 1):
                    corners.extend((*polygon[0], *polygon[i], *polygon[i + 1]))
                    self._group.append(now_group)
                    self._material.append(now_material)
            elif kind in ("o", "g"):
                groups.append(" ".join(words[1:]))
                now_group = len(groups) - 1
            elif kind == "usemtl":
                name = " ".join(words[1:])
                now_material = material_index.setdefault(name, len(materials))
                if now_material == len(materials):
                    materials.append(name)
            elif kind == "mtllib":
                libraries.append(line.split(None, 1)[1].strip() if len(words) > 1 else "")
        if not self._group:
            raise MeshError(file, "is empty: it has no faces")
        points = np.array(self._points).reshape(-1, 3)
        check_vertices(points, file)
        coloured = len(self._colours) == len(self._points)
        return ObjFile(
            vertices=points,
            uv=np.zeros((0, 2)) if self._uv_is_broken else np.array(self._uv).reshape(-1, 2),
            corners=np.array(corners, dtype=np.int64).reshape(-1, 3, 2),
            group=np.array(self._group, dtype=np.int64),
            material=np.array(self._material, dtype=np.int64),
            groups=groups,
            materials=materials,
            libraries=[name for name in dict.fromkeys(libraries) if name],
            colours=np.clip(np.array(self._colours).reshape(-1, 3), 0, 1) if coloured else None,
        )

    def _vertex(self, words: list[str], line: int) -> None:
        """x y z, or x y z r g b as MeshLab writes it. A fourth number alone is a weight, and is passed over."""
        try:
            x, y, z = float(words[1]), float(words[2]), float(words[3])
            self._points.extend((x, y, z))
        except (ValueError, IndexError):
            text = " ".join(words[1:4])[:60]
            raise MeshError(self._file, f"vertex '{text}' is not 3 finite numbers", element=f"line {line}") from None
        if x - x or y - y or z - z or "_" in words[1] + words[2] + words[3]:  # not finite, or "1_0"
            text = " ".join(words[1:4])[:60]
            raise MeshError(self._file, f"vertex '{text}' is not 3 finite numbers", element=f"line {line}")
        if len(words) >= 7:
            rgb = [parse_number(word) for word in words[4:7]]
            self._colours.extend(v for v in rgb if v is not None)

    def _texture_point(self, words: list[str]) -> None:
        """u and perhaps v. Broken texture coordinates cost the texture, not the mesh."""
        try:
            u, v = float(words[1]), float(words[2]) if len(words) > 2 else 0.0
        except (ValueError, IndexError):
            u = v = math.nan
        self._uv_is_broken |= not (abs(u) <= MAX_NUMBER and abs(v) <= MAX_NUMBER)
        self._uv.extend((u, v))


def _lines(raw: bytes) -> Iterator[tuple[int, str]]:
    """(number, line) of text in UTF-8; a backslash at its end continues a line. A few MB are decoded at a time."""
    number, at, first = 0, 0, 0
    waiting: list[str] = []
    while at < len(raw):
        end = raw.find(b"\n", at + 2**22)
        end = len(raw) if end < 0 else end
        for line in raw[at:end].decode("utf-8", errors="replace").split("\n"):
            number += 1
            text = line.removesuffix("\r")
            if text.endswith("\\"):
                waiting.append(text[:-1])
                first = first or number
                continue
            yield first or number, " ".join([*waiting, line]) if waiting else line
            waiting, first = [], 0
        at = end + 1
    if waiting:
        yield first, " ".join(waiting)


def group_meshes(obj: ObjFile) -> list[Mesh]:
    """One mesh per `o`/`g` group that has faces, in the file's order, with the vertices it uses."""
    meshes = []
    for index, rows in _rows_by_value(obj.group):
        used, faces = np.unique(obj.corners[rows, :, 0], return_inverse=True)
        meshes.append(_mesh(obj.vertices[used], faces.reshape(-1, 3), obj.groups[index]))
    return [m for m in meshes if len(m.faces)]


def material_meshes(obj: ObjFile) -> list[tuple[str, Mesh, np.ndarray | None, np.ndarray]]:
    """(material name, mesh, uv [n, 2] or None, index [n] of its vertices in the file) per material that has faces, and
    one more for those of its faces that have no texture coordinates; vertices are split at texture seams."""
    parts = []
    for index, rows in _rows_by_value(obj.material):
        has_uv = np.all(obj.corners[rows, :, 1] >= 0, axis=1) & bool(len(obj.uv))
        for textured in (True, False):
            corners = obj.corners[rows[has_uv == textured]]
            pairs = corners.reshape(-1, 2) if textured else corners.reshape(-1, 2) * [1, 0]
            used, faces = np.unique(pairs, axis=0, return_inverse=True)
            mesh = _mesh(obj.vertices[used[:, 0]], faces.reshape(-1, 3), obj.materials[index])
            if len(mesh.faces):
                parts.append((obj.materials[index], mesh, obj.uv[used[:, 1]] if textured else None, used[:, 0]))
    return parts


def _rows_by_value(values: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """(value, ascending rows that have it), values ascending: one sort, however many values there are."""
    order = np.argsort(values, kind="stable")
    found, starts = np.unique(values[order], return_index=True)
    yield from zip(found.tolist(), np.split(order, starts[1:]), strict=True)


def _mesh(vertices: np.ndarray, faces: np.ndarray, name: str) -> Mesh:
    """Drops triangles that name a vertex twice."""
    a, b, c = faces.T
    return Mesh(vertices, faces[(a != b) & (b != c) & (c != a)], name)


def _polygon(words: list[str], vertices: int, uvs: int, file: pathlib.Path, line: int) -> list[tuple[int, int]]:
    """Corners i, i/j, i//k, i/j/k -> (vertex index, uv index or -1), 0-based; negative numbers count backwards."""
    polygon = []
    for word in words:
        first, _, rest = word.partition("/")
        second = rest.partition("/")[0]
        try:
            i = int(first)
            j = int(second) if second else 0
        except ValueError:
            raise MeshError(file, f"'{word[:40]}' is not a corner of a face", element=f"line {line}") from None
        i = i - 1 if i > 0 else vertices + i
        j = j - 1 if j >= 0 else uvs + j
        if not 0 <= i < vertices or first.strip("+-") in ("0", "00"):
            raise MeshError(file, f"corner '{word[:40]}' names a vertex that does not exist", element=f"line {line}")
        polygon.append((i, j if 0 <= j < uvs else -1))
    return polygon


@dataclasses.dataclass
class ObjMaterial:
    """One `newmtl`: diffuse colour with opacity, and the name of its diffuse texture. folder: of the MTL file."""

    rgba: tuple[float, float, float, float] | None = None
    texture: str | None = None
    folder: pathlib.Path | None = None


def read_mtl(file: pathlib.Path) -> tuple[dict[str, ObjMaterial], list[str]]:
    """(materials, lines of diffuse colours that are not read) of an MTL file. Raises InputError: unreadable."""
    materials: dict[str, ObjMaterial] = {}
    unread: list[str] = []
    now = ObjMaterial()
    for line in decoded(read_bytes(file, 2**24)).replace("\r", "\n").split("\n"):
        words = line.split()
        if not words:
            continue
        kind, values = words[0].lower(), [parse_number(w) for w in words[1:4]]
        if kind == "newmtl":
            now = materials.setdefault(" ".join(words[1:]), ObjMaterial())
        elif kind == "kd":
            grey = (values * 3)[:3] if len(values) == 1 else values  # one number stands for all three
            if len(grey) != 3 or None in grey:
                unread.append(" ".join(words)[:60])
                continue
            r, g, b = (min(max(float(v or 0.0), 0.0), 1.0) for v in grey)
            now.rgba = (r, g, b, now.rgba[3] if now.rgba else 1.0)
        elif kind in ("d", "tr") and values and values[0] is not None:
            opacity = values[0] if kind == "d" else 1.0 - values[0]
            r, g, b, _ = now.rgba or (0.8, 0.8, 0.8, 1.0)
            now.rgba = (r, g, b, min(max(opacity, 0.0), 1.0) or 1.0)  # exporters write d 0 for "not set"
        elif kind == "map_kd" and len(words) > 1:
            now.texture = words[-1] if words[1].startswith("-") else line.split(None, 1)[1].strip()
    for material in materials.values():
        if material.texture and material.rgba and not any(material.rgba[:3]):
            material.rgba = (1.0, 1.0, 1.0, material.rgba[3])  # exporters write Kd 0 0 0 where an image says the colour
    return materials, unread
