"""Hands on arms: how a robot with wheels, an arm and a gripper moves its hand (`ArmBody`), and where the arm goes.

A hand on an arm is moved as a floating one is: by positions and orientations of its grasp point. Each agent step asks
the arm's inverse kinematics for a small displacement. `ArmModel` knows what the joints do then, so that a way of the
hand can be followed without physics (`ArmModel.follow`): a way counts where the arm gets to its end, and where none of
its links meets anything. Inverse kinematics begin at several postures (`ArmModel.solve`).

Axes: W worlds, J joints of the arm, N postures, P points of a way, T agent steps.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.agents.base import ACTION_PERIOD, Controller
from ig2mj.agents.fetch.controller import AHEAD, EASE, GAIN, POSTURE, FetchController
from ig2mj.agents.fetch.figures import CHAIN, CHAIN_JOINTS, VELOCITY
from ig2mj.agents.fetch.robot import HAND as FETCH_HAND
from ig2mj.agents.kinematics import Chain, forward, inverse
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.agents.urdf.controller import UrdfController
from ig2mj.agents.urdf.robot import UrdfRobot
from ig2mj.engine.view import Array
from ig2mj.geometry.host_rotations import (
    length,
    matrix_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    quat_rotate_inverse,
    quat_to_rotation_vector,
)
from ig2mj.geometry.poses import quat_conjugate as conjugate
from ig2mj.geometry.poses import quat_multiply as multiply
from ig2mj.geometry.poses import quat_to_rotation_vector as rotation_vector
from ig2mj.geometry.poses import rotation_vector_to_quat as from_rotation_vector
from ig2mj.planning.bodies import Direction, Rows, Senses, WheeledBody, goals_of_hand, grip_of
from ig2mj.planning.clearance import HELD, Obstacles
from ig2mj.planning.hand_search import connect
from ig2mj.planning.phases import Base, Phase
from ig2mj.scene.scene import Scene

PULL = 0.5
"""Share of what is left that a hand is asked to move and turn by in an agent step."""

FASTEST, TURN_FASTEST = 0.04, 0.09
"""m and rad in an agent step that a hand on an arm is asked to move and turn by at most."""

SEEDS, ITERATIONS = 8, 24
"""Postures at which inverse kinematics begin, and their steps."""

OFF, TURNED_OFF = 0.015, 0.12
"""m and rad from a pose within which a posture counts for it."""

POINTS, STEPS = 8, 160
"""Points of a way, and agent steps, for which following it is compiled; longer ways are followed in parts."""

NEAR, TURNED_NEAR = 0.03, 0.2
"""m and rad from a point of a way at which the next one is gone for, and within which the end has to be reached."""

EVERY = 4
"""Agent steps between the postures of a way whose links are checked."""

LINK_SPACING, LINK_RADIUS = 0.06, 0.025
"""m: between the middles of spheres in a link that is not round, and their radius at least."""

SLACK = 0.015
"""m by which links may seem to enter what is there: spheres are larger than links."""

ASIDE = 0.6
"""m that a base would like to be from what its arm does; less than the arm's reach by half."""


