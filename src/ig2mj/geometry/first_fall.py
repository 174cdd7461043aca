"""What a falling point meets first: vertical lines against the pieces of all objects, most of which are far away.

Boxes of the pieces along the world's axes leave few candidates (some at a time); only these are
held against half-spaces. `ig2mj.geometry.targets.fall_contact` answers for each object, at the cost of all pieces.

Axes: W worlds, K points, S lines of a point's way, B bodies, E pieces, M candidates of a turn, O objects.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from ig2mj.geometry import rays
from ig2mj.geometry.boxes import core_boxes, piece_cores
from ig2mj.geometry.poses import AnyArray, matrices_on_host, quat_to_matrix
from ig2mj.geometry.targets import planes_in_body
from ig2mj.scene.tables import PieceKind, SceneTables

AT_ONCE = {"cpu": (16, 4), "gpu": (32, 8)}
"""Candidates of a turn, of pieces with few half-spaces and of others. On a GPU a turn costs more than what it
computes."""

WORD = 32
"""Bits of the words in which candidates are marked."""

PLAIN = 8
"""Half-spaces up to which pieces, most of them boxes, are a group of their own."""

SLACK = 1e-3
"""m by which boxes are larger than their pieces: rounding."""

NONE = np.iinfo(np.int32).max
"""Number of no object."""

SCENES = 8
"""Scenes whose pieces are kept: those asked for last."""


@dataclasses.dataclass(frozen=True, eq=False)
class FallPieces:
    """Pieces of a scene's objects, those of one object next to each other, objects in rising order.

    Attributes:
      object, body: of each piece. primitives: they are spheres, capsules or cylinders, else all are polyhedra.
      kind, size, pos, rotation: shapes of primitives and their poses in their bodies. centre, half: box of the piece
        along the axes of its body, m. planes: half-spaces in the frame of the body, of primitives none.
    """

    object: Int[np.ndarray, "E"]
    body: Int[np.ndarray, "E"]
    primitives: bool
    kind: Int[np.ndarray, "E"]
    size: Float[np.ndarray, "E 3"]
    pos: Float[np.ndarray, "E 3"]
    rotation: Float[np.ndarray, "E 3 3"]
    centre: Float[np.ndarray, "E 3"]
    half: Float[np.ndarray, "E 3"]
    planes: Float[np.ndarray, "E N 4"]

    @staticmethod
    @functools.lru_cache(maxsize=SCENES)
    def of(tables: SceneTables) -> tuple[FallPieces, ...]:
        """Those of a scene in groups that are computed alike; asked again, the same objects."""
        solid = tables.piece_kind == PieceKind.POLYHEDRON
        count = np.any(tables.piece_planes[..., :3] != 0.0, axis=-1).sum(axis=-1)
        owned = tables.piece_object >= 0
        groups = (owned & solid & (count <= PLAIN), owned & solid & (count > PLAIN), owned & ~solid)
        return tuple(FallPieces._of_some(tables, np.flatnonzero(mask), count) for mask in groups if mask.any())

    @staticmethod
    def _of_some(tables: SceneTables, some: Int[np.ndarray, "E"], count: Int[np.ndarray, "K"]) -> FallPieces:
        order = some[np.argsort(tables.piece_object[some], kind="stable")]
        rotation = matrices_on_host(tables.piece_quat[order])
        columns = (tables.piece_kind, tables.piece_size, tables.piece_vertices, tables.piece_pos, tables.piece_quat)
        low, high = core_boxes(np.tile(np.eye(3), (len(order), 1, 1)), *piece_cores(*(c[order] for c in columns)))
        planes = planes_in_body(tables.piece_planes[order], tables.piece_pos[order], rotation, int(count[order].max()))
        return FallPieces(
            object=tables.piece_object[order],
            body=tables.piece_body[order],
            primitives=bool(tables.piece_kind[order[0]] != PieceKind.POLYHEDRON),
            kind=tables.piece_kind[order],
            size=tables.piece_size[order].astype(np.float32),
            pos=tables.piece_pos[order].astype(np.float32),
            rotation=rotation.astype(np.float32),
            centre=(0.5 * (low + high)).astype(np.float32),
            half=(0.5 * (high - low) + SLACK).astype(np.float32),
            planes=planes.transpose(2, 0, 1).copy(),
        )


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
    nothing = FirstMet(jnp.full(ways.active.shape, -1, jnp.int32), jnp.full(ways.active.shape, jnp.inf))
    axes, pos = quat_to_matrix(jnp.asarray(body_quat)), jnp.asarray(body_pos)
    marked = [_Marked.of(_near(pieces, axes, pos, ways)) for pieces in groups]
    counts = AT_ONCE["cpu" if jax.default_backend() == "cpu" else "gpu"]
    at_once = [
        counts[0] if pieces.planes.shape[1] <= PLAIN and not pieces.primitives else counts[1] for pieces in groups
    ]
    turns = [-(-jnp.max(m.until[:, -1]) // n) for m, n in zip(marked, at_once, strict=True)]
    most = functools.reduce(jnp.maximum, turns, jnp.int32(0))

    def turn(state: tuple[jax.Array, FirstMet]) -> tuple[jax.Array, FirstMet]:
        number, found = state
        for pieces, of_group, count in zip(groups, marked, at_once, strict=True):
            place = of_group.places(number * count, count)  # [W, M]; E or more: no more
            found = _nearer(found, _first_of(pieces, place, axes, pos, ways))
        return number + 1, found

    return jax.lax.while_loop(lambda state: state[0] < most, turn, (jnp.int32(0), nothing))[1]


def _nearer(one: FirstMet, other: FirstMet) -> FirstMet:
    takes = (other.depth < one.depth) | ((other.depth == one.depth) & (other.object < one.object))
    return FirstMet(jnp.where(takes, other.object, one.object), jnp.where(takes, other.depth, one.depth))


def _first_of(
    pieces: FallPieces,
    place: Int[jax.Array, "W M"],
    axes: Float[jax.Array, "W B 3 3"],
    pos: Float[jax.Array, "W B 3"],
    ways: Ways,
) -> FirstMet:
    """`first_met` of some pieces of a group."""
    count = len(pieces.object)
    piece = jnp.minimum(place, count - 1)
    reach = jnp.where((place < count)[:, None], _reach(pieces, piece, axes, pos, ways), jnp.inf)  # [W, K, M]
    depth = jnp.min(reach, axis=-1)
    owner = jnp.asarray(pieces.object)[piece][:, None]
    mine = jnp.min(jnp.where(reach <= depth[..., None], owner, NONE), axis=-1)
    return FirstMet(jnp.where(jnp.isfinite(depth), mine, -1).astype(jnp.int32), depth)


class _Marked(NamedTuple):
    """Which pieces are marked: bits in words, and how many are in the words up to each, itself included."""

    words: UInt32[jax.Array, "W D"]
    until: Int[jax.Array, "W D"]

    @classmethod
    def of(cls, mask: Bool[jax.Array, "W E"]) -> _Marked:
        padded = jnp.pad(mask, ((0, 0), (0, -mask.shape[1] % WORD))).reshape(len(mask), -1, WORD)
        bits = np.uint32(1) << np.arange(WORD, dtype=np.uint32)
        words = jnp.sum(jnp.where(padded, bits, np.uint32(0)), axis=-1, dtype=jnp.uint32)
        return cls(words, jnp.cumsum(jax.lax.population_count(words).astype(jnp.int32), axis=-1))

    def places(self, first: jax.Array, count: int) -> Int[jax.Array, "W M"]:
        """Places of `count` marked pieces, from a number on; beyond the last a number past the end."""
        number = first + np.arange(count, dtype=np.int32)  # [M]
        before = self.until[:, None] <= number[:, None]  # [W, M, D]
        word = jnp.sum(before, axis=-1, dtype=jnp.int32)
        passed = jnp.max(jnp.where(before, self.until[:, None], 0), axis=-1)
        mine = word[..., None] == np.arange(self.words.shape[1])
        bits = jnp.sum(jnp.where(mine, self.words[:, None], np.uint32(0)), axis=-1, dtype=jnp.uint32)
        left, at = number - passed, jnp.zeros_like(word)
        for width in (16, 8, 4, 2, 1):
            low = bits & np.uint32((1 << width) - 1)
            there = jax.lax.population_count(low).astype(jnp.int32)
            later = left >= there
            left = jnp.where(later, left - there, left)
            bits = jnp.where(later, bits >> np.uint32(width), low)
            at = jnp.where(later, at + width, at)
        return jnp.where(word < self.words.shape[1], word * WORD + at, NONE)


def _near(
    pieces: FallPieces, axes: Float[jax.Array, "W B 3 3"], pos: Float[jax.Array, "W B 3"], ways: Ways
) -> Bool[jax.Array, "W E"]:
    """Pieces whose boxes some line of an active point passes through."""
    turn = [[axes[:, pieces.body, i, j] for j in range(3)] for i in range(3)]  # [W, E] each
    centre = [pos[:, pieces.body, i] + sum(turn[i][j] * pieces.centre[:, j] for j in range(3)) for i in range(3)]
    half = [sum(jnp.abs(turn[i][j]) * pieces.half[:, j] for j in range(3)) for i in range(3)]
    found = jnp.zeros(centre[0].shape, bool)
    for k in range(ways.active.shape[1]):
        of_point = jnp.zeros(found.shape, bool)
        for s in range(len(ways.above)):
            x, y, z = (ways.start[:, k, s, i, None] for i in range(3))
            within = (jnp.abs(x - centre[0]) <= half[0]) & (jnp.abs(y - centre[1]) <= half[1])
            top, bottom = centre[2] + half[2], centre[2] - half[2]
            of_point |= within & (z >= bottom) & (z - ways.length[:, k, s, None] <= top)
        found |= of_point & ways.active[:, k, None] & (ways.ignored[:, k, None] != pieces.object)
    return found


def _reach(
    pieces: FallPieces,
    piece: Int[jax.Array, "W M"],
    axes: Float[jax.Array, "W B 3 3"],
    pos: Float[jax.Array, "W B 3"],
    ways: Ways,
) -> Float[jax.Array, "W K M"]:
    """How deep each point has fallen where it meets each candidate; inf: it does not."""
    body = jnp.asarray(pieces.body)[piece]
    turn = jnp.take_along_axis(axes, body[..., None, None], axis=1)[:, None, None]  # [W, 1, 1, M, 3, 3]
    offset = ways.start[:, :, :, None] - jnp.take_along_axis(pos, body[..., None], axis=1)[:, None, None]
    origin = [sum(turn[..., i, j] * offset[..., i] for i in range(3)) for j in range(3)]  # [W, K, S, M]
    down = [-turn[..., 2, j] for j in range(3)]
    if pieces.primitives:
        depth = _into_primitives(pieces, piece, origin, down, ways)
    else:
        planes = jnp.moveaxis(jnp.asarray(pieces.planes)[piece], (2, 3), (0, 1))[:, :, :, None, None]
        # Gathered once, not for each half-space.
        planes, origin, down = jax.lax.optimization_barrier((planes, origin, down))
        low, low_by, high, high_by = rays.clip_line(planes, origin, down)
        meets = (low * high_by <= high * low_by) & (low <= ways.length[..., None] * low_by) & (high >= 0.0)
        depth = jnp.where(meets, jnp.maximum(low / low_by, 0.0), jnp.inf)
    ignored = ways.ignored[..., None] == jnp.asarray(pieces.object)[piece][:, None]
    depth = jnp.where(ignored[:, :, None] | ~ways.active[:, :, None, None], jnp.inf, depth)
    return jnp.min(depth + ways.above[:, None], axis=2)


def _into_primitives(
    pieces: FallPieces, piece: Int[jax.Array, "W M"], origin: list, down: list, ways: Ways
) -> Float[jax.Array, "W K S M"]:
    """How far each line runs until it meets each candidate."""
    kind, size, turn, at = (
        jnp.asarray(column)[piece][:, None, None] for column in (pieces.kind, pieces.size, pieces.rotation, pieces.pos)
    )
    point = jnp.stack(origin, axis=-1) - at
    o = jnp.sum(turn * point[..., None], axis=-2)
    d = jnp.sum(turn * jnp.stack(down, axis=-1)[..., None], axis=-2) + 0.0 * o
    depth = jnp.full(o.shape[:-1], jnp.inf)
    for shape in np.unique(pieces.kind):
        low, high = rays.piece_interval(np.array(shape), size, np.zeros((1, 4), np.float32), o, d)
        meets = (low <= high) & (low <= ways.length[..., None]) & (high >= 0.0)
        depth = jnp.where((kind == shape) & meets, jnp.maximum(low, 0.0), depth)
    return depth
