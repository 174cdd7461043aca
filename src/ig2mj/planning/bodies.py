"""How a robot's own action moves its base and hands: one class for each kind of base.

`command` gives numbers of the controller's action in its own units. All of it is pure and batched.

Axes: W worlds, n numbers of a robot's action, H hands of the robot, F links of fingers, O objects, Y graspable bodies,
Q joints of all robots.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from ig2mj.agents.base import Controller
from ig2mj.agents.humanoid.frames import BODY_HEIGHT, HAND_POS, HAND_QUAT, HAND_REACH, SHOULDER_POS
from ig2mj.agents.humanoid.robot import BODY_RADIUS
from ig2mj.agents.task_robot import HandControl, TaskRobot
from ig2mj.geometry.host_rotations import (
    cross,
    length,
    matrix_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    quat_rotate_inverse,
    quat_to_rotation_vector,
)
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.phases import Base, Phase, Until
from ig2mj.planning.senses import FrictionHolds, Senses, acting_grip
from ig2mj.scene.scene import Scene

AHEAD = 0.35
"""rad of a base's direction from that of the way within which it drives; else it turns first."""

AT_ONCE = 0.06
"""m from a point within which a base need not face it."""

TURN_STEP, HAND_TURN_STEP = 0.25, 0.2
"""rad in an agent step: of a base that moves sideways, and of a hand."""

LADEN_TURN = 0.4
"""Share of the turn that is left by which a hand that carries something is turned in an agent step: targets of hands
add up, and what is heavy follows them late, so that with the whole turn it would swing."""

GAIN, MOST = 1.2, 0.5
"""Of a wheeled base: command of its turning for each rad (1 is its greatest speed), and the greatest command of turning
and driving."""

RADIUS, CORNER, BEHIND, ALONG = 0.03, 0.03, 0.014, (0.07, 0.1)
"""m: of the spheres of a floating hand: radius; of the palm's corners from its middle, along the fingers and across; of
the palm behind the grasp point; of the fingers ahead of it."""

RUSH, RUSHING = 0.2, 3.0
"""m in an agent step from which on a wheeled base drives as fast as it can, to take an edge of a carpet, and by how
much its gain is greater then."""

PASSING, CROSSING = 0.05, 0.8
"""m, tolerance of a point from which on a base only passes it, and least command of driving to such a point as fast as
it can: an edge of a carpet on the way stops what is slower."""

RUSH_AHEAD, RUSH_TURN = 0.8, 0.15
"""rad off its way up to which a base that drives so goes on, and its greatest command of turning meanwhile: where it
slows down to turn, an edge stops it."""

_BODY = tuple(f"body_{n}" for n in ("x", "y", "z", "roll", "pitch", "yaw"))

QUICK = 0.08
"""m of an empty hand that floats in an agent step."""

TOGETHER = (0.03, 0.06)
"""m and rad in an agent step of a base whose hands hold the same: they lose what is too heavy for one in quicker
turns."""

UPRIGHT = 0.5
"""Share of a hovering body's tilt and of its error of height that is taken back in an agent step."""


Direction = Sequence[float] | np.ndarray

Rows = Mapping[str, np.ndarray]
"""The present phases, from `Programs.at`; of programs that are carried out also `still`: agent steps of the phase in
which the acting hand has not moved."""


@runtime_checkable
class Body(Protocol):
    """A robot as programs move it.

    Attributes:
      size: n. friction: what its hands hold by friction alone; None: they hold by constraints. hands: numbers of its
        hands among all hands of the scene. grips: [H, 3] m, the point with which each hand takes hold, in its frame.
      sideways: its base moves in any direction. stands: m, height of a body that hovers; else 0. climbs: it passes over
        edges of carpets. opening: m between the fingers of an arm's gripper; None: hands float, and take hold with the
        palm, or there are none.
    """

    size: int
    friction: FrictionHolds | None
    hands: Int[np.ndarray, "H"]
    grips: Float[np.ndarray, "H 3"]
    sideways: bool
    stands: float
    climbs: bool
    opening: float | None

    def command(self, senses: Senses, rows: Rows) -> Float[np.ndarray, "W n"]:
        """The controller's action of the present phases."""
        ...


