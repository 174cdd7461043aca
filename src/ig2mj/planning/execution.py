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
from ig2mj.planning.bodies import Body, Rows, goals_of_hand
from ig2mj.planning.phases import REASON_NUMBERS, Base, Phase, Programs, Until
from ig2mj.planning.senses import Senses, acting_grip, sense

RUNNING, DONE = -1, 0
"""Statuses; larger ones are numbers of `REASON_NUMBERS`."""

SETTLING = 2
"""Agent steps that a phase lasts at least: a hand that is asked to open or close needs them."""


RISEN = 0.03
"""m within which a body is at its height."""

STILL, STILL_TURNED, BLOCKED = 0.004, 0.02, 4
"""m and rad in an agent step below which a hand on an arm does not move, and steps of it after which the hand is
blocked: a controller adds up what is asked of a blocked hand, and a hand that is far behind loses what it holds."""

STANDS, STANDS_TURNED, STUCK = 0.008, 0.03, 20
"""m and rad that a base on wheels has not moved in so many agent steps of a phase that moves it, if it is stuck: what
has stopped it does so for the rest of the phase."""

CARRIED_OFF, TURNED_OFF = 0.2, 0.5
"""m and rad from where a base stays beyond which somebody else has moved it."""

NEAR, TURNED_NEAR = 0.08, 0.2
"""m and rad from the end of a phase within which a base creeps, and does not count as stuck."""


@dataclasses.dataclass(frozen=True, eq=False)
class Carry:
    """State of the execution.

    Attributes:
      programs: of all worlds. phase: number of the present one. steps: agent steps in it. status: of each world.
      rows: the present phases. rise: m by which bodies are asked to be above their height.
      hand_pos, hand_quat: where hands were. still: agent steps of the present phase in which the acting one, of
        an arm, has not moved. base: x, y and direction, m and rad, from which bases that are to move have not gone far
        in so many agent steps of the present phase as `stood` says. stays: where bases that are to stay began to.
    """

    programs: Programs
    phase: Int[np.ndarray, "W"]
    steps: Int[np.ndarray, "W"]
    status: Int[np.ndarray, "W"]
    rows: Rows
    rise: Float[np.ndarray, "W"]
    hand_pos: Float[np.ndarray, "W H 3"] | None
    hand_quat: Float[np.ndarray, "W H 4"] | None
    still: Int[np.ndarray, "W"]
    base: Float[np.ndarray, "W 3"] | None
    stood: Int[np.ndarray, "W"]
    stays: Float[np.ndarray, "W 3"] | None = None

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
    rise = np.zeros(len(programs), np.float32)
    return Carry(packed, zero, zero, status, packed.at(zero), rise, None, None, zero, None, zero)


def begin_some(carry: Carry, programs: Mapping[int, Sequence[Phase]]) -> Carry:
    """New programs in some worlds; the others go on. `programs`: by the number of the world."""
    return begin_packed(carry, list(programs), Programs.pack(list(programs.values()))) if programs else carry


def begin_packed(carry: Carry, worlds: Sequence[int], fresh: Programs) -> Carry:
    """As `begin_some`, with the programs of k worlds as arrays."""
    new = np.array(worlds, np.int64)
    packed = carry.programs.with_rows(new, fresh)
    counts = (carry.phase, carry.steps, carry.still, carry.stood)
    phase, steps, still, stood = (a.copy() for a in counts)
    status = carry.status.copy()
    for count in (phase, steps, still, stood):
        count[new] = 0
    status[new] = np.where(fresh.length > 0, RUNNING, DONE)
    return dataclasses.replace(
        carry, programs=packed, phase=phase, steps=steps, status=status, rows=packed.at(phase), still=still, stood=stood
    )


def advance(body: Body, agent: int, carry: Carry, view: PhysicsView) -> tuple[Float[np.ndarray, "W n"], Carry]:
    """The robot's action in every world, in its controller's units, and what is remembered. Pure.

    Args:
      view: of the present physics. Worlds whose programs have ended get an action that leaves everything as it is.
    """
    return advance_sensed(body, carry, sense(view, agent, body.hands, body.friction))


