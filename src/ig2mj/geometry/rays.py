"""Rays against convex pieces: where does a ray ENTER a piece, for every piece on the line and not just the nearest.

iGibson's adjacency states rest on Bullet's rays (adjacency.py): a ray that starts inside a convex shape does not
hit it, nothing occludes anything, and a hit means that the ray enters the shape at 0 <= t <= length. Hence the basic
function here is the interval [t_in, t_out] of a whole line inside a shape; whether a ray enters, forwards or
backwards, follows from it. An empty interval is (inf, -inf). t counts in multiples of the direction's length.

Shapes are in their own frame: capsules and cylinders lie along z; `size` is MuJoCo's geom_size (radius, half length);
polyhedra are half-spaces (n, d) with n.x <= d, |n| = 1, padded with (0, 0, 0, 1). `inflate` (metres) grows a shape;
Bullet's rays see hulls grown by 1.75 mm.

A NaN in an origin, a direction or a pose yields no hit.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ig2mj.geometry.poses import AnyArray
from ig2mj.scene.tables import PieceKind

Interval = tuple[Float[Array, "*b"], Float[Array, "*b"]]

UNBOUNDED = 1e30
"""Stands for infinity where it is multiplied with slopes that may be zero."""


def piece_interval(
    kind: Int[AnyArray, "*#b"],
    size: Float[AnyArray, "*#b 3"],
    planes: Float[AnyArray, "*#b N 4"],
    origin: Float[AnyArray, "*#b 3"],
    direction: Float[AnyArray, "*#b 3"],
    inflate: float = 0.0,
) -> Interval:
    """Interval of a line inside pieces of mixed kinds, in the pieces' frames.

    Kinds known while tracing (a numpy array) cost nothing where they do not occur.
    """
    present = set(PieceKind) if isinstance(kind, Array) else {PieceKind(k) for k in np.unique(kind)}
    shapes = {
        PieceKind.SPHERE: lambda: sphere_interval(origin, direction, size[..., 0] + inflate),
        PieceKind.CAPSULE: lambda: capsule_interval(origin, direction, size[..., 0] + inflate, size[..., 1]),
        PieceKind.CYLINDER: lambda: cylinder_interval(
            origin, direction, size[..., 0] + inflate, size[..., 1] + inflate
        ),
        PieceKind.POLYHEDRON: lambda: polyhedron_interval(origin, direction, planes, inflate),
    }
    shape = jnp.broadcast_shapes(kind.shape, origin.shape[:-1], direction.shape[:-1])
    low, high = jnp.full(shape, jnp.inf), jnp.full(shape, -jnp.inf)
    for k in sorted(present):
        inside_low, inside_high = shapes[k]()
        low, high = jnp.where(kind == k, inside_low, low), jnp.where(kind == k, inside_high, high)
    return low, high


def sphere_interval(
    origin: Float[AnyArray, "*#b 3"], direction: Float[AnyArray, "*#b 3"], radius: Float[AnyArray, "*#b"] | float
) -> Interval:
    """Interval of a line inside a sphere about the frame's origin."""
    return quadratic_interval(
        jnp.sum(direction * direction, axis=-1),
        jnp.sum(origin * direction, axis=-1),
        jnp.sum(origin * origin, axis=-1),
        radius,
    )


def cylinder_interval(
    origin: Float[AnyArray, "*#b 3"],
    direction: Float[AnyArray, "*#b 3"],
    radius: Float[AnyArray, "*#b"] | float,
    half: Float[AnyArray, "*#b"] | float,
) -> Interval:
    """Interval of a line inside a cylinder along z."""
    origin, direction = jnp.asarray(origin), jnp.asarray(direction)
    o, d = origin[..., :2], direction[..., :2]
    side = quadratic_interval(jnp.sum(d * d, axis=-1), jnp.sum(o * d, axis=-1), jnp.sum(o * o, axis=-1), radius)
    top = _half_space_interval(direction[..., 2], half - origin[..., 2])
    bottom = _half_space_interval(-direction[..., 2], half + origin[..., 2])
    return _intersect(side, _intersect(top, bottom))


def capsule_interval(
    origin: Float[AnyArray, "*#b 3"],
    direction: Float[AnyArray, "*#b 3"],
    radius: Float[AnyArray, "*#b"] | float,
    half: Float[AnyArray, "*#b"] | float,
) -> Interval:
    """Interval of a line inside a capsule along z.

    The capsule is the union of a cylinder and two spheres; as it is convex the interval reaches from the first of
    their entries to the last of their exits.
    """
    low, high = cylinder_interval(origin, direction, radius, half)
    for sign in (1.0, -1.0):
        centre = jnp.stack([jnp.zeros_like(jnp.asarray(half))] * 2 + [sign * jnp.asarray(half)], axis=-1)
        cap_low, cap_high = sphere_interval(origin - centre, direction, radius)
        # A line that misses this part has the interval (inf, -inf), which leaves the union as it is.
        low, high = jnp.minimum(low, cap_low), jnp.maximum(high, cap_high)
    return low, high


def polyhedron_interval(
    origin: Float[AnyArray, "*#b 3"],
    direction: Float[AnyArray, "*#b 3"],
    planes: Float[AnyArray, "*#b N 4"],
    inflate: float = 0.0,
) -> Interval:
    """Interval of a line inside the intersection of half-spaces; (-1e30, 1e30) where all planes are padding."""
    low, low_by, high, high_by = clip_line(
        jnp.moveaxis(jnp.asarray(planes), (-2, -1), (0, 1)),
        [origin[..., i] for i in range(3)],
        [direction[..., i] for i in range(3)],
        inflate,
    )
    return _tidy(low / low_by, jnp.where(high_by > 0.0, high / jnp.where(high_by > 0.0, high_by, 1.0), -jnp.inf))


