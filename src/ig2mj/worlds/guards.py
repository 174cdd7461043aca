"""Guards: worlds with errors are flagged, counted, and replaced at the next reset.

A flagged world is stepped with the others, but its results are meaningless. On the native engine a world that is no
longer finite stays as it was in the step before.
"""

from __future__ import annotations

import enum
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import Engine
from ig2mj.engine.health import CAPACITY, SETTING, Health, Overflow
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.engine.warp.profile import PROFILE_FILE
from ig2mj.errors import EngineError

TOP_SPEED = 20.0
"""m/s. Nothing in a household moves faster; what does was shot out of a penetration."""

BELOW_FLOOR = 0.5
"""Metres. An object whose centre of mass is this far below the lowest support has left the house."""


class Flag(enum.IntFlag):
    """Errors of a world."""

    OVERFLOW = 1
    NOT_FINITE = 2
    FELL = 4
    TOO_FAST = 8
    WRONG_CONTROLS = 32


def check(health: Health, object_com: Float[Array, "W O 3"], floor: Float[Array, "O"]) -> Int[Array, "W"]:
    """Flags of every world now.

    Args:
      health: from the engine. object_com: of the view of the same instant.
      floor: metres; the height below which each object has left the house (`lowest_support`).
    """
    com = jnp.asarray(object_com)
    finite = jnp.asarray(health.finite)
    flags = jnp.where((jnp.asarray(health.overflow) & int(CAPACITY)) != 0, int(Flag.OVERFLOW), 0)
    flags |= jnp.where(~finite, int(Flag.NOT_FINITE), 0)
    flags |= jnp.where(finite & (com[..., 2] < floor).any(1), int(Flag.FELL), 0)
    flags |= jnp.where(finite & (jnp.asarray(health.top_speed) > TOP_SPEED), int(Flag.TOO_FAST), 0)
    flags |= jnp.where(jnp.asarray(health.wrong_controls), int(Flag.WRONG_CONTROLS), 0)
    return flags.astype(jnp.int32)


def lowest_support(view: PhysicsView, fixed: Bool[np.ndarray, "O"]) -> Float[np.ndarray, "O"]:
    """Height (m) below which an object has left the house: under everything that is fixed, and under its own start."""
    low = np.asarray(view.aabb_low)[0, :, 2]
    floor = low[fixed].min() if fixed.any() else 0.0
    return np.minimum(floor, low) - BELOW_FLOOR


def count(flags: Int[Array, "W"]) -> Int[Array, "W K"]:
    """One column per `Flag`, in its order: 1 where the world carries it."""
    return jnp.stack([(flags & int(flag)) != 0 for flag in Flag], axis=-1).astype(jnp.int32)


def counted(
    step: Int[Array, "W"],
    time: Float[Array, "W"],
    flags: Int[Array, "W"],
    troubles: Int[Array, "W K"],
    health: Health,
    object_com: Float[Array, "W O 3"],
    *,
    floor: Float[Array, "O"],
    seconds: float,
) -> tuple[Int[Array, "W"], Float[Array, "W"], Int[Array, "W"], Int[Array, "W K"]]:
    """Clocks and guards after a control step of so many seconds; `floor` as of `check`."""
    now = check(health, object_com, floor)
    return step + 1, time + jnp.float32(seconds), flags | now, troubles + count(now & ~flags)


def counter(engine: Engine, floor: Callable[[], Float[np.ndarray, "O"]], seconds: float) -> Callable[..., tuple]:
    """`counted` of the first six arguments, compiled. In most steps NumPy finds no error, in a tenth of
    the time of the compiled program."""

    def count_fn(step: Array, time: Array, flags: Array, troubles: Array, health: Health, com: Array) -> tuple:
        return counted(step, time, flags, troubles, health, com, floor=floor(), seconds=seconds)

    def fine(step: Array, time: Array, flags: Array, troubles: Array, health: Health, com: Array) -> tuple | None:
        speed, height = np.asarray(health.top_speed), np.asarray(com)[..., 2]
        sound = (speed <= TOP_SPEED).all() and (height >= np.float32(floor())).all() and np.asarray(health.finite).all()
        if not sound or np.asarray(health.wrong_controls).any() or np.asarray(health.overflow).any():
            return None
        return np.asarray(step) + np.int32(1), np.asarray(time) + np.float32(seconds), flags, troubles

    return engine.compile(count_fn, fine)


def metrics(counts: Int[Array, "W K"]) -> dict[str, int]:
    """Sums over worlds, by the flags' names in lower case."""
    totals = np.asarray(counts).sum(0)
    return {flag.name.lower(): int(n) for flag, n in zip(Flag, totals, strict=True) if flag.name}


def explain(world: int, flags: int, overflow: int) -> str:
    """One line: which world, which flags, and what to raise where a buffer was too small."""
    names = ", ".join(flag.name.lower() for flag in Flag if flags & flag and flag.name)
    text = f"world {world}: {names}"
    lost = [bit for bit in Overflow if overflow & bit & CAPACITY]
    if lost:
        raise_these = sorted({SETTING[bit] for bit in lost if bit in SETTING})
        text += f" ({', '.join(bit.name or '' for bit in lost)}"
        text += f"; raise {', '.join(raise_these)} in {PROFILE_FILE}, or run `ig2mj calibrate`)" if raise_these else ")"
    return text


def raise_first(flags: Int[Array, "W"], overflow: Int[Array, "W"]) -> None:
    """Raises EngineError for the first flagged world, if there is one. On the host: it waits for the device."""
    flagged = np.flatnonzero(np.asarray(flags))
    if len(flagged):
        world = int(flagged[0])
        raise EngineError(explain(world, int(np.asarray(flags)[world]), int(np.asarray(overflow)[world])))
