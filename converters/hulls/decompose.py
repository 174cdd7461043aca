"""A solid that is not convex, cut up: into exact boxes where it is made of them, else by CoACD, else its hull."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh

from . import coacd_process
from . import piece_cache as cache
from .budget import Budgeted, Merged, keep_to_budget
from .convex import Hull, clip_to, hull_of, solid_hull, union_mesh, union_volume
from .mesh_parts import MeshComponent, decimate, signed_volume
from .openings import Openings
from .pieces import HullOptions, HullPieceSource
from .rectilinear import boxes_of
from .shapes import Convex

MOST_FACES = 20_000
"""Meshes with more are made coarser before CoACD sees them."""

MOST_SHEET_FACES = 400
"""The same for a sheet, whose faces become pieces."""

LADDER = (
    {"threshold": 1.0, "mcts_iterations": 150, "preprocess_resolution": 50},
    {"threshold": 2.0, "mcts_iterations": 60, "preprocess_resolution": 30},
    {"threshold": 4.0, "mcts_iterations": 30, "preprocess_resolution": 20},
)
"""CoACD settings from fine to coarse: `threshold` multiplies the requested one. Measured on a thick bowl: 9, 3.5 and
1.8 s of processor time; on an open handle, which CoACD rebuilds as voxels: 63, 13 and 1.2 s."""
FINE_FROM, MIDDLE_FROM = 0.5, 0.15
"""A part is cut with the first settings if its diagonal is this share of its link's, with the second from the other on:
what is small in its link adds little to the link's error, however coarse its pieces are."""
LEAST_SECONDS = 4.0
"""Processor time that every part gets, however many there are."""
RECUT = {"threshold": 0.03, "mcts_iterations": 60, "preprocess_mode": "off"}
"""CoACD settings for pieces that the budget cannot merge well; what they enclose together is a closed surface."""
RECUT_FACES, RECUT_SECONDS = 1500, 15.0
"""CoACD is given no surface of more faces, and no more processor time: on 90 wires of a dishwasher's rack (5,000 faces)
it found nothing in 60 s, and wires cannot be cut into fewer pieces anyway."""


COARSE_FACES = 1500
"""Faces that CoACD sees of a part of a large model. A torus of 20,000 faces takes 28 s of processor time as it is, and
3 s at this number and the second step of `LADDER`."""
COARSE_TOLERANCES = (0.003, 0.01, 0.03)
"""Distance by which the surface of such a part may be moved, relative to its diagonal: the first that is enough."""


@dataclasses.dataclass
class CutTask:
    """A part to cut.

    effort: the first step of `LADDER` to try. seconds: of processor time for it. coarse: make its mesh coarser first.
    """

    part: MeshComponent
    options: HullOptions
    effort: int = 0
    seconds: float = 60.0
    coarse: bool = False


@dataclasses.dataclass
class HullCut:
    """Convex pieces of one part, their source, and warnings for the user.

    stopped: time or a signal ended a finer try: the pieces may be better on another day, so they are not to be kept.
    seconds: it took.
    """

    hulls: list[Hull]
    source: HullPieceSource
    warnings: list[str]
    stopped: bool = False
    seconds: float = 0.0


def effort_for(share: float) -> int:
    """First step of `LADDER` for a part whose diagonal is this share of its link's."""
    return 0 if share >= FINE_FROM else 1 if share >= MIDDLE_FROM else 2


def cut_part(task: CutTask) -> HullCut:
    """Cuts a part whose own hull is a bad fit. No piece reaches beyond the part's hull."""
    started = time.perf_counter()
    part = task.part
    boxes = boxes_of(part.vertices, part.faces, part.volume) if part.closed and not part.hollow else None
    if part.hollow:
        cut = HullCut(sheet_hulls(part, task.options.min_thickness), "sheet", [])
    elif boxes:
        cut = HullCut(boxes, "boxes", [])
    else:
        cut = _coacd(part, task)
    cut.hulls = [h for hull in cut.hulls if (h := clip_to(hull, part.hull)) is not None]
    cut.seconds = time.perf_counter() - started
    return cut


