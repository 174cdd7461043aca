"""A hand of a robot in a scene (`hand_of`), and the arm that carries it (`Arm`: postures and inverse kinematics)."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.agents.urdf import UrdfRobot
from ig2mj.agents.urdf.following import FollowingJoints
from ig2mj.agents.urdf.grip import finger_tips, jaw_frame
from ig2mj.calibration.robot_place import collisions
from ig2mj.errors import EngineError
from ig2mj.scene.scene import Scene

NEAR = (-0.006, 0.0, 0.006)
"""m round the grasp point at which the opening of a hand is measured, along its approach and across it."""

FREE_JOINTS = 6
"""Joints with which an arm can bring its hand to any position in any orientation."""

WEIGHT, WEIGHT_FEW = 0.3, 0.03
"""m/rad: of the orientation next to the position in inverse kinematics, with that many joints and with fewer."""


@dataclasses.dataclass(frozen=True)
class Hand:
    """A hand of a robot in a scene.

    Attributes:
      palm: its body. point: where it holds, in its frame. approach, across: unit vectors in its frame: towards what it
        holds, and from one finger to the other. opening: m between the fingers; infinite of suction.
      joints: of the arm that carries it. close: its action. beyond: m by which its fingers, half closed, extend beyond
        `point` along the approach.
    """

    palm: str
    point: Float[np.ndarray, "3"]
    approach: Float[np.ndarray, "3"]
    across: Float[np.ndarray, "3"]
    opening: float
    joints: tuple[str, ...]
    close: str
    beyond: float = 0.0


class Arm:
    """An arm in the compiled scene: postures, and inverse kinematics by damped least squares."""

    def __init__(self, scene: Scene, robot: UrdfRobot, hand: Hand):
        self.scene, self.hand, self.model = scene, hand, scene.model
        self.data = scene.start_data()
        joints = [scene.model.joint(f"{robot.name}_{name}") for name in hand.joints]
        self._qpos = np.array([j.qposadr[0] for j in joints])
        self._dof = np.array([j.dofadr[0] for j in joints])
        self._low = np.array([j.range[0] if scene.model.jnt_limited[j.id] else -np.pi for j in joints])
        self._high = np.array([j.range[1] if scene.model.jnt_limited[j.id] else np.pi for j in joints])
        self._body = scene.model.body(hand.palm).id
        self._following = FollowingJoints(scene.model, [j.name for j in joints])

    def put(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Grasp point, approach and finger axis in the world, with the arm's joints at q."""
        self.data.qpos[self._qpos] = q
        self._following.put(self.data)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        turn = self.data.xmat[self._body].reshape(3, 3)
        hand = self.hand
        return self.data.xpos[self._body] + turn @ hand.point, turn @ hand.approach, turn @ hand.across

    def random(self, rng: np.random.Generator) -> np.ndarray:
        """A posture within the limits, away from their ends."""
        span = self._high - self._low
        return self._low + span * (0.03 + 0.94 * rng.random(len(span)))

    def solve(
        self, q: np.ndarray, point: np.ndarray, approach: np.ndarray, across: np.ndarray | None, steps: int = 100
    ) -> tuple[np.ndarray, float, float]:
        """Posture near q that brings the hand there, and its errors: m and rad (of the approach)."""
        weight = WEIGHT if len(q) >= FREE_JOINTS else WEIGHT_FEW
        for _ in range(steps):
            at, along, side = self.put(q)
            moves, turns = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
            mujoco.mj_jac(self.model, self.data, moves, turns, at, self._body)
            turn = np.cross(along, approach)
            if across is not None:
                turn = turn + np.cross(side, across if side @ across >= 0 else -across)
            error = np.concatenate([point - at, weight * turn])
            columns = np.concatenate([moves, weight * turns])
            jacobian = columns[:, self._dof]
            for dof, leader, rate in self._following.rates(self.data):
                jacobian[:, leader] += rate * columns[:, dof]
            if across is None:  # turning about the approach is free
                jacobian[3:] -= np.outer(along, along @ jacobian[3:])
            step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-4 * np.eye(6), error)
            q = np.clip(q + np.clip(step, -0.2, 0.2), self._low, self._high)
        at, along, _ = self.put(q)
        return q, float(np.linalg.norm(point - at)), float(np.arccos(np.clip(along @ approach, -1, 1)))

    def collides(self) -> bool:
        """The robot touches something in the posture that was put last."""
        mujoco.mj_collision(self.model, self.data)
        return collisions(self.scene, self.data)


