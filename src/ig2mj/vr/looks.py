"""`Looks`: how states look in a home, for any renderer: particles, tints, what is hidden, and the goal."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.viewer.state_effects import effects
from ig2mj.viewer.state_marks import marks, tint_of_objects

if TYPE_CHECKING:
    from ig2mj.vr.session import Session

SPHERE, BOX = 0, 1
"""Kinds of marks."""

OPAQUE = 0.5
"""Opacity of a mark from which it is shown: pages draw all of them opaque, so that steam would hide what steams."""


@dataclasses.dataclass(frozen=True, eq=False)
class Looks:
    """At one instant.

    Attributes:
      marks: [N, 15] of each particle: kind, half sizes, position, quaternion, colour (rgba).
      tint: [O] number in `sensors.tints.TINTS`, -1 where none shows.
      goal: literals with their truth. holds: the whole goal does. seconds: of the episode.
    """

    marks: Float[np.ndarray, "N 15"]
    tint: Int[np.ndarray, "O"]
    goal: tuple[tuple[str, bool], ...]
    holds: bool
    seconds: float


def looks_of(session: Session) -> Looks:
    """Of a session's present state."""
    world, rules = session.state.batch.world, session.env.core.rules
    assert rules is not None
    rows = []
    tint, time = tint_of_objects(rules.model, world.states), float(np.asarray(world.time)[0])
    seen = rules.model, world.states, world.view
    clear = [mark for mark in effects(*seen, time=time, tint=tint) if mark.rgba[3] > OPAQUE]
    for mark in [*marks(*seen), *clear]:
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(mark.axes).ravel())
        kind = BOX if mark.kind == mujoco.mjtGeom.mjGEOM_BOX else SPHERE
        size = (*mark.size, *mark.size[-1:] * (3 - len(mark.size)))
        rows.append([kind, *size, *mark.pos, *quat, *mark.rgba])
    return Looks(
        np.array(rows, np.float32).reshape(-1, 15),
        tint,
        tuple(session.goal()),
        bool(np.asarray(session.state.status.holds)[0]),
        time,
    )
