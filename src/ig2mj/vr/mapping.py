"""`action_of`: from what a person's devices say to the humanoid's 28 numbers (iGibson's VR interface).

The head is set directly. Hands and body are targets, to which the humanoid's constraints pull with 300 N and 50 N; so
hands stop at walls, whatever the person's own hands do. A body without a tracker stands below the head and faces where
the head faces, however it is pitched.

Both squeezes held for a second let go of the robot, or take hold of it again; one alone brings that hand back to rest.
Without a person the robot stays where it was sent, hands at rest and open.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from ig2mj.agents.humanoid import HumanoidState
from ig2mj.agents.humanoid.frames import BODY_Z, EYE_POS, MAX_MOVE, MAX_TURN
from ig2mj.engine.view import PhysicsView
from ig2mj.vr.frames import Pose, PoseFrame

TOGGLE_SECONDS = 1.0
"""Both squeezes held for so long take hold of the robot, or let go of it."""

PRESSED = 0.5
"""From here on a squeeze counts."""

BODY_TURN = 1.0 / 3.0
"""rad by which the body is turned in a frame: what it can turn in 1/30 s (`humanoid.controller.MAX_TURN_RATE`). With
iGibson's 1 rad a hand that is stretched out would have to go further in the body's frame than its own limit lets it,
and would be dragged along whenever a person looks around."""

LEVEL = 0.05
"""Horizontal length of the head's right below which it has no heading: it lies on its side."""


@dataclasses.dataclass(frozen=True, eq=False)
class HumanoidPose:
    """The humanoid as it is: pose of its body in the world; targets of eye and hands in the body's frame; triggers."""

    body: Pose
    eye: Pose
    hands: tuple[Pose, Pose]
    triggers: tuple[float, float]


@dataclasses.dataclass(frozen=True, eq=False)
class Memory:
    """What `action_of` remembers.

    Attributes:
      body: where it was sent last, world. attached: devices move the robot.
      squeezed: s, when both squeezes began to be held. toggled: they were held long enough and not let go since.
      took_hold: counts how often devices took hold of the robot; the play area is then brought to it.
    """

    body: Pose | None = None
    attached: bool = True
    squeezed: float | None = None
    toggled: bool = False
    took_hold: int = 0


def robot_of(view: PhysicsView, state: HumanoidState, world: int = 0, agent: int = 0) -> HumanoidPose:
    """One humanoid of a view, with what its controller remembers."""

    def pose(pos: object, quat: object) -> Pose:
        q = np.asarray(quat, np.float64)
        return Pose(np.asarray(pos, np.float64), q / np.linalg.norm(q))

    hands = [pose(np.asarray(state.hand_pos)[world, k], np.asarray(state.hand_quat)[world, k]) for k in range(2)]
    triggers = np.asarray(state.trigger, np.float64)[world]
    return HumanoidPose(
        pose(np.asarray(view.agent.base_pos)[world, agent], np.asarray(view.agent.base_quat)[world, agent]),
        pose(np.asarray(state.eye_pos)[world], np.asarray(state.eye_quat)[world]),
        (hands[0], hands[1]),
        (float(triggers[0]), float(triggers[1])),
    )


def action_of(frame: PoseFrame | None, robot: HumanoidPose, memory: Memory) -> tuple[Float[np.ndarray, "28"], Memory]:
    """The humanoid's action, in metres, radians and shares, and what to remember. Pure.

    Args:
      frame: None: there is no person.
      robot: before the action.
    """
    action = np.zeros(28)
    if frame is None:
        memory = dataclasses.replace(memory, body=memory.body or robot.body, squeezed=None, toggled=False)
        assert memory.body is not None
        action[:6], _ = _body_step(robot.body, memory.body)
        for k in range(2):
            action[18 + 8 * k], action[19 + 8 * k] = -robot.triggers[k], 1.0
        return action, memory
    memory = _switched(frame, memory)
    desired = memory.body or robot.body
    if memory.attached:
        desired = desired_body(frame, desired)
    memory = dataclasses.replace(memory, body=desired)
    action[:6], body = _body_step(robot.body, desired)
    if not memory.attached:
        return action, memory

    into = body.inverse()
    if frame.head is not None:
        action[6:12], _ = _step(robot.eye, into * frame.in_world(frame.head))
    for k, hand in enumerate(frame.hands):
        at = 12 + 8 * k
        if hand.squeeze >= PRESSED:
            action[at + 7] = 1.0
        elif hand.pose is not None:
            action[at : at + 6], _ = _step(robot.hands[k], into * frame.in_world(hand.pose))
        action[at + 6] = float(np.clip(hand.trigger, 0.0, 1.0)) - robot.triggers[k]
    return action, memory