class ArmModel:
    """The joints of one arm as its controller moves them, in the frame of the robot's base.

    Attributes:
      chain: to the hand. joints: numbers of its joints among those of all robots. rest: their positions at rest.
      offset, turn: from the chain's tip to the hand: grasp point (m) and orientation (w-x-y-z) in the tip's frame.
    """

    def __init__(
        self,
        chain: Chain,
        joints: Int[np.ndarray, "J"],
        rest: Float[np.ndarray, "J"],
        ease: Float[np.ndarray, "J"],
        speed: Float[np.ndarray, "J"],
        shares: tuple[float, float],
        posture: float,
    ):
        """speed: rad/s or m/s, largest. shares: of a displacement that inverse kinematics solve, and of that to their
        solution that an agent step makes. posture: pull to `rest`."""
        self.chain, self.joints, self.rest = chain, joints, np.asarray(rest, np.float32)
        self.offset, self.turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        self._ease, self._speed, self._shares, self._posture = ease, speed, shares, posture
        self.step: Callable[..., Any] = jax.jit(self._step)
        self._follow = jax.jit(self._follow_steps)
        self._solve = jax.jit(self._solve_seeds)

    def calibrate(
        self, data: Any, base: int, palm: int, grip: Float[np.ndarray, "3"], q: Float[np.ndarray, "J"]
    ) -> None:
        """Takes `offset` and `turn` from a compiled scene in which the joints are at q."""
        turn = data.xmat[base].reshape(3, 3)
        at = turn.T @ (data.xpos[palm] + data.xmat[palm].reshape(3, 3) @ grip - data.xpos[base])
        quat = matrix_to_quat(turn.T @ data.xmat[palm].reshape(3, 3))
        tip, tip_quat, _ = (np.asarray(v, float)[0] for v in forward(self.chain, jnp.asarray(q[None], jnp.float32)))
        self.offset = np.asarray(quat_rotate_inverse(tip_quat, at - tip), float)
        self.turn = np.asarray(quat_multiply(quat_conjugate(tip_quat), quat), float)

    def hand(self, q: Float[np.ndarray, "N J"]) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 4"]]:
        """Grasp point and orientation of the hand, in the base's frame."""
        pos, quat = self._hand(jnp.asarray(q, jnp.float32))
        return np.asarray(pos, float), np.asarray(quat, float)

    def _hand(self, q: Array) -> tuple[Array, Array]:
        tip, quat, _ = forward(self.chain, q)
        return self._of_tip(tip, quat)

    def _of_tip(self, tip: Array, quat: Array) -> tuple[Array, Array]:
        from ig2mj.geometry.poses import quat_rotate as rotate

        offset = jnp.broadcast_to(jnp.asarray(self.offset, jnp.float32), tip.shape)
        turn = jnp.broadcast_to(jnp.asarray(self.turn, jnp.float32), quat.shape)
        return tip + rotate(quat, offset), multiply(quat, turn)

    def _tip_of(self, pos: Array, quat: Array) -> tuple[Array, Array]:
        from ig2mj.geometry.poses import quat_rotate as rotate

        back = jnp.broadcast_to(jnp.asarray(quat_conjugate(self.turn), jnp.float32), quat.shape)
        tip_quat = multiply(quat, back)
        offset = jnp.broadcast_to(jnp.asarray(self.offset, jnp.float32), pos.shape)
        return pos - rotate(tip_quat, offset), tip_quat

    def _step(self, q: Array, move: Array, turn: Array) -> Array:
        """Joints after an agent step in which the hand is asked to move (m) and turn (rad), base's frame."""
        solved, made = self._shares
        pos, quat = self._hand(q)
        scale = solved / made
        goal = self._tip_of(pos + scale * move, multiply(from_rotation_vector(scale * turn), quat))
        found = inverse(self.chain, q, *goal, self.rest, posture=self._posture, ease=self._ease)
        change = made / solved * (found - q)
        change = change / jnp.maximum(1.0, jnp.max(jnp.abs(change) / (self._speed * ACTION_PERIOD), -1, keepdims=True))
        return jnp.clip(q + change, jnp.asarray(self.chain.lower, q.dtype), jnp.asarray(self.chain.upper, q.dtype))

    def _follow_steps(self, q: Array, points: Array, quats: Array) -> tuple[Array, Array]:
        """[T, J] joints and [T] number of the point that is gone for; points [P, 3], quats [P, 4]."""

        def step(carry: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
            q, k = carry
            at = jnp.minimum(k, POINTS - 1)
            pos, quat = self._hand(q)
            move, turn = points[at] - pos, rotation_vector(multiply(quats[at], conjugate(quat)))
            far, angle = jnp.linalg.norm(move), jnp.linalg.norm(turn)
            there = (far < NEAR) & ((angle < TURNED_NEAR) | (at < POINTS - 1))
            move = PULL * move * jnp.minimum(1.0, FASTEST / jnp.maximum(PULL * far, 1e-6))
            turn = PULL * turn * jnp.minimum(1.0, TURN_FASTEST / jnp.maximum(PULL * angle, 1e-6))
            new = self._step(q, move, turn)
            return (jnp.where(k < POINTS, new, q), jnp.where(there, k + 1, k)), (q, k)

        (_, _), found = jax.lax.scan(step, (q, jnp.int32(0)), None, length=STEPS)
        return found

    def follow(
        self, q: Float[np.ndarray, "J"], points: Float[np.ndarray, "P 3"], quats: Float[np.ndarray, "P 4"]
    ) -> Float[np.ndarray, "T J"] | None:
        """Joints while the hand goes along points, base's frame; None: it does not get to the last one."""
        parts = []
        for first in range(0, len(points), POINTS):
            some, turned = points[first : first + POINTS], quats[first : first + POINTS]
            lack = POINTS - len(some)
            some = np.concatenate([np.tile(some[:1], (lack, 1)), some]).astype(np.float32)
            turned = np.concatenate([np.tile(turned[:1], (lack, 1)), turned]).astype(np.float32)
            joints, number = (np.asarray(a) for a in self._follow(jnp.asarray(q, jnp.float32), some, turned))
            if number[-1] < POINTS:
                return None
            parts.append(joints[: int(np.argmax(number >= POINTS)) + 1].astype(float))
            q = parts[-1][-1]
        return np.concatenate(parts)

    @functools.cached_property
    def _seeds(self) -> Float[np.ndarray, "N J"]:
        rng = np.random.default_rng(0)
        low, high = (np.where(np.isfinite(v), v, s * np.pi) for v, s in ((self.chain.lower, -1), (self.chain.upper, 1)))
        found = low + (high - low) * (0.1 + 0.8 * rng.random((SEEDS, len(self.rest))))
        found[0] = self.rest
        return found.astype(np.float32)

    def _solve_seeds(self, seeds: Array, pos: Array, quat: Array) -> tuple[Array, Array, Array]:
        goal = self._tip_of(jnp.broadcast_to(pos, (SEEDS, 3)), jnp.broadcast_to(quat, (SEEDS, 4)))
        q = inverse(self.chain, seeds, *goal, self.rest, iterations=ITERATIONS, posture=0.0)
        at, turned = self._hand(q)
        return (
            q,
            jnp.linalg.norm(at - pos, axis=-1),
            jnp.linalg.norm(
                rotation_vector(multiply(jnp.broadcast_to(quat, turned.shape), conjugate(turned))), axis=-1
            ),
        )

    def solve(
        self, pos: Float[np.ndarray, "3"], quat: Float[np.ndarray, "4"], near: Float[np.ndarray, "J"] | None = None
    ) -> Float[np.ndarray, "n J"]:
        """Postures with the hand at a pose of the base's frame, the nearest to `near` (None: rest) first."""
        seeds = self._seeds if near is None else np.concatenate([[near], self._seeds[1:]]).astype(np.float32)
        q, off, turned = (
            np.asarray(a, float) for a in self._solve(seeds, pos.astype(np.float32), np.asarray(quat, np.float32))
        )
        found = q[(off < OFF) & (turned < TURNED_OFF)]
        return found[np.argsort(np.abs(found - (self.rest if near is None else near)).max(1))]


def model_of_arm(scene: Scene, controller: Controller, agent: int) -> ArmModel | None:
    """That of a robot's arm; None: it has none with a hand, or its controller moves it in no known way."""
    tables, name = scene.tables, scene.tables.agent_names[agent]
    hands = np.flatnonzero(tables.hand_agent == agent)
    if len(hands) != 1:
        return None
    if isinstance(controller, FetchController):
        names = [f"{name}_{n}" for n in _FETCH_NAMES]
        joints = np.array([tables.agent_joint_names.index(n) for n in names])
        rest = controller.rest[CHAIN_JOINTS]
        model = ArmModel(CHAIN, joints, rest, EASE, VELOCITY[CHAIN_JOINTS], (AHEAD, GAIN * ACTION_PERIOD), POSTURE)
    elif isinstance(controller, UrdfController) and controller.arms and controller.arms[0] is not None:
        arm = controller.arms[0]
        names = [f"{name}_{n}" for n in arm.names]
        joints = np.array([tables.agent_joint_names.index(n) for n in names])
        model = ArmModel(arm.chain, joints, arm.rest, np.ones(len(joints)), arm.speed, (1.0, 1.0), 0.0)
    else:
        return None
    robot = scene.agents[agent]
    assert isinstance(robot, TaskRobot)
    data = scene.start_data()
    q = np.array([data.qpos[scene.model.joint(n).qposadr[0]] for n in names])
    mujoco.mj_kinematics(scene.model, data)
    palm, base = int(tables.hand_body[hands[0]]), scene.model.body(name).id
    model.calibrate(data, base, palm, np.asarray(robot.hand_rays()[0].grasp_point, float), q)
    return model


_FETCH_NAMES = (
    *("torso_lift_joint", "shoulder_pan_joint", "shoulder_lift_joint", "upperarm_roll_joint", "elbow_flex_joint"),
    *("forearm_roll_joint", "wrist_flex_joint", "wrist_roll_joint"),
)


class ArmBody(WheeledBody):
    """A base on wheels with one arm and a gripper. The base stands still while the hand moves. See `HandedBody`.

    Attributes:
      opening: m between the open fingers.
    """

    resting = tucked = None
    rises = (0.0, 0.0)

    def __init__(self, scene: Scene, controller: Controller, agent: int, model: ArmModel):
        super().__init__(scene, controller, agent)
        robot = scene.agents[agent]
        self.stands = float(robot.stands) if isinstance(robot, TaskRobot) else 0.0
        self.model, self._controller = model, controller
        pos, quat = model.hand(model.rest[None])
        self.rest, self.carry, self._rest_quat = pos, pos.copy(), quat[0]
        first = int(np.argmin(model.chain.slides))
        low, high = (np.where(model.chain.slides, v, 0.0) for v in (model.chain.lower, model.chain.upper))
        lift = np.where(model.chain.slides, (low + high) / 2, model.rest)[: first + 1]
        start = Chain(*(v[: first + 1] for v in _columns(model.chain)), tip=np.zeros(3))
        self.shoulders = np.asarray(forward(start, jnp.asarray(lift[None], jnp.float32))[0], float)
        links = np.linalg.norm(model.chain.origin[first + 1 :], axis=1).sum() + np.linalg.norm(model.chain.tip)
        travel = (model.chain.upper - model.chain.lower)[model.chain.slides]
        self.reach = float(links + np.linalg.norm(model.offset) + travel.sum() / 2)
        self.away = ASIDE * float(links)
        self._links = LinkSpheres(scene, agent, model)
        self.arm, self.trunk = self._links.bodies, self._links.trunk
        self._grip, self.opening, self._spheres = _gripper(scene, agent, int(self.hands[0]), self.grips[0])

    def command(self, senses: Senses, rows: Rows) -> Float[np.ndarray, "W n"]:
        action = np.zeros((len(senses.base_pos), self.size), np.float32)
        moves = rows["base"] != Base.STAY
        drive = super().command(senses, rows)
        for name in ("forward", "turn_left"):
            place = self._places(name)
            action[:, place] = np.where(moves[:, None], drive[:, place], 0.0)
        mine, move, turn = self._hand_step(senses, rows)
        self._act(action, senses, mine, move, turn)
        held = senses.held[:, 0].any(1)
        closed = np.where((rows["close"] < 0) | ~mine, held, rows["close"] > 0)
        action[:, self._places(self._close)] = np.where(closed, -1.0, 1.0)[:, None]
        return action

    @property
    def _close(self) -> str:
        return next(n for n in self._names if n.endswith(("gripper", "_suction")))

    def _hand_step(self, senses: Senses, rows: Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Worlds in which the hand moves, and by how much it is to move (m) and turn (rad), in the base's frame."""
        mine = rows["hand"] == 0
        base, quat = senses.base_quat, senses.hand_quat[:, 0]
        pos, required = goals_of_hand(senses, rows)
        move = np.asarray(quat_rotate_inverse(base, pos - grip_of(senses, 0, self.grips[0])))
        turn = np.asarray(quat_to_rotation_vector(quat_multiply(required, quat_conjugate(quat))))
        turn = np.asarray(quat_rotate_inverse(base, turn))
        move = PULL * np.where((mine & (rows["moves"] > 0))[:, None], move, 0.0)
        turn = PULL * np.where((mine & (rows["turns"] > 0))[:, None], turn, 0.0)
        move *= np.minimum(1.0, np.minimum(rows["speed"], FASTEST) / np.maximum(np.asarray(length(move)), 1e-6))[
            :, None
        ]
        turn *= np.minimum(1.0, TURN_FASTEST / np.maximum(np.asarray(length(turn)), 1e-6))[:, None]
        return mine, move, turn

    def _act(self, action: np.ndarray, senses: Senses, mine: np.ndarray, move: np.ndarray, turn: np.ndarray) -> None:
        """Writes the numbers of the action that move the arm."""
        if isinstance(self._controller, FetchController):
            share = GAIN * ACTION_PERIOD
            scale = self._controller.stretch * share
            control = FETCH_HAND
            action[:, self._places(*control.move)] = np.clip(move / scale[:3], -1.0, 1.0)
            action[:, self._places(*control.turn)] = np.clip(turn / scale[3:], -1.0, 1.0)
            return
        assert isinstance(self._controller, UrdfController) and senses.joints is not None
        arm = self._controller.arms[0]
        assert arm is not None
        q = senses.joints[:, self.model.joints]
        new = np.asarray(self.model.step(jnp.asarray(q, jnp.float32), jnp.asarray(move), jnp.asarray(turn)))
        asked = np.where(mine[:, None], (new - q) / (arm.speed * ACTION_PERIOD), 0.0)
        action[:, self._places(*arm.names)] = np.clip(asked, -1.0, 1.0)

    def turned(self, hand: int, fingers: Direction, palm: Direction) -> tuple[float, float, float, float]:
        """Of a gripper: `palm` is where it points, `fingers` is from one finger to the other."""
        x, y = np.asarray(palm, float), np.asarray(fingers, float)
        w, x_, y_, z_ = np.asarray(matrix_to_quat(np.stack([x, y, np.cross(x, y)], axis=-1) @ self._grip.T), float)
        return (float(w), float(x_), float(y_), float(z_))

    def axes(self, hand: int, frame: Float[np.ndarray, "3 3"]) -> tuple[np.ndarray, np.ndarray]:
        own = frame @ self._grip
        return own[:, 1], own[:, 0]

    def hand_spheres(self, fingers: Direction, palm: Direction) -> Float[np.ndarray, "S 4"]:
        x, y = np.asarray(palm, float), np.asarray(fingers, float)
        turn = np.stack([x, y, np.cross(x, y)], axis=-1)
        return np.column_stack([self._spheres[:, :3] @ turn.T, self._spheres[:, 3]])

    def prepared(self, program: Sequence[Phase]) -> list[Phase]:
        """A hand that goes to rest is moved there, and one that keeps its orientation keeps that of the last phase."""
        from dataclasses import replace

        found, quat = [], None
        for phase in program:
            if phase.reset:
                w, x, y, z = self._rest_quat
                rest, turn = tuple(float(v) for v in self.rest[0]), (float(w), float(x), float(y), float(z))
                phase = Phase(hand=0, pos=rest, quat=turn, in_body=True, close=phase.close, tolerance=0.06,  # pyright: ignore
                              turn_tolerance=0.35, limit=REST_LIMIT, after="")  # fmt: skip
                quat = None
            elif phase.hand >= 0 and phase.pos is not None and not phase.in_body:
                quat = phase.quat or quat
                phase = replace(phase, quat=quat)
            if phase.base == Base.SHIFT:
                phase = replace(phase, tolerance=max(phase.tolerance, SHIFT_TOLERANCE))
            found.append(phase)
        return found

    def follower(
        self,
        joints: Float[np.ndarray, "J"],
        at_rest: bool,
        base: tuple[Float[np.ndarray, "3"], float],
        quat: Sequence[float] | np.ndarray,
        obstacles: Obstacles,
    ) -> ArmFollower:
        """Whether the arm follows ways of its hand. joints: of all robots, now. base: position and direction."""
        q = self.model.rest if at_rest else joints[self.model.joints]
        return ArmFollower(self.model, self._links, np.asarray(q, float), base, np.asarray(quat, float), obstacles)


REST_LIMIT = 60
"""Agent steps that an arm has for the way to where it rests."""

SHIFT_TOLERANCE = 0.05
"""m from its end at which a straight way of a base on wheels ends, which cannot go sideways."""


class ArmFollower:
    """Whether an arm follows a way of its hand from where the robot stands, with room for its links."""

    def __init__(
        self,
        model: ArmModel,
        links: LinkSpheres,
        q: Float[np.ndarray, "J"],
        base: tuple[Float[np.ndarray, "3"], float],
        quat: Float[np.ndarray, "4"],
        obstacles: Obstacles,
    ):
        self._model, self._links, self._q, self._obstacles = model, links, q, obstacles
        self._pos, yaw = base
        self._base = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
        self._quat = np.asarray(quat_multiply(quat_conjugate(self._base), quat), float)

    def _own(self, points: np.ndarray) -> np.ndarray:
        offset = np.asarray(points, float) - self._pos
        return np.asarray(quat_rotate_inverse(np.broadcast_to(self._base, (len(offset), 4)), offset), float)

    def reaches(self, point: Float[np.ndarray, "3"]) -> bool:
        """Whether there is a posture with the hand at a point of the world, clear of what is there."""
        found = self._model.solve(self._own(point[None])[0], self._quat, self._q)
        return any(self._clear(q[None]) for q in found[:4])

    def __call__(self, points: Sequence[np.ndarray]) -> bool:
        """Whether the hand gets along points of the world from where it is, and the links have room."""
        own = self._own(np.array(points))
        found = self._model.follow(self._q, own, np.tile(self._quat, (len(own), 1)))
        return found is not None and self._clear(np.concatenate([found[EVERY::EVERY], found[-1:]]))

    def _clear(self, joints: np.ndarray) -> bool:
        spheres = self._links.placed(joints)
        turn = np.broadcast_to(self._base, (len(spheres), 4))
        centres = np.asarray(quat_rotate(turn, spheres[:, :3]), float) + self._pos
        return self._obstacles.clear(np.column_stack([centres, spheres[:, 3]]))


JOINT_STRIDE, JOINT_STEP, JOINT_SAMPLES = 0.6, 0.06, 300
"""rad or m: by which a tree of postures grows at once, and between postures that are checked; postures sampled."""


class ArmWay:
    """Ways of an arm, with its hand, from one posture to others, where the base stands; see `connect`."""

    def __init__(
        self,
        model: ArmModel,
        links: LinkSpheres,
        base: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4"]],
        obstacles: Obstacles,
    ):
        """links: with the hand. base: position and orientation, world frame."""
        self._model, self._links, self._base, self._obstacles = model, links, base, obstacles

    def is_clear(self, joints: Float[np.ndarray, "N J"]) -> bool:
        """Whether nothing meets the arm in any of some postures."""
        spheres, (pos, quat) = self._links.placed(joints), self._base
        centres = np.asarray(quat_rotate(np.broadcast_to(quat, (len(spheres), 4)), spheres[:, :3]), float) + pos
        return self._obstacles.clear(np.column_stack([centres, spheres[:, 3]]))

    def _free(self, one: np.ndarray, other: np.ndarray) -> bool:
        count = int(np.ceil(float(np.abs(other - one).max()) / JOINT_STEP)) + 1
        return self.is_clear(one + np.linspace(0.0, 1.0, count)[:, None] * (other - one))

    def find(
        self, q: Float[np.ndarray, "J"], goals: Float[np.ndarray, "n J"], samples: int, seed: int
    ) -> tuple[Float[np.ndarray, "N J"] | None, str]:
        """Postures of a way to one of some, the first is q, and the method that found it: "straight" or "rrt_connect".
        None: none was found."""
        for goal in goals:
            if self._free(q, goal):
                return np.stack([q, goal]), "straight"
        chain = self._model.chain
        for goal in goals[:2]:
            low = np.where(np.isfinite(chain.lower), chain.lower, np.minimum(q, goal) - np.pi / 2)
            high = np.where(np.isfinite(chain.upper), chain.upper, np.maximum(q, goal) + np.pi / 2)
            way = connect(self._free, q, goal, low, high, JOINT_STRIDE, samples, seed)
            if way is not None:
                return np.stack(way), "rrt_connect"
        return None, ""


class LinkSpheres:
    """Spheres of an arm's links, without its hand, in the frame of the robot's base.

    Attributes:
      bodies: of the scene, that the arm moves, the hand among them. trunk: m, radius and height of the rest.
    """

    def __init__(self, scene: Scene, agent: int, arm: ArmModel, with_hand: bool = False):
        """with_hand: the hand counts, too."""
        model, tables, name = scene.model, scene.tables, scene.tables.agent_names[agent]
        self._data, self._model = scene.start_data(), model
        joints = [model.joint(tables.agent_joint_names[j]) for j in arm.joints]
        self._qpos = np.array([j.qposadr[0] for j in joints])
        own = [int(model.jnt_bodyid[j.id]) for j in joints]
        root = own[int(np.argmin(arm.chain.slides))]
        mine = np.flatnonzero(tables.body_agent == agent)
        self.bodies: Int[np.ndarray, "n"] = np.array([b for b in mine if _below(model, int(b), root)])
        self._base = model.body(name).id
        hand = tables.body_hand[self.bodies] >= 0
        links = set(self.bodies[~hand | with_hand].tolist()) - {root}
        collides = (model.geom_contype | model.geom_conaffinity) != 0
        geoms = [g for g in np.flatnonzero(collides) if int(model.geom_bodyid[g]) in links]
        self._geoms = [(int(g), geom_spheres(model, int(g), LINK_SPACING, LINK_RADIUS)) for g in geoms]
        mujoco.mj_kinematics(model, self._data)
        rest = [
            g for g in np.flatnonzero(collides) if int(model.geom_bodyid[g]) in set(mine) - set(self.bodies.tolist())
        ]
        turn = self._data.xmat[self._base].reshape(3, 3)
        radius = height = 0.0
        for g in rest:
            box, signs = model.geom_aabb[g], np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
            corners = (box[:3] + signs * box[3:]) @ self._data.geom_xmat[g].reshape(3, 3).T + self._data.geom_xpos[g]
            own_corners = (corners - self._data.xpos[self._base]) @ turn
            round_ = int(model.geom_type[g]) in _ROUND
            middle = own_corners.mean(0)
            wide = float(np.hypot(*middle[:2])) + float(model.geom_size[g, 0]) if round_ else None
            radius = max(radius, wide or float(np.hypot(*own_corners[:, :2].T).max()))
            height = max(height, float(own_corners[:, 2].max()))
        self.trunk = (radius, height)

    def placed(self, joints: Float[np.ndarray, "N J"]) -> Float[np.ndarray, "S 4"]:
        """Spheres of all postures together."""
        found, data = [], self._data
        for q in joints:
            data.qpos[self._qpos] = q
            mujoco.mj_kinematics(self._model, data)
            turn, pos = data.xmat[self._base].reshape(3, 3), data.xpos[self._base]
            for geom, spheres in self._geoms:
                centres = spheres[:, :3] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
                found.append(np.column_stack([(centres - pos) @ turn, np.maximum(spheres[:, 3] - SLACK, HELD + 1e-3)]))
        return np.concatenate(found) if found else np.zeros((0, 4))


_ROUND = (int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_CYLINDER))


def geom_spheres(model: mujoco.MjModel, geom: int, spacing: float, radius: float) -> Float[np.ndarray, "S 4"]:
    """Spheres that cover a geom, in its frame: along the axis of a round one, a lattice in the box of another.

    Args:
      spacing: m between middles in a box, at most. radius: m, at least.
    """
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind in _ROUND:
        wide = max(float(size[0]), radius)
        half = 0.0 if kind == int(mujoco.mjtGeom.mjGEOM_SPHERE) else float(size[1])
        along = np.linspace(-half, half, max(1, int(np.ceil(2 * half / wide)) + 1)) if half > 0 else np.zeros(1)
        return np.column_stack([np.zeros((len(along), 2)), along, np.full(len(along), wide)])
    middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    wide = max(min(float(half.min()), spacing), radius)
    ranges = []
    for h in half:
        inner = max(float(h) - wide, 0.0)
        ranges.append(np.linspace(-inner, inner, max(1, int(np.ceil(2 * inner / spacing)) + 1)) if inner else [0.0])
    grid = np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, 3) + middle
    return np.column_stack([grid, np.full(len(grid), wide)])