@runtime_checkable
class Follower(Protocol):
    """Whether the arm that carries a hand follows ways of it; from one place of the base, with one orientation."""

    def reaches(self, point: Float[np.ndarray, "3"]) -> bool:
        """Whether the hand can be at a point of the world, m."""
        ...

    def __call__(
        self,
        points: Sequence[np.ndarray],
        spheres: Float[np.ndarray, "S 4"],
        turned_at: Float[np.ndarray, "3"] | None = None,
    ) -> bool:
        """Whether it goes along points of the world, m, the first of which is not where it is, with room for it, and
        for the hand where the arm brings it: off the straight lines between the points.

        Args:
          spheres: of the hand with what it holds, turned as it is to be, about its grasp point. turned_at: where the
            hand is turned before it goes on; None: it is turned on its way.
        """
        ...

    def passes(self, points: Sequence[np.ndarray]) -> bool:
        """As a call, whatever is in the way: what the hand moves along is there, too."""
        ...

    def arrives(self, points: Sequence[np.ndarray]) -> bool:
        """As `passes`, with room for the arm, about, where the hand is at the last point."""
        ...


@runtime_checkable
class HandedBody(Body, Protocol):
    """A robot whose hands are planned: floating ones, or such that are carried by an arm.

    Attributes:
      reach: m from a shoulder that a hand goes. shoulders, carry, rest: [H, 3] m, in the frame of the base: of the
        shoulders, and of the grasp points where hands carry things and where empty hands rest.
      away: m, horizontal, that the base is at least to be from what a hand does.
      trunk: m, radius and height of the upright body that what is held keeps clear of.
      resting: m, heights of empty hands at rest, and how far from the axis they reach; None: the footprint has them.
      arm: bodies, of the scene, that move with the hands and do not count where the robot stands.
      rises: m by which the body stoops, and stretches, for what its hands do not reach otherwise.
      tucked: [H, 3] m, where empty hands are in narrow places; None: as they are.
      lifts: kg that one hand lifts; where it lifts less than an object's mass, two hands take it.
    """

    lifts: float
    reach: float
    shoulders: Float[np.ndarray, "H 3"]
    carry: Float[np.ndarray, "H 3"]
    rest: Float[np.ndarray, "H 3"]
    away: float
    trunk: tuple[float, float]
    resting: tuple[float, float, float] | None
    arm: Int[np.ndarray, "n"]
    rises: tuple[float, float]
    tucked: Float[np.ndarray, "H 3"] | None
    stands: float

    def turned(self, hand: int, fingers: Direction, palm: Direction) -> tuple[float, float, float, float]:
        """Orientation of a hand whose fingers point, and whose palm faces, along directions at right angles."""
        ...

    def axes(self, hand: int, frame: Float[np.ndarray, "3 3"]) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Where the fingers point, and the palm faces, of a hand turned so: the inverse of `turned`."""
        ...

    def hand_spheres(self, fingers: Direction, palm: Direction) -> Float[np.ndarray, "S 4"]:
        """x, y, z from a hand's grasp point (world axes) and radius of spheres that hold an open hand, m."""
        ...

    def hand_corners(self, fingers: Direction, palm: Direction) -> Float[np.ndarray, "n 3"]:
        """Corners of the boxes of a gripper's geoms, from its grasp point (world axes), m; none of other hands."""
        ...

    def prepared(self, program: Sequence[Phase]) -> list[Phase]:
        """A program as this body carries it out."""
        ...

    def arm_spheres(self, joints: Float[np.ndarray, "Q"], at_rest: bool) -> Float[np.ndarray, "S 4"]:
        """x, y, z in the frame of the base, and radius, of spheres that hold an arm and its hand, m; none of a hand
        that floats. Arguments as of `follower`."""
        ...

    def follower(
        self,
        joints: Float[np.ndarray, "Q"],
        at_rest: bool,
        base: tuple[Float[np.ndarray, "3"], float],
        quat: Sequence[float] | np.ndarray,
        obstacles: Obstacles,
    ) -> Follower | None:
        """Whether an arm carries the hand along ways; None: the hand floats.

        Args:
          joints: of all robots, now. at_rest: the arm begins where it rests. base: position and direction of the base.
          quat: orientation of the hand on the way, w-x-y-z.
        """
        ...


