"""Convex pieces of links' collision shapes: the converter's way from meshes to collision geoms.

In two steps, since convexity survives every linear map. `decompose_links` does the work once per model, at the size
the source has: shapes are taken apart (`shapes`), what is not convex is cut up (`decompose`), copies and contained
pieces go, and the budget merges what it must. `scaled_pieces` then gives the collision geoms of one size: every piece
is mapped, tried as box, sphere or cylinder, and the rest get at most so many vertices.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress

from ..base.description import Shape
from ..base.process_pool import TaskPool
from . import piece_cache as cache
from .budget import drop_contained
from .convex import Hull, distance_outside, hull_of, reduce_vertices, solid_hull, union_volume
from .decompose import COARSE_FACES, COARSE_TOLERANCES, CutTask, cut_part, effort_for, recut_to_budget
from .fitting import fit_primitive, primitive_hull
from .pieces import HullOptions, HullPiece, HullPieceSource, LinkHulls
from .shapes import Concave, Convex, ShapeParts, label_of, primitive_piece, take_apart

__all__ = ["HullOptions", "HullPiece", "LinkHulls", "LinkPieces", "decompose_link", "decompose_links", "scaled_pieces"]

OUTSIDE = 5e-4
"""Metres that a piece may reach beyond the convex hull of its link's source meshes,"""
OUTSIDE_SHARE = 1e-3
"""and this share of that hull's diagonal. Recognised cylinders and spheres go round the facets of their source, and a
round convex body with too many vertices is replaced by one of the same volume and box (see `HullPiece.fit_error`)."""
CUT = ("boxes", "sheet", "coacd", "merged", "recut")
"""Sources of pieces that are a part of something larger."""


HEAVY_FACES = 2000
"""Faces from which on a mesh may take long to cut up,"""
FEW_HEAVY = 8
"""and so many of them that a model may have before it counts as large."""
LARGE_SECONDS = 600.0
"""Processor time that a large model's meshes share, where they need so much: CoACD's limit, not what it takes."""


@dataclasses.dataclass(frozen=True)
class ModelSize:
    """How much there is to cut up in a model. It depends on what is read only, so that results can be kept.

    heavy: meshes without groups of more than `HEAVY_FACES` faces.
    """

    heavy: int = 0

    @classmethod
    def of(cls, links: Mapping[str, Sequence[Shape]]) -> ModelSize:
        shapes = [shape for own in links.values() for shape in own if shape.kind == "mesh" and not shape.grouped]
        return cls(sum(sum(len(mesh.faces) for mesh in shape.meshes) > HEAVY_FACES for shape in shapes))

    @property
    def large(self) -> bool:
        """Its meshes are cut with coarser settings, made coarser first, and share their time."""
        return self.heavy > FEW_HEAVY

    def seconds(self, options: HullOptions) -> float:
        """Of processor time for the cuts of one link."""
        return min(options.time_limit, LARGE_SECONDS / self.heavy) if self.large else options.time_limit


@dataclasses.dataclass
class LinkPieces:
    """A link's meshes as convex pieces at the source's size. Its primitives are not among them.

    Attributes:
      pieces: within the budget.
      corners: [n, 3] points on the hull of all source meshes.
      before, volume_before, source_volume, warnings, stopped, seconds, cached: as in `LinkHulls`.
    """

    pieces: list[Convex] = dataclasses.field(default_factory=list)
    corners: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))
    before: int = 0
    volume_before: float = 0.0
    source_volume: float | None = None
    warnings: list[str] = dataclasses.field(default_factory=list)
    stopped: bool = False
    seconds: float = 0.0
    cached: bool = False


def decompose_link(shapes: Sequence[Shape], options: HullOptions | None = None) -> LinkHulls:
    """Turns all collision shapes of one link into convex pieces in the link frame, at the size they have.

    `Shape.scale` is applied before `Shape.pose`. Never raises on bad geometry: what cannot be used is left out and
    named in `warnings`.
    """
    options = options or HullOptions()
    found = decompose_links({"link": shapes}, options)["link"]
    return scaled_pieces(found, shapes, np.eye(3), options)


