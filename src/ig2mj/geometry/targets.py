"""Rays from chosen objects against the pieces of chosen target objects: the adjacency behind on_top, under, inside,
next_to.

Only the pairs a task names are computed, and of the target only its real pieces. Both are known before tracing, so
`RayTargets` lays the work out once on the host: entry e is one (pair, piece); entries of one kind and one number of
half-spaces stand together; half-spaces are kept in the frame of the BODY the piece rides on. Inside the step, arrays
have the shape [W, R, E] with the entries last, and nothing that holds both lines and half-spaces is ever stored.

Axes: W worlds, P pairs, R lines, B bodies, K pieces of the scene, E entries.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from ig2mj.geometry import rays
from ig2mj.geometry.poses import AnyArray, matrices_on_host, quat_to_matrix
from ig2mj.scene.tables import PieceKind, SceneTables

PLANE_STEPS = (6, 12, 24, 48, 96, 192, 384, 768)
"""Polyhedra are grouped by number of half-spaces, rounded up to one of these: a box is not charged for 60 faces."""

FORWARDS, BACKWARDS = np.uint8(1), np.uint8(2)


@dataclasses.dataclass(frozen=True, eq=False)
class EntryGroup:
    """Entries that are computed alike.

    Attributes:
      kind: their shape. pair, body: of each entry; `body` may be traced. pos, rotation: pose of the piece in its body
      (primitives only; rotation maps piece axes to body axes). size: MuJoCo's geom_size. planes: half-spaces in the
      body's frame, with their number first, so that planes[n] is one half-space of every entry; zero of them for
      primitives.
    """

    kind: PieceKind
    pair: Int[np.ndarray, "E"]
    body: Int[AnyArray, "E"]
    pos: Float[AnyArray, "E 3"]
    rotation: Float[AnyArray, "E 3 3"]
    size: Float[AnyArray, "E 3"]
    planes: Float[AnyArray, "N 4 E"]


@dataclasses.dataclass(frozen=True, eq=False)
class RayTargets:
    """Which pieces the rays of each pair are held against. Built once per scene and list of pairs.

    Attributes:
      num_pairs: P. groups: the entries. slots: for each pair the positions of its entries in the joined groups, padded
      with the number of entries, [P, most entries of a pair]. planes_at_once: of `rays.clip_line`.
    """

    num_pairs: int
    groups: tuple[EntryGroup, ...]
    slots: Int[AnyArray, "P S"]
    planes_at_once: int | None = None

    @classmethod
    def build(
        cls, tables: SceneTables, targets: Int[np.ndarray, "P"], plane_steps: Sequence[int] = PLANE_STEPS
    ) -> RayTargets:
        """Lay out the work for P pairs, `targets` being the object index whose pieces each pair's rays may enter.

        Fewer `plane_steps` make a shorter program that computes more padding.
        """
        return cls.from_pieces(
            np.asarray(targets),
            tables.piece_object,
            tables.piece_body,
            tables.piece_pos,
            tables.piece_quat,
            tables.piece_kind,
            tables.piece_size,
            tables.piece_planes,
            plane_steps,
        )

    @classmethod
    def from_pieces(
        cls,
        targets: Int[np.ndarray, "P"],
        piece_object: Int[np.ndarray, "K"],
        piece_body: Int[np.ndarray, "K"],
        piece_pos: Float[np.ndarray, "K 3"],
        piece_quat: Float[np.ndarray, "K 4"],
        piece_kind: Int[np.ndarray, "K"],
        piece_size: Float[np.ndarray, "K 3"],
        piece_planes: Float[np.ndarray, "K N 4"],
        plane_steps: Sequence[int] = PLANE_STEPS,
    ) -> RayTargets:
        """As `build`, from the pieces' tables one by one."""
        owned = [np.flatnonzero(piece_object == target) for target in targets]
        pair = np.concatenate([np.full(len(o), p) for p, o in enumerate(owned)] or [np.zeros(0)]).astype(int)
        piece = np.concatenate([*owned, np.zeros(0)]).astype(int)
        steps = _plane_steps(piece_kind[piece], piece_planes[piece], plane_steps)
        rotation = matrices_on_host(piece_quat)
        groups, order = [], []
        for kind, step in sorted(set(zip(piece_kind[piece].tolist(), steps.tolist(), strict=True))):
            members = np.flatnonzero((piece_kind[piece] == kind) & (steps == step))
            k = piece[members]
            order.append(members)
            groups.append(
                EntryGroup(
                    kind=PieceKind(kind),
                    pair=pair[members],
                    body=piece_body[k],
                    pos=piece_pos[k].astype(np.float32),
                    rotation=rotation[k].astype(np.float32),
                    size=piece_size[k].astype(np.float32),
                    planes=planes_in_body(piece_planes[k], piece_pos[k], rotation[k], step),
                )
            )
        slots = _slots(pair[np.concatenate([*order, np.zeros(0, int)])], len(targets))
        return cls(num_pairs=len(targets), groups=tuple(groups), slots=slots)


