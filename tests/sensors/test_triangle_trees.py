"""Trees of triangles: every triangle in one leaf, boxes around what they hold, and rays that meet what a search
through all triangles finds."""

# pyright: reportArgumentType=false, reportInvalidTypeForm=false

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from ig2mj.sensors import triangle_trees
from ig2mj.sensors.triangle_rays import Hit, first_triangle
from ig2mj.sensors.triangle_trees import DEEPEST, LEAF, trees_of

REACH = 50.0


@wp.kernel
def _cast(
    tree: wp.uint64,
    origin: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    culled: bool,
    hits: wp.array(dtype=Hit),
):
    i = wp.tid()
    hits[i] = first_triangle(tree, origin[i], direction[i], REACH, culled)


def cast(tree: np.ndarray, origin: np.ndarray, direction: np.ndarray, culled: bool = False) -> np.ndarray:
    """Hits of rays, each as `Hit`."""
    with wp.ScopedDevice("cpu"):
        rows, hits = wp.array(tree, dtype=wp.vec4), wp.zeros(len(origin), dtype=Hit)
        rays = [wp.array(of.astype(np.float32), dtype=wp.vec3) for of in (origin, direction)]
        wp.launch(_cast, len(origin), inputs=[wp.uint64(rows.ptr), *rays, culled], outputs=[hits])
        return hits.numpy()


def searched(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray, culled: bool = False) -> np.ndarray:
    """Distances of the first triangles among all of them; infinite where there is none."""
    a, b, c = corners.astype(float).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = direction @ normal.T
        t = ((a * normal).sum(1) - origin @ normal.T) / rise
        point = origin[:, None] + t[..., None] * direction[:, None]
        inside = np.ones(t.shape, bool)
        for start, end in ((a, b), (b, c), (c, a)):
            inside &= (np.cross(end - start, point - start) * normal).sum(-1) >= 0.0
    t = np.where(inside & (t >= 0.0) & (t < REACH) & (~culled | (rise < 0.0)), t, np.inf)
    return t.min(axis=1, initial=np.inf)


def soup(count: int, seed: int) -> np.ndarray:
    """Triangles of all sizes, some long and thin, in a room."""
    rng = np.random.default_rng(seed)
    sizes = 10.0 ** rng.uniform(-2.0, 0.5, (count, 1, 3))
    return (rng.uniform(-3.0, 3.0, (count, 1, 3)) + sizes * rng.normal(size=(count, 3, 3))).astype(np.float32)


