"""Execution of motion programs in a batch of worlds: `start(programs)`, then `advance(view)` once for each agent step.

Axes: W worlds, n numbers of the robot's action.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.host_rotations import rotation_angle
from ig2mj.planning.bodies import Body, Rows, Senses, goals_of_hand, grip_of, sense
from ig2mj.planning.phases import REASON_NUMBERS, Base, Phase, Programs, Until

RUNNING, DONE = -1, 0
"""Statuses; larger ones are numbers of `REASON_NUMBERS`."""

SETTLING = 2
"""Agent steps that a phase lasts at least: a hand that is asked to open or close needs them."""


RISEN = 0.03
"""m within which a body is at its height."""


@dataclasses.dataclass(frozen=True, eq=False)
class Carry:
    """State of the execution.

    Attributes:
      programs: of all worlds. phase: number of the present one. steps: agent steps in it. status: of each world.
      rows: the present phases. rise: m by which bodies are asked to be above their height.
    """

    programs: Programs
    phase: Int[np.ndarray, "W"]
    steps: Int[np.ndarray, "W"]
    status: Int[np.ndarray, "W"]
    rows: Rows
    rise: Float[np.ndarray, "W"]

    @property
    def running(self) -> Bool[np.ndarray, "W"]:
        """Worlds whose programs go on."""
        return self.status == RUNNING

    def reason(self, world: int) -> str:
        """Why a world's program failed; "" where it has not."""
        return REASON_NUMBERS[max(int(self.status[world]), 0)]


def begin(programs: Sequence[Sequence[Phase]]) -> Carry:
    """Programs at their start; an empty one is done."""
    packed = Programs.pack(programs)
    zero = np.zeros(len(programs), np.int32)
    status = np.where(packed.length > 0, RUNNING, DONE).astype(np.int32)
    return Carry(packed, zero, zero, status, packed.at(zero), np.zeros(len(programs), np.float32))


def begin_some(carry: Carry, programs: Mapping[int, Sequence[Phase]]) -> Carry:
    """New programs in some worlds; the others go on. `programs`: by the number of the world."""
    if not programs:
        return carry
    new = np.array(list(programs), np.int64)
    fresh = Programs.pack(list(programs.values()))
    packed = carry.programs.with_rows(new, fresh)
    phase, steps, status = carry.phase.copy(), carry.steps.copy(), carry.status.copy()
    phase[new], steps[new] = 0, 0
    status[new] = np.where(fresh.length > 0, RUNNING, DONE)
    return Carry(packed, phase, steps, status, packed.at(phase), carry.rise)


def advance(body: Body, agent: int, carry: Carry, view: PhysicsView) -> tuple[Float[np.ndarray, "W n"], Carry]:
    """The robot's action in every world, in its controller's units, and what is remembered. Pure.

    Args:
      view: of the present physics. Worlds whose programs have ended get an action that leaves everything as it is.
    """
    senses = sense(view, agent, body.hands)
    rows = carry.rows
    there, lost = _ended(body, senses, rows), _lost(senses, rows)
    there &= carry.steps >= np.where(rows["close"] >= 0, SETTLING, 0)
    late = carry.steps >= rows["limit"]
    waited = late & (rows["until"] == Until.WAITED)
    failed = np.where(lost, REASON_NUMBERS.index("slipped"), np.where(late & ~there & ~waited, rows["after"], 0))
    passed = there | waited | (late & (failed == 0))
    running = carry.running
    forward = running & passed & (failed == 0)
    phase = np.where(forward, carry.phase + 1, carry.phase)
    finished = forward & (phase >= carry.programs.length)
    status = np.where(running & (failed > 0), failed, np.where(finished, DONE, carry.status))
    rows = carry.programs.at(phase) if forward.any() else rows
    rise = np.where(np.isnan(rows["rise"]), carry.rise, rows["rise"])
    new = Carry(carry.programs, phase, np.where(forward, 0, carry.steps + 1), status.astype(np.int32), rows, rise)
    going = new.running
    still = {**rows, "base": np.where(going, rows["base"], Base.STAY), "hand": np.where(going, rows["hand"], -1)}
    still["rise"] = rise
    return body.command(senses, still).astype(np.float32), new


def _ended(body: Body, senses: Senses, rows: Rows) -> Bool[np.ndarray, "W"]:
    """Worlds in which the present phase has reached its end."""
    apart = np.linalg.norm(rows["xy"] - senses.base_pos[:, :2], axis=1)
    turned = np.abs((rows["yaw"] - senses.yaw + np.pi) % (2 * np.pi) - np.pi)
    moves = (rows["base"] == Base.DRIVE) | (rows["base"] == Base.SHIFT)
    turns = (rows["base"] == Base.TURN) | (rows["base"] == Base.SHIFT)
    there = (~moves | (apart < rows["tolerance"])) & (~turns | (turned < rows["turn_tolerance"]))
    there &= np.isnan(rows["rise"]) | (np.abs(body.stands + rows["rise"] - senses.base_pos[:, 2]) < RISEN)
    held, empty = np.zeros(len(there), bool), np.ones(len(there), bool)
    world, index = np.arange(len(there)), np.maximum(rows["object"], 0)
    pos, quat = goals_of_hand(senses, rows)
    for number in range(len(body.hands)):
        mine = rows["hand"] == number
        if not mine.any():
            continue
        grip = grip_of(senses, number, body.grips[number])
        near = np.linalg.norm(pos - grip, axis=1) < rows["tolerance"]
        angle = np.asarray(rotation_angle(senses.hand_quat[:, number], quat))
        near = ((rows["moves"] == 0) | near) & ((rows["turns"] == 0) | (angle < rows["turn_tolerance"]))
        there &= ~mine | near
        held |= mine & senses.held[world, number, index]
        empty &= ~mine | ~senses.held[:, number].any(1)
    touched = senses.touching[world, index]
    until = rows["until"]
    return np.select(
        [until == Until.HELD, until == Until.TOUCHED, until == Until.EMPTY, until == Until.WAITED],
        [held, touched, empty, np.zeros(len(there), bool)],
        there,
    )


def _lost(senses: Senses, rows: Rows) -> Bool[np.ndarray, "W"]:
    """Worlds in which what had to stay in a hand is in none."""
    kept = senses.held[np.arange(len(rows["keeps"])), :, np.maximum(rows["keeps"], 0)].any(1)
    return (rows["keeps"] >= 0) & ~kept
