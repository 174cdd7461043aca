"""What a controller and a planner know of a robot: its base, its hands, what they hold and what it touches.

Axes: W worlds, H hands of the robot, F links of fingers, O objects, Y graspable bodies, Q joints of all robots.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.host_rotations import quat_rotate

PRESSED, PRESSING = 0.2, 2
"""N with which a finger's link presses on what it holds, at least, and links that hold something by friction alone."""


@dataclasses.dataclass(frozen=True, eq=False)
class Senses:
    """What executing a program reads of the view; world frame, m, w-x-y-z. joints: of all robots, rad or m."""

    base_pos: Float[np.ndarray, "W 3"]
    base_quat: Float[np.ndarray, "W 4"]
    hand_pos: Float[np.ndarray, "W H 3"]
    hand_quat: Float[np.ndarray, "W H 4"]
    held: Bool[np.ndarray, "W H O"]
    touching: Bool[np.ndarray, "W O"]
    joints: Float[np.ndarray, "W J"] | None = None

    @functools.cached_property
    def yaw(self) -> Float[np.ndarray, "W"]:
        """Direction of the base, rad."""
        w, x, y, z = np.moveaxis(self.base_quat, -1, 0)
        return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def of(self, worlds: Int[np.ndarray, "k"]) -> Senses:
        """The same of k worlds."""
        joints = None if self.joints is None else self.joints[worlds]
        base, hand = (self.base_pos[worlds], self.base_quat[worlds]), (self.hand_pos[worlds], self.hand_quat[worlds])
        return Senses(*base, *hand, self.held[worlds], self.touching[worlds], joints)


class FrictionHolds:
    """What hands hold by friction alone, where no constraint says so: what two links of a hand's fingers press on."""

    def __init__(
        self,
        hand_of_link: Int[np.ndarray, "F"],
        object_of_body: Int[np.ndarray, "Y"],
        objects: int,
        hands: Int[np.ndarray, "H"],
    ):
        """hand_of_link, object_of_body: numbers of each finger link's hand, and each graspable body's object."""
        self._links = (hand_of_link[None] == hands[:, None]).astype(np.int32)
        self._bodies = (object_of_body[:, None] == np.arange(objects)).astype(np.int32)

    def __call__(self, force: Float[Array, "W F Y"]) -> Bool[np.ndarray, "W H O"]:
        """force: N with which each link presses on each body (`AgentView.finger_force`)."""
        pressed = (np.asarray(force) > PRESSED).astype(np.int32)
        return (np.einsum("hf,wfy->why", self._links, pressed) >= PRESSING).astype(np.int32) @ self._bodies > 0


def sense(view: PhysicsView, agent: int, hands: Int[np.ndarray, "H"], friction: FrictionHolds | None = None) -> Senses:
    """What the view says of one robot. friction: its hands hold by friction alone; None: by constraints."""
    return senses_of(jax.device_get(sensed(view, friction is not None)), agent, hands, friction)  # copied side by side


def sensed(view: PhysicsView, by_friction: bool) -> tuple[Array, ...]:
    """What `senses_of` reads of the view, of all robots; may be traced. by_friction: hands hold by friction alone."""
    a = view.agent
    holding = a.finger_force if by_friction else view.held
    return a.base_pos, a.base_quat, a.hand_pos, a.hand_quat, holding, a.touching, a.joint_pos


def senses_of(
    arrays: Sequence[np.ndarray], agent: int, hands: Int[np.ndarray, "H"], friction: FrictionHolds | None = None
) -> Senses:
    """As `sense`, from the arrays of `sensed` on the host."""
    base_pos, base_quat, hand_pos, hand_quat, holding, touching, joints = arrays
    return Senses(
        base_pos=base_pos[:, agent],
        base_quat=base_quat[:, agent],
        hand_pos=hand_pos[:, hands],
        hand_quat=hand_quat[:, hands],
        held=holding[:, hands] if friction is None else friction(holding),
        touching=touching[:, agent],
        joints=joints,
    )


def grip_of(senses: Senses, number: int, grip: Array) -> Float[np.ndarray, "W 3"]:
    """Where a hand's grasp point is, world frame, m."""
    point = np.broadcast_to(np.asarray(grip, np.float32), senses.hand_pos[:, number].shape)
    return senses.hand_pos[:, number] + np.asarray(quat_rotate(senses.hand_quat[:, number], point))


def acting_grip(
    senses: Senses, hand: Int[np.ndarray, "W"], grips: Float[np.ndarray, "H 3"]
) -> tuple[Float[np.ndarray, "W 3"], Float[np.ndarray, "W 4"]]:
    """Where the grasp point of one hand in each world is, world frame, m, and how that hand is turned, w-x-y-z.

    Args:
      hand: number of the hand. grips: grasp points in the frames of hands, m.
    """
    world = np.arange(len(hand))
    pos, quat = senses.hand_pos[world, hand], senses.hand_quat[world, hand]
    return pos + quat_rotate(quat, grips[hand].astype(np.float32)), quat