def lines_enter_targets(
    targets: RayTargets,
    body_pos: Float[AnyArray, "W B 3"],
    body_quat: Float[AnyArray, "W B 4"],
    origins: Float[AnyArray, "W P 3"],
    directions: Float[AnyArray, "R 3"],
    lengths: Float[AnyArray, "R"],
    inflate: float = 0.0,
) -> tuple[Bool[Array, "W P R"], Bool[Array, "W P R"]]:
    """Whether the rays from each pair's origin enter any piece of its target: (along +direction, along -direction).

    Both ways cost as much as one. `directions` are unit vectors in world axes, the same for all pairs; `lengths` in
    metres. False for targets without pieces and wherever a pose or an origin is NaN.
    """
    sides = _sides(targets, body_pos, body_quat, origins, directions, lengths, inflate)
    return (sides & FORWARDS) > 0, (sides & BACKWARDS) > 0


def fall_contact(
    targets: RayTargets,
    body_pos: Float[AnyArray, "W B 3"],
    body_quat: Float[AnyArray, "W B 4"],
    points: Float[AnyArray, "W N 3"],
    distances: Float[AnyArray, "W N"],
    inflate: float = 0.0,
) -> Float[Array, "W N P"]:
    """How far every point falls straight down before it meets each target, metres; inf where not within its distance.

    Unlike for rays, a point that is inside a piece already meets it at 0. With `inflate` the points are balls of that
    radius, exactly so above faces (half-spaces are moved outwards, so edges of a polyhedron stay sharp).
    """
    none = jnp.full((*points.shape[:2], 1), jnp.inf)
    down = np.array([[0.0, 0.0, -1.0]], np.float32)
    found = []
    for group in targets.groups:
        origin, direction = _in_body_frames(group, body_pos, body_quat, points[:, :, None], down)
        low, low_by, high, high_by = _clip(group, origin, direction, inflate, targets.planes_at_once)
        reaches = (low * high_by <= high * low_by) & (low <= distances[..., None] * low_by) & (high >= 0.0)
        found.append(jnp.where(reaches, jnp.maximum(low / low_by, 0.0), jnp.inf))
    return jnp.min(jnp.concatenate([*found, none], axis=-1)[:, :, targets.slots], axis=-1, initial=jnp.inf)


def _sides(
    targets: RayTargets,
    body_pos: Float[AnyArray, "W B 3"],
    body_quat: Float[AnyArray, "W B 4"],
    origins: Float[AnyArray, "W P 3"],
    directions: Float[AnyArray, "R 3"],
    lengths: Float[AnyArray, "R"],
    inflate: float,
) -> UInt8[Array, "W P R"]:
    """FORWARDS and BACKWARDS bits of every pair and line, any piece of the target counting."""
    none = jnp.zeros((origins.shape[0], directions.shape[0], 1), jnp.uint8)  # what padded slots point to
    once = targets.planes_at_once
    found = [_group_sides(g, body_pos, body_quat, origins, directions, lengths, inflate, once) for g in targets.groups]
    of_entries = jnp.concatenate([*found, none], axis=-1)[:, :, targets.slots]
    return jnp.swapaxes(jnp.bitwise_or.reduce(of_entries, axis=-1), 1, 2)


def _group_sides(
    group: EntryGroup,
    body_pos: Float[AnyArray, "W B 3"],
    body_quat: Float[AnyArray, "W B 4"],
    origins: Float[AnyArray, "W P 3"],
    directions: Float[AnyArray, "R 3"],
    lengths: Float[AnyArray, "R"],
    inflate: float,
    planes_at_once: int | None,
) -> UInt8[Array, "W R E"]:
    """The bits for every entry. One array rather than two, or XLA goes through the half-spaces twice."""
    origin, direction = _in_body_frames(group, body_pos, body_quat, origins[:, None, group.pair], directions)
    clipped = _clip(group, origin, direction, inflate, planes_at_once)
    forwards, backwards = rays.fractions_enter(*clipped, lengths[:, None])
    return forwards * FORWARDS | backwards * BACKWARDS


