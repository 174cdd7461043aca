"""Convex pieces of one link's collision shapes: the converter's way from meshes to collision geoms.

Per shape: primitives stay; each `o`/`g` group is one hull (iGibson's convention, dataset_format.md fact 4); a mesh
without groups is its hull where that fits, else the hulls of its connected parts, else cut up (`decompose`). Then for
the whole link: copies and contained pieces go, the budget merges, every piece is tried as box, sphere or cylinder, and
the rest get at most so many vertices.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base import cache
from ..base.description import Mesh, Shape
from .budget import drop_contained, merge_to_budget
from .convex import Hull, distance_outside, reduce_vertices, solid_hull, union_volume
from .decompose import cut_part
from .fitting import fit_primitive, primitive_hull, primitive_volume
from .mesh_parts import clean, decimate, enclosed_volume, hull_stands_for, parts
from .pieces import HullOptions, LinkHulls, Piece, PieceSource

__all__ = ["HullOptions", "LinkHulls", "Piece", "decompose_link", "is_cached"]

GROUP_RATIO = 1.3
"""A group whose hull has more than this many times its mesh's volume is no convex piece, whatever the file says
(dataset_format.md section 8.4)."""

MOST_FACES = 60_000
"""Meshes with more are made coarser first."""

MOST_PARTS = 400
"""A mesh in more connected parts keeps so many of the largest; the small ones are joined to their nearest."""


@dataclasses.dataclass
class _Found:
    hull: Hull
    source: PieceSource


def decompose_link(shapes: Sequence[Shape], options: HullOptions | None = None) -> LinkHulls:
    """Turns all collision shapes of one link into convex pieces in the link frame.

    `Shape.scale` is applied before `Shape.pose`; a caller that has baked scale and pose into the vertices hands over
    shapes with scale (1, 1, 1) and pose identity. Arguments and result can be pickled, so a process pool can map it.
    Never raises on bad geometry: what cannot be used is left out and named in `warnings`.
    """
    options = options or HullOptions()
    key = _key(shapes, options)
    if options.cache:
        known = cache.load(key)
        if known is not None:
            return _unpack(*known)
    result = _decompose(shapes, options)
    if options.cache and not result.stopped:
        cache.store(key, *_pack(result))
    return result


def is_cached(shapes: Sequence[Shape], options: HullOptions) -> bool:
    """Whether `decompose_link` would find its result in the cache, and so take no time worth a process of its own."""
    return options.cache and cache.holds(_key(shapes, options))


def _decompose(shapes: Sequence[Shape], options: HullOptions) -> LinkHulls:
    started = time.monotonic()
    out = LinkHulls()
    exact: list[Piece] = []
    found: list[_Found] = []
    for number, shape in enumerate(shapes):
        label = shape.name or (shape.file.name if shape.file else f"collision {number}")
        if shape.kind == "mesh":
            found += _from_mesh(shape, label, options, started + options.time_limit, out)
        else:
            piece = _from_primitive(shape, label, out)
            if piece is not None:
                exact.append(piece)
    slack = 1e-6 * max((f.hull.diagonal for f in found), default=0.0)
    found = [found[i] for i in drop_contained([f.hull for f in found], slack)]
    exact_hulls = [h for h in (_hull(p) for p in exact) if h is not None]
    out.before = len(found) + len(exact)
    out.volume_before = union_volume([f.hull for f in found] + exact_hulls)
    pieces = exact + [_finish(f, options) for f in _budget(found, len(exact), options, out)]
    out.pieces = pieces
    out.volume = _union_of(pieces)
    out.method = "+".join(sorted({p.source for p in pieces}))
    out.seconds = time.monotonic() - started
    return out


# ---------------------------------------------------------------------------------------------------- shapes


def _from_primitive(shape: Shape, label: str, out: LinkHulls) -> Piece | None:
    size = np.array(shape.size, float)
    scale = np.array(shape.scale, float)
    if shape.kind == "box":
        size = size * np.abs(scale)
    elif np.ptp(np.abs(scale)) <= 1e-9:
        size = size * abs(scale[0])
    else:
        out.warnings.append(f"{label}: a {shape.kind} cannot be scaled unevenly; its scale is left out")
    needed = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2}.get(shape.kind)
    if needed is None or len(size) != needed or not np.all(np.isfinite(size)) or np.any(size <= 0):
        out.warnings.append(f"{label}: {shape.kind} of size {tuple(shape.size)} left out")
        return None
    sizes = tuple(float(s) for s in size)
    hull = primitive_hull(shape.kind, sizes, shape.pose)
    if hull is None:
        out.warnings.append(f"{label}: {shape.kind} of size {sizes} is too thin, left out")
        return None
    volume = primitive_volume(shape.kind, sizes)
    out.source_volume = (out.source_volume or 0.0) + volume
    kind: Any = shape.kind
    return Piece(kind, hull.vertices, hull.faces, shape.pose.copy(), sizes, "primitive", volume)


def _from_mesh(shape: Shape, label: str, options: HullOptions, deadline: float, out: LinkHulls) -> list[_Found]:
    meshes = [_placed(mesh, shape) for mesh in shape.meshes]
    if not shape.grouped:
        return _from_soup(meshes, label, options, deadline, out, joined=True)
    found: list[_Found] = []
    for number, mesh in enumerate(meshes):
        name = f"{label} group '{mesh.name or number}'"
        hull, note = solid_hull(mesh.vertices[np.unique(mesh.faces)], options.min_thickness)
        if hull is None:
            if len(mesh.vertices):
                out.warnings.append(f"{name} {note}, left out")
        elif not note and _no_convex_group(mesh, hull):
            out.warnings.append(f"{name} is not convex although it is a group: cut up")
            found += _from_soup([mesh], name, options, deadline, out, joined=False)
        else:
            if note:
                out.warnings.append(f"{name} is flat: thickened to {options.min_thickness * 1000:g} mm")
            found.append(_Found(hull, "group"))
            out.source_volume = (out.source_volume or 0.0) + hull.volume
    return found


def _no_convex_group(mesh: Mesh, hull: Hull) -> bool:
    """Whether a closed group is far from convex. Groups that name themselves convex, and open ones, are believed."""
    if "convex" in mesh.name.lower() or len(mesh.faces) > MOST_FACES:
        return False
    vertices, faces = clean(mesh.vertices, mesh.faces)
    solid = parts(vertices, faces)
    if not solid or any(p.hollow or not p.closed for p in solid):
        return False
    volume = sum(p.volume for p in solid)
    return volume > 0 and hull.volume > GROUP_RATIO * volume


def _from_soup(
    meshes: list[Mesh], label: str, options: HullOptions, deadline: float, out: LinkHulls, *, joined: bool
) -> list[_Found]:
    """Pieces of a mesh that says nothing about its convex parts."""
    vertices, faces = _joined(meshes)
    everything = vertices[np.unique(faces)] if len(faces) else vertices[:0]
    whole, note = solid_hull(everything, options.min_thickness)
    if whole is None:
        out.warnings.append(f"{label} {note}, left out")
        return []
    if note:
        out.warnings.append(f"{label} is flat: thickened to {options.min_thickness * 1000:g} mm")
        return [_Found(whole, "hull")]
    if len(faces) > MOST_FACES:
        out.warnings.append(f"{label} has {len(faces)} faces: made coarser before its convex parts are sought")
        vertices, faces = decimate(vertices, faces, MOST_FACES)
    vertices, faces = clean(vertices, faces)
    solid = parts(vertices, faces)
    if not solid:
        out.warnings.append(f"{label} consists of flat sheets: its hull stands for it")
        return [_Found(whole, "hull")]
    volume = enclosed_volume(solid, whole)
    out.source_volume = (out.source_volume or 0.0) + volume
    ratio, depth = options.hull_ratio, options.hull_depth
    hollow = any(p.hollow for p in solid)
    if not hollow and hull_stands_for(whole, vertices[faces], volume, ratio, depth):
        return [_Found(whole, "hull")]
    found: list[_Found] = []
    for part in _fewer(solid):
        if part.hollow:
            out.warnings.append(f"{label}: a surface open at the top is taken for a hollow container")
        elif hull_stands_for(part.hull, part.triangles, part.volume, ratio, depth):
            found.append(_Found(part.hull, "component" if len(solid) > 1 else "hull"))
            continue
        cut = cut_part(part, options, deadline)
        out.warnings += [f"{label}: {w}" for w in cut.warnings]
        out.stopped = out.stopped or cut.stopped
        found += [_Found(h, cut.source) for h in cut.hulls]
    return found


def _fewer(solid: list) -> list:
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


def _placed(mesh: Mesh, shape: Shape) -> Mesh:
    """The mesh in the link frame without unusable faces; a mirroring scale turns the faces round."""
    vertices = np.asarray(mesh.vertices, np.float64).reshape(-1, 3) * np.array(shape.scale, float)
    vertices = vertices @ shape.pose[:3, :3].T + shape.pose[:3, 3]
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    faces = faces[np.all((faces >= 0) & (faces < len(vertices)), axis=1)]
    usable = np.asarray(np.isfinite(vertices).all(axis=1))
    faces = faces[usable[faces].all(axis=1)]
    mirrored = np.prod(shape.scale) * np.linalg.det(shape.pose[:3, :3]) < 0
    return Mesh(vertices, faces[:, ::-1] if mirrored else faces, mesh.name)


def _joined(meshes: list[Mesh]) -> tuple[np.ndarray, np.ndarray]:
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    vertices = [m.vertices for m in meshes] or [np.zeros((0, 3))]
    faces = [m.faces + o for m, o in zip(meshes, offsets, strict=False)] or [np.zeros((0, 3), np.int64)]
    return np.concatenate(vertices), np.concatenate(faces)


# ---------------------------------------------------------------------------------------------------- the whole link


def _budget(found: list[_Found], taken: int, options: HullOptions, out: LinkHulls) -> list[_Found]:
    if options.max_hulls is None:
        return found
    limit = max(options.max_hulls - taken, 1)
    if taken + 1 > options.max_hulls and found:
        out.warnings.append(f"{taken} primitives and {len(found)} hulls are over the budget of {options.max_hulls}")
    if len(found) <= limit:
        return found
    merged = merge_to_budget([f.hull for f in found], limit)
    return [_Found(m.hull, "merged" if len(m.members) > 1 else found[min(m.members)].source) for m in merged]


def _finish(found: _Found, options: HullOptions) -> Piece:
    hull = found.hull
    if options.primitives:
        fit = fit_primitive(hull)
        if fit is not None:
            return Piece(
                fit.kind, hull.vertices, hull.faces, fit.pose, fit.size, found.source, fit.volume, fit.distance,
                fit.volume_error,
            )  # fmt: skip
    small = reduce_vertices(hull, options.max_hull_vertices)
    away = 0.0
    if small is not hull:
        away = max(distance_outside(hull.vertices, small), distance_outside(small.vertices, hull))
    return Piece(
        "hull", small.vertices, small.faces, source=found.source, volume=small.volume, fit_error=away,
        volume_error=small.volume / hull.volume - 1,
    )  # fmt: skip


def _hull(piece: Piece) -> Hull | None:
    return solid_hull(piece.vertices, 1e-3)[0]


def _union_of(pieces: list[Piece]) -> float:
    """m3 of what is emitted. Round primitives count by their polyhedra, each made good for what it lacks."""
    hulls = [primitive_hull(p.kind, p.size, p.pose) if p.kind != "hull" else _hull(p) for p in pieces]
    lost = sum(p.volume - h.volume for p, h in zip(pieces, hulls, strict=True) if h is not None and p.kind != "hull")
    return union_volume([h for h in hulls if h is not None]) + lost


# ---------------------------------------------------------------------------------------------------- cache


def _key(shapes: Sequence[Shape], options: HullOptions) -> str:
    rules = dataclasses.asdict(options)
    for no_matter in ("threads", "cache"):
        del rules[no_matter]
    given = [
        [s.kind, s.pose, [float(x) for x in s.size], [float(x) for x in s.scale], s.grouped, s.name]
        + [[m.name, np.asarray(m.vertices, np.float64), np.asarray(m.faces, np.int64)] for m in s.meshes]
        for s in shapes
    ]
    return cache.key_of("link", rules, given)


def _pack(result: LinkHulls) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    facts = {f.name: getattr(result, f.name) for f in dataclasses.fields(result) if f.name not in ("pieces", "cached")}
    arrays: dict[str, np.ndarray] = {}
    facts["pieces"] = []
    for i, piece in enumerate(result.pieces):
        arrays |= {f"{i}.vertices": piece.vertices, f"{i}.faces": piece.faces, f"{i}.pose": piece.pose}
        facts["pieces"].append(
            {k: v for k, v in vars(piece).items() if not isinstance(v, np.ndarray)} | {"size": list(piece.size)}
        )
    return json.loads(json.dumps(facts)), arrays


def _unpack(facts: dict[str, Any], arrays: dict[str, np.ndarray]) -> LinkHulls:
    pieces = [
        Piece(**{**p, "size": tuple(p["size"])}, vertices=arrays[f"{i}.vertices"], faces=arrays[f"{i}.faces"],
              pose=arrays[f"{i}.pose"])
        for i, p in enumerate(facts["pieces"])
    ]  # fmt: skip
    rest = {f.name: facts[f.name] for f in dataclasses.fields(LinkHulls) if f.name not in ("pieces", "cached")}
    return LinkHulls(pieces=pieces, cached=True, **rest)