def advance_sensed(body: Body, carry: Carry, senses: Senses) -> tuple[Float[np.ndarray, "W n"], Carry]:
    """As `advance`, from what was read of the view."""
    rows = carry.rows
    there, lost, wrong = _ended(body, senses, rows), _lost(senses, rows), _holds_another(senses, rows)
    still = np.zeros_like(carry.still)
    if body.opening is not None:
        still = np.where(_hand_is_still(carry, senses, rows), carry.still + 1, 0)
        ends = (rows["until"] == Until.TOUCHED) | ((rows["until"] == Until.THERE) & (rows["after"] == 0))
        there |= ends & (rows["moves"] > 0) & (still >= BLOCKED)
    there &= carry.steps >= np.where(rows["close"] >= 0, SETTLING, 0)
    stands, base = _base_stands(body, carry, senses, rows)
    stays = _where_bases_stay(carry, senses, rows)
    stood = np.where(stands, carry.stood + 1, 0)
    late = (carry.steps >= rows["limit"]) | (stood >= STUCK)
    waited = late & (rows["until"] == Until.WAITED)
    failed = np.where(lost, REASON_NUMBERS.index("slipped"), np.where(late & ~there & ~waited, rows["after"], 0))
    failed = np.where(wrong, REASON_NUMBERS.index("no_grasp"), failed)
    passed = there | waited | (late & (failed == 0))
    running = carry.running
    forward = running & passed & (failed == 0)
    phase = np.where(forward, carry.phase + 1, carry.phase)
    finished = forward & (phase >= carry.programs.length)
    status = np.where(running & (failed > 0), failed, np.where(finished, DONE, carry.status))
    rows = carry.programs.at(phase) if forward.any() else rows
    rise = np.where(np.isnan(rows["rise"]), carry.rise, rows["rise"])
    steps, waits, stood = (np.where(forward, 0, count) for count in (carry.steps + 1, still, stood))
    hands = senses.hand_pos, senses.hand_quat
    new = Carry(carry.programs, phase, steps, status.astype(np.int32), rows, rise, *hands, waits, base, stood, stays)
    going = new.running
    asked = {**rows, "base": np.where(going, rows["base"], Base.STAY), "hand": np.where(going, rows["hand"], -1)}
    asked["rise"], asked["still"], asked["stays"] = rise, waits, stays
    return body.command(senses, asked).astype(np.float32), new


def _ended(body: Body, senses: Senses, rows: Rows) -> Bool[np.ndarray, "W"]:
    """Worlds in which the present phase has reached its end."""
    apart = np.linalg.norm(rows["xy"] - senses.base_pos[:, :2], axis=1)
    turned = np.abs((rows["yaw"] - senses.yaw + np.pi) % (2 * np.pi) - np.pi)
    moves = (rows["base"] == Base.DRIVE) | (rows["base"] == Base.SHIFT)
    turns = (rows["base"] == Base.TURN) | (rows["base"] == Base.SHIFT)
    there = (~moves | (apart < rows["tolerance"])) & (~turns | (turned < rows["turn_tolerance"]))
    there &= np.isnan(rows["rise"]) | (np.abs(body.stands + rows["rise"] - senses.base_pos[:, 2]) < RISEN)
    world, index = np.arange(len(there)), np.maximum(rows["object"], 0)
    held, empty = np.zeros(len(there), bool), np.ones(len(there), bool)
    acts = np.flatnonzero(rows["hand"] >= 0)
    if len(acts):
        own, mine = senses.of(acts), {name: values[acts] for name, values in rows.items()}
        pos, quat = goals_of_hand(own, mine)
        grip, turned = acting_grip(own, mine["hand"], body.grips)
        near = (mine["moves"] == 0) | (np.linalg.norm(pos - grip, axis=1) < mine["tolerance"])
        there[acts] &= near & ((mine["turns"] == 0) | (rotation_angle(turned, quat) < mine["turn_tolerance"]))
        held[acts] = own.held[np.arange(len(acts)), mine["hand"], index[acts]]
        asked = (mine["both"] > 0)[:, None] | (mine["hand"][:, None] == np.arange(len(body.hands)))
        empty[acts] = ~(asked & own.held.any(2)).any(1)
    touched = senses.touching[world, index]
    until = rows["until"]
    return np.select(
        [until == Until.HELD, until == Until.TOUCHED, until == Until.EMPTY, until == Until.WAITED],
        [held, touched, empty, np.zeros(len(there), bool)],
        there,
    )