class _Body:
    stands = 0.0
    climbs = False
    friction: FrictionHolds | None = None
    opening: float | None = None

    def __init__(self, scene: Scene, controller: Controller, agent: int):
        robot = scene.agents[agent]
        self._names, self.size = tuple(controller.action_names), controller.action_size
        self.hands: Int[np.ndarray, "H"] = np.flatnonzero(scene.tables.hand_agent == agent)
        rays = robot.hand_rays() if isinstance(robot, TaskRobot) else ()
        self.grips: Float[np.ndarray, "H 3"] = np.array([r.grasp_point for r in rays], float).reshape(-1, 3)
        controls: Sequence[HandControl] = robot.hand_controls if isinstance(robot, TaskRobot) else ()
        self._controls: Sequence[HandControl] = controls
        self._rest = np.zeros(self.size, np.float32)
        for control in controls:
            if control.rests_open:
                self._rest[self._names.index(control.close)] = control.opens

    def _places(self, *names: str) -> list[int]:
        return [self._names.index(name) for name in names]


class WheeledBody(_Body):
    """A base on two driven wheels: it turns on the spot and drives forwards, in a straight shift backwards, too. Its
    hands stay as they are."""

    sideways = False
    carrying = MOST, MOST
    """Greatest commands of driving and turning while a hand holds something."""

    def command(self, senses: Senses, rows: Rows) -> Float[np.ndarray, "W n"]:
        action = np.tile(self._rest, (len(senses.base_pos), 1))
        forward, turn = self._places("forward", "turn_left")
        offset = rows["xy"] - senses.base_pos[:, :2]
        apart = np.linalg.norm(offset, axis=1)
        arrived = (rows["base"] == Base.SHIFT) & (apart < rows["tolerance"])  # what is left is to turn
        drives = (rows["base"] == Base.DRIVE) | ((rows["base"] == Base.SHIFT) & ~arrived)
        way = np.arctan2(offset[:, 1], offset[:, 0])
        back = (rows["base"] == Base.SHIFT) & drives & (np.cos(way - senses.yaw) < 0.0)
        heading = np.where(drives, way + np.pi * back, rows["yaw"])
        left = _wrapped(heading - senses.yaw)
        acts = rows["base"] != Base.STAY
        carries = senses.held.any(axis=(1, 2))
        rushes = drives & (rows["speed"] >= RUSH) & ~carries
        ahead = drives & (np.abs(left) < np.where(rushes, RUSH_AHEAD, AHEAD))
        most = np.where(carries, self.carrying[1], np.where(rushes & ahead, RUSH_TURN, MOST))
        action[:, turn] = np.where(acts, np.clip(GAIN * left, -most, most), 0.0)
        least = np.where(rushes & (rows["tolerance"] > PASSING), CROSSING, 0.0)
        speed = np.where(rushes, RUSHING, 1.0) * GAIN * apart
        speed = np.clip(speed, least, np.where(carries, self.carrying[0], np.where(rushes, 1.0, MOST))) * np.cos(left)
        action[:, forward] = np.where(ahead, np.where(back, -speed, speed), 0.0)
        return action