def decompose_links(
    links: Mapping[str, Sequence[Shape]],
    options: HullOptions,
    pool: TaskPool | None = None,
    progress: ProgressCallback = no_progress,
) -> dict[str, LinkPieces]:
    """The convex pieces of every link, at the size the shapes have; each link's are looked up in the cache first.

    Args:
      links: link -> its collision shapes.
      pool: does shapes and parts side by side; without one they are done here, one after the other.
    """
    pool, size = pool or TaskPool(1), ModelSize.of(links)
    keys = {name: _key(shapes, options, size) for name, shapes in links.items()}
    done = {name: known for name, key in keys.items() if options.cache and (known := _load(key)) is not None}
    missing = [name for name in links if name not in done]
    shapes = [
        (name, number, shape)
        for name in missing
        for number, shape in enumerate(links[name])
        if shape.kind == "mesh" and shape.meshes
    ]
    taken = pool.map(
        _take_apart,
        [(shape, label_of(shape, number), options) for _, number, shape in shapes],
        [f"link {name}: {label_of(shape, number)}" for name, number, shape in shapes],
        progress,
        lambda task: sum(len(mesh.faces) for mesh in task[0].meshes) <= HEAVY_FACES,
    )
    apart: dict[str, list[ShapeParts]] = {name: [] for name in missing}
    for (name, _, _), parts in zip(shapes, taken, strict=True):
        apart[name].append(parts)
    _cut_concave(apart, options, size, pool, progress)
    results = pool.map(
        _keep_to_budget,
        [(apart[name], links[name], options) for name in missing],
        [f"link {name}: pieces" for name in missing],
        progress,
        lambda task: sum(len(parts.items) for parts in task[0]) <= options.few_hulls,
    )
    for name, result in zip(missing, results, strict=True):
        done[name] = result
        if options.cache and not result.stopped:
            _store(keys[name], result)
    return {name: done[name] for name in links}


def all_cached(links: Mapping[str, Sequence[Shape]], options: HullOptions) -> bool:
    """Whether `decompose_links` would find its results in the cache, and so take no time worth a process of its own."""
    size = ModelSize.of(links)
    return options.cache and all(cache.holds(_key(shapes, options, size)) for shapes in links.values() if shapes)


def _take_apart(task: tuple[Shape, str, HullOptions]) -> ShapeParts:
    return take_apart(*task)


def _cut_concave(
    apart: Mapping[str, list[ShapeParts]],
    options: HullOptions,
    size: ModelSize,
    pool: TaskPool,
    progress: ProgressCallback,
) -> None:
    """Cuts up the concave parts of all links, side by side, and puts the pieces in their places."""
    tasks: list[CutTask] = []
    labels: list[str] = []
    for name, shapes in apart.items():
        concave = [item for parts in shapes for item in parts.items if isinstance(item, Concave)]
        if not concave:
            continue
        corners = np.concatenate([parts.corners for parts in shapes if len(parts.corners)])
        across = float(np.linalg.norm(np.ptp(corners, axis=0)))
        for number, item in enumerate(concave):
            effort = max(effort_for(item.part.hull.diagonal / across), int(size.large))
            tasks.append(CutTask(item.part, options, effort, size.seconds(options) / len(concave), size.large))
            labels.append(f"link {name}: part {number + 1} of {len(concave)}")
    cuts = iter(pool.map(cut_part, tasks, labels, progress))
    for shapes in apart.values():
        for parts in shapes:
            items: list[Convex | Concave] = []
            for item in parts.items:
                if isinstance(item, Convex):
                    items.append(item)
                    continue
                cut = next(cuts)
                items += [Convex(hull, cut.source) for hull in cut.hulls]
                parts.warnings += [f"{item.label}: {line}" for line in cut.warnings]
                parts.seconds += cut.seconds
                parts.stopped = parts.stopped or cut.stopped
            parts.items = items