def _in_body_frames(
    group: EntryGroup,
    body_pos: Float[AnyArray, "W B 3"],
    body_quat: Float[AnyArray, "W B 4"],
    origins: Float[AnyArray, "W #R #E 3"],
    directions: Float[AnyArray, "#R 3"],
) -> tuple[list, list]:
    """Components x, y, z of origins and directions, each [W, R or 1, E], in the frame of each entry's body."""
    if isinstance(group.body, np.ndarray):
        bodies, place = np.unique(group.body, return_inverse=True)
    else:
        bodies, place = slice(None), group.body
    axes = quat_to_matrix(jnp.asarray(body_quat)[:, bodies])  # [W, bodies, 3, 3], columns are the body's axes
    offset = origins - jnp.asarray(body_pos)[:, None, group.body]
    columns = [[axes[:, None, :, i, j][:, :, place] for i in range(3)] for j in range(3)]
    origin = [
        column[0] * offset[..., 0] + column[1] * offset[..., 1] + column[2] * offset[..., 2] for column in columns
    ]
    x, y, z = (directions[:, i, None] for i in range(3))
    return origin, [column[0] * x + column[1] * y + column[2] * z for column in columns]


def _clip(
    group: EntryGroup, origin: list, direction: list, inflate: float, planes_at_once: int | None
) -> tuple[Array, Array, Array, Array]:
    """The lines' intervals inside the entries' pieces as fractions (see `rays.clip_line`), each [W, R, E]."""
    if group.kind is PieceKind.POLYHEDRON:
        # The barrier keeps the half-spaces one array (as separate constants they cost five times the time on a CPU)
        # and the gathers before from being repeated for each of them.
        planes, origin, direction = jax.lax.optimization_barrier((jnp.asarray(group.planes), origin, direction))
        return rays.clip_line(planes, origin, direction, inflate, planes_at_once)
    # A vector in piece axes is rotation^T v, which is v @ rotation.
    o = jnp.einsum("wrei,eij->wrej", jnp.stack(origin, axis=-1) - group.pos, group.rotation)
    d = jnp.einsum("wrei,eij->wrej", jnp.stack(direction, axis=-1), group.rotation)
    kinds = np.full(len(group.pair), group.kind)
    low, high = rays.piece_interval(kinds, group.size, np.zeros((1, 0, 4), np.float32), o, d, inflate)
    bound = jnp.float32(rays.UNBOUNDED)  # infinity times a divisor is fine, infinity against infinity is not
    return jnp.clip(low, -bound, bound), jnp.ones_like(low), jnp.clip(high, -bound, bound), jnp.ones_like(high)


def _plane_steps(
    kind: Int[np.ndarray, "E"], planes: Float[np.ndarray, "E N 4"], steps: Sequence[int]
) -> Int[np.ndarray, "E"]:
    """Number of half-spaces of each polyhedron rounded up to a step, or to the largest number; 0 for other kinds."""
    count = np.where(kind == PieceKind.POLYHEDRON, np.any(planes[..., :3] != 0.0, axis=-1).sum(axis=-1), 0)
    most = int(count.max(initial=0))
    rounded = np.array([*(s for s in steps if s < most), most])
    return np.where(kind == PieceKind.POLYHEDRON, rounded[np.searchsorted(rounded, count)], 0)


def planes_in_body(
    planes: Float[np.ndarray, "E N 4"],
    pos: Float[np.ndarray, "E 3"],
    rotation: Float[np.ndarray, "E 3 3"],
    step: int,
) -> Float[np.ndarray, "M 4 E"]:
    """The first `step` half-spaces of each piece, those in use sorted to the front, moved into the body's frame."""
    unused = np.all(planes[..., :3] == 0.0, axis=-1)
    front = np.argsort(unused, axis=1, kind="stable")
    planes = np.take_along_axis(planes, front[..., None], axis=1)[:, :step].astype(np.float64)
    normal = np.einsum("eij,enj->eni", rotation, planes[..., :3])
    offset = planes[..., 3] + np.einsum("eni,ei->en", normal, pos)
    moved = np.concatenate([normal, offset[..., None]], axis=-1).astype(np.float32)
    return np.ascontiguousarray(moved.transpose(1, 2, 0))


def _slots(pair: Int[np.ndarray, "E"], num_pairs: int) -> Int[np.ndarray, "P S"]:
    members = [np.flatnonzero(pair == p) for p in range(num_pairs)]
    slots = np.full((num_pairs, max((len(m) for m in members), default=0)), len(pair))
    for row, m in zip(slots, members, strict=True):
        row[: len(m)] = m
    return slots
