"""Forward kinematics, Jacobian and inverse kinematics of a chain of joints: pure JAX, from a table, for any batch.

The frames of a chain's links are parallel at joint positions 0, as in Fetch's description. Everything is in the frame
of the chain's base. Axes: W worlds, J joints that are moved, K joints of the chain: those, and joints that follow them,
such as the segments of a telescope.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import (
    axis_angle_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    quat_to_rotation_vector,
)


@dataclasses.dataclass(frozen=True, eq=False)
class Chain:
    """Joints from the base to the tip.

    Attributes:
      origin: of each joint in its parent link's frame, m.
      axis: unit vectors, in the link's own frame. slides: the joint slides along it instead of turning about it.
      lower, upper: rad or m; infinite where a joint turns without end.
      tip: of the chain in the last link's frame, m; its orientation is the link's.
      follows: of each joint of the chain the number of the moved joint that it goes with, the factor of that one's
        position, and what is added, rad or m; None: each is moved itself.
    """

    origin: Float[np.ndarray, "K 3"]
    axis: Float[np.ndarray, "K 3"]
    slides: Bool[np.ndarray, "K"]
    lower: Float[np.ndarray, "J"]
    upper: Float[np.ndarray, "J"]
    tip: Float[np.ndarray, "3"]
    follows: tuple[tuple[int, float, float], ...] | None = None

    @property
    def sources(self) -> tuple[tuple[int, float, float], ...]:
        """`follows` of every joint of the chain."""
        return self.follows or tuple((j, 1.0, 0.0) for j in range(len(self.slides)))

    @property
    def sliding(self) -> Bool[np.ndarray, "J"]:
        """Of the joints that are moved: they slide."""
        found = np.zeros(len(self.lower), bool)
        for (source, _, _), slides in zip(self.sources, self.slides, strict=True):
            found[source] |= slides
        return found

    @property
    def travel(self) -> Float[np.ndarray, "J"]:
        """m by which the tip slides between the limits of each joint that is moved, with those that follow; 0 of joints
        that turn."""
        rates = np.zeros(len(self.lower))
        for (source, rate, _), slides in zip(self.sources, self.slides, strict=True):
            rates[source] += abs(rate) if slides else 0.0
        return np.where(rates > 0, rates * np.where(rates > 0, self.upper - self.lower, 0.0), 0.0)

    def upright(self, least: float = 0.9) -> int:
        """Number of joints at the beginning of the chain that slide vertically: a lift."""
        level = ~(self.slides & (np.abs(self.axis[:, 2]) >= least))
        return int(np.argmax(level)) if level.any() else len(level)

    def part(self, count: int) -> Chain:
        """The first joints of the chain; the tip is where the last of them is."""
        follows = None if self.follows is None else self.follows[:count]
        moved = 1 + max((source for source, _, _ in self.sources[:count]), default=-1)
        return Chain(
            self.origin[:count], self.axis[:count], self.slides[:count], self.lower[:moved], self.upper[:moved],
            np.zeros(3), follows,
        )  # fmt: skip


def forward(
    chain: Chain, q: Float[Array, "W J"]
) -> tuple[Float[Array, "W 3"], Float[Array, "W 4"], Float[Array, "W 6 J"]]:
    """Position (m) and orientation (w-x-y-z) of the tip in the base's frame, and its Jacobian: rows 0-2 velocity,
    3-5 angular velocity."""
    q = jnp.asarray(q)
    pos = jnp.zeros((*q.shape[:-1], 3), q.dtype)
    quat = jnp.broadcast_to(jnp.array([1.0, 0.0, 0.0, 0.0], q.dtype), (*q.shape[:-1], 4))
    places, axes = [], []
    for (source, rate, shift), origin, axis, slides in zip(
        chain.sources, chain.origin, chain.axis, chain.slides, strict=True
    ):
        at = q[..., source]
        if (rate, shift) != (1.0, 0.0):
            at = rate * at + shift
        origin, axis = jnp.asarray(origin, q.dtype), jnp.asarray(axis, q.dtype)
        pos = pos + quat_rotate(quat, origin)
        along = quat_rotate(quat, axis)
        places.append(pos)
        axes.append(along)
        if slides:
            pos = pos + along * at[..., None]
        else:
            quat = quat_multiply(quat, axis_angle_to_quat(axis, at))
    tip = pos + quat_rotate(quat, jnp.asarray(chain.tip, q.dtype))
    columns: list[Array | None] = [None] * q.shape[-1]
    for (source, rate, _), place, along, slides in zip(chain.sources, places, axes, chain.slides, strict=True):
        column = jnp.concatenate(
            [along, jnp.zeros_like(along)] if slides else [jnp.cross(along, tip - place), along], axis=-1
        )
        column, before = column if rate == 1.0 else rate * column, columns[source]
        columns[source] = column if before is None else before + column
    none = jnp.zeros((*tip.shape[:-1], 6), q.dtype)
    return tip, quat, jnp.stack([none if column is None else column for column in columns], axis=-1)


def inverse(
    chain: Chain,
    q: Float[Array, "W J"],
    pos: Float[Array, "W 3"],
    quat: Float[Array, "W 4"],
    rest: Float[np.ndarray, "J"],
    iterations: int = 6,
    damping: float = 0.05,
    posture: float = 0.02,
    ease: Float[np.ndarray, "J"] | None = None,
) -> Float[Array, "W J"]:
    """Joint positions that bring the tip to a pose, by damped least squares; a fixed number of steps, within limits.

    Args:
      q: where to begin. pos, quat: the target, in the base's frame.
      rest: posture that the joints return to as far as the tip is not moved by it.
      damping: of the least squares (m and rad alike). posture: share of the way to `rest` in an iteration.
      ease: weight of each joint's movement, the larger the more of it; None: all alike. The pose that is reached does
        not depend on it, only which joints make it.
    """
    low, high = jnp.asarray(chain.lower, q.dtype), jnp.asarray(chain.upper, q.dtype)
    readily = jnp.ones(q.shape[-1], q.dtype) if ease is None else jnp.asarray(ease, q.dtype)

    def step(q: Float[Array, "W J"], _: None) -> tuple[Float[Array, "W J"], None]:
        tip, turned, jacobian = forward(chain, q)
        turn = quat_to_rotation_vector(quat_multiply(quat, quat_conjugate(turned)))
        error = jnp.concatenate([pos - tip, turn], axis=-1)
        back = posture * (jnp.asarray(rest, q.dtype) - q)
        left = error - jnp.einsum("...ij,...j->...i", jacobian, back)
        eased = jacobian * readily
        square = jnp.einsum("...ij,...kj->...ik", eased, jacobian) + damping**2 * jnp.eye(6, dtype=q.dtype)
        q = q + back + jnp.einsum("...ij,...i->...j", eased, solve_positive(square, left))
        return jnp.clip(q, low, high), None

    return jax.lax.scan(step, q, None, length=iterations)[0]


def solve_positive(matrix: Float[Array, "*b n n"], right: Float[Array, "*b n"]) -> Float[Array, "*b n"]:
    """x with `matrix @ x = right` for a symmetric positive definite matrix of a few rows.

    Cholesky's method written out: elementwise operations that XLA fuses, instead of a library call for a batch.
    """
    n = right.shape[-1]
    low: list[list] = [[None] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[..., i, j] - sum(low[i][k] * low[j][k] for k in range(j))
            low[i][j] = jnp.sqrt(rest) if i == j else rest / low[j][j]
    y: list = []
    for i in range(n):
        y.append((right[..., i] - sum(low[i][k] * y[k] for k in range(i))) / low[i][i])
    x: list = [None] * n
    for i in reversed(range(n)):
        x[i] = (y[i] - sum(low[k][i] * x[k] for k in range(i + 1, n))) / low[i][i]
    return jnp.stack(x, axis=-1)
