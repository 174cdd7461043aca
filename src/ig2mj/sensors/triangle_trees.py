"""Trees of boxes around the triangles of meshes, in the layout that `ig2mj.sensors.triangle_rays` reads.

A tree is an array of rows of four 32-bit numbers:

- row 0, integers: the row of the first triangle, the row of the faces, and what the root is (see below);
- four rows for each inner node, two for each of its two children: low corner and what the child is, high corner and 0;
- three rows for each triangle, leaf by leaf: the affine map from the mesh's frame to where its corners are (0, 0),
  (1, 0) and (0, 1) in the plane of the first two coordinates (once it is `GROWN`), and the third one is along its
  normal;
- the triangles' faces, integers, four in a row.

What a node is, an integer: the row of an inner node, or minus (8 x its first triangle + how many it has) of a leaf; 0
where there are no triangles.

Boxes are split where the surface area heuristic, over bins along the three axes, is smallest (I. Wald, "On fast
Construction of SAH-based Bounding Volume Hierarchies", 2007). The map is that of D. Baldwin and M. Weber, "Fast
Ray-Triangle Intersections by Coordinate Transformation", 2016. The trees of all meshes are made together, level by
level.

Axes: F triangles of a mesh, T of all meshes, N nodes of a level, S of them that are split, R rows.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

LEAF = 4
"""Most triangles of a leaf, at most 7."""

BINS = 8
"""Along each axis, at whose borders boxes may be split."""

BOX_COST = 1.2
"""What the box of a node costs a ray, where a triangle costs 1."""

HALVED_FROM, DEEPEST = 24, 48
"""Levels from which on boxes are split where half of the triangles are on each side, and levels at most; a ray's list
of nodes that it still has to look at has room for as many."""

GROWN = 5e-6
"""m by which triangles and boxes are larger on each side than they are: more than what rays are rounded by in a home,
so that none passes between two triangles with an edge in common."""

FLAT, SLENDER = 1e-14, 1e-12
"""m2 and rad: triangles with less area, or less than this between two edges, are left out. They are thinner than what
their neighbours are grown by, and the map of a thinner one is singular."""


@dataclasses.dataclass
class _Level:
    """Nodes of one depth.

    Attributes:
      mesh: of each. start, end: its triangles, in the order of leaves. low, high: corners of its box, m.
      child: the first of its two children in the next level; -1 for leaves.
    """

    mesh: Int[np.ndarray, "N"]
    start: Int[np.ndarray, "N"]
    end: Int[np.ndarray, "N"]
    low: Float[np.ndarray, "N 3"]
    high: Float[np.ndarray, "N 3"]
    child: Int[np.ndarray, "N"]


def trees_of(meshes: Sequence[Float[np.ndarray, "_ 3 3"]]) -> list[Float[np.ndarray, "_ 4"]]:
    """The tree of each mesh.

    Args:
      meshes: corners of triangles, m. Those without area are left out.
    """
    corners = np.concatenate([np.zeros((0, 3, 3)), *meshes]).astype(np.float64)
    counts = np.array([len(mesh) for mesh in meshes], int)
    mesh, first = np.repeat(np.arange(len(meshes)), counts), np.cumsum(counts) - counts
    edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(*edges)
    spanned = SLENDER * np.linalg.norm(edges[0], axis=1) * np.linalg.norm(edges[1], axis=1)
    solid = np.flatnonzero(np.linalg.norm(normal, axis=1) > np.maximum(spanned, 2.0 * FLAT))
    corners, normal, mesh = corners[solid], normal[solid], mesh[solid]
    order, levels = _split_all(corners, mesh)
    maps, faces, mesh = _maps(corners, normal)[order], (solid - first[mesh])[order], mesh[order]
    return [_rows(levels, number, maps[mesh == number], faces[mesh == number]) for number in range(len(meshes))]


def _maps(corners: Float[np.ndarray, "T 3 3"], normal: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3 4"]:
    """From the mesh's frame to coordinates along a triangle's first and last edge and its normal."""
    edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turn = np.linalg.inv(np.stack([*edges, normal], axis=-1))
    maps = np.concatenate([turn, -turn @ corners[:, 0, :, None]], axis=-1)
    # Shares of the corners, each of which grows by the same length from 0 at an edge.
    shares = np.stack([turn[:, 0], turn[:, 1], turn[:, 0] + turn[:, 1]], axis=1)
    more = GROWN * np.linalg.norm(shares, axis=-1)
    maps[:, :2, 3] += more[:, :2]
    maps[:, :2] /= 1.0 + more.sum(axis=1)[:, None, None]
    return maps.astype(np.float32)


def _split_all(
    corners: Float[np.ndarray, "T 3 3"], mesh: Int[np.ndarray, "T"]
) -> tuple[Int[np.ndarray, "T"], list[_Level]]:
    """Triangles in the order of leaves, and the nodes of all levels. Triangles of a mesh follow each other."""
    low, high, order = corners.min(axis=1), corners.max(axis=1), np.arange(len(corners))
    which, sizes = np.unique(mesh, return_counts=True)
    end = np.cumsum(sizes)
    levels, start = [], end - sizes
    while len(start):
        places, first = _places(start, end)
        boxes = np.minimum.reduceat(low[order[places]], first), np.maximum.reduceat(high[order[places]], first)
        level = _Level(which, start, end, *boxes, np.full(len(start), -1))
        levels.append(level)
        if len(levels) == DEEPEST:
            assert (end - start <= LEAF).all(), "levels that halve their triangles are enough"
            break
        split, left = _split(level, order, low, high, halved=len(levels) > HALVED_FROM)
        level.child[split] = 2 * np.arange(len(split))
        middle = start[split] + left
        start, end = np.stack([start[split], middle], 1).ravel(), np.stack([middle, end[split]], 1).ravel()
        which = np.repeat(which[split], 2)
    return order, levels


def _split(
    level: _Level,
    order: Int[np.ndarray, "T"],
    low: Float[np.ndarray, "T 3"],
    high: Float[np.ndarray, "T 3"],
    halved: bool,
) -> tuple[Int[np.ndarray, "S"], Int[np.ndarray, "S"]]:
    """Sorts the triangles of nodes that are not leaves by side. Returns these nodes and how many are on the first side.

    Args:
      order: changed. low, high: corners of the triangles' boxes. halved: each side gets half of them.
    """
    nodes = np.flatnonzero(level.end - level.start > 1)
    if not len(nodes):
        return nodes, nodes
    count = (level.end - level.start)[nodes]
    places, first = _places(level.start[nodes], level.end[nodes])
    owner, own = np.repeat(np.arange(len(nodes)), count), order[places]
    number = np.arange(len(own)) - first[owner]
    middle = (low[own] + high[own]) / 2
    lowest, highest = np.minimum.reduceat(middle, first), np.maximum.reduceat(middle, first)
    extent = highest - lowest
    if halved:
        axis, cost = extent.argmax(axis=1), np.where(count > LEAF, 0.0, np.inf)
        along = middle[np.arange(len(own)), axis[owner]]
        rank = np.empty(len(own), int)
        rank[np.lexsort([along, owner])] = number
        second = rank >= (count // 2)[owner]
    else:
        scale = np.divide(BINS, extent, out=np.zeros_like(extent), where=extent > 0.0)
        bins = np.minimum((middle - lowest[owner]) * scale[owner], BINS - 1).astype(int)
        axis, border, cost = _best_border(owner, bins, low[own], high[own], len(nodes))
        second = bins[np.arange(len(own)), axis[owner]] > border[owner]
        same = ~np.isfinite(cost)  # all in one bin
        second = np.where(same[owner], number >= (count // 2)[owner], second)
        x, y, z = (level.high[nodes] - level.low[nodes]).T
        whole = x * y + y * z + z * x
        cost = np.where(same, np.where(count > LEAF, 0.0, np.inf), cost + BOX_COST * whole)
        cost = np.where((count > LEAF) | (cost < count * whole), cost, np.inf)
    split = np.isfinite(cost)
    second &= split[owner]
    order[places] = own[np.argsort(2 * owner + second, kind="stable")]
    left = count - np.bincount(owner, second, minlength=len(nodes)).astype(int)
    return nodes[split], left[split]


def _best_border(
    owner: Int[np.ndarray, "n"],
    bins: Int[np.ndarray, "n 3"],
    low: Float[np.ndarray, "n 3"],
    high: Float[np.ndarray, "n 3"],
    nodes: int,
) -> tuple[Int[np.ndarray, "N"], Int[np.ndarray, "N"], Float[np.ndarray, "N"]]:
    """Of each node the axis, the last bin of the first side, and the sum over sides of triangles x area; infinite where
    all triangles are in the same bins."""
    shape = (BINS, nodes, 3)
    key = ((bins * nodes + owner[:, None]) * 3 + np.arange(3)).ravel()
    count = np.bincount(key, minlength=BINS * nodes * 3).reshape(shape)
    lows, highs = np.full((3, BINS * nodes * 3), np.inf), np.full((3, BINS * nodes * 3), -np.inf)
    for axis in range(3):
        np.minimum.at(lows[axis], key, np.repeat(low[:, axis], 3))
        np.maximum.at(highs[axis], key, np.repeat(high[:, axis], 3))
    lows, highs = lows.reshape(3, *shape), highs.reshape(3, *shape)
    costs = []
    for turn in (slice(None), slice(None, None, -1)):  # first sides, last sides
        number, below, above = np.cumsum(count[turn], axis=0), lows[:, turn].copy(), highs[:, turn].copy()
        for k in range(1, BINS):
            np.minimum(below[:, k], below[:, k - 1], out=below[:, k])
            np.maximum(above[:, k], above[:, k - 1], out=above[:, k])
        x, y, z = np.where(number > 0, above - below, 0.0)
        costs.append(np.where(number > 0, number * (x * y + y * z + z * x), np.inf)[turn])
    cost = (costs[0][:-1] + costs[1][1:]).transpose(1, 2, 0).reshape(nodes, -1)
    best = cost.argmin(axis=1)
    return best // (BINS - 1), best % (BINS - 1), cost[np.arange(nodes), best]


def _places(
    start: Int[np.ndarray, "N"], end: Int[np.ndarray, "N"]
) -> tuple[Int[np.ndarray, "n"], Int[np.ndarray, "N"]]:
    """The numbers from start to end of each node, one node after the other, and where each node's begin."""
    count = end - start
    first = np.cumsum(count) - count
    return np.arange(count.sum()) + np.repeat(start - first, count), first


