"""Wavefront OBJ, keeping what trimesh's reader merges: one mesh per `o`/`g` group, or one per material with texture uv.

Bullet makes one convex hull of each `o` or `g` group (iGibson's dataset format), so for collision files the groups
are the decomposition.
"""

from __future__ import annotations

import dataclasses
import pathlib

import numpy as np

from ..base.description import Mesh
from .mesh_limits import MAX_FACES, MAX_MESH_BYTES, MeshError, check_vertices, too_many_faces
from .xml_reader import parse_number, read_bytes


@dataclasses.dataclass
class ObjFile:
    """The statements of an OBJ file.

    Attributes:
      vertices: [n, 3]. uv: [k, 2].
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

    @property
    def grouped(self) -> bool:
        """Every face stands in an `o` or `g` group."""
        return len(self.group) > 0 and bool(np.all(self.group > 0))


def read_obj(file: pathlib.Path) -> ObjFile:
    """Reads an OBJ. Raises MeshError: no text, no faces, bad numbers, non-finite vertices, too many faces."""
    raw = read_bytes(file, MAX_MESH_BYTES)
    if raw.startswith(b"version https://git-lfs"):
        raise MeshError(file, "is a Git LFS pointer, not the mesh", fix="run git lfs pull")
    if b"\0" in raw[:4096]:
        raise MeshError(file, "is not an OBJ file: it is not text")
    lines = raw.decode("utf-8", errors="replace").replace("\\\r\n", " ").replace("\\\n", " ").split("\n")
    del raw
    vertices: list[list[str]] = []
    vertex_lines: list[int] = []
    uv: list[list[str]] = []
    corners: list[tuple[int, int]] = []
    group: list[int] = []
    material: list[int] = []
    groups, materials, libraries = [""], [""], []
    material_index = {"": 0}
    now_group, now_material = 0, 0
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        kind = words[0]
        if kind == "v":
            vertices.append(words[1:4])
            vertex_lines.append(number)
        elif kind == "vt":
            uv.append([*words[1:3], "0"][:2])
        elif kind == "f":
            if "#" in line:
                words = line.split("#", 1)[0].split()
            if len(words) < 4:
                continue  # a point or an edge
            polygon = _polygon(words[1:], len(vertices), len(uv), file, number)
            for i in range(1, len(polygon) - 1):
                corners += (polygon[0], polygon[i], polygon[i + 1])
                group.append(now_group)
                material.append(now_material)
            if len(group) > MAX_FACES:
                raise too_many_faces(file, len(group))
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
    if not group:
        raise MeshError(file, "is empty: it has no faces")
    points = _floats(vertices, 3, file, vertex_lines)
    check_vertices(points, file)
    return ObjFile(
        vertices=points,
        uv=_floats(uv, 2, file, None),
        corners=np.array(corners, dtype=np.int64).reshape(-1, 3, 2),
        group=np.array(group),
        material=np.array(material),
        groups=groups,
        materials=materials,
        libraries=[name for name in libraries if name],
    )


def group_meshes(obj: ObjFile) -> list[Mesh]:
    """One mesh per `o`/`g` group that has faces, in the file's order, with the vertices it uses."""
    meshes = []
    for index in np.unique(obj.group):
        used, faces = np.unique(obj.corners[obj.group == index, :, 0], return_inverse=True)
        meshes.append(_mesh(obj.vertices[used], faces.reshape(-1, 3), obj.groups[index]))
    return [m for m in meshes if len(m.faces)]


def material_meshes(obj: ObjFile) -> list[tuple[str, Mesh, np.ndarray | None]]:
    """(material name, mesh, uv [n, 2] or None) per material that has faces; vertices are split at texture seams."""
    parts = []
    for index in np.unique(obj.material):
        corners = obj.corners[obj.material == index]
        textured = bool(len(obj.uv)) and bool(np.all(corners[..., 1] >= 0))
        pairs = corners.reshape(-1, 2) if textured else corners.reshape(-1, 2) * [1, 0]
        used, faces = np.unique(pairs, axis=0, return_inverse=True)
        mesh = _mesh(obj.vertices[used[:, 0]], faces.reshape(-1, 3), obj.materials[index])
        if len(mesh.faces):
            parts.append((obj.materials[index], mesh, obj.uv[used[:, 1]] if textured else None))
    return parts


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


def _floats(rows: list[list[str]], width: int, file: pathlib.Path, lines: list[int] | None) -> np.ndarray:
    """Words -> [n, width]; finds the line of the first bad number."""
    if not rows:
        return np.zeros((0, width))
    try:
        values = np.array(rows, dtype=np.float64)
        if values.shape == (len(rows), width) and np.all(np.isfinite(values)):
            return values
    except ValueError:
        pass
    if lines is None:
        return np.zeros((0, width))  # broken texture coordinates cost the texture, not the mesh
    for row, line in zip(rows, lines, strict=True):
        if len(row) != width or any(parse_number(w) is None for w in row):
            raise MeshError(
                file, f"vertex '{' '.join(row)[:60]}' is not {width} finite numbers", element=f"line {line}"
            )
    return np.array([[float(w) for w in row] for row in rows])


@dataclasses.dataclass
class Material:
    """One `newmtl`: diffuse colour with opacity, and the name of its diffuse texture."""

    rgba: tuple[float, float, float, float] | None = None
    texture: str | None = None


def read_mtl(file: pathlib.Path) -> dict[str, Material]:
    """Materials of an MTL file; statements that make no sense are passed over. Raises InputError: unreadable."""
    materials: dict[str, Material] = {}
    now = Material()
    for line in read_bytes(file, 2**22).decode("utf-8", errors="replace").splitlines():
        words = line.split()
        if not words:
            continue
        values = [parse_number(w) for w in words[1:4]]
        if words[0] == "newmtl":
            now = materials.setdefault(" ".join(words[1:]), Material())
        elif words[0] == "Kd" and len(values) == 3 and None not in values:
            r, g, b = (min(max(float(v or 0.0), 0.0), 1.0) for v in values)
            now.rgba = (r, g, b, now.rgba[3] if now.rgba else 1.0)
        elif words[0] in ("d", "Tr") and values and values[0] is not None:
            opacity = values[0] if words[0] == "d" else 1.0 - values[0]
            r, g, b, _ = now.rgba or (0.8, 0.8, 0.8, 1.0)
            now.rgba = (r, g, b, min(max(opacity, 0.0), 1.0) or 1.0)  # exporters write d 0 for "not set"
        elif words[0] == "map_Kd" and len(words) > 1:
            now.texture = words[-1] if words[1].startswith("-") else line.split(None, 1)[1].strip()
    return materials
