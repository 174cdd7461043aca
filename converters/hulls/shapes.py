"""One collision shape: what of it is convex already, and which parts have to be cut up.

A primitive stays one; each `o`/`g` group of a mesh is one hull (iGibson's convention); a mesh
without groups is its hull where that fits, else the hulls of its connected parts. A part whose own hull is a bad fit is
left to `decompose`.
"""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np

from ..base.description import Mesh, Shape
from .convex import Hull, solid_hull
from .fitting import primitive_hull, primitive_volume
from .mesh_parts import MeshComponent, clean, decimate, enclosed_volume, hull_stands_for, is_thin_shell, parts
from .pieces import HullOptions, HullPiece, HullPieceSource

GROUP_RATIO = 1.3
"""A group whose hull has more than this many times its mesh's volume is not a convex piece, whatever the file says."""

MOST_FACES = 60_000
"""Meshes with more are made coarser first."""

MOST_PARTS = 400
"""A mesh in more connected parts keeps so many of the largest; the small ones are joined to their nearest."""


@dataclasses.dataclass
class Convex:
    """A convex piece before any budget. flat: the points [n, 3] of a flat one, whose hull is those points thickened."""

    hull: Hull
    source: HullPieceSource
    flat: np.ndarray | None = None


@dataclasses.dataclass
class Concave:
    """A part that must be cut up, and the shape it belongs to, for warnings."""

    part: MeshComponent
    label: str


@dataclasses.dataclass
class ShapeParts:
    """A mesh shape taken apart, in the link frame.

    Attributes:
      items: its parts, in order. volume: m3 that it encloses; None where it encloses nothing.
      corners: [n, 3] vertices of its faces that lie on its hull: no piece reaches beyond their common hull.
      warnings: one line each. stopped: see `LinkHulls`. seconds: it took.
    """

    items: list[Convex | Concave] = dataclasses.field(default_factory=list)
    volume: float | None = None
    corners: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))
    warnings: list[str] = dataclasses.field(default_factory=list)
    stopped: bool = False
    seconds: float = 0.0

    def enclose(self, volume: float) -> None:
        """Adds to the volume."""
        self.volume = (self.volume or 0.0) + volume


def label_of(shape: Shape, number: int) -> str:
    """What warnings call the link's collision shape with this number."""
    return shape.name or (shape.file.name if shape.file else f"collision {number}")


def take_apart(shape: Shape, label: str, options: HullOptions) -> ShapeParts:
    """Takes a mesh shape apart. Never raises on bad geometry: what cannot be used is left out, with a warning."""
    started = time.perf_counter()
    out = ShapeParts()
    meshes = [placed(mesh, shape) for mesh in shape.meshes]
    points = [mesh.vertices[np.unique(mesh.faces)] for mesh in meshes if len(mesh.faces)]
    if points:
        whole, _ = solid_hull(np.concatenate(points), options.min_thickness)
        out.corners = np.concatenate(points) if whole is None else whole.vertices
    if shape.grouped:
        for number, mesh in enumerate(meshes):
            _take_group(mesh, f"{label} group '{mesh.name or number}'", options, out)
    else:
        _take_soup(meshes, label, options, out)
    out.seconds = time.perf_counter() - started
    return out


def primitive_piece(shape: Shape, label: str, warnings: list[str]) -> HullPiece | None:
    """The piece of a primitive shape; None, and a warning, for one that cannot be used."""
    size = np.array(shape.size, float)
    scale = np.array(shape.scale, float)
    if shape.kind == "box":
        size = size * np.abs(scale)
    elif np.ptp(np.abs(scale)) <= 1e-9:
        size = size * abs(scale[0])
    else:
        warnings.append(f"{label}: a {shape.kind} cannot be scaled unevenly; its scale is left out")
    needed = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2}.get(shape.kind)
    if needed is None or len(size) != needed or not np.all(np.isfinite(size)) or np.any(size <= 0):
        warnings.append(f"{label}: {shape.kind} of size {tuple(shape.size)} left out")
        return None
    sizes = tuple(float(s) for s in size)
    hull = primitive_hull(shape.kind, sizes, shape.pose)
    if hull is None:
        warnings.append(f"{label}: {shape.kind} of size {sizes} is too thin, left out")
        return None
    kind: Any = shape.kind
    volume = primitive_volume(shape.kind, sizes)
    return HullPiece(kind, hull.vertices, hull.faces, shape.pose.copy(), sizes, "primitive", volume)


def placed(mesh: Mesh, shape: Shape) -> Mesh:
    """The mesh in the link frame without unusable faces; a mirroring scale turns the faces round."""
    vertices = np.asarray(mesh.vertices, np.float64).reshape(-1, 3) * np.array(shape.scale, float)
    vertices = vertices @ shape.pose[:3, :3].T + shape.pose[:3, 3]
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    faces = faces[np.all((faces >= 0) & (faces < len(vertices)), axis=1)]
    usable = np.asarray(np.isfinite(vertices).all(axis=1))
    faces = faces[usable[faces].all(axis=1)]
    mirrored = np.prod(shape.scale) * np.linalg.det(shape.pose[:3, :3]) < 0
    return Mesh(vertices, faces[:, ::-1] if mirrored else faces, mesh.name)


