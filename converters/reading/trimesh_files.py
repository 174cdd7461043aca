"""STL and PLY, read by trimesh. Images that a PLY names are opened by `looks` alone, never by trimesh."""

from __future__ import annotations

import contextlib
import io
import logging
import pathlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import trimesh
from trimesh.resolvers import Resolver

from ..base.text import without_mark
from .geometry_parts import Geometry, MeshContent, MeshSource, PlacedGeometry
from .looks import SurfaceLook
from .mesh_limits import MeshError, check_faces


def read_stl(source: MeshSource) -> MeshContent:
    """Binary or ASCII. Bytes after the triangles that a binary header counts are passed over.

    Raises MeshError: truncated, neither of both, or over a limit.
    """
    raw = without_mark(source.raw)
    ascii_ = raw.lstrip()[:5].lower() == b"solid" and b"facet" in raw[:4096].lower()
    if ascii_:
        check_faces(raw.lower().count(b"endfacet"), source.file)
        content = _with_trimesh(raw, "stl", source)
        if not content.placed:
            raise MeshError(source.file, "cannot be read as ASCII STL: it is truncated or damaged")
        return content
    count = int.from_bytes(raw[80:84], "little")
    check_faces((len(raw) - 84) // 50, source.file)
    if len(raw) < 84 or (len(raw) < 84 + 50 * count):
        held = max(len(raw) - 84, 0) // 50
        problem = f"its header counts {count} triangles, and {held} are there: it is truncated, or no STL file"
        raise MeshError(source.file, problem if len(raw) >= 84 else "is too short for an STL file")
    return _with_trimesh(raw[: 84 + 50 * count], "stl", source)


def read_ply(source: MeshSource) -> MeshContent:
    """Raises MeshError: counts that cannot be, or over a limit."""
    raw = without_mark(source.raw)
    _check_ply(raw, source.file)
    return _with_trimesh(raw, "ply", source)


class _Files(Resolver):
    """Gives trimesh an image of one pixel for whatever a PLY names, so that it keeps texture coordinates and opens
    nothing untrusted."""

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


def _with_trimesh(raw: bytes, file_type: str, source: MeshSource) -> MeshContent:
    textures, files = source.textures, _Files()
    with _quiet_trimesh():
        loaded = trimesh.load_scene(io.BytesIO(raw), file_type=file_type, resolver=files, process=False)
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
        placed.append(PlacedGeometry(found, np.eye(4), SurfaceLook(None, image)))
    return MeshContent(placed)


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