class HoveringBody(_Body):
    """The humanoid: a body that moves in any direction, and hands whose targets are displaced in its frame.

    Attributes:
      reach: m from a shoulder that a hand goes. shoulders, carry, rest, tucked: [H, 3] m, in the body's frame: of the
        shoulders, and of the grasp points where hands carry things, where empty hands rest, and where they are in
        narrow places.
    """

    sideways = climbs = True
    away = 0.0
    trunk = (BODY_RADIUS + 0.01, 2 * BODY_HEIGHT)
    resting = (0.56, 0.8, 0.33)
    rises = (-0.5, 0.25)

    def __init__(self, scene: Scene, controller: Controller, agent: int):
        super().__init__(scene, controller, agent)
        self.arm = np.zeros(0, int)
        robot = scene.agents[agent]
        self.stands = float(robot.stands) if isinstance(robot, TaskRobot) else 0.0
        self.lifts = float(robot.hand_lifts) if isinstance(robot, TaskRobot) else np.inf
        self.reach, self.shoulders = HAND_REACH - SPARE_REACH, np.array(SHOULDER_POS)
        self.carry = np.array([[CARRY[0], side * CARRY[1], CARRY[2]] for side in (1, -1)])
        self.tucked = np.array([[TUCKED[0], side * TUCKED[1], TUCKED[2]] for side in (1, -1)])
        self.rest = np.array(HAND_POS) + np.stack(
            [np.asarray(quat_rotate(q, g)) for q, g in zip(HAND_QUAT, self.grips, strict=True)]
        )

    def command(self, senses: Senses, rows: Rows) -> Float[np.ndarray, "W n"]:
        action = np.tile(self._rest, (len(senses.base_pos), 1))
        action[:, self._places(*_BODY)] = self._base(senses, rows)
        acts = np.flatnonzero(rows["hand"] >= 0)
        if not len(acts):
            return action
        rows = {name: values[acts] for name, values in rows.items()}
        hand, (move, turn) = rows["hand"], self._hand(senses.of(acts), rows)
        for number, control in enumerate(self._controls):
            mine = hand == number
            moves = mine | (rows["both"] > 0)
            action[acts[moves, None], self._places(*control.move)] = move[moves]
            action[acts[mine, None], self._places(*control.turn)] = turn[mine]
            closing = -control.opens * rows["closes"]
            close = np.where(rows["close"] < 0, 0.0, np.where(rows["close"] > 0, closing, control.opens))
            action[acts[moves], self._places(control.close)] = close[moves]
            reset = control.close.replace("trigger", "reset")
            if reset in self._names:
                action[acts[mine], self._places(reset)] = rows["reset"][mine] > 0
        return action

    def _base(self, senses: Senses, rows: Rows) -> Float[np.ndarray, "W 6"]:
        """Displacement and turn of the body in its own frame; it is kept upright and at its height."""
        mode = rows["base"]
        offset = rows["xy"] - senses.base_pos[:, :2]
        apart = np.linalg.norm(offset, axis=1)
        heading = np.where(mode == Base.DRIVE, np.arctan2(offset[:, 1], offset[:, 0]), rows["yaw"])
        left = _wrapped(heading - senses.yaw)
        left = np.where((mode == Base.STAY) | ((mode == Base.DRIVE) & (apart < AT_ONCE)), 0.0, left)
        together = np.any(np.all(senses.held, axis=1), axis=1)  # all hands hold the same
        moves = (mode == Base.SHIFT) | ((mode == Base.DRIVE) & (np.abs(left) < AHEAD))
        speed = np.where(rows["hand"] >= 0, SPEED_OF_BASE, rows["speed"])
        speed = np.where(together, np.minimum(speed, TOGETHER[0]), speed)
        most = np.where(together, TOGETHER[1], TURN_STEP)
        share = np.where(moves, np.minimum(1.0, speed / np.maximum(apart, 1e-6)), 0.0)
        rise = UPRIGHT * (self.stands + rows["rise"] - senses.base_pos[:, 2])
        move = np.concatenate([share[:, None] * offset, np.clip(rise, -0.05, 0.05)[:, None]], axis=1)
        up = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), move.shape)
        turn = UPRIGHT * cross(quat_rotate(senses.base_quat, up), up)
        turn[:, 2] = np.clip(left, -most, most)
        own = [np.asarray(quat_rotate_inverse(senses.base_quat, v.astype(np.float32))) for v in (move, turn)]
        return np.concatenate(own, axis=1)

    def turned(self, hand: int, fingers: Direction, palm: Direction) -> tuple[float, float, float, float]:
        """Orientation of a hand whose fingers point, and whose palm faces, along directions at right angles."""
        z, y = np.asarray(palm, float), np.asarray(fingers, float) * (1.0 if hand == 0 else -1.0)
        matrix = np.stack([np.cross(y, z), y, z], axis=-1)
        w, x, y_, z_ = np.asarray(matrix_to_quat(matrix), float)
        return (float(w), float(x), float(y_), float(z_))

    def axes(self, hand: int, frame: Float[np.ndarray, "3 3"]) -> tuple[np.ndarray, np.ndarray]:
        """See `HandedBody.axes`."""
        return frame[:, 1] * (1.0 if hand == 0 else -1.0), frame[:, 2]

    def hand_spheres(self, fingers: Direction, palm: Direction) -> Float[np.ndarray, "S 4"]:
        """See `HandedBody.hand_spheres`."""
        return hand_spheres(fingers, palm)

    def hand_corners(self, fingers: Direction, palm: Direction) -> Float[np.ndarray, "n 3"]:
        """See `HandedBody.hand_corners`."""
        return np.zeros((0, 3))

    def prepared(self, program: Sequence[Phase]) -> list[Phase]:
        """With empty hands that are quick where nothing is touched."""
        return [
            dataclasses.replace(p, speed=QUICK)
            if p.hand >= 0 and p.speed is None and p.keeps < 0 and p.until == Until.THERE and p.close is None
            else p
            for p in program
        ]

    def arm_spheres(self, *_: Any) -> Float[np.ndarray, "S 4"]:
        """None: the hands float."""
        return np.zeros((0, 4))

    def follower(self, *_: Any) -> None:
        """None: the hands float."""

    def _hand(self, senses: Senses, rows: Rows) -> tuple[Float[np.ndarray, "W 3"], Float[np.ndarray, "W 3"]]:
        """Displacement and turn of the acting hand in the body's frame; each world has one."""
        base, (grip, quat) = senses.base_quat, acting_grip(senses, rows["hand"], self.grips)
        pos, required = goals_of_hand(senses, rows)
        move = np.where(rows["moves"][:, None] > 0, np.asarray(quat_rotate_inverse(base, pos - grip)), 0.0)
        move *= np.minimum(1.0, rows["speed"] / np.maximum(np.asarray(length(move)), 1e-6))[:, None]
        left = np.asarray(quat_to_rotation_vector(quat_multiply(required, quat_conjugate(quat))))
        turn = np.where(rows["turns"][:, None] > 0, np.asarray(quat_rotate_inverse(base, left)), 0.0)
        turn *= np.where(rows["keeps"] >= 0, LADEN_TURN, 1.0)[:, None]
        turn *= np.minimum(1.0, HAND_TURN_STEP / np.maximum(np.asarray(length(turn)), 1e-6))[:, None]
        return move, turn