def _take_group(mesh: Mesh, name: str, options: HullOptions, out: ShapeParts) -> None:
    points = mesh.vertices[np.unique(mesh.faces)]
    hull, note = solid_hull(points, options.min_thickness)
    if hull is None:
        if len(mesh.vertices):
            out.warnings.append(f"{name} {note}, left out")
    elif not note and _is_no_convex_group(mesh, hull):
        out.warnings.append(f"{name} is a group but not convex; decomposed")
        _take_soup([mesh], name, options, out)
    else:
        if note:
            out.warnings.append(f"{name} is flat: thickened to {options.min_thickness * 1000:g} mm")
        out.items.append(Convex(hull, "group", points if note else None))
        out.enclose(hull.volume)


def _is_no_convex_group(mesh: Mesh, hull: Hull) -> bool:
    """Whether a closed group is far from convex. Groups that name themselves convex, and open ones, are believed."""
    if "convex" in mesh.name.lower() or len(mesh.faces) > MOST_FACES:
        return False
    vertices, faces = clean(mesh.vertices, mesh.faces)
    solid = parts(vertices, faces)
    if not solid or any(p.hollow or not p.closed for p in solid):
        return False
    volume = sum(p.volume for p in solid)
    return volume > 0 and hull.volume > GROUP_RATIO * volume


def _take_soup(meshes: list[Mesh], label: str, options: HullOptions, out: ShapeParts) -> None:
    """A mesh that says nothing about its convex parts."""
    vertices, faces = _joined(meshes)
    everything = vertices[np.unique(faces)] if len(faces) else vertices[:0]
    whole, note = solid_hull(everything, options.min_thickness)
    if whole is None:
        out.warnings.append(f"{label} {note}, left out")
        return
    if note:
        out.warnings.append(f"{label} is flat: thickened to {options.min_thickness * 1000:g} mm")
        out.items.append(Convex(whole, "hull", everything))
        return
    if len(faces) > MOST_FACES:
        out.warnings.append(f"{label} has {len(faces)} faces; simplified before convex decomposition")
        vertices, faces = decimate(vertices, faces, MOST_FACES)
    vertices, faces = clean(vertices, faces)
    if is_thin_shell(whole, vertices[faces]):
        out.items.append(Convex(whole, "hull"))
        out.enclose(whole.volume)
        return
    solid = parts(vertices, faces)
    if not solid:
        out.warnings.append(f"{label} consists of flat sheets; its convex hull is used")
        out.items.append(Convex(whole, "hull"))
        return
    volume = enclosed_volume(solid, whole)
    out.enclose(volume)
    if options.whole_meshes or options.max_hulls == 1:  # pieces would be merged into it
        out.items.append(Convex(whole, "hull"))
        return
    ratio, depth = options.hull_ratio, options.hull_depth
    hollow = any(p.hollow for p in solid)
    if not hollow and hull_stands_for(whole, vertices[faces], volume, ratio, depth):
        out.items.append(Convex(whole, "hull"))
        return
    for part in _fewer(solid):
        if part.hollow:
            out.warnings.append(f"{label}: a surface open at the top is taken for a hollow container")
        elif is_thin_shell(part.hull, part.triangles) or hull_stands_for(
            part.hull, part.triangles, part.volume, ratio, depth
        ):
            out.items.append(Convex(part.hull, "component" if len(solid) > 1 else "hull"))
            continue
        out.items.append(Concave(part, label))


def _fewer(solid: list[MeshComponent]) -> list[MeshComponent]:
    """At most MOST_PARTS parts; the small rest is joined, as hulls, to the nearest of the large."""
    if len(solid) <= MOST_PARTS:
        return solid
    large, small = solid[:MOST_PARTS], solid[MOST_PARTS:]
    middles = np.array([p.hull.vertices.mean(axis=0) for p in large])
    for part in small:
        i = int(np.linalg.norm(middles - part.hull.vertices.mean(axis=0), axis=1).argmin())
        joint, _ = solid_hull(np.concatenate([large[i].hull.vertices, part.hull.vertices]), 0.0)
        if joint is not None:
            large[i] = dataclasses.replace(
                large[i],
                vertices=joint.vertices,
                faces=joint.faces,
                hull=joint,
                volume=joint.volume,
                closed=True,
                hollow=False,
            )
    return large


def _joined(meshes: list[Mesh]) -> tuple[np.ndarray, np.ndarray]:
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    vertices = [m.vertices for m in meshes] or [np.zeros((0, 3))]
    faces = [m.faces + o for m, o in zip(meshes, offsets, strict=False)] or [np.zeros((0, 3), np.int64)]
    return np.concatenate(vertices), np.concatenate(faces)
