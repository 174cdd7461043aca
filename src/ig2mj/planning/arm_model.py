"""`ArmModel`: joint trajectories of an arm along paths of its hand, and inverse kinematics.

Axes: J joints of the arm, N postures, P points of a way, T agent steps.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.kinematics import Chain, forward, inverse
from ig2mj.engine.view import Array
from ig2mj.geometry.host_rotations import (
    matrix_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_rotate_inverse,
)
from ig2mj.geometry.poses import quat_conjugate as conjugate
from ig2mj.geometry.poses import quat_multiply as multiply
from ig2mj.geometry.poses import quat_to_rotation_vector as rotation_vector
from ig2mj.geometry.poses import rotation_vector_to_quat as from_rotation_vector
from ig2mj.process.xla_small_call import SmallCall

PULL = 0.5
"""Share of what is left that a hand is asked to move and turn by in an agent step."""

FASTEST, TURN_FASTEST = 0.04, 0.09
"""m and rad in an agent step that a hand on an arm is asked to move and turn by at most."""

SEEDS, ITERATIONS = 24, 24
"""Postures at which inverse kinematics begin, and their steps: of poses that Fetch's arm reaches, 92 % are found from 8
postures, 99 % from 24, which take 1.7 ms in place of 1.2."""

OFF, TURNED_OFF = 0.015, 0.12
"""m and rad from a pose within which a posture counts for it."""

HANDS = 64
"""Postures for whose multiples it is compiled where the hand is in each."""

POINTS, STEPS = 8, 160
"""Points of a way, and agent steps, for which following it is compiled; longer ways are followed in parts."""

IDLE, NEARER, RADIUS = 30, 0.001, 0.3
"""Agent steps in which a hand comes no nearer to a point of a way, by so many m, after which it is given up; and m that
a rad of turning counts as."""

DIGITS = 6
"""Of offset and turn of a hand: they are constants of compiled programs, which differ by rounding between places of the
robot, and would be compiled for each of these."""

UNFUSED = {"xla_disable_hlo_passes": "fusion"}
"""Options of XLA on the host, where fused operations compute what is before a joint again for each column of the
Jacobian: inverse kinematics take 0.9 ms without fusion, and 2.5 ms with it."""

NEAR, TURNED_NEAR = 0.03, 0.2
"""m and rad from a point of a way at which the next one is gone for, and within which the end has to be reached."""


class ArmModel:
    """The joints of one arm as its controller moves them, in the frame of the robot's base.

    Attributes:
      chain: to the hand. joints: numbers of its joints among those of all robots. rest: their positions at rest.
      offset, turn: from the chain's tip to the hand: grasp point (m) and orientation (w-x-y-z) in the tip's frame.
    """

    def __init__(
        self,
        chain: Chain,
        joints: Int[np.ndarray, "J"],
        rest: Float[np.ndarray, "J"],
        ease: Float[np.ndarray, "J"],
        speed: Float[np.ndarray, "J"],
        shares: tuple[float, float],
        posture: float,
    ):
        """speed: rad/s or m/s, largest. shares: of a displacement that inverse kinematics solve, and of that to their
        solution that an agent step makes. posture: pull to `rest`."""
        self.chain, self.joints, self.rest = chain, joints, np.asarray(rest, np.float32)
        self.offset, self.turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        self._ease, self._speed, self._shares, self._posture = ease, speed, shares, posture
        self.step: Callable[..., Any] = jax.jit(self._step)
        self._follow, self._hands = SmallCall(self._follow_steps), SmallCall(self._hand)
        self._solve = SmallCall(self._solve_seeds, UNFUSED if jax.default_backend() == "cpu" else None)

    def calibrate(
        self, data: Any, base: int, palm: int, grip: Float[np.ndarray, "3"], q: Float[np.ndarray, "J"]
    ) -> None:
        """Takes `offset` and `turn` from a compiled scene in which the joints are at q."""
        turn = data.xmat[base].reshape(3, 3)
        at = turn.T @ (data.xpos[palm] + data.xmat[palm].reshape(3, 3) @ grip - data.xpos[base])
        quat = matrix_to_quat(turn.T @ data.xmat[palm].reshape(3, 3))
        tip, tip_quat, _ = (np.asarray(v, float)[0] for v in forward(self.chain, jnp.asarray(q[None], jnp.float32)))
        offset, turn = quat_rotate_inverse(tip_quat, at - tip), quat_multiply(quat_conjugate(tip_quat), quat)
        self.offset, self.turn = (np.round(np.asarray(v, float), DIGITS) + 0.0 for v in (offset, turn))

    def hand(self, q: Float[np.ndarray, "N J"]) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 4"]]:
        """Grasp point and orientation of the hand, in the base's frame."""
        count, q = len(q), np.asarray(q, np.float32)
        padded = np.concatenate([q, np.tile(q[-1:], (-count % HANDS, 1))])
        pos, quat = self._hands(jnp.asarray(padded))
        return np.asarray(pos, float)[:count], np.asarray(quat, float)[:count]

    def _hand(self, q: Array) -> tuple[Array, Array]:
        tip, quat, _ = forward(self.chain, q)
        return self._of_tip(tip, quat)

    def _of_tip(self, tip: Array, quat: Array) -> tuple[Array, Array]:
        from ig2mj.geometry.poses import quat_rotate as rotate

        offset = jnp.broadcast_to(jnp.asarray(self.offset, jnp.float32), tip.shape)
        turn = jnp.broadcast_to(jnp.asarray(self.turn, jnp.float32), quat.shape)
        return tip + rotate(quat, offset), multiply(quat, turn)

    def _tip_of(self, pos: Array, quat: Array) -> tuple[Array, Array]:
        from ig2mj.geometry.poses import quat_rotate as rotate

        back = jnp.broadcast_to(jnp.asarray(quat_conjugate(self.turn), jnp.float32), quat.shape)
        tip_quat = multiply(quat, back)
        offset = jnp.broadcast_to(jnp.asarray(self.offset, jnp.float32), pos.shape)
        return pos - rotate(tip_quat, offset), tip_quat

    def _step(self, q: Array, move: Array, turn: Array) -> Array:
        """Joints after an agent step in which the hand is asked to move (m) and turn (rad), base's frame."""
        solved, made = self._shares
        pos, quat = self._hand(q)
        scale = solved / made
        goal = self._tip_of(pos + scale * move, multiply(from_rotation_vector(scale * turn), quat))
        found = inverse(self.chain, q, *goal, self.rest, posture=self._posture, ease=self._ease)
        change = made / solved * (found - q)
        change = change / jnp.maximum(1.0, jnp.max(jnp.abs(change) / (self._speed * ACTION_PERIOD), -1, keepdims=True))
        return jnp.clip(q + change, jnp.asarray(self.chain.lower, q.dtype), jnp.asarray(self.chain.upper, q.dtype))

    def _follow_steps(self, q: Array, points: Array, quats: Array) -> tuple[Array, Array]:
        """[T, J] joints and [T] number of the point that is gone for; points [P, 3], quats [P, 4]."""

        def goes_on(carry: tuple[Array, ...]) -> Array:
            _, k, t, _, _, _, idle = carry
            return (k < POINTS) & (t < STEPS) & (idle < IDLE)

        def step(carry: tuple[Array, ...]) -> tuple[Array, ...]:
            # [1, J], numbers of a point and of an agent step, what is returned; the least left, and for how long
            q, k, t, joints, number, least, idle = carry
            at = jnp.minimum(k, POINTS - 1)
            pos, quat = self._hand(q)
            move, turn = points[at] - pos, rotation_vector(multiply(quats[at][None], conjugate(quat)))
            far, angle = jnp.linalg.norm(move), jnp.linalg.norm(turn)
            there = (far < NEAR) & ((angle < TURNED_NEAR) | (at < POINTS - 1))
            move = PULL * move * jnp.minimum(1.0, FASTEST / jnp.maximum(PULL * far, 1e-6))
            turn = PULL * turn * jnp.minimum(1.0, TURN_FASTEST / jnp.maximum(PULL * angle, 1e-6))
            new, left = self._step(q, move, turn), far + RADIUS * angle
            comes = there | (left < least - NEARER)
            least, idle = jnp.where(there, jnp.inf, jnp.where(comes, left, least)), jnp.where(comes, 0, idle + 1)
            after = jnp.where(there, k + 1, k), t + 1, _with_row(joints, t, q[0]), _with_row(number, t, k), least, idle
            return new, *after

        rows = jnp.zeros((STEPS, len(q)), q.dtype), jnp.zeros(STEPS, jnp.int32)
        begins = q[None], jnp.int32(0), jnp.int32(0), *rows, jnp.asarray(jnp.inf, q.dtype), jnp.int32(0)
        q, k, t, joints, number, _, _ = jax.lax.while_loop(goes_on, step, begins)
        after = jnp.arange(STEPS) >= t
        return jnp.where(after[:, None], q, joints), jnp.where(after, k, number)

    def follow(
        self, q: Float[np.ndarray, "J"], points: Float[np.ndarray, "P 3"], quats: Float[np.ndarray, "P 4"]
    ) -> Float[np.ndarray, "T J"] | None:
        """Joints while the hand goes along points, base's frame; None: it does not get to the last one."""
        parts = []
        for first in range(0, len(points), POINTS):
            some, turned = points[first : first + POINTS], quats[first : first + POINTS]
            lack = POINTS - len(some)
            some = np.concatenate([np.tile(some[:1], (lack, 1)), some]).astype(np.float32)
            turned = np.concatenate([np.tile(turned[:1], (lack, 1)), turned]).astype(np.float32)
            joints, number = (np.asarray(a) for a in self._follow(jnp.asarray(q, jnp.float32), some, turned))
            if number[-1] < POINTS:
                return None
            parts.append(joints[: int(np.argmax(number >= POINTS)) + 1].astype(float))
            q = parts[-1][-1]
        return np.concatenate(parts)

    @functools.cached_property
    def _seeds(self) -> Float[np.ndarray, "N J"]:
        rng = np.random.default_rng(0)
        low, high = (np.where(np.isfinite(v), v, s * np.pi) for v, s in ((self.chain.lower, -1), (self.chain.upper, 1)))
        found = low + (high - low) * (0.1 + 0.8 * rng.random((SEEDS, len(self.rest))))
        found[0] = self.rest
        return found.astype(np.float32)

    def _solve_seeds(self, seeds: Array, pos: Array, quat: Array) -> tuple[Array, Array, Array]:
        goal = self._tip_of(jnp.broadcast_to(pos, (SEEDS, 3)), jnp.broadcast_to(quat, (SEEDS, 4)))
        q = inverse(self.chain, seeds, *goal, self.rest, iterations=ITERATIONS, posture=0.0)
        at, turned = self._hand(q)
        return (
            q,
            jnp.linalg.norm(at - pos, axis=-1),
            jnp.linalg.norm(
                rotation_vector(multiply(jnp.broadcast_to(quat, turned.shape), conjugate(turned))), axis=-1
            ),
        )

    def solve(
        self, pos: Float[np.ndarray, "3"], quat: Float[np.ndarray, "4"], near: Float[np.ndarray, "J"] | None = None
    ) -> Float[np.ndarray, "n J"]:
        """Postures with the hand at a pose of the base's frame, the nearest to `near` (None: rest) first."""
        seeds = self._seeds if near is None else np.concatenate([[near], self._seeds[1:]]).astype(np.float32)
        q, off, turned = (
            np.asarray(a, float) for a in self._solve(seeds, pos.astype(np.float32), np.asarray(quat, np.float32))
        )
        found = q[(off < OFF) & (turned < TURNED_OFF)]
        return found[np.argsort(np.abs(found - (self.rest if near is None else near)).max(1))]


def _with_row(rows: Array, number: Array, row: Array) -> Array:
    """The same rows with another one at a place."""
    return jnp.asarray(rows).at[number].set(row)
