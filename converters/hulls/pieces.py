"""What a link's collision geometry becomes: convex pieces, and how good they are."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np

from ..base.options import ConvertOptions

HullPieceKind = Literal["box", "cylinder", "sphere", "capsule", "hull"]
HullPieceSource = Literal[
    "primitive", "group", "hull", "component", "boxes", "sheet", "coacd", "fallback", "merged", "recut"
]


@dataclasses.dataclass(frozen=True)
class HullOptions:
    """How collision geometry is turned into convex pieces.

    Attributes:
      max_hulls: most pieces per link; more are merged. None: no limit, for walls, floors and ceilings, whose segments
        must never be merged across a door.
      few_hulls: so many pieces are never merged: they cost too little to be worth any error.
      max_volume_error: between these two numbers a link has as few pieces as keep the error of its volume below this,
        relative, and its openings open.
      max_hull_vertices: most vertices per hull; fewer by best fit.
      primitives: try box, cylinder and sphere on every piece.
      hull_ratio: one hull stands for a mesh without groups if its volume is at most this many times the mesh's.
      hull_depth: and if no point of the hull is farther from the mesh than this, metres (or 5 % of the diagonal,
        whichever is less): a small door in a large wall changes the volume little.
      coacd_threshold: CoACD's concavity, relative to the mesh's size.
      time_limit: seconds of processor time for all CoACD runs on one link.
      min_thickness: flat pieces are thickened to this, metres.
      seed: CoACD's.
      whole_meshes: one hull for each mesh (or group of it), however concave.
      threads: CoACD's; does not change the result.
      cache: look up and keep results in the user's cache folder.
    """

    max_hulls: int | None = 64
    few_hulls: int = 16
    max_volume_error: float = 0.15
    max_hull_vertices: int = 32
    primitives: bool = True
    hull_ratio: float = 1.1
    hull_depth: float = 0.05
    coacd_threshold: float = 0.05
    time_limit: float = 60.0
    min_thickness: float = 1e-3
    seed: int = 0
    whole_meshes: bool = False
    threads: int = 1
    cache: bool = True

    @classmethod
    def of(cls, options: ConvertOptions, *, building: bool = False) -> HullOptions:
        """Those of a conversion. Wall segments are never merged: the gaps between them are doors."""
        return cls(
            max_hulls=None if building else options.max_hulls,
            max_hull_vertices=options.max_hull_vertices,
            seed=options.seed,
            cache=options.cache,
        )

    def __post_init__(self) -> None:
        if self.max_hulls is not None and self.max_hulls < 1:
            raise ValueError(f"max_hulls is {self.max_hulls}, must be at least 1")
        if self.max_hull_vertices < 8:
            raise ValueError(f"max_hull_vertices is {self.max_hull_vertices}, must be at least 8")


@dataclasses.dataclass
class HullPiece:
    """One convex collision geom, in the link frame, metres.

    Attributes:
      kind: the geom's type.
      pose: 4x4 of the primitive's centre and axes in the link frame (a cylinder's axis is its z); identity of a hull.
      size: as `description.Shape.size`: full edge lengths of a box, (radius, length) of a cylinder or capsule (length
        without the caps), (radius,) of a sphere; () of a hull.
      vertices, faces: [n, 3] float64 and [m, 3] int32, wound outward: the convex hull the piece stands for, in the
        link frame. Of a hull these are the geom itself; of a recognised primitive they are the hull it replaced; of a
        primitive that was one in the source, a fine enough polyhedron.
      source: where it came from. "primitive": the source said so; "group": one `o`/`g` group; "hull": the whole
        mesh's hull; "component": a connected part's hull; "boxes": an exact cut into boxes; "sheet": a side of a
        container without thickness; "coacd"; "fallback": one hull because decomposition failed; "merged": by the
        budget; "recut": the whole link cut up again, because merging would have filled too much.
      volume: of the geom that is emitted, m3.
      fit_error: greatest distance between the surface of the geom and the hull it stands for before any reduction,
        metres.
      volume_error: relative change of volume by primitive fit and vertex reduction (signed; + is bigger).
    """

    kind: HullPieceKind
    vertices: np.ndarray
    faces: np.ndarray
    pose: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(4))
    size: tuple[float, ...] = ()
    source: HullPieceSource = "hull"
    volume: float = 0.0
    fit_error: float = 0.0
    volume_error: float = 0.0


@dataclasses.dataclass
class LinkHulls:
    """The collision geometry of one link.

    Attributes:
      pieces: what to emit; empty if the link has no usable collision geometry.
      before: convex pieces (groups, components, CoACD parts, primitives) before the budget.
      after: len(pieces).
      volume_before: m3 of the union of the pieces before the budget.
      volume: m3 of the union of what is emitted.
      volume_error: volume / volume_before - 1: what budget, vertex reduction and primitive fits changed together.
      source_volume: m3 of the solid the source meshes enclose; None where they do not enclose one.
      method: how the pieces were found, e.g. "groups", "hull", "components", "coacd", "primitives", joined by "+".
      warnings: one line each, for the report.
      stopped: time or a signal ended a finer decomposition: another run may do better, so it is not cached.
      seconds: it took (of the first run, if cached). cached: it came from the cache.
    """

    pieces: list[HullPiece] = dataclasses.field(default_factory=list)
    before: int = 0
    volume_before: float = 0.0
    volume: float = 0.0
    source_volume: float | None = None
    method: str = ""
    warnings: list[str] = dataclasses.field(default_factory=list)
    stopped: bool = False
    seconds: float = 0.0
    cached: bool = False

    @property
    def after(self) -> int:
        return len(self.pieces)

    @property
    def volume_error(self) -> float:
        return self.volume / self.volume_before - 1.0 if self.volume_before > 0 else 0.0

    def kinds(self) -> dict[str, int]:
        """How many pieces of each kind."""
        counts: dict[str, int] = {}
        for piece in self.pieces:
            counts[piece.kind] = counts.get(piece.kind, 0) + 1
        return counts