def recut_to_budget(
    found: Sequence[Convex], others: Sequence[Hull], options: HullOptions, warnings: list[str]
) -> list[Convex]:
    """The pieces within the budget: merged, or all cut up again where merging fills too much.

    Args:
      others: pieces of the link that stay as they are; they count.
      warnings: gets a line where the budget is too small.
    """
    assert options.max_hulls is not None
    most = max(options.max_hulls - len(others), 1)
    if len(others) >= options.max_hulls:
        warnings.append(f"{len(others)} primitives and {len(found)} hulls are over the budget of {options.max_hulls}")
    hulls = [f.hull for f in found]
    few = max(options.few_hulls - len(others), 1)
    reference = _inside_of_sheets(found)
    best = keep_to_budget(hulls, others, few, most, options.max_volume_error, reference)
    source: HullPieceSource = "merged"
    if best.needed > len(best.pieces) and reference is None and most > few:  # fewer than few is the user's own wish
        recut = _recut(hulls, others, most, options)
        if recut is not None and (recut.open, -recut.volume_error) > (best.open, -best.volume_error):
            best, source = recut, "recut"
    if best.volume_error > options.max_volume_error or not best.open:
        closed = "" if best.open else " and close an opening"
        warnings.append(
            f"{len(best.pieces)} pieces instead of {len(found)} enclose {best.volume_error:.0%} more{closed}:"
            f" --max-hulls {best.needed + len(others)} would keep that under {options.max_volume_error:.0%}"
        )
    if source == "recut":
        return [Convex(p.hull, source) for p in best.pieces]
    return [found[p.members[0]] if len(p.members) == 1 else Convex(p.hull, source) for p in best.pieces]


def _inside_of_sheets(found: Sequence[Convex]) -> float | None:
    """m3 of the hull of all pieces where some are of a sheet, else None.

    The thickness of a sheet, and so its volume, is our choice: what counts is how much of its inside is filled.
    """
    if all(f.source != "sheet" for f in found):
        return None
    whole = hull_of(np.concatenate([f.hull.vertices for f in found]))
    return None if whole is None else whole.volume


def _recut(hulls: list[Hull], others: Sequence[Hull], most: int, options: HullOptions) -> Budgeted | None:
    """At most `most` pieces of what the hulls enclose together, or None."""
    vertices, faces = union_mesh(hulls)
    volume = signed_volume(vertices[faces])
    pieces = boxes_of(vertices, faces, volume)
    if pieces is None or len(pieces) > most:
        if len(faces) > RECUT_FACES:
            return None
        parameters = {**RECUT, "max_convex_hull": most, "seed": options.seed}
        try:
            points = coacd_process.run_coacd(
                vertices, faces, parameters, cpu_limit=min(RECUT_SECONDS, options.time_limit), threads=options.threads
            )
        except coacd_process.DecompositionError:
            return None
        pieces = [h for p in points if (h := hull_of(p)) is not None]
    if not 0 < len(pieces) <= most:
        return None
    error = union_volume([*pieces, *others]) / union_volume([*hulls, *others]) - 1.0
    is_open = Openings([*hulls, *others]).stay_open([*pieces, *others])
    return Budgeted([Merged(h, (i,)) for i, h in enumerate(pieces)], abs(error), is_open, len(hulls))


def sheet_hulls(part: MeshComponent, thickness: float) -> list[Hull]:
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


def _coacd(part: MeshComponent, task: CutTask) -> HullCut:
    options = task.options
    effort = (
        task.effort if part.closed else max(task.effort, 1)
    )  # CoACD rebuilds an open mesh as voxels: slow when fine
    rules: list[Any] = [options.coacd_threshold, options.seed, options.max_volume_error, effort, LADDER]
    if task.coarse:
        rules += [COARSE_FACES, COARSE_TOLERANCES]
    key = cache.key_of("coacd", _version(), part.vertices, part.faces, part.closed, rules)
    if options.cache:
        known = cache.load(key)
        if known is not None:
            facts, arrays = known
            hulls = [hull_of(arrays[f"piece_{i}"]) for i in range(int(facts["count"]))]
            return HullCut([h for h in hulls if h is not None], "coacd", list(facts["warnings"]))
    cut = _ladder(part, task, effort)
    if cut.source == "coacd" and options.cache and not cut.warnings:
        arrays = {f"piece_{i}": h.vertices for i, h in enumerate(cut.hulls)}
        cache.store(key, {"count": len(cut.hulls), "warnings": cut.warnings}, arrays)
    return cut


