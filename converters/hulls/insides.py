"""The inside of containers: where something poured in from above stays, found from collision geometry.

An object at rest is cut into cells. A cell is solid if a convex piece of the base body meets it. Water of a certain
level stays in the free cells below that level that are not connected, below it, to the outside. The inside is the
largest such pool over all levels; it counts if it is open to above and not much flatter than the object. Closed
containers of liquids (`CLOSED`) get a prism in their body, with an opening at the top.

Cells that a piece only touches are solid, so that thin walls do not leak; corners are moved outwards by a cell.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import scipy.ndimage
import scipy.spatial

from ig2mj.scene.manifest import BUILDING, FORMAT_VERSION, InsideEntry, Manifest, ObjectEntry

CELLS = (44, 32, 22, 16)
"""Along each edge of the object, at most; the first with which a pool is found. Large cells close narrow gaps between
pieces."""

SMALLEST = 0.0015
"""m: edge of a cell, at least."""

DIRECTIONS = 8
"""Corners of each layer of an inside, and of a rim."""

LAYERS = 4

LEAST_LITRES = 0.004
"""A smaller pool is no inside: half a tablespoon."""

LEAST_SHARE = 0.06
"""Of the object's bounding box that a pool must fill."""

LEAST_OPEN = 0.5
"""Part of a pool's surface above which nothing is."""

CLOSED = frozenset(
    """
    atomizer beer blender carton catsup coffee_cup coffee_pouch cologne conditioner cream cruet detergent flour honey
    jam jar juice kettle lotion mayonnaise medicine milk olive_oil paint pepper_grinder perfume pop
    powder_bottle protein_powder puree salt shampoo soap soup spaghetti_sauce sugar_jar sunscreen teapot
    toothpaste vinegar water wine_bottle yogurt
    """.split()  # noqa: SIM905
)
"""Categories of closed containers, which have an inside without an opening in their collision geometry."""

CLOSED_SHARE = 0.85
"""Of each extent of a closed container's largest piece that its inside has."""

NECK = 0.012
"""m: radius of the opening of a closed container, at most."""

HOLDS_NOTHING = BUILDING | frozenset(
    """
    armchair bed bench chaise_longue chair coat colander dish_rack door foot_rule grandfather_clock piano
    pool_table rocking_chair sofa stool straight_chair swivel_chair window
    """.split()  # noqa: SIM905
)
"""Categories whose hollows are no containers."""

DIGITS = 4
"""Behind the point, m."""

Pieces = Sequence[tuple[np.ndarray, np.ndarray]]
"""Corners [V, 3] and half-spaces [N, 4] (n . x <= d) of convex pieces, m."""


def add_insides(manifest: Manifest, model: mujoco.MjModel) -> int:
    """Finds the inside of every object of a manifest that belongs to a compiled model; how many have one.

    The same models at the same size are looked at once.
    """
    known: dict[tuple[object, ...], InsideEntry | None] = {}
    for entry in manifest.objects:
        key = (entry.category, entry.model, tuple(entry.scale), entry.bounding_box, entry.part_of is None)
        if key not in known:
            known[key] = find_inside(entry, model)
        entry.inside = known[key]
    manifest.format_version = FORMAT_VERSION
    return sum(entry.inside is not None for entry in manifest.objects)


def find_inside(entry: ObjectEntry, model: mujoco.MjModel) -> InsideEntry | None:
    """The inside of one object; None: it holds nothing."""
    if entry.category in HOLDS_NOTHING or entry.part_of is not None or entry.category.startswith("half_"):
        return None
    pieces = _pieces(model, model.body(entry.bodies[0]).id)
    if not pieces:
        return None
    corners = np.concatenate([points for points, _ in pieces])
    low, high = corners.min(0), corners.max(0)
    if entry.category in CLOSED and (found := _pool(pieces, low, high, CELLS[0])) is None:
        return _closed(pieces, high)
    if len(pieces) == 1:  # convex
        return None
    return next((found for cells in CELLS if (found := _pool(pieces, low, high, cells)) is not None), None)