def clip_line(
    planes: Float[AnyArray, "N 4 *#b"],
    origin: Sequence,
    direction: Sequence,
    inflate: float = 0.0,
    at_once: int | None = None,
) -> tuple[Float[Array, "*b"], Float[Array, "*b"], Float[Array, "*b"], Float[Array, "*b"]]:
    """Interval of a line inside half-spaces as two fractions: (low, low's divisor, high, high's divisor).

    `planes[n]` is (nx, ny, nz, d) of one half-space; `origin` and `direction` list x, y, z; all of them broadcast. The
    divisors are positive and bounds are compared crosswise, so that there is no division (XLA would store every
    quotient) and a line parallel to a face needs no threshold: slope 0 with negative room makes the divisor of high 0,
    its numerator negative: -inf.

    Args:
      at_once: None unrolls the half-spaces into one elementwise pass that stores nothing per half-space: fastest to
        run, slow to compile. A number takes so many in each turn of a loop: a short program, but on a CPU about twenty
        times slower per half-space, since XLA computes each of the four bounds on its own.
    """
    planes = jnp.asarray(planes)
    shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in (*origin, *direction)), planes.shape[2:])
    spoilt = 0.0 * sum((*origin[1:], *direction), start=origin[0])  # NaN where any of them is
    low, low_by = jnp.broadcast_to(spoilt - UNBOUNDED, shape), jnp.ones(shape)
    bounds = (low, low_by, jnp.full(shape, UNBOUNDED), jnp.ones(shape))

    def clip(bounds: tuple, some: Float[Array, "M 4 *#b"]) -> tuple[tuple, None]:
        low, low_by, high, high_by = bounds
        for nx, ny, nz, offset in ([plane[i] for i in range(4)] for plane in some):
            slope = nx * direction[0] + ny * direction[1] + nz * direction[2]
            room = offset + inflate - (nx * origin[0] + ny * origin[1] + nz * origin[2])
            entering = slope < 0.0
            tighter = entering & (-room * low_by > -slope * low)
            low, low_by = jnp.where(tighter, -room, low), jnp.where(tighter, -slope, low_by)
            tighter = ~entering & (room * high_by < slope * high)
            high, high_by = jnp.where(tighter, room, high), jnp.where(tighter, slope, high_by)
        return (low, low_by, high, high_by), None

    count = planes.shape[0]
    if at_once is None or count <= at_once:
        return clip(bounds, planes)[0]
    missing = np.zeros((-count % at_once, 4, *planes.shape[2:]), np.float32)
    missing[:, 3] = 1.0
    blocks = jnp.concatenate([planes, missing]).reshape(-1, at_once, *planes.shape[1:])
    return jax.lax.scan(clip, bounds, blocks)[0]


def fractions_enter(
    low: Float[Array, "*#b"],
    low_by: Float[Array, "*#b"] | float,
    high: Float[Array, "*#b"],
    high_by: Float[Array, "*#b"] | float,
    length: Float[AnyArray, "*#b"] | float,
) -> tuple[Bool[Array, "*b"], Bool[Array, "*b"]]:
    """Whether the rays along and against the line's direction enter, from what `clip_line` returns.

    A ray enters at 0 <= t <= length; one that starts inside does not. There is no division.
    """
    meets = low * high_by <= high * low_by
    forwards = meets & (low >= 0.0) & (low <= length * low_by)
    return forwards, meets & (high <= 0.0) & (-high <= length * high_by)


def _half_space_interval(slope: Float[AnyArray, "*#b"], room: Float[AnyArray, "*#b"]) -> Interval:
    """Where slope * t <= room."""
    parallel = slope == 0.0
    slope = jnp.where(parallel, 1.0, slope)
    t = jnp.where(parallel, jnp.where(room >= 0.0, jnp.inf, -jnp.inf), room / slope)
    leaving = slope > 0.0
    return jnp.where(leaving, -jnp.inf, t), jnp.where(leaving, t, jnp.inf)


def quadratic_interval(
    a: Float[AnyArray, "*#b"],
    b: Float[AnyArray, "*#b"],
    c: Float[AnyArray, "*#b"],
    radius: Float[AnyArray, "*#b"] | float,
) -> Interval:
    """Where |o + t d| <= radius, with a = d.d, b = o.d, c = o.o.

    A line with a = 0 (along a cylinder's axis) is inside for ever or never.
    """
    parallel = a == 0.0
    safe = jnp.where(parallel, 1.0, a)
    # (radius^2 - distance of the line from the centre^2) / a
    reach = (radius * radius - (c - b * b / safe)) / safe
    meets = reach > 0.0
    root = jnp.sqrt(jnp.where(meets, reach, 1.0))
    low = jnp.where(meets, -b / safe - root, jnp.inf)
    high = jnp.where(meets, -b / safe + root, -jnp.inf)
    within = c <= radius * radius
    return (
        jnp.where(parallel, jnp.where(within, -jnp.inf, jnp.inf), low),
        jnp.where(parallel, jnp.where(within, jnp.inf, -jnp.inf), high),
    )


def _intersect(a: Interval, b: Interval) -> Interval:
    return _tidy(jnp.maximum(a[0], b[0]), jnp.minimum(a[1], b[1]))


def _tidy(low: Float[Array, "*b"], high: Float[Array, "*b"]) -> Interval:
    """Empty intervals in their one form, (inf, -inf), so that a union by min and max is right."""
    empty = (low > high) | (high == -jnp.inf)
    return jnp.where(empty, jnp.inf, low), jnp.where(empty, -jnp.inf, high)