def _hand_is_still(carry: Carry, senses: Senses, rows: Rows) -> Bool[np.ndarray, "W"]:
    """Worlds in which the acting hand neither moves nor turns."""
    if carry.hand_pos is None or carry.hand_quat is None or not senses.hand_pos.shape[1]:
        return np.zeros(len(rows["hand"]), bool)
    world, hand = np.arange(len(rows["hand"])), np.maximum(rows["hand"], 0)
    moved = np.linalg.norm((senses.hand_pos - carry.hand_pos)[world, hand], axis=1)
    turned = np.asarray(rotation_angle(senses.hand_quat[world, hand], carry.hand_quat[world, hand]))
    return (rows["hand"] >= 0) & (moved < STILL) & (turned < STILL_TURNED)


def _base_stands(
    body: Body, carry: Carry, senses: Senses, rows: Rows
) -> tuple[Bool[np.ndarray, "W"], Float[np.ndarray, "W 3"]]:
    """Worlds in which a base on wheels is to move far and is about where it was, and where that is."""
    base = np.column_stack([senses.base_pos[:, :2], senses.yaw])
    if carry.base is None or body.sideways:
        return np.zeros(len(base), bool), base
    moved = base - carry.base
    turned = np.abs((moved[:, 2] + np.pi) % (2 * np.pi) - np.pi)
    stands = (np.linalg.norm(moved[:, :2], axis=1) < STANDS) & (turned < STANDS_TURNED)
    stands &= _far(senses, rows)
    return stands, np.where(stands[:, None], carry.base, base)


def _where_bases_stay(carry: Carry, senses: Senses, rows: Rows) -> Float[np.ndarray, "W 3"]:
    """x, y and direction of bases where they were when they last moved by themselves; of those that somebody else has
    moved far, where they are."""
    base = np.column_stack([senses.base_pos[:, :2], senses.yaw])
    if carry.stays is None:
        return base
    moved = base - carry.stays
    turned = np.abs((moved[:, 2] + np.pi) % (2 * np.pi) - np.pi)
    gone = (np.linalg.norm(moved[:, :2], axis=1) > CARRIED_OFF) | (turned > TURNED_OFF)
    return np.where(((rows["base"] != Base.STAY) | gone)[:, None], base, carry.stays)


def _far(senses: Senses, rows: Rows) -> Bool[np.ndarray, "W"]:
    """Worlds in which the base is not near the goal of its phase, to which it creeps."""
    apart = np.linalg.norm(rows["xy"] - senses.base_pos[:, :2], axis=1)
    turned = np.abs((rows["yaw"] - senses.yaw + np.pi) % (2 * np.pi) - np.pi)
    goes = (rows["base"] == Base.DRIVE) | (rows["base"] == Base.SHIFT)
    return (goes & (apart > NEAR)) | ((rows["base"] == Base.TURN) & (turned > TURNED_NEAR))


def _holds_another(senses: Senses, rows: Rows) -> Bool[np.ndarray, "W"]:
    """Worlds in which a hand that closes on an object holds another one, such as the drawer that it lies in: it takes
    hold of nothing else any more, and would press the object through what it no longer meets."""
    world, hand = np.arange(len(rows["hand"])), np.maximum(rows["hand"], 0)
    if not senses.held.shape[1]:
        return np.zeros(len(world), bool)
    holds = senses.held[world, hand]
    closes = (rows["until"] == Until.HELD) & (rows["hand"] >= 0) & (rows["object"] >= 0)
    return closes & holds.any(1) & ~holds[world, np.maximum(rows["object"], 0)]


def _lost(senses: Senses, rows: Rows) -> Bool[np.ndarray, "W"]:
    """Worlds in which what had to stay in a hand is in none, or what had to stay in all is not."""
    holds = senses.held[np.arange(len(rows["keeps"])), :, np.maximum(rows["keeps"], 0)]
    kept = np.where(rows["both"] > 0, holds.all(1), holds.any(1))
    return (rows["keeps"] >= 0) & ~kept