def _pieces(model: mujoco.MjModel, body: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Corners [V, 3] and half-spaces [N, 4] (n . x <= d) of the body's convex pieces, in its frame."""
    found = []
    for geom in np.flatnonzero(model.geom_bodyid == body):
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        points = _corners(model, int(geom)) @ turn.reshape(3, 3).T + model.geom_pos[geom]
        try:
            hull = scipy.spatial.ConvexHull(points)
        except scipy.spatial.QhullError:  # flat
            continue
        planes = hull.equations * np.array([1.0, 1.0, 1.0, -1.0])
        found.append((points, planes))
    return found


def _corners(model: mujoco.MjModel, geom: int) -> np.ndarray:
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        return np.asarray(model.mesh_vert[start : start + count], float)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        half = size
    else:  # a round piece: the corners of a prism or a ball
        angles = np.arange(16) * (np.pi / 8)
        ring = np.c_[np.cos(angles), np.sin(angles)] * size[0]
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            heights = np.linspace(-1, 1, 7)
            shrink = np.sqrt(np.maximum(1 - heights**2, 1e-6))
            return np.concatenate(
                [np.c_[ring * s, np.full(16, h * size[0])] for h, s in zip(heights, shrink, strict=True)]
            )
        length = size[1] + (size[0] if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0)
        return np.concatenate([np.c_[ring, np.full(16, z)] for z in (-length, length)])
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half


def _pool(
    pieces: Sequence[tuple[np.ndarray, np.ndarray]], low: np.ndarray, high: np.ndarray, cells: int
) -> InsideEntry | None:
    """The largest pool of an object in its base body's frame, z up."""
    step = np.maximum((high - low) / cells, SMALLEST)
    shape = np.ceil((high - low) / step).astype(int) + 2  # one layer of air around
    start = (low + high) / 2 - shape * step / 2 + step / 2
    axes = [start[i] + step[i] * np.arange(shape[i]) for i in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    solid = np.zeros(shape, bool)
    for points, planes in pieces:
        first = np.maximum(np.floor((points.min(0) - start) / step - 0.5).astype(int), 0)
        last = np.minimum(np.ceil((points.max(0) - start) / step + 0.5).astype(int) + 1, shape)
        window = tuple(slice(a, b) for a, b in zip(first, last, strict=True))
        slack = np.abs(planes[:, :3]) @ step / 2
        solid[window] |= np.all(grid[window] @ planes[:, :3].T <= planes[:, 3] + slack, axis=-1)
    best, least = None, LEAST_LITRES / 1000 / float(np.prod(step))
    for top in range(1, shape[2] - 1):
        below = ~solid
        below[:, :, top + 1 :] = False
        labels, count = _labelled(below)
        if not count:
            continue
        drained = np.unique(np.concatenate([a.ravel() for a in _sides(labels)]))
        sizes = np.bincount(labels.ravel(), minlength=count + 1)
        sizes[drained] = sizes[0] = 0
        largest = int(sizes.argmax())
        if sizes[largest] >= max(least, 0 if best is None else best[0] + 1):
            pool = labels == largest
            surface = pool[:, :, top]
            if surface.any() and (surface & ~solid[:, :, top + 1 :].any(2)).sum() >= LEAST_OPEN * surface.sum():
                best = int(sizes[largest]), pool, top
    if best is None or best[0] * np.prod(step) < LEAST_SHARE * np.prod(high - low):
        return None
    return _described(best[1], axes, step)


def _labelled(cells: np.ndarray) -> tuple[np.ndarray, int]:
    """Number of the connected part of each cell, 0 for none, and how many there are."""
    labels = np.zeros(cells.shape, np.int32)
    count = scipy.ndimage.label(cells, output=labels)
    return labels, int(np.asarray(count))


def _sides(labels: np.ndarray) -> list[np.ndarray]:
    """Faces of the grid through which a pool would drain; all but the one above."""
    return [labels[0], labels[-1], labels[:, 0], labels[:, -1], labels[:, :, 0]]


def _described(pool: np.ndarray, axes: Sequence[np.ndarray], step: np.ndarray) -> InsideEntry:
    layers = np.flatnonzero(pool.any((0, 1)))
    chosen = np.unique(np.linspace(0, len(layers) - 1, LAYERS).round().astype(int))
    angles = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    ways = np.c_[np.cos(angles), np.sin(angles)]
    vertices: list[tuple[float, float, float]] = []
    polygon = np.zeros((0, 2))
    for layer in layers[chosen]:
        i, j = np.nonzero(pool[:, :, layer])
        points = np.c_[axes[0][i], axes[1][j]]
        corners = points[(points @ ways.T).argmax(0)]
        polygon = np.unique(corners + ways * step[:2], axis=0)
        height = axes[2][layer] + step[2] / 2 * (int(layer == layers[-1]) - int(layer == layers[0]))
        vertices += [_rounded((x, y, height)) for x, y in polygon]
    top = axes[2][layers[-1]] + step[2] / 2
    middle = polygon.mean(0)
    order = np.argsort(np.arctan2(*(polygon - middle).T[::-1]))
    rim = [_rounded((x, y, top)) for x, y in polygon[order]]
    hull = scipy.spatial.ConvexHull(np.array(vertices)).volume
    litres = 1000 * min(hull, 1.35 * float(pool.sum() * np.prod(step)))
    return InsideEntry(litres=round(float(litres), DIGITS), vertices=vertices, rim=rim)


def _closed(pieces: Pieces, top: np.ndarray) -> InsideEntry | None:
    """A prism in the largest piece, and an opening above it at the top of the object."""
    points = max((points for points, _ in pieces), key=lambda p: float(scipy.spatial.ConvexHull(p).volume))
    middle = (points.min(0) + points.max(0)) / 2
    angles = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    ways = np.c_[np.cos(angles), np.sin(angles)]
    outline = middle[:2] + CLOSED_SHARE * (points[(points[:, :2] @ ways.T).argmax(0), :2] - middle[:2])
    low, high = middle[2] + CLOSED_SHARE * (np.array([points[:, 2].min(), points[:, 2].max()]) - middle[2])
    vertices = [_rounded((x, y, z)) for z in (low, high) for x, y in np.unique(outline, axis=0)]
    litres = 1000 * float(scipy.spatial.ConvexHull(np.array(vertices)).volume)
    if litres < LEAST_LITRES:
        return None
    radius = min(NECK, 0.5 * float(np.ptp(outline, axis=0).min()) / 2)
    rim = [_rounded((middle[0] + radius * x, middle[1] + radius * y, float(top[2]))) for x, y in ways]
    vertices += rim
    return InsideEntry(litres=round(litres, DIGITS), vertices=vertices, rim=rim)


def _rounded(point: Sequence[float] | np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(v), DIGITS) + 0.0 for v in point)
    return x, y, z
