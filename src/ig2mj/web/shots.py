"""`Shot`: one world at one instant, handed from the thread that simulates to the one that shows."""

from __future__ import annotations

import dataclasses
import threading
from typing import Any

import numpy as np
from jaxtyping import Float

from ig2mj.engine.base import Engine
from ig2mj.engine.view import PhysicsView
from ig2mj.states.world import ExtendedStates


@dataclasses.dataclass(frozen=True)
class Shot:
    """What is shown. Nobody changes its arrays.

    Attributes:
      view, states: of one world or more; the one that is shown is `row`.
      time: simulated seconds of the episode. facts: further lines for people, name and value.
      jump: the world was put here, it did not come here: do not show a way from the last shot.
      period: seconds that passed since the last shot, where that was the step before.
    """

    view: PhysicsView
    states: ExtendedStates
    row: int
    time: float
    facts: tuple[tuple[str, str], ...] = ()
    jump: bool = False
    period: float = 0.0

    @property
    def body_pos(self) -> Float[np.ndarray, "B 3"]:
        """World frame, metres."""
        return np.asarray(self.view.body_pos)[self.row]

    @property
    def body_quat(self) -> Float[np.ndarray, "B 4"]:
        """World frame, w-x-y-z."""
        return np.asarray(self.view.body_quat)[self.row]


def shot_of(engine: Engine, view: PhysicsView, states: ExtendedStates, world: int, time: float, **more: Any) -> Shot:
    """A shot of a world of a batch of the engine, in arrays that outlive its next step."""
    (view, states), row = engine.kept_row((view, states), world)
    return Shot(view, states, row, time, **more)


class Mailbox:
    """The newest shot; one that was not fetched in time is dropped, so that the producer never waits."""

    def __init__(self):
        self._lock = threading.Condition()
        self._shot: Shot | None = None

    def put(self, shot: Shot) -> None:
        """Replaces the shot that is there."""
        with self._lock:
            jump = shot.jump or (self._shot is not None and self._shot.jump)
            self._shot = dataclasses.replace(shot, jump=jump) if jump != shot.jump else shot
            self._lock.notify()

    def get(self, timeout: float | int) -> Shot | None:
        """The newest shot that was not fetched yet, or None after `timeout` seconds without one."""
        with self._lock:
            if self._shot is None:
                self._lock.wait(timeout)
            shot, self._shot = self._shot, None
            return shot


def between(a: Shot, b: Shot, share: float) -> tuple[Float[np.ndarray, "B 3"], Float[np.ndarray, "B 4"]]:
    """Poses on the way from one shot to the next; `share`: 0..1."""
    pos = (1 - share) * a.body_pos + share * b.body_pos
    before, after = a.body_quat, b.body_quat
    sign = np.where((before * after).sum(-1, keepdims=True) < 0, -1.0, 1.0)
    quat = (1 - share) * before + share * sign * after
    return pos, quat / np.maximum(np.linalg.norm(quat, axis=-1, keepdims=True), 1e-9)
