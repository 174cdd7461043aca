"""Convex pieces of one link's collision shapes: the converter's way from meshes to collision geoms."""

from __future__ import annotations

from collections.abc import Sequence

from .description import Shape
from .pieces import HullOptions, LinkHulls, Piece

__all__ = ["HullOptions", "LinkHulls", "Piece", "decompose_link"]


def decompose_link(shapes: Sequence[Shape], options: HullOptions | None = None) -> LinkHulls:
    """Turns all collision shapes of one link into convex pieces in the link frame.

    `Shape.scale` is applied before `Shape.pose`; a caller that has baked scale and pose into the vertices hands over
    shapes with scale (1, 1, 1) and pose identity. Arguments and result can be pickled, so a process pool can map it.
    Never raises on bad geometry: what cannot be used is left out and named in `warnings`.
    """
    raise NotImplementedError