def hand_of(robot: UrdfRobot) -> Hand:
    """The robot's first hand that can hold something. Raises EngineError: no arm carries one."""
    rays, layout, body = robot.hand_rays(), robot.layout, robot.body
    if not rays:
        raise EngineError(f"robot '{robot.name}' has no hand that can hold something")
    links = [*(one.hand for one in layout.grippers), *layout.suction]
    ray = rays[0]
    link = next(k for k in links if robot.body_name(body.frame(k)[0]) == ray.palm)
    joints = tuple(layout.arm[k] for k in body.chain_joints(layout, link))
    if not joints:
        raise EngineError(f"no joint of robot '{robot.name}' moves its hand")
    open_data = body.posed({name: body.start_of(name, layout) for name in layout.gripper})
    palm_link = body.frame(link)[0]
    pos, turn = body.pose(palm_link, open_data)

    def inner(names: tuple[str, ...], points: np.ndarray) -> np.ndarray:
        placed = []
        for name, point in zip(names, points, strict=True):
            other = name.removeprefix(f"{robot.name}_") if name != robot.name else body.base
            at, turned = body.pose(other, open_data)
            placed.append(turn.T @ (at + turned @ point - pos))
        return np.mean(placed, axis=0)

    one, two = inner(ray.start_bodies, ray.starts), inner(ray.end_bodies, ray.ends)
    suction = link in layout.suction
    point = ray.grasp_point if suction else (one + two) / 2
    across = two - one
    opening = float(np.linalg.norm(across))
    across = across / max(opening, 1e-9)
    jaw = None if suction else jaw_frame(body, next(one for one in layout.grippers if one.hand == link))
    if jaw is not None:
        across, point = jaw.across, jaw.point
    fingers = {*ray.start_bodies}, {*ray.end_bodies}
    if suction:
        opening = np.inf
    elif ray.palm not in ray.end_bodies:  # else a finger hangs on what it closes against
        ahead = point - across * (point @ across)
        ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
        places = [pos + turn @ (point + a * ahead + b * np.cross(ahead, across)) for a in NEAR for b in NEAR]
        found = [body.shapes.free_way(fingers, robot.name, place, turn @ across, open_data) for place in places]
        opening = min(
            (way for way in found if way is not None), default=body.shapes.gap(*fingers, robot.name, open_data)
        )
    if suction:
        approach = across
        across = np.cross(approach, np.eye(3)[int(np.argmin(np.abs(approach)))])
        across = across / np.linalg.norm(across)
    else:
        approach = point - across * (point @ across) if jaw is None else jaw.ahead
        approach = approach / max(float(np.linalg.norm(approach)), 1e-9)
    single = len(layout.grippers) == 1
    close = f"{link}_suction" if suction else "gripper" if single else f"{link}_gripper"
    beyond = 0.0
    if not suction:
        gripper = next(one for one in layout.grippers if one.hand == link)
        half = body.posed({name: sum(body.limits(name)) / 2 for name in layout.gripper})
        pos, turn = body.pose(palm_link, half)
        for tip in finger_tips(body, gripper):
            at, turned = body.pose(tip, half)
            beyond = max(
                beyond, float((((at + body.shapes.points(tip) @ turned.T - pos) @ turn - point) @ approach).max())
            )
    return Hand(ray.palm, point, approach, across, opening, joints, close, beyond)
