"""Motion programs: phases of a robot's motion as data, and as arrays over a batch of worlds.

A primitive plans a program on the host (`list[Phase]`); `ig2mj.planning.execution` follows the programs of all worlds
together. A phase moves the base, a hand, or both, and ends by what it says, or after a limit of agent steps.

Axes: W worlds, P phases.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

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
      until: what ends the phase. object: number of the object that this is about.
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


@dataclasses.dataclass(frozen=True, eq=False)
class Programs:
    """Programs of a batch; the fields are those of `Phase`, and a world's phases from `length` on do not count. `rise`
    is NaN for None."""

    length: Int[np.ndarray, "W"]
    base: Int[np.ndarray, "W P"]
    xy: Float[np.ndarray, "W P 2"]
    yaw: Float[np.ndarray, "W P"]
    hand: Int[np.ndarray, "W P"]
    moves: Int[np.ndarray, "W P"]
    pos: Float[np.ndarray, "W P 3"]
    turns: Int[np.ndarray, "W P"]
    quat: Float[np.ndarray, "W P 4"]
    in_body: Int[np.ndarray, "W P"]
    reset: Int[np.ndarray, "W P"]
    close: Int[np.ndarray, "W P"]
    closes: Float[np.ndarray, "W P"]
    until: Int[np.ndarray, "W P"]
    object: Int[np.ndarray, "W P"]
    keeps: Int[np.ndarray, "W P"]
    tolerance: Float[np.ndarray, "W P"]
    turn_tolerance: Float[np.ndarray, "W P"]
    limit: Int[np.ndarray, "W P"]
    after: Int[np.ndarray, "W P"]
    speed: Float[np.ndarray, "W P"]
    rise: Float[np.ndarray, "W P"]
    both: Int[np.ndarray, "W P"]

    @classmethod
    def pack(cls, programs: Sequence[Sequence[Phase]]) -> Programs:
        """One program for each world; an empty one does nothing."""
        most = max([1, *map(len, programs)])
        padded = [[*p, *[Phase()] * (most - len(p))] for p in programs]

        def column(read, dtype) -> np.ndarray:
            return np.array([[read(phase) for phase in row] for row in padded], dtype)

        return cls(
            length=np.array([len(p) for p in programs], np.int32),
            base=column(lambda p: p.base, np.int32),
            xy=column(lambda p: p.xy, np.float32),
            yaw=column(lambda p: p.yaw, np.float32),
            hand=column(lambda p: p.hand, np.int32),
            moves=column(lambda p: p.pos is not None, np.int32),
            pos=column(lambda p: p.pos or (0.0, 0.0, 0.0), np.float32),
            turns=column(lambda p: p.quat is not None, np.int32),
            quat=column(lambda p: p.quat or (1.0, 0.0, 0.0, 0.0), np.float32),
            in_body=column(lambda p: p.in_body, np.int32),
            reset=column(lambda p: p.reset, np.int32),
            close=column(lambda p: -1 if p.close is None else int(p.close), np.int32),
            closes=column(lambda p: p.closes, np.float32),
            until=column(lambda p: p.until, np.int32),
            object=column(lambda p: p.object, np.int32),
            keeps=column(lambda p: p.keeps, np.int32),
            tolerance=column(lambda p: p.tolerance, np.float32),
            turn_tolerance=column(lambda p: p.turn_tolerance, np.float32),
            limit=column(lambda p: p.limit, np.int32),
            after=column(lambda p: REASON_NUMBERS.index(p.after), np.int32),
            speed=column(lambda p: p.speed or (HAND_SPEED if p.hand >= 0 else SPEED), np.float32),
            rise=column(lambda p: np.nan if p.rise is None else p.rise, np.float32),
            both=column(lambda p: p.both, np.int32),
        )

    @classmethod
    def together(cls, parts: Sequence[Programs]) -> Programs:
        """Worlds of all parts, at least one, in their order. P is that of the longest program."""
        most = max(part.base.shape[1] for part in parts)
        found = {"length": np.concatenate([part.length for part in parts])}
        for f in dataclasses.fields(cls):
            if f.name != "length":
                fill = np.nan if f.name == "rise" else 0.0
                found[f.name] = np.concatenate([_longer(getattr(part, f.name), most, fill) for part in parts])
        return cls(**found)

    def with_rows(self, worlds: Int[np.ndarray, "k"], others: Programs) -> Programs:
        """The same with the programs of `others` in k worlds. P is that of the longest program that was ever there."""
        most, ends = max(self.base.shape[1], others.base.shape[1]), others.base.shape[1]
        found = {}
        for f in dataclasses.fields(self):
            old, new = getattr(self, f.name), getattr(others, f.name)
            if f.name == "length":
                found[f.name] = old.copy()
                found[f.name][worlds] = new
                continue
            fill = np.nan if f.name == "rise" else 0.0
            found[f.name] = _longer(old, most, fill)
            found[f.name][worlds, :ends] = new
            found[f.name][worlds, ends:] = fill
        return Programs(**found)

    def at(self, phase: Int[np.ndarray, "W"]) -> dict[str, np.ndarray]:
        """The present phase of every world: each field but `length` without the P axis."""
        row = np.arange(len(phase))
        return {
            f.name: getattr(self, f.name)[row, np.minimum(phase, self.base.shape[1] - 1)]
            for f in dataclasses.fields(self)
            if f.name != "length"
        }


def _longer(values: np.ndarray, count: int, fill: float) -> np.ndarray:
    """A copy of values, [W, P, ...], with so many phases; those behind a program's end are read when it has ended."""
    longer = np.empty((len(values), count, *values.shape[2:]), values.dtype)
    longer[:, : values.shape[1]] = values
    longer[:, values.shape[1] :] = fill
    return longer
