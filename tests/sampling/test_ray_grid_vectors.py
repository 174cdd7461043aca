"""The ray grid of spec/states.md: its vectors (section 22) and its shape (section 14.3)."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.sampling.ray_grid import ray_grid, rays_along


@pytest.mark.parametrize(
    ("width", "depth", "counts"),
    [(0.08, 0.08, (3, 3)), (0.5, 0.3, (5, 3)), (1.0, 0.6, (11, 5))],
)
def test_section_22_ray_grid_vectors(width, depth, counts):
    assert (rays_along(width), rays_along(depth)) == counts
    assert len(ray_grid(width, depth)) == counts[0] * counts[1]


def test_the_grid_spans_the_footprint_and_has_its_middle():
    grid = ray_grid(0.5, 0.3)
    assert np.allclose(grid.min(0), [-0.25, -0.15]) and np.allclose(grid.max(0), [0.25, 0.15])
    assert (np.abs(grid).sum(1) < 1e-12).sum() == 1
