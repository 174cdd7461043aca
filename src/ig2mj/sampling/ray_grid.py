"""The grid of parallel rays that probes a surface for an object's footprint (spec/states.md 14.3, step 3)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

SPACING = 0.1
"""Metres of half width for which a further pair of rays is added (iGibson's sampling_utils.py)."""

FEWEST = 3
"""Rays along each direction, at the least."""


def rays_along(width: float) -> int:
    """Rays along one direction of a footprint, metres wide: odd, so that one goes through the middle."""
    return max(FEWEST, 2 * int(width / 2 / SPACING) + 1)


def ray_grid(width: float, depth: float) -> Float[np.ndarray, "R 2"]:
    """Offsets (m) of the rays from the footprint's middle, along its width and its depth, edge to edge."""
    x = np.linspace(-width / 2, width / 2, rays_along(width))
    y = np.linspace(-depth / 2, depth / 2, rays_along(depth))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
