"""Motion programs: phases of a robot's motion as data, and as arrays over a batch of worlds.

A primitive plans a program on the host (`list[Phase]`); `ig2mj.planning.execution` follows the programs of all worlds
together. A phase moves the base, a hand, or both, and ends by what it says, or after a limit of agent steps.

Axes: W worlds, P phases.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Int

from ig2mj.planning.steps import REASONS

LIMIT = 150
"""Agent steps of a phase, 15 s, unless it says otherwise."""

SPEED, HAND_SPEED = 0.08, 0.05
"""m in an agent step of 1/10 s: of a base, and of a hand, which is 0.5 m/s as in the paper's activities."""


class Base(enum.IntEnum):
    """What the base does in a phase: stay; drive to a point, facing it; turn; shift to a point and turn at the same
    time, which only a base that can move sideways does."""

    STAY = 0
    DRIVE = 1
    TURN = 2
    SHIFT = 3


class Until(enum.IntEnum):
    """What ends a phase: base and hand are where they should be; a hand holds the object; the robot touches the object;
    the hand holds nothing; the limit has passed."""

    THERE = 0
    HELD = 1
    TOUCHED = 2
    EMPTY = 3
    WAITED = 4


@dataclasses.dataclass(frozen=True)
class Phase:
    """One phase.

    Attributes:
      base: what the base does. xy, yaw: m and rad, world frame: where to.
      hand: number of the robot's hand that acts, -1: none. pos: m of its grasp point; None: it stays in the body's
        frame. quat: orientation of the hand, w-x-y-z; None: any. in_body: both are in the frame of the robot's base.
      reset: the hand goes back to where it rests. close: True: the hand closes, False: it opens, None: as it is.
      closes: share of its way by which a floating hand closes in an agent step.
      until: what ends the phase. object: number of the object that this is about,
        or of what the hand pushes on its way there.
      keeps: number of an object that must stay in the hand, else the phase fails as "slipped"; -1: none.
      tolerance, turn_tolerance: m and rad within which base and hand are there.
      limit: agent steps. after: reason of the failure where the limit passes first; "": the next phase begins.
      speed: m of the hand, or of the base where no hand moves, in an agent step.
      rise: m by which the body of a base that hovers is above its height; None: as it was.
      both: the robot's other hands move by the same displacement, and close or open, as the one that acts does;
        `keeps` is of all hands then, and all are to be empty.
    """

    base: Base = Base.STAY
    xy: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    hand: int = -1
    pos: tuple[float, float, float] | None = None
    quat: tuple[float, float, float, float] | None = None
    in_body: bool = False
    reset: bool = False
    close: bool | None = None
    closes: float = 1.0
    until: Until = Until.THERE
    object: int = -1
    keeps: int = -1
    tolerance: float = 0.03
    turn_tolerance: float = 0.2
    limit: int = LIMIT
    after: str = "timeout"
    speed: float | None = None
    rise: float | None = None
    both: bool = False


REASON_NUMBERS = ("", *REASONS)
"""Reasons by the numbers that programs hold."""