def rays(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions; the first ones are along the axes."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    direction[:30] = np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), 5, axis=0)
    origin = rng.uniform(-4.0, 4.0, (count, 3)).astype(np.float32).astype(float)
    direction = (direction / np.linalg.norm(direction, axis=1, keepdims=True)).astype(np.float32).astype(float)
    return origin, direction


@pytest.mark.parametrize("culled", [False, True])
@pytest.mark.parametrize("count", [1, 5, 300])
def test_rays_meet_the_triangle_that_a_search_through_all_finds(count, culled):
    corners, (origin, direction) = soup(count, count), rays(4000, count + 1)
    hits = cast(trees_of([corners])[0], origin, direction, culled)
    expected = searched(corners, origin, direction, culled)
    met = hits[:, 0] >= 0.0
    assert (met == np.isfinite(expected)).mean() > 0.999, "but for rays at an edge"
    both = met & np.isfinite(expected)
    assert np.median(np.abs(hits[both, 0] - expected[both])) < 1e-6
    assert (np.abs(hits[both, 0] - expected[both]) < 1e-3).mean() > 0.998, "thin triangles seen at an angle"
    face = hits[both, 3].astype(int)
    shares = np.stack([hits[both, 1], hits[both, 2], 1.0 - hits[both, 1] - hits[both, 2]], 1)
    point = (shares[:, :, None] * corners[face]).sum(1)
    there = origin[both] + hits[both, :1] * direction[both]
    assert (np.abs(point - there).max(1) < 1e-3).mean() > 0.998
    normal = np.cross(corners[face, 1] - corners[face, 0], corners[face, 2] - corners[face, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(hits[both, 4:], normal, atol=1e-3)


def test_no_ray_passes_between_triangles_with_an_edge_in_common():
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(np.linspace(-3, 3, 41), np.linspace(-3, 3, 41), indexing="ij"), -1)
    points = np.concatenate([grid, 0.3 * rng.random((41, 41, 1))], -1).astype(np.float32)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    corners = np.concatenate([np.stack(t, -2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])
    at = np.concatenate([points.reshape(-1, 3), ((a + c) / 2).reshape(-1, 3), ((a + b) / 2).reshape(-1, 3)]).astype(
        float
    )
    at = at[np.abs(at[:, :2]).max(1) < 2.9]
    origin = np.array([0.3, -0.2, 2.0]) + 0.1 * rng.random(at.shape)
    direction = (at - origin) / np.linalg.norm(at - origin, axis=1, keepdims=True)
    assert (cast(trees_of([corners])[0], origin, direction)[:, 0] > 0.0).all()


def nodes(tree: np.ndarray) -> tuple[list[tuple[np.ndarray, int]], list[int]]:
    """Boxes with what they are, outermost first, and the triangles of all leaves."""
    words, boxes, triangles, todo = tree.view(np.int32), [], [], [int(tree.view(np.int32)[0, 2])]
    while todo:
        what = todo.pop()
        if what > 0:
            for row in (what, what + 2):
                todo.append(int(words[row, 3]))
                boxes.append((tree[row : row + 2, :3], todo[-1]))
        elif what < 0:
            assert -what & 7 <= LEAF
            triangles += range(-what >> 3, (-what >> 3) + (-what & 7))
    return boxes, triangles


def test_every_triangle_is_in_one_leaf_and_in_the_boxes_above_it():
    meshes = [soup(500, 0), np.zeros((0, 3, 3)), soup(3, 1), np.repeat(soup(1, 2), 40, axis=0)]
    for corners, tree in zip(meshes, trees_of(meshes), strict=True):
        boxes, triangles = nodes(tree)
        words = tree.view(np.int32)
        assert sorted(triangles) == list(range(len(corners)))
        faces = words[words[0, 1] :].ravel()[: len(corners)]
        assert sorted(faces) == list(range(len(corners)))
        for (low, high), what in boxes:
            if what < 0:
                held = corners[faces[-what >> 3 : (-what >> 3) + (-what & 7)]]
                assert (held.min((0, 1)) >= low).all() and (held.max((0, 1)) <= high).all()
            else:
                of_children = tree[what : what + 4, :3]
                assert (of_children >= low - 1e-5).all() and (of_children <= high + 1e-5).all()


def test_triangles_without_area_are_in_no_leaf_and_faces_keep_their_numbers():
    corners = soup(20, 3)
    corners[::2] = corners[::2, :1]
    tree = trees_of([corners])[0]
    words = tree.view(np.int32)
    assert sorted(words[words[0, 1] :].ravel()[: len(nodes(tree)[1])]) == list(range(1, 20, 2))


def test_triangles_too_thin_to_have_a_map_are_in_no_leaf():
    """Two nearly parallel edges: what is between them is less than double precision tells."""
    corners = soup(6, 4).astype(np.float64)
    corners[1] = [[1.0, 2.0, 3.0], [1.1, 2.2, 3.3], [1.3, 2.6, 3.9 + 1e-16]]
    corners[3] = corners[3, :1] + 1e-9 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    tree = trees_of([corners])[0]
    words = tree.view(np.int32)
    assert sorted(words[words[0, 1] :].ravel()[: len(nodes(tree)[1])]) == [0, 2, 4, 5]


def test_a_tree_is_no_deeper_than_a_ray_remembers(monkeypatch):
    """Triangles of nine magnitudes side by side: the heuristic splits off the largest ones."""
    sizes = 10.0 ** -np.linspace(0.0, 9.0, 300)
    corners = sizes[:, None, None] * np.array([[1.0, 0.0, 0.0], [1.0, 0.4, 0.0], [1.0, 0.0, 0.4]])
    monkeypatch.setattr(triangle_trees, "BINS", 2)
    words = trees_of([corners])[0].view(np.int32)

    def depth(what: int) -> int:
        return 1 if what <= 0 else 1 + max(depth(int(words[row, 3])) for row in (what, what + 2))

    assert 20 < depth(int(words[0, 2])) <= DEEPEST