def desired_body(frame: PoseFrame, last: Pose) -> Pose:
    """Where the body shall be: at its tracker, else below the head; where there is neither, it stays."""
    if frame.torso is not None:
        return frame.in_world(frame.torso)
    if frame.head is None:
        return last
    head = frame.in_world(frame.head)
    yaw = heading(head)
    turn = Rotation.from_euler("z", _yaw_of(last) if yaw is None else yaw)
    pos = head.pos - turn.apply(EYE_POS)
    return Pose.of((pos[0], pos[1], float(np.clip(pos[2], *BODY_Z))), turn)


def heading(head: Pose) -> float | None:
    """Direction in which a head faces, rad about the vertical; None for one that lies on its side.

    By its right, which stays level when the head is pitched, and which tells looking straight up and down from each
    other.
    """
    right = head.turn.apply((0.0, -1.0, 0.0))
    return None if math.hypot(right[0], right[1]) < LEVEL else math.atan2(right[0], -right[1])


def _switched(frame: PoseFrame, memory: Memory) -> Memory:
    """After what both squeezes say."""
    if not all(hand.squeeze >= PRESSED for hand in frame.hands):
        return dataclasses.replace(memory, squeezed=None, toggled=False)
    since = frame.time if memory.squeezed is None else memory.squeezed
    memory = dataclasses.replace(memory, squeezed=since)
    if memory.toggled or frame.time - since <= TOGGLE_SECONDS:
        return memory
    attached = not memory.attached
    return dataclasses.replace(memory, attached=attached, toggled=True, took_hold=memory.took_hold + attached)


def _body_step(now: Pose, desired: Pose) -> tuple[Float[np.ndarray, "6"], Pose]:
    """Of the body, in its present frame; and where that brings it, as the controller reckons."""
    delta = now.inverse() * desired
    move, turn = _limited(delta.pos), _limited_turn(delta.turn, BODY_TURN)
    new = now * Pose.of(move, turn)
    low, high = BODY_Z
    new = dataclasses.replace(new, pos=np.array([*new.pos[:2], float(np.clip(new.pos[2], low, high))]))
    return np.concatenate([move, turn.as_euler("xyz")]), new


def _step(now: Pose, desired: Pose) -> tuple[Float[np.ndarray, "6"], Pose]:
    """Of eye or hand: what is added to its place, and the turn about the body's axes that is put before its own."""
    move = _limited(desired.pos - now.pos)
    turn = _limited_turn(desired.turn * now.turn.inv())
    return np.concatenate([move, turn.as_euler("xyz")]), Pose.of(now.pos + move, turn * now.turn)


def _limited(move: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Shortened on its line until no number is above `MAX_MOVE`."""
    return move * min(1.0, MAX_MOVE / max(float(np.abs(move).max()), 1e-12))


def _limited_turn(turn: Rotation, most: float = MAX_TURN) -> Rotation:
    """At most so much, about the same axis; its roll, pitch and yaw are then no larger either."""
    angle = turn.magnitude()
    return turn if angle <= most else Rotation.from_rotvec(turn.as_rotvec() * (most / angle))


def _yaw_of(pose: Pose) -> float:
    forward = pose.turn.apply((1.0, 0.0, 0.0))
    return math.atan2(forward[1], forward[0])