_READ: Mapping[str, tuple[Callable[[Phase], Any], Any]] = {
    "base": (lambda p: p.base, np.int32),
    "xy": (lambda p: p.xy, (np.float32, 2)),
    "yaw": (lambda p: p.yaw, np.float32),
    "hand": (lambda p: p.hand, np.int32),
    "moves": (lambda p: p.pos is not None, np.int32),
    "pos": (lambda p: p.pos or (0.0, 0.0, 0.0), (np.float32, 3)),
    "turns": (lambda p: p.quat is not None, np.int32),
    "quat": (lambda p: p.quat or (1.0, 0.0, 0.0, 0.0), (np.float32, 4)),
    "in_body": (lambda p: p.in_body, np.int32),
    "reset": (lambda p: p.reset, np.int32),
    "close": (lambda p: -1 if p.close is None else int(p.close), np.int32),
    "closes": (lambda p: p.closes, np.float32),
    "until": (lambda p: p.until, np.int32),
    "object": (lambda p: p.object, np.int32),
    "keeps": (lambda p: p.keeps, np.int32),
    "tolerance": (lambda p: p.tolerance, np.float32),
    "turn_tolerance": (lambda p: p.turn_tolerance, np.float32),
    "limit": (lambda p: p.limit, np.int32),
    "after": (lambda p: REASON_NUMBERS.index(p.after), np.int32),
    "speed": (lambda p: p.speed or (HAND_SPEED if p.hand >= 0 else SPEED), np.float32),
    "rise": (lambda p: np.nan if p.rise is None else p.rise, np.float32),
    "both": (lambda p: p.both, np.int32),
}
"""What the arrays hold of a phase: how it is read, and its type. `moves` and `turns`: it has a position, and a quat."""

_PHASE = np.dtype([(name, *(kind if isinstance(kind, tuple) else (kind,))) for name, (_, kind) in _READ.items()])

_BEHIND = np.array(tuple(read(Phase()) for read, _ in _READ.values()), _PHASE)
"""A phase behind the end of a program, which does nothing."""


@dataclasses.dataclass(frozen=True, eq=False)
class Programs:
    """Programs of a batch.

    Attributes:
      length: phases of each world's program. phases: [W, P] of records, whose fields are those of `Phase`, with -1 for
        a hand that stays as it is (`close`), NaN for a body that does (`rise`), and `moves` and `turns`, which say
        whether there are a position and an orientation. A world's phases from `length` on do not count.
    """

    length: Int[np.ndarray, "W"]
    phases: np.ndarray

    @classmethod
    def pack(cls, programs: Sequence[Sequence[Phase]]) -> Programs:
        """One program for each world; an empty one does nothing."""
        length = np.array([len(p) for p in programs], np.int32)
        phases = np.full((len(programs), max([1, *map(len, programs)])), _BEHIND)
        for row, program in zip(phases, programs, strict=True):
            for number, phase in enumerate(program):
                row[number] = tuple(read(phase) for read, _ in _READ.values())
        return cls(length, phases)

    @classmethod
    def together(cls, parts: Sequence[Programs]) -> Programs:
        """Worlds of all parts, at least one, in their order. P is that of the longest program."""
        length = np.concatenate([part.length for part in parts])
        phases = np.full((len(length), max(part.phases.shape[1] for part in parts)), _BEHIND)
        end = 0
        for part in parts:
            begin, end = end, end + len(part.phases)
            phases[begin:end, : part.phases.shape[1]] = part.phases
        return cls(length, phases)

    def with_rows(self, worlds: Int[np.ndarray, "k"], others: Programs) -> Programs:
        """The same with the programs of `others` in k worlds. P is that of the longest program that was ever there."""
        length, phases, ends = self.length.copy(), _whole(self.phases).copy().view(_PHASE), others.phases.shape[1]
        if ends > phases.shape[1]:
            behind = np.full((len(phases), ends - phases.shape[1]), _BEHIND)
            phases = np.concatenate([phases, behind], axis=1)
        length[worlds], phases[worlds, :ends], phases[worlds, ends:] = others.length, others.phases, _BEHIND
        return Programs(length, phases)

    def at(self, phase: Int[np.ndarray, "W"]) -> dict[str, np.ndarray]:
        """The present phase of every world: each field without the P axis."""
        numbers = np.arange(len(phase)), np.minimum(phase, self.phases.shape[1] - 1)
        rows = _whole(self.phases)[numbers].view(_PHASE)
        return {name: rows[name] for name in _READ}


def _whole(phases: np.ndarray) -> np.ndarray:
    """The same memory without fields: NumPy copies records field by field, and takes 15 times as long."""
    return phases.view(f"V{_PHASE.itemsize}")