def _gripper(
    scene: Scene, agent: int, hand: int, grip: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3 3"], float, Float[np.ndarray, "S 4"]]:
    """Of a gripper as it stands open at the start: where it points, from finger to finger, and the third axis, as
    columns in the palm's frame; m between the fingers; spheres about the grasp point in that frame."""
    model, tables, data = scene.model, scene.tables, scene.start_data()
    mujoco.mj_kinematics(model, data)
    robot = scene.agents[agent]
    assert isinstance(robot, TaskRobot)
    ray = robot.hand_rays()[0]
    palm = int(tables.hand_body[hand])
    pos, turn = data.xpos[palm], data.xmat[palm].reshape(3, 3)

    def middle(names: Sequence[str], points: np.ndarray) -> np.ndarray:
        at = [data.body(n).xpos + data.body(n).xmat.reshape(3, 3) @ p for n, p in zip(names, points, strict=True)]
        return turn.T @ (np.mean(at, axis=0) - pos)

    one, two = middle(ray.start_bodies, ray.starts), middle(ray.end_bodies, ray.ends)
    across = two - one
    opening = float(np.linalg.norm(across))
    across = across / max(opening, 1e-9)
    ahead = (one + two) / 2
    ahead = ahead - across * (ahead @ across)
    if isinstance(robot, UrdfRobot) and np.linalg.norm(ahead) > 1e-3:
        ahead = ahead / np.linalg.norm(ahead)
    else:  # `HandControl.two_fingers`
        ahead = np.array([1.0, 0.0, 0.0]) - across * across[0]
        ahead = ahead / np.linalg.norm(ahead)
    frame = np.stack([ahead, across, np.cross(ahead, across)], axis=-1)
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    found = []
    for geom in np.flatnonzero(collides & (tables.body_hand[model.geom_bodyid] == hand)):
        own = geom_spheres(model, int(geom), 0.04, HELD + 1e-3)
        centres = own[:, :3] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        local = ((centres - pos) @ turn - grip) @ frame
        found.append(np.column_stack([local, own[:, 3]]))
    return frame, opening, np.concatenate(found)


def _below(model: mujoco.MjModel, body: int, root: int) -> bool:
    while body > 0:
        if body == root:
            return True
        body = int(model.body_parentid[body])
    return False


def _columns(chain: Chain) -> tuple[np.ndarray, ...]:
    return chain.origin, chain.axis, chain.slides, chain.lower, chain.upper