def _ladder(part: MeshComponent, task: CutTask, effort: int) -> HullCut:
    """Tries settings from `effort` on: coarser ones where they fail, a finer one where the pieces enclose too much."""
    options = task.options
    vertices, faces = coarse_mesh(part) if task.coarse else decimate(part.vertices, part.faces, MOST_FACES)
    seconds = max(task.seconds, min(LEAST_SECONDS, options.time_limit))
    warnings: list[str] = []
    stopped = False
    for step in range(effort, len(LADDER)):
        seconds = seconds / 2 if step < len(LADDER) - 1 else seconds
        try:
            hulls = _try(part, vertices, faces, step, seconds, options)
        except coacd_process.DecompositionError as e:
            threshold = _settings(step, options)["threshold"]
            warnings.append(f"convex decomposition (threshold {threshold:g}) {e}")
            stopped = stopped or e.stopped
            continue
        if step == effort and step == 1 and part.closed and _excess(hulls, part) > options.max_volume_error:
            try:
                finer = _try(part, vertices, faces, step - 1, seconds, options)
                hulls = min(hulls, finer, key=lambda h: _excess(h, part))
            except coacd_process.DecompositionError:
                pass  # what there is will do
        return HullCut(hulls, "coacd", warnings, stopped)
    warnings.append(f"a single hull approximates a concave shape ({_times(part)})")
    return HullCut([part.hull], "fallback", warnings, stopped)


def coarse_mesh(part: MeshComponent) -> tuple[np.ndarray, np.ndarray]:
    """The part's vertices and faces, of about `COARSE_FACES` faces or fewer.

    Edge collapse by quadrics alone keeps slivers, of which meshes out of CAD programs consist, so that a closed mesh is
    made simpler by a tolerance.
    """
    import manifold3d

    vertices, faces = part.vertices, part.faces
    if part.closed and len(faces) > COARSE_FACES:
        solid = manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(vertices), faces.astype(np.uint64)))
        if solid.status() == manifold3d.Error.NoError:
            for tolerance in COARSE_TOLERANCES:
                mesh = solid.simplify(tolerance * part.hull.diagonal).to_mesh64()
                if 4 <= len(mesh.tri_verts) < len(faces):
                    vertices, faces = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, np.int64)
                if len(faces) <= COARSE_FACES:
                    break
    return decimate(vertices, faces, COARSE_FACES)


def _settings(step: int, options: HullOptions) -> dict[str, Any]:
    threshold = min(max(LADDER[step]["threshold"] * options.coacd_threshold, 0.01), 1.0)
    return {**LADDER[step], "threshold": threshold, "seed": options.seed}


def _try(
    part: MeshComponent, vertices: np.ndarray, faces: np.ndarray, step: int, seconds: float, options: HullOptions
) -> list[Hull]:
    """CoACD's pieces, clipped to the part's hull: it inflates a mesh that it has to rebuild as voxels."""
    points = coacd_process.run_coacd(
        vertices, faces, _settings(step, options), cpu_limit=seconds, threads=options.threads
    )
    solid = (solid_hull(p, options.min_thickness)[0] for p in points)
    hulls = [h for s in solid if s is not None and (h := clip_to(s, part.hull)) is not None]
    if not hulls:
        raise coacd_process.DecompositionError("produced no solid piece")
    return hulls


def _excess(hulls: Sequence[Hull], part: MeshComponent) -> float:
    """By how much the pieces enclose more than the part, relative."""
    return union_volume(hulls) / part.volume - 1.0 if part.volume > 0 else 0.0


def _times(part: MeshComponent) -> str:
    return f"{part.hull.volume / part.volume:.1f} times its volume" if part.volume > 0 else "it encloses nothing"


def _version() -> str:
    import importlib.metadata

    return importlib.metadata.version("coacd")
