"""What a falling point meets first: vertical lines against the pieces of all objects, all at once.

A piece is an intersection of slabs: a box, as nearly all are, of three. Pieces of bodies that never move are in the
world's frame already. There is no loop and no list of candidates: a GPU takes longer to start a kernel, or to ask the
host how a loop goes on, than to hold a few lines against some hundred boxes. What is computed of a piece is numbers,
not vectors (`ig2mj.geometry.frames`), and one reduction over the pieces of a group finds what all points meet, so that
XLA makes few kernels of it and keeps little in between. `ig2mj.geometry.targets.fall_contact` answers for each object.

Axes: W worlds, K points, S lines of a point's way, B bodies, E pieces, A slabs, O objects.
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
from ig2mj.geometry.frames import Frames, Numbers, dot, numbers
from ig2mj.geometry.poses import AnyArray, matrices_on_host
from ig2mj.scene.tables import PieceKind, SceneTables

BOX = 3
"""Slabs of a box."""

FEW = 5
"""Slabs up to which polyhedra that are no boxes are a group of their own. On a GPU the slabs of those with more are an
axis, since programs get long, and those that never move are with them."""

OPPOSITE = -1.0 + 1e-6
"""Largest product of unit normals of faces that count as parallel."""

STEEPEST = 1e-9
"""Least slope of a line against a face: a line along a face never crosses it within metres."""

FAR = 1e6
"""m where there is nothing to meet."""

NONE = np.iinfo(np.int32).max
"""Number of no object."""

SCENES = 8
"""Scenes whose pieces are kept: those asked for last."""


@dataclasses.dataclass(frozen=True, eq=False)
class FallPieces:
    """Pieces of a scene's objects that are computed alike, in rising order of objects.

    Attributes:
      object: of each piece. body: likewise; None: these pieces never move, and all is in the world's frame.
      slabs: pairs of parallel faces in the frame of the body, of which a polyhedron is the intersection: normal, and
        distances of the middle and of each face from it, m; None of other pieces. Where a polyhedron has no opposite
        face, the slab ends at its farthest vertex.
      kind, size, pos, rotation: shapes of primitives and their poses in their bodies; None of polyhedra.
    """

    object: Int[np.ndarray, "E"]
    body: Int[np.ndarray, "E"] | None
    slabs: Float[np.ndarray, "E A 5"] | None = None
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
        rests = tables.body_rests[tables.piece_body[order]] & solid  # round ones are few: one group
        return (*_groups(tables, order[rests], True), *_groups(tables, order[~rests], False))


def _groups(tables: SceneTables, pieces: Int[np.ndarray, "E"], rests: bool) -> list[FallPieces]:
    """Groups of pieces. `rests`: all are polyhedra whose bodies never move."""
    pos, rotation = tables.piece_pos[pieces], matrices_on_host(tables.piece_quat[pieces])
    if rests:
        at, quat = tables.body_rest_pos[tables.piece_body[pieces]], tables.body_rest_quat[tables.piece_body[pieces]]
        turn = matrices_on_host(quat)
        pos, rotation = at + np.einsum("eij,ej->ei", turn, pos), np.einsum("eij,ejk->eik", turn, rotation)
    owner = tables.piece_object[pieces]
    body = None if rests else tables.piece_body[pieces]
    solid = tables.piece_kind[pieces] == PieceKind.POLYHEDRON
    polyhedra = np.flatnonzero(solid)
    slabs = _all_slabs(tables, pieces[polyhedra], pos[polyhedra], rotation[polyhedra])
    counts = (BOX,) if rests and not _on_cpu() else (BOX, FEW)
    group = np.searchsorted(counts, [len(found) for found in slabs])
    found = []
    for number in np.unique(group):
        own = np.flatnonzero(group == number)
        most = max(len(slabs[e]) for e in own)
        rows = [np.concatenate([slabs[e], np.repeat(slabs[e][:1], most - len(slabs[e]), axis=0)]) for e in own]
        own = polyhedra[own]
        found.append(FallPieces(owner[own], None if body is None else body[own], slabs=np.array(rows, np.float32)))
    rest = np.flatnonzero(~solid)
    if len(rest):
        shapes = dict(
            kind=tables.piece_kind[pieces[rest]],
            size=tables.piece_size[pieces[rest]].astype(np.float32),
            pos=pos[rest].astype(np.float32),
            rotation=rotation[rest].astype(np.float32),
        )
        found.append(FallPieces(owner[rest], None if body is None else body[rest], **shapes))
    return found


def _all_slabs(
    tables: SceneTables,
    polyhedra: Int[np.ndarray, "E"],
    pos: Float[np.ndarray, "E 3"],
    rotation: Float[np.ndarray, "E 3 3"],
) -> list[Float[np.ndarray, "A 5"]]:
    """The slabs of polyhedra in the frame in which `pos` and `rotation` are."""
    planes = tables.piece_planes[polyhedra]
    normals = np.einsum("eij,enj->eni", rotation, planes[..., :3])
    offsets = planes[..., 3] + np.einsum("eni,ei->en", normals, pos)
    vertices = np.einsum("eij,evj->evi", rotation, tables.piece_vertices[polyhedra]) + pos[:, None]
    used = np.any(planes[..., :3] != 0.0, axis=-1)
    return [_slabs(n[u], d[u], v) for n, d, u, v in zip(normals, offsets, used, vertices, strict=True)]


def _slabs(
    normals: Float[np.ndarray, "N 3"], offsets: Float[np.ndarray, "N"], vertices: Float[np.ndarray, "V 3"]
) -> Float[np.ndarray, "A 5"]:
    """The slabs of which a body of half-spaces is the intersection."""
    opposite = normals @ normals.T <= OPPOSITE
    made, left = [], np.ones(len(normals), bool)
    for n, (normal, offset, others) in enumerate(zip(normals, offsets, opposite, strict=True)):
        if not left[n]:
            continue
        left[n] = False
        partner = np.flatnonzero(others & left)
        left[partner] = False
        end = -offsets[partner].min() if len(partner) else np.min(vertices @ normal)
        made.append([*normal, 0.5 * (offset + end), 0.5 * (offset - end)])
    return np.array(made)


class Ways(NamedTuple):
    """Points that fall, each along lines straight down that are moved aside.

    Attributes:
      active: there is a point. start: x, y and z of where it begins, m, world frame. aside: x and y of the direction
        in which its lines are moved. ignored: object that is not in its way, -1: none.
      shift: m by which each line is moved aside. depth: m below the start at which each line begins, and where the last
        ends.
    """

    active: Bool[AnyArray, "W K"]
    start: Sequence[Float[AnyArray, "W K"]]
    aside: Sequence[Float[AnyArray, "W K"]]
    ignored: Int[AnyArray, "W K"]
    shift: Float[np.ndarray, "S"]
    depth: Float[np.ndarray, "S1"]

    def line(self, number: int) -> list[Float[AnyArray, "W K 1"]]:
        """Where a line begins, number by number."""
        x, y = (self.start[i] + float(self.shift[number]) * self.aside[i] for i in range(2))
        return [n[..., None] for n in (x, y, self.start[2] - float(self.depth[number]))]


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
        frame = Frames(None, None)
        if pieces.body is not None:
            frame = Frames.of(body_pos, body_quat, pieces.body).with_axes(1)
        found = _nearer(found, _first_of(pieces, frame, ways))
    return found


def _nearer(one: FirstMet, other: FirstMet) -> FirstMet:
    takes = (other.depth < one.depth) | ((other.depth == one.depth) & (other.object < one.object))
    return FirstMet(jnp.where(takes, other.object, one.object), jnp.where(takes, other.depth, one.depth))


def _first_of(pieces: FallPieces, frame: Frames, ways: Ways) -> FirstMet:
    """`first_met` of a group."""
    owner = pieces.object.astype(np.int32)
    if _on_cpu():
        depth = _depths(pieces, frame, ways)
        least = jnp.min(depth, axis=-1)
        # the search for the place of the least is one number at a time
        found = jnp.min(jnp.where(depth <= least[..., None], owner, NONE), axis=-1)
    elif pieces.slabs is None or pieces.body is None or pieces.slabs.shape[1] > FEW:
        (least,), (found,) = least_of_all([_depths(pieces, frame, ways)], owner)
    else:  # what is computed of the pieces serves all points
        of_points = [_depths(pieces, frame, _point(ways, k))[:, 0] for k in range(ways.active.shape[1])]
        least, found = (jnp.stack(x, axis=-1) for x in least_of_all(of_points, owner))
    return FirstMet(jnp.where(jnp.isfinite(least), found, -1), least)


def _on_cpu() -> bool:
    return jax.default_backend() == "cpu"


def _point(ways: Ways, k: int) -> Ways:
    """One of the points, which is moved out of the way where it is none."""
    own = slice(k, k + 1)
    x = jnp.where(ways.active[:, own], ways.start[0][:, own], FAR)
    start = [x, *(n[:, own] for n in ways.start[1:])]
    return ways._replace(
        active=np.ones((1, 1), bool), start=start, aside=[n[:, own] for n in ways.aside], ignored=ways.ignored[:, own]
    )


def least_of_all(
    depths: Sequence[Float[jax.Array, "*b E"]], owner: Int[np.ndarray, "E"]
) -> tuple[Sequence[Float[jax.Array, "*b"]], Sequence[Int[jax.Array, "*b"]]]:
    """The least of each of some depths and its owner, the first of equals, in one reduction."""
    count = len(depths)
    owners = jnp.broadcast_to(jnp.asarray(owner), depths[0].shape)

    def nearer(one: tuple, other: tuple) -> tuple:
        pairs = [_nearer(FirstMet(one[count + k], one[k]), FirstMet(other[count + k], other[k])) for k in range(count)]
        return (*(pair.depth for pair in pairs), *(pair.object for pair in pairs))

    far, none = np.float32(np.inf), np.int32(NONE)
    operands, start = (*depths, *[owners] * count), (*[far] * count, *[none] * count)
    found = jax.lax.reduce(operands, start, nearer, (depths[0].ndim - 1,))
    return found[:count], found[count:]


def _depths(pieces: FallPieces, frame: Frames, ways: Ways) -> Float[jax.Array, "W K E"]:
    """How deep each point has fallen where it meets each piece; inf: it does not."""
    if pieces.slabs is None:
        depth = _into_round(pieces, frame, ways)
    elif pieces.slabs.shape[1] > FEW and not _on_cpu():
        depth = _into_many_slabs(pieces.slabs, frame, ways)
    else:
        depth = _into_slabs(pieces.slabs, frame, ways)
    return jnp.where((ways.ignored[..., None] != pieces.object) & ways.active[..., None], depth, jnp.inf)


def _into_slabs(slabs: Float[np.ndarray, "E A 5"], frame: Frames, ways: Ways) -> Float[jax.Array, "W K E"]:
    every = range(slabs.shape[1])
    normal = [frame.turned(numbers(slabs[:, a, :3])) for a in every]
    per = [1.0 / _steep(-n[2]) for n in normal]
    half = [jnp.abs(per[a]) * slabs[:, a, 4] for a in every]
    depth: AnyArray = np.full(1, np.inf, np.float32)
    for line in range(len(ways.shift)):  # in the same pass over the polyhedra
        offset = frame.offset(ways.line(line))
        middle = [(slabs[:, a, 3] - dot(normal[a], offset)) * per[a] for a in every]
        low = functools.reduce(jnp.maximum, [m - h for m, h in zip(middle, half, strict=True)])
        high = functools.reduce(jnp.minimum, [m + h for m, h in zip(middle, half, strict=True)])
        depth = jnp.minimum(depth, _met(low, high, ways, line))
    return jnp.asarray(depth)


def _steep(slope: AnyArray) -> AnyArray:
    """Slopes of faces against the way down, none of them 0."""
    return jnp.where(jnp.abs(slope) < STEEPEST, -STEEPEST, slope)


def _met(low: AnyArray, high: AnyArray, ways: Ways, line: int) -> AnyArray:
    """How deep points have fallen where one of their lines is in pieces from `low` to `high`; inf: it ends before."""
    length = float(ways.depth[line + 1] - ways.depth[line])
    meets = (low <= high) & (low <= length) & (high >= 0.0)
    return jnp.where(meets, jnp.maximum(low, 0.0) + float(ways.depth[line]), jnp.inf)


def _into_many_slabs(slabs: Float[np.ndarray, "E A 5"], frame: Frames, ways: Ways) -> Float[jax.Array, "W K E"]:
    """`_into_slabs` with an axis of slabs [W, K, E, A]."""
    normal = numbers(slabs[..., :3])
    per = 1.0 / _steep(-dot([jnp.asarray(up)[..., None] for up in frame.up()], normal))
    half = jnp.abs(per) * slabs[..., 4]
    depth: AnyArray = np.full(1, np.inf, np.float32)
    lows, highs = list[jax.Array](), list[jax.Array]()
    for line in range(len(ways.shift)):
        start = frame.local(frame.offset(ways.line(line)))
        middle = (slabs[..., 3] - dot([x[..., None] for x in start], normal)) * per
        lows.append(jnp.asarray(middle - half))
        highs.append(jnp.asarray(-middle - half))
    ends = _greatest([*lows, *highs])
    for line, (low, high) in enumerate(zip(ends[: len(lows)], ends[len(lows) :], strict=True)):
        depth = jnp.minimum(depth, _met(low, -high, ways, line))
    return jnp.asarray(depth)


def _greatest(values: Sequence[Float[jax.Array, "*b A"]]) -> Sequence[Float[jax.Array, "*b"]]:
    """The greatest of each array along its last axis, in one reduction."""

    def greater(one: tuple, other: tuple) -> tuple:
        return tuple(jnp.maximum(a, b) for a, b in zip(one, other, strict=True))

    return jax.lax.reduce(tuple(values), tuple([np.float32(-np.inf)] * len(values)), greater, (values[0].ndim - 1,))


def _into_round(pieces: FallPieces, frame: Frames, ways: Ways) -> Float[jax.Array, "W K E"]:
    """Depths of spheres, capsules and cylinders."""
    kind, size, rotation, pos = pieces.kind, pieces.size, pieces.rotation, pieces.pos
    assert kind is not None and size is not None and rotation is not None and pos is not None
    own = Frames([[rotation[:, i, j] for j in range(3)] for i in range(3)], numbers(pos))
    d = [-n for n in own.local(frame.up())]
    depth: AnyArray = np.full(1, np.inf, np.float32)
    for line in range(len(ways.shift)):
        start = own.local(own.offset(frame.local(frame.offset(ways.line(line)))))
        depth = jnp.minimum(depth, _met(*_in_round(kind, size, start, d), ways, line))
    return jnp.asarray(depth)


def _in_round(
    kind: Int[np.ndarray, "E"], size: Float[np.ndarray, "E 3"], o: Numbers, d: Numbers
) -> tuple[AnyArray, AnyArray]:
    """The intervals of lines in pieces, in the pieces' frames; (inf, -inf): none."""
    radius, half = size[:, 0], size[:, 1]
    side = rays.quadratic_interval(dot(d[:2], d[:2]), dot(o[:2], d[:2]), dot(o[:2], o[:2]), radius)
    ends = _between(o[2], d[2], half)
    low, high = jnp.maximum(side[0], ends[0]), jnp.minimum(side[1], ends[1])
    low, high = jnp.where(low > high, jnp.inf, low), jnp.where(low > high, -jnp.inf, high)
    if (kind == PieceKind.CYLINDER).all():
        return low, high
    for end in (-1.0, 1.0):
        ball = [*o[:2], o[2] - np.where(kind == PieceKind.CAPSULE, end * half, 0.0).astype(np.float32)]
        inside = rays.quadratic_interval(dot(d, d), dot(ball, d), dot(ball, ball), radius)
        joined = jnp.minimum(low, inside[0]), jnp.maximum(high, inside[1])
        low, high = (
            jnp.where(kind == PieceKind.SPHERE, own, jnp.where(kind == PieceKind.CAPSULE, more, before))
            for own, more, before in zip(inside, joined, (low, high), strict=True)
        )
    return low, high


def _between(start: AnyArray, slope: AnyArray, half: Float[np.ndarray, "E"]) -> tuple[AnyArray, AnyArray]:
    """Where |start + slope t| <= half."""
    per = 1.0 / _steep(slope)
    middle, width = -start * per, half * jnp.abs(per)
    return middle - width, middle + width
