"""What a falling point meets first: vertical lines against the pieces of all objects, all at once.

Nearly all pieces are boxes, which are three slabs. No loop and no list of candidates: a GPU takes longer to start a
kernel, or to ask the host how a loop goes on, than to hold a few lines against some hundred boxes.
`ig2mj.geometry.targets.fall_contact` answers for each object.

Axes: W worlds, K points, S lines of a point's way, B bodies, E pieces, N half-spaces, O objects.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.geometry import rays
from ig2mj.geometry.poses import AnyArray, matrices_on_host, quat_to_matrix
from ig2mj.geometry.targets import planes_in_body
from ig2mj.scene.tables import PieceKind, SceneTables

SLABS = 3
"""Pairs of parallel faces of a box."""

PLAIN = 8
"""Half-spaces up to which polyhedra that are no boxes are a group of their own."""

OPPOSITE = -1.0 + 1e-6
"""Largest product of unit normals of faces that count as parallel."""

STEEPEST = 1e-9
"""Least slope of a line against a face: a line along a face never crosses it within metres."""

NONE = np.iinfo(np.int32).max
"""Number of no object."""

SCENES = 8
"""Scenes whose pieces are kept: those asked for last."""


@dataclasses.dataclass(frozen=True, eq=False)
class FallPieces:
    """Pieces of a scene's objects that are computed alike, in rising order of objects.

    Attributes:
      object, body: of each piece.
      slabs: pairs of faces in the frame of the body: normal, and distances of the middle and of each face from it, m;
        None of other pieces.
      kind, size, pos, rotation: shapes of primitives and their poses in their bodies; None of polyhedra.
      planes: half-spaces of polyhedra that are no boxes, in the frame of the body; None of others.
    """

    object: Int[np.ndarray, "E"]
    body: Int[np.ndarray, "E"]
    slabs: Float[np.ndarray, "E 3 5"] | None = None
    planes: Float[np.ndarray, "N 4 E"] | None = None
    kind: Int[np.ndarray, "E"] | None = None
    size: Float[np.ndarray, "E 3"] | None = None
    pos: Float[np.ndarray, "E 3"] | None = None
    rotation: Float[np.ndarray, "E 3 3"] | None = None

    @staticmethod
    @functools.lru_cache(maxsize=SCENES)
    def of(tables: SceneTables) -> tuple[FallPieces, ...]:
        """Those of a scene in groups that are computed alike; asked again, the same objects."""
        owned = np.flatnonzero(tables.piece_object >= 0)
        order = owned[np.argsort(tables.piece_object[owned], kind="stable")]
        solid = tables.piece_kind[order] == PieceKind.POLYHEDRON
        round_ones, polyhedra = order[~solid], order[solid]
        count = np.any(tables.piece_planes[polyhedra, :, :3] != 0.0, axis=-1).sum(axis=-1)
        planes = planes_in_body(
            tables.piece_planes[polyhedra],
            tables.piece_pos[polyhedra],
            matrices_on_host(tables.piece_quat[polyhedra]),
            int(count.max(initial=0)),
        )
        slabs = [_slabs(planes[:n, :, e]) for e, n in enumerate(count)]
        box = np.array([s is not None for s in slabs], bool)
        found = []
        if box.any():
            boxes = np.array([s for s in slabs if s is not None], np.float32)
            found.append(FallPieces(*_owners(tables, polyhedra[box]), slabs=boxes))
        for group in (~box & (count <= PLAIN), ~box & (count > PLAIN)):
            if group.any():
                most = int(count[group].max())
                found.append(FallPieces(*_owners(tables, polyhedra[group]), planes=planes[:most, :, group]))
        if len(round_ones):
            found.append(
                FallPieces(
                    *_owners(tables, round_ones),
                    kind=tables.piece_kind[round_ones],
                    size=tables.piece_size[round_ones].astype(np.float32),
                    pos=tables.piece_pos[round_ones].astype(np.float32),
                    rotation=matrices_on_host(tables.piece_quat[round_ones]).astype(np.float32),
                )
            )
        return tuple(found)


def _owners(tables: SceneTables, some: Int[np.ndarray, "E"]) -> tuple[Int[np.ndarray, "E"], Int[np.ndarray, "E"]]:
    return tables.piece_object[some], tables.piece_body[some]


def _slabs(planes: Float[np.ndarray, "N 4"]) -> Float[np.ndarray, "3 5"] | None:
    """The slabs of which a body of half-spaces is the intersection; None: it is no box."""
    if len(planes) != 2 * SLABS:
        return None
    opposite = planes[:, :3] @ planes[:, :3].T <= OPPOSITE
    if not np.all(opposite.sum(axis=1) == 1):
        return None
    first = [n for n in range(len(planes)) if opposite[n].argmax() > n]
    rows = [(planes[n], planes[opposite[n].argmax()][3]) for n in first]
    return np.array([[*p[:3], 0.5 * (p[3] - other), 0.5 * (p[3] + other)] for p, other in rows])


class Ways(NamedTuple):
    """Points that fall, each along lines straight down.

    Attributes:
      active: there is a point. start: of each line, m, world frame. length: of each, m. above: m that a point has
        fallen before each line begins. ignored: object that is not in its way, -1: none.
    """

    active: Bool[AnyArray, "W K"]
    start: Float[AnyArray, "W K S 3"]
    length: Float[AnyArray, "W K S"]
    above: Float[np.ndarray, "S"]
    ignored: Int[AnyArray, "W K"]


class FirstMet(NamedTuple):
    """What each point meets first: the object (-1: nothing), and how deep it has fallen then (m; inf)."""

    object: Int[jax.Array, "W K"]
    depth: Float[jax.Array, "W K"]


def first_met(
    groups: Sequence[FallPieces], body_pos: Float[AnyArray, "W B 3"], body_quat: Float[AnyArray, "W B 4"], ways: Ways
) -> FirstMet:
    """The first object in the way of each point; of equals the one with the least number. A point that is in a piece
    meets it at once."""
    found = FirstMet(jnp.full(ways.active.shape, -1, jnp.int32), jnp.full(ways.active.shape, jnp.inf))
    for pieces in groups:
        axes = quat_to_matrix(jnp.asarray(body_quat)[:, pieces.body])[:, None]
        pos = jnp.asarray(body_pos)[:, pieces.body][:, None]
        turn = [[axes[..., i, j] for j in range(3)] for i in range(3)]  # [W, 1, E] each
        at = [pos[..., i] for i in range(3)]
        found = _nearer(found, _first_of(pieces, turn, at, ways))
    return found


def _nearer(one: FirstMet, other: FirstMet) -> FirstMet:
    takes = (other.depth < one.depth) | ((other.depth == one.depth) & (other.object < one.object))
    return FirstMet(jnp.where(takes, other.object, one.object), jnp.where(takes, other.depth, one.depth))


def _first_of(pieces: FallPieces, turn: list, at: list, ways: Ways) -> FirstMet:
    """`first_met` of a group. `turn`, `at`: poses of the bodies, by row and column, and by axis [W, 1, E]."""
    if pieces.slabs is not None:
        depth = _into_boxes(pieces.slabs, turn, at, ways)
    elif pieces.planes is not None:
        depth = _into_polyhedra(pieces.planes, turn, at, ways)
    else:
        depth = _into_primitives(pieces, turn, at, ways)
    free = (ways.ignored[..., None] != pieces.object) & ways.active[..., None]
    depth = jnp.where(free, depth, jnp.inf)  # [W, K, E]
    least = jnp.min(depth, axis=-1)
    if jax.default_backend() == "cpu":  # where the search for a place is one number at a time
        owner = jnp.min(jnp.where(depth <= least[..., None], pieces.object.astype(np.int32), NONE), axis=-1)
    else:
        owner = jnp.asarray(pieces.object, jnp.int32)[jnp.argmin(depth, axis=-1)]
    return FirstMet(jnp.where(jnp.isfinite(least), owner, -1), least)


def _into_boxes(slabs: Float[np.ndarray, "E 3 5"], turn: list, at: list, ways: Ways) -> Float[jax.Array, "W K E"]:
    """How deep each point has fallen where it meets each box; inf: it does not."""
    normal = [[sum(turn[i][j] * slabs[:, a, j] for j in range(3)) for i in range(3)] for a in range(SLABS)]
    per = [1.0 / jnp.where(jnp.abs(n[2]) < STEEPEST, STEEPEST, -n[2]) for n in normal]
    half = [jnp.abs(per[a]) * slabs[:, a, 4] for a in range(SLABS)]
    low, high = [], []
    for line in range(len(ways.above)):  # in the same pass over the boxes
        offset = [ways.start[:, :, line, i, None] - at[i] for i in range(3)]
        middle = [(slabs[:, a, 3] - sum(normal[a][i] * offset[i] for i in range(3))) * per[a] for a in range(SLABS)]
        low.append(functools.reduce(jnp.maximum, [m - h for m, h in zip(middle, half, strict=True)]))
        high.append(functools.reduce(jnp.minimum, [m + h for m, h in zip(middle, half, strict=True)]))
    return _least(low, high, ways)


def _into_polyhedra(planes: Float[np.ndarray, "N 4 E"], turn: list, at: list, ways: Ways) -> Float[jax.Array, "W K E"]:
    low: list[AnyArray] = [np.full(1, -np.inf, np.float32)] * len(ways.above)
    high: list[AnyArray] = [np.full(1, np.inf, np.float32)] * len(ways.above)
    offsets = [[ways.start[:, :, line, i, None] - at[i] for i in range(3)] for line in range(len(ways.above))]
    for plane in planes:
        normal = [sum(turn[i][j] * plane[j] for j in range(3)) for i in range(3)]
        per = 1.0 / jnp.where(jnp.abs(normal[2]) < STEEPEST, STEEPEST, -normal[2])
        for line, offset in enumerate(offsets):
            crosses = (plane[3] - sum(normal[i] * offset[i] for i in range(3))) * per
            low[line] = jnp.maximum(low[line], jnp.where(per < 0.0, crosses, -jnp.inf))
            high[line] = jnp.minimum(high[line], jnp.where(per < 0.0, jnp.inf, crosses))
    return _least(low, high, ways)


def _least(low: Sequence, high: Sequence, ways: Ways) -> Float[jax.Array, "W K E"]:
    """Depths of points whose lines are in the pieces from `low` to `high`, by line."""
    depth: AnyArray = np.full(1, np.inf, np.float32)
    for line, above in enumerate(ways.above):
        meets = (low[line] <= high[line]) & (low[line] <= ways.length[:, :, line, None]) & (high[line] >= 0.0)
        depth = jnp.minimum(depth, jnp.where(meets, jnp.maximum(low[line], 0.0) + above, jnp.inf))
    return jnp.asarray(depth)


def _into_primitives(pieces: FallPieces, turn: list, at: list, ways: Ways) -> Float[jax.Array, "W K E"]:
    kind, size, rotation, pos = pieces.kind, pieces.size, pieces.rotation, pieces.pos
    assert kind is not None and size is not None and rotation is not None and pos is not None
    low, high = [], []
    down = [-turn[2][j] for j in range(3)]
    for line in range(len(ways.above)):
        offset = [ways.start[:, :, line, i, None] - at[i] for i in range(3)]
        origin = [sum(turn[i][j] * offset[i] for i in range(3)) - pos[:, j] for j in range(3)]
        o, d = (
            jnp.stack([sum(rotation[:, i, j] * v[i] for i in range(3)) for j in range(3)], axis=-1)
            for v in (origin, down)
        )
        interval = rays.piece_interval(kind, size, np.zeros((1, 4), np.float32), o, d + 0.0 * o)
        low.append(interval[0])
        high.append(interval[1])
    return _least(low, high, ways)