def _rows(
    levels: list[_Level], mesh: int, maps: Float[np.ndarray, "F 3 4"], faces: Int[np.ndarray, "F"]
) -> Float[np.ndarray, "R 4"]:
    """A mesh's tree; `maps` and `faces` in the order of its leaves."""
    of_mesh = [np.flatnonzero(level.mesh == mesh) for level in levels]
    inner = sum(int((level.child[own] >= 0).sum()) for level, own in zip(levels, of_mesh, strict=True))
    triangles = 1 + 4 * inner
    ids = triangles + 3 * len(faces)
    rows = np.zeros((ids + -(-len(faces) // 4), 4), np.float32)
    words = rows.view(np.int32)
    words[0, :2] = triangles, ids
    rows[triangles:ids] = maps.reshape(-1, 4)
    words[ids:].reshape(-1)[: len(faces)] = faces
    begin = int(levels[0].start[of_mesh[0][0]]) if len(faces) else 0
    row, parents = 1, np.zeros(0, np.int64)  # rows of what is in the next level
    for level, own in zip(levels, of_mesh, strict=True):
        if not len(own):
            break
        within = level.child[own] >= 0
        what = -(8 * (level.start[own] - begin) + level.end[own] - level.start[own])
        what[within] = row + 4 * np.arange(within.sum())
        if level is levels[0]:
            words[0, 2] = what[0]
        else:
            rows[parents, :3], rows[parents + 1, :3] = level.low[own] - GROWN, level.high[own] + GROWN
            words[parents, 3] = what
        parents = np.add.outer(what[within], np.array([0, 2])).ravel()
        row += 4 * int(within.sum())
    return rows
