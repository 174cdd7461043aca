"""A solid that is not convex, cut up: into exact boxes where it is made of them, else by CoACD, else its hull."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import trimesh

from ..base import cache
from . import workers
from .convex import Hull, hull_of, solid_hull
from .mesh_parts import Part, decimate
from .pieces import HullOptions, PieceSource
from .rectilinear import boxes_of

MOST_FACES = 20_000
"""Meshes with more are made coarser before CoACD sees them."""

MOST_SHEET_FACES = 400
"""The same for a sheet, whose faces become pieces."""

LADDER = (
    {"threshold": 1.0, "mcts_iterations": 150, "preprocess_resolution": 50},
    {"threshold": 2.0, "mcts_iterations": 60, "preprocess_resolution": 30},
    {"threshold": 4.0, "mcts_iterations": 30, "preprocess_resolution": 20},
)
"""CoACD settings from fine to coarse: `threshold` multiplies the asked one. Each step gets half of the time left."""


@dataclasses.dataclass
class Cut:
    """Convex pieces of one part, where they are from, and what to tell the user.

    stopped: time or a signal ended a finer try: the pieces may be better on another day, so they are not to be kept.
    """

    hulls: list[Hull]
    source: PieceSource
    warnings: list[str]
    stopped: bool = False


def cut_part(part: Part, options: HullOptions, deadline: float) -> Cut:
    """Cuts a part whose own hull is a bad fit.

    Args:
      deadline: `time.monotonic()` after which no more is tried.
    """
    if part.hollow:
        return Cut(sheet_hulls(part, options.min_thickness), "sheet", [])
    if part.closed:
        boxes = boxes_of(part.vertices, part.faces, part.volume)
        if boxes:
            return Cut(boxes, "boxes", [])
    return _coacd(part, options, deadline)


def sheet_hulls(part: Part, thickness: float) -> list[Hull]:
    """The sides of a surface without thickness, each made so thick to its inner side: hollow containers stay hollow.

    Flat sides are one hull where they are convex; other faces are one each.
    """
    vertices, faces = decimate(part.vertices, part.faces, MOST_SHEET_FACES)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    whole = [list(side) for side in mesh.facets]
    sides: list[list[int]] = []
    for side in whole:
        hull, _ = solid_hull(vertices[np.unique(faces[side])], 1.0)  # 1 m thick: its volume is its area
        convex = hull is not None and hull.volume <= 1.02 * float(mesh.area_faces[side].sum())
        sides += [side] if convex else [[face] for face in side]
    taken = {face for side in whole for face in side}
    sides += [[face] for face in range(len(faces)) if face not in taken]
    found = []
    for side in sides:
        points = vertices[np.unique(faces[side])]
        inward = -mesh.face_normals[side].mean(axis=0)
        found.append(hull_of(np.concatenate([points, points + thickness * inward])))
    return [h for h in found if h is not None]


def _coacd(part: Part, options: HullOptions, deadline: float) -> Cut:
    key = cache.key_of("coacd", _version(), part.vertices, part.faces, options.coacd_threshold, options.seed, LADDER)
    if options.cache:
        known = cache.load(key)
        if known is not None:
            facts, arrays = known
            hulls = [hull_of(arrays[f"piece_{i}"]) for i in range(int(facts["count"]))]
            return Cut([h for h in hulls if h is not None], "coacd", list(facts["warnings"]))
    vertices, faces = decimate(part.vertices, part.faces, MOST_FACES)
    warnings: list[str] = []
    stopped = False
    ladder = LADDER if part.closed else LADDER[1:]  # CoACD rebuilds an open mesh as voxels: slow when fine
    for step, settings in enumerate(ladder):
        left = deadline - time.monotonic()
        if left <= 0:
            warnings.append("convex decomposition ran out of time")
            stopped = True
            break
        limit = left if step == len(ladder) - 1 else left / 2
        threshold = min(max(settings["threshold"] * options.coacd_threshold, 0.01), 1.0)
        parameters = {**settings, "threshold": threshold, "seed": options.seed}
        try:
            points = workers.run_coacd(vertices, faces, parameters, time_limit=limit, threads=options.threads)
        except workers.WorkerError as e:
            warnings.append(f"convex decomposition (threshold {threshold:g}) {e}")
            stopped = stopped or e.stopped
            continue
        hulls = [h for h in (solid_hull(p, options.min_thickness)[0] for p in points) if h is not None]
        if not hulls:
            warnings.append(f"convex decomposition (threshold {threshold:g}) gave nothing solid")
            continue
        arrays = {f"piece_{i}": h.vertices for i, h in enumerate(hulls)}
        if options.cache and not warnings:
            cache.store(key, {"count": len(hulls), "warnings": warnings}, arrays)
        return Cut(hulls, "coacd", warnings, stopped)
    warnings.append(f"one hull stands for a shape that is not convex ({_times(part)})")
    return Cut([part.hull], "fallback", warnings, stopped)


def _times(part: Part) -> str:
    return f"{part.hull.volume / part.volume:.1f} times its volume" if part.volume > 0 else "it encloses nothing"


def _version() -> str:
    import importlib.metadata

    return importlib.metadata.version("coacd")
