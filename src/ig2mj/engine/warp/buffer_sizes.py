"""From what was measured to the sizes of the Warp engine's buffers: tails of distributions, and an `EngineProfile`.

Two kinds of buffers. Those of a single world (degrees of freedom awake, constraint rows) must hold the rarest event of
millions of world-steps: a pile that wakes. Those that all worlds share (the contact list) must hold the sum, which in a
large batch is the number of worlds times the mean, and in a small one hardly more than one world's worst.

The contact list holds the pairs of the broad phase, too, before it holds contacts. MJX-Warp does not notice when these
are too many in a scene with sleeping: its second pass, over what just woke, resets their count. So they are counted
from C MuJoCo's poses (`ig2mj.engine.warp.candidate_pairs`) and the list is made large enough for them.
"""

from __future__ import annotations

import dataclasses
import math

import mujoco
import numpy as np
from jaxtyping import Int

from ig2mj.engine.warp.profile import EngineProfile, default_profile

RARE = 1e-8
"""Share of world-steps that may overflow a world's own buffers: one in 6,000 control steps of 16,384 worlds."""

TAIL_LEAST, TAIL_LENGTH = 20, 1.5
"""A tail's slope is taken up to the value exceeded in this many world-steps, from this many decades more often."""

SHARED = 1.5
"""Factor on the largest mean over the worlds, for buffers that all worlds share."""

SPARE_ROWS = 64
"""Constraint rows of a world beyond the peak, at least: 16 contacts. In a small home a hand that lies in a corner adds
them to what is always there, and the tail of a calibration does not show it."""

ALIGN = 4
"""Sizes are rounded up to a multiple of this."""

QUANTITIES = ("awake_dofs", "constraints", "contacts", "pairs")


@dataclasses.dataclass
class Tail:
    """How often a number was seen: `counts[v]` world-steps had the value v."""

    counts: Int[np.ndarray, "V"]

    @classmethod
    def of(cls, values: np.ndarray) -> Tail:
        return cls(np.bincount(np.asarray(values, np.int64).ravel(), minlength=1))

    def __add__(self, other: Tail) -> Tail:
        counts = np.zeros(max(len(self.counts), len(other.counts)), np.int64)
        counts[: len(self.counts)] += self.counts
        counts[: len(other.counts)] += other.counts
        return Tail(counts)

    @property
    def total(self) -> int:
        return int(self.counts.sum())

    @property
    def peak(self) -> int:
        return int(np.flatnonzero(self.counts)[-1]) if self.total else 0

    def exceeded(self, share: float) -> int:
        """Smallest value that is exceeded in no more than this share of world-steps."""
        above = self.total - np.cumsum(self.counts)
        return int(np.argmax(above <= share * self.total)) if self.total else 0

    def beyond(self, share: float = RARE) -> float:
        """The value exceeded in this share of world-steps; where that was too rare to be seen, the tail goes on as
        it was (exponentially), from the peak or from the last value that was seen often, whichever gives more."""
        if not self.total:
            return 0.0
        if share * self.total >= TAIL_LEAST:
            return float(self.exceeded(share))
        seen = min(0.05, TAIL_LEAST / self.total)
        decade = (self.exceeded(seen) - self.exceeded(seen * 10**TAIL_LENGTH)) / TAIL_LENGTH
        from_peak = self.peak + decade * math.log10(max(1.0, 1 / (self.total * share)))
        return max(from_peak, self.exceeded(seen) + decade * math.log10(seen / share))


@dataclasses.dataclass
class Measurement:
    """What a disturbed scene asked for.

    Attributes:
      tails: per world and step, of each of `QUANTITIES` that was counted.
      means: the largest mean over the worlds, of `contacts` and `pairs`.
    """

    tails: dict[str, Tail]
    means: dict[str, float]

    def joined(self, other: Measurement) -> Measurement:
        """Both together; a quantity that only one of them counted is taken from it."""
        tails = {
            n: self.tails[n] + other.tails[n]
            if n in self.tails and n in other.tails
            else {**self.tails, **other.tails}[n]
            for n in {*self.tails, *other.tails}
        }
        means = {n: max(self.means.get(n, 0.0), other.means.get(n, 0.0)) for n in {*self.means, *other.means}}
        return Measurement(tails, means)

    def summary(self) -> dict[str, float | int]:
        """For people: of each quantity what is exceeded in 1 % and in 0.01 % of world-steps, the peak, the means."""
        out: dict[str, float | int] = {}
        for name in QUANTITIES:
            if name in self.tails:
                tail = self.tails[name]
                out |= {f"p99_{name}": tail.exceeded(1e-2), f"p9999_{name}": tail.exceeded(1e-4)}
                out |= {f"peak_{name}": tail.peak}
        out |= {f"mean_{name}": round(value, 2) for name, value in sorted(self.means.items())}
        return out


def profile_of(measured: Measurement, model: mujoco.MjModel, safety: float = 1.0) -> EngineProfile:
    """Sizes for a measurement. `safety`: factor on all of them. Never more than `default_profile` says."""
    widest = default_profile(model)
    tails, means = measured.tails, measured.means
    shared = {n: SHARED * means[n] for n in ("contacts", "pairs")}
    worst = {n: tails[n].beyond() for n in ("contacts", "pairs")}
    contacts, convex = max(shared.values()), shared["pairs"]
    rows = max(tails["constraints"].beyond(), tails["constraints"].peak + SPARE_ROWS)
    return EngineProfile(
        awake_dofs=min(_round(safety * tails["awake_dofs"].beyond()), widest.awake_dofs),
        constraints=min(_round(safety * rows), widest.constraints),
        contacts=min(_round(safety * contacts), widest.contacts),
        convex_contacts=min(_round(safety * convex), widest.convex_contacts),
        spare_contacts=_round(safety * max(0.0, max(worst.values()) - contacts)),
        spare_convex_contacts=_round(safety * max(0.0, worst["pairs"] - convex)),
    )


def _round(size: float | int) -> int:
    return ALIGN * math.ceil(max(1.0, size) / ALIGN)