def hand_spheres(fingers: Direction, palm: Direction) -> Float[np.ndarray, "S 4"]:
    """x, y, z from a floating hand's grasp point (world axes) and radius of spheres that hold it open, m; five of the
    palm first."""
    (x, y, z), (u, v, w) = fingers, palm
    side = (y * w - z * v, z * u - x * w, x * v - y * u)
    return np.concatenate([_OF_HAND @ np.array([fingers, side, palm], float), _RADII], axis=1)


_OF_HAND = np.array(
    [[CORNER * a, CORNER * b, -BEHIND] for a, b in ((0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))]
    + [[a, 0.0, -BEHIND] for a in ALONG]
)
"""m along the fingers, to the side and along the palm from a floating hand's grasp point to the middles of spheres."""

_RADII = np.full((len(_OF_HAND), 1), RADIUS)


SPARE_REACH, CARRY, TUCKED = 0.05, (0.34, 0.16, 0.5), (0.1, 0.1, 0.1)
"""m that are left of an arm's reach; forwards, to the side and up: where a hand carries what it holds, above tables,
and where an empty one is in narrow places."""

SPEED_OF_BASE = 0.05
"""m in an agent step of a base that moves together with a hand."""


def goals_of_hand(senses: Senses, rows: Rows) -> tuple[Float[np.ndarray, "W 3"], Float[np.ndarray, "W 4"]]:
    """Where the phases want the hands' grasp points, and how they want the hands turned; world frame."""
    inside = rows["in_body"] > 0
    pos = senses.base_pos + np.asarray(quat_rotate(senses.base_quat, rows["pos"]))
    quat = np.asarray(quat_multiply(senses.base_quat, rows["quat"]))
    return np.where(inside[:, None], pos, rows["pos"]), np.where(inside[:, None], quat, rows["quat"])


def _wrapped(angle: Float[np.ndarray, "W"]) -> Float[np.ndarray, "W"]:
    """The same angle in [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