def _keep_to_budget(task: tuple[list[ShapeParts], Sequence[Shape], HullOptions]) -> LinkPieces:
    """One link's pieces out of those of its shapes."""
    apart, shapes, options = task
    started = time.perf_counter()
    out = LinkPieces(stopped=any(parts.stopped for parts in apart))
    found = [item for parts in apart for item in parts.items if isinstance(item, Convex)]
    for parts in apart:
        out.warnings += parts.warnings
        if parts.volume is not None:
            out.source_volume = (out.source_volume or 0.0) + parts.volume
    corners = [parts.corners for parts in apart if len(parts.corners)]
    out.corners = np.concatenate(corners) if corners else out.corners
    slack = 1e-6 * max((f.hull.diagonal for f in found), default=0.0)
    found = [found[i] for i in drop_contained([f.hull for f in found], slack)]
    fixed = [p for i, s in enumerate(shapes) if s.kind != "mesh" and (p := primitive_piece(s, label_of(s, i), []))]
    others = [h for h in map(_hull, fixed) if h is not None]
    out.before = len(found) + len(fixed)
    out.volume_before = union_volume([f.hull for f in found] + others)
    if options.max_hulls is not None and found:
        found = recut_to_budget(found, others, options, out.warnings)
    out.pieces = found
    out.seconds = time.perf_counter() - started + sum(parts.seconds for parts in apart)
    return out


# ------------------------------------------------------------------------------------------------- pieces of one size


def scaled_pieces(
    found: LinkPieces, shapes: Sequence[Shape], linear: np.ndarray, options: HullOptions | None = None
) -> LinkHulls:
    """The collision geoms of a link at one size.

    Args:
      found: its meshes' pieces at the source's size.
      shapes: its collision shapes at the size wanted; only those that are primitives in the source are looked at.
      linear: [3, 3], the map of the link frame from the source's size to the one wanted.
    """
    options = options or HullOptions()
    started = time.perf_counter()
    factor = abs(float(np.linalg.det(linear)))
    out = LinkHulls(
        before=found.before,
        volume_before=found.volume_before * factor,
        source_volume=None if found.source_volume is None else found.source_volume * factor,
        warnings=list(found.warnings),
        stopped=found.stopped,
        cached=found.cached,
    )
    same = np.array_equal(linear, np.eye(3))
    pieces = found.pieces if same else [p for piece in found.pieces if (p := _mapped(piece, linear, options))]
    stretched: list[Convex] = []
    for number, shape in enumerate(shapes):
        if shape.kind == "mesh":
            if shape.was_primitive:
                taken = take_apart(shape, label_of(shape, number), options)
                stretched += [item for item in taken.items if isinstance(item, Convex)]
            continue
        piece = primitive_piece(shape, label_of(shape, number), out.warnings)
        if piece is not None:
            out.pieces.append(piece)
            out.source_volume = (out.source_volume or 0.0) + piece.volume
    corners = found.corners if same else found.corners @ linear.T
    bounds = hull_of(corners) if len(corners) else None
    out.pieces += [_finish(piece, bounds, options) for piece in pieces]
    out.pieces += [_finish(piece, None, options) for piece in stretched]
    out.volume = _union_of(out.pieces)
    out.method = "+".join(sorted({p.source for p in out.pieces}))
    out.seconds = found.seconds + time.perf_counter() - started
    return out


def _mapped(piece: Convex, linear: np.ndarray, options: HullOptions) -> Convex | None:
    points = piece.hull.vertices if piece.flat is None else piece.flat
    hull, _ = solid_hull(points @ linear.T, options.min_thickness)
    return None if hull is None else Convex(hull, piece.source)


def _finish(found: Convex, bounds: Hull | None, options: HullOptions) -> HullPiece:
    hull = found.hull
    if options.primitives:
        fit = fit_primitive(hull)
        if fit is not None and (fit.kind != "box" or _within(primitive_hull("box", fit.size, fit.pose), bounds)):
            return HullPiece(
                fit.kind, hull.vertices, hull.faces, fit.pose, fit.size, found.source, fit.volume, fit.distance,
                fit.volume_error,
            )  # fmt: skip
    small = reduce_vertices(hull, options.max_hull_vertices)
    if small is not hull and found.source in CUT and not _within(small, bounds):
        small = reduce_vertices(hull, options.max_hull_vertices, keep_volume=False)
    away = 0.0
    if small is not hull:
        away = max(distance_outside(hull.vertices, small), distance_outside(small.vertices, hull))
    return HullPiece(
        "hull", small.vertices, small.faces, source=found.source, volume=small.volume, fit_error=away,
        volume_error=small.volume / hull.volume - 1,
    )  # fmt: skip


def _within(hull: Hull | None, bounds: Hull | None) -> bool:
    """Whether no corner is farther outside than pieces may be; flat sources are thickened, so they bound nothing."""
    if hull is None or bounds is None:
        return True
    return bool(bounds.contains(hull.vertices, OUTSIDE + OUTSIDE_SHARE * bounds.diagonal).all())


def _hull(piece: HullPiece) -> Hull | None:
    return solid_hull(piece.vertices, 1e-3)[0]


def _union_of(pieces: list[HullPiece]) -> float:
    """m3 of what is emitted. Round primitives count by their polyhedra, each made good for what it lacks."""
    hulls = [primitive_hull(p.kind, p.size, p.pose) if p.kind != "hull" else _hull(p) for p in pieces]
    lost = sum(p.volume - h.volume for p, h in zip(pieces, hulls, strict=True) if h is not None and p.kind != "hull")
    return union_volume([h for h in hulls if h is not None]) + lost


# ---------------------------------------------------------------------------------------------------- cache

_FACTS = ("before", "volume_before", "source_volume", "warnings", "seconds")


def _key(shapes: Sequence[Shape], options: HullOptions, size: ModelSize) -> str:
    rules = dataclasses.asdict(options)
    if size.large:
        rules |= {"coarse": [COARSE_FACES, COARSE_TOLERANCES], "time_limit": size.seconds(options)}
    for no_matter in ("threads", "cache", "max_hull_vertices", "primitives"):
        del rules[no_matter]
    if not options.whole_meshes:
        del rules["whole_meshes"]
    given = [
        [s.kind, s.pose, [float(x) for x in s.size], [float(x) for x in s.scale], s.grouped, s.name]
        + [[m.name, np.asarray(m.vertices, np.float64), np.asarray(m.faces, np.int64)] for m in s.meshes]
        for s in shapes
    ]
    return cache.key_of("link", rules, given)


def _store(key: str, result: LinkPieces) -> None:
    facts: dict[str, Any] = {name: getattr(result, name) for name in _FACTS}
    facts["pieces"] = [{"source": p.source, "volume": p.hull.volume} for p in result.pieces]
    arrays: dict[str, np.ndarray] = {"corners": result.corners}
    for i, p in enumerate(result.pieces):
        arrays |= {f"{i}.vertices": p.hull.vertices, f"{i}.faces": p.hull.faces, f"{i}.planes": p.hull.planes}
        if p.flat is not None:
            arrays[f"{i}.flat"] = p.flat
    cache.store(key, json.loads(json.dumps(facts)), arrays)


def _load(key: str) -> LinkPieces | None:
    known = cache.load(key)
    if known is None:
        return None
    facts, arrays = known
    pieces = []
    for i, piece in enumerate(facts["pieces"]):
        source: HullPieceSource = piece["source"]
        hull = Hull(arrays[f"{i}.vertices"], arrays[f"{i}.faces"], arrays[f"{i}.planes"], piece["volume"])
        pieces.append(Convex(hull, source, arrays.get(f"{i}.flat")))
    return LinkPieces(pieces, arrays["corners"], cached=True, **{name: facts[name] for name in _FACTS})
