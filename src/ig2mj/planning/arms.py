"""`ArmBody`: how a robot with wheels, one arm and a gripper moves its hand, and which paths its arm can follow.

A hand on an arm is moved as a floating one is: by positions and orientations of its grasp point. Each agent step asks
the arm's inverse kinematics for a small displacement. `ArmModel` knows what the joints do then, so that a way of the
hand can be followed without physics (`ArmModel.follow`): a way counts where the arm gets to its end, and where none of
its links meets anything. Inverse kinematics begin at several postures (`ArmModel.solve`).

Axes: W worlds, Q joints of all robots, J joints of the arm, N postures, P points of a way, T agent steps.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.agents.base import Controller
from ig2mj.agents.kinematics import forward
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.agents.urdf.grip import JawFrame, jaw_frame
from ig2mj.agents.urdf.robot import UrdfRobot
from ig2mj.geometry.host_rotations import (
    length,
    matrix_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    quat_rotate_inverse,
    quat_to_rotation_vector,
)
from ig2mj.planning.arm_kinds import ArmKind
from ig2mj.planning.arm_links import LinkSpheres, geom_spheres
from ig2mj.planning.arm_model import FASTEST, PULL, TURN_FASTEST, ArmModel
from ig2mj.planning.bodies import GAIN, Direction, Rows, WheeledBody, goals_of_hand
from ig2mj.planning.clearance import HELD, Obstacles
from ig2mj.planning.phases import Base, Phase
from ig2mj.planning.senses import Senses, grip_of
from ig2mj.scene.scene import Scene

UP, FORWARDS = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])

EVERY, HAND_EVERY = 4, 2
"""Agent steps between the postures of a way whose links are checked, and in which the hand is."""

PART, PART_TOLERANCE = 0.12, 0.05
"""m between points of a way of a hand that carries something, at most, and within which it is at one of them."""

STRAYS = 0.02
"""m by which a hand may come nearer to what is around where its arm brings it than on the straight way, and the arm
where the hand is at what it takes."""

POSTURES = 8
"""In which the links of an arm are looked at that has its hand at a pose, at most."""

YIELDS = 0.5
"""Share of its speed that is asked of a laden hand for each agent step but one in which it has not moved: servos add up
what is asked of a blocked hand, and lose what it holds when it is 10 cm behind."""

ROLLED, ROLLED_TURN, BACK = 0.005, 0.01, 0.1
"""m and rad from where a base stays up to which it has not rolled away, and share of its largest speeds at which it
comes back."""

DRAWN_BACK = 0.005
"""m in an agent step by which a hand that carries something is moved back to where it does, at most: as much as inverse
kinematics draw it away. Servos add up what is asked, so that with more what touches something on its way is lost at
once."""

ASIDE = 0.6
"""m that a base would like to be from what its arm does; less than the arm's reach by half."""


class ArmBody(WheeledBody):
    """A base on wheels with one arm and a gripper. The base stands still while the hand moves. See `HandedBody`.

    Attributes:
      opening: m between the open fingers.
    """

    resting = tucked = None
    rises = (0.0, 0.0)
    lifts = np.inf

    def __init__(self, scene: Scene, controller: Controller, agent: int, kind: ArmKind, model: ArmModel):
        super().__init__(scene, controller, agent)
        robot = scene.agents[agent]
        self.stands = float(robot.stands) if isinstance(robot, TaskRobot) else 0.0
        self.model, self._kind = model, kind
        self._grip, self.opening, self._spheres, self._corners = _gripper(
            scene, agent, int(self.hands[0]), self.grips[0]
        )
        self._at_rest = self._tucked()
        pos, quat = model.hand(self._at_rest[None])
        self.rest, self._rest_quat = pos, quat[0]
        self.climbs = kind.climbs
        self.carrying = kind.carrying or self.carrying
        self.carry = pos.copy() if kind.carry is None else np.array([kind.carry])
        chain, first = model.chain, model.chain.upright()
        low, high = (np.where(chain.sliding, v, 0.0) for v in (chain.lower, chain.upper))
        start = chain.part(first + 1)
        lift = np.where(chain.sliding, (low + high) / 2, model.rest)[: len(start.lower)]
        self.shoulders = np.asarray(forward(start, jnp.asarray(lift[None], jnp.float32))[0], float)
        links = np.linalg.norm(chain.origin[first + 1 :], axis=1).sum() + np.linalg.norm(chain.tip)
        self.reach = float(links + np.linalg.norm(model.offset) + chain.travel.sum() / 2)
        self.away = ASIDE * float(links)
        self._links = LinkSpheres(scene, agent, model)
        self.arm, self.trunk = self._links.bodies, self._links.trunk
        self._all_links = LinkSpheres(scene, agent, model, with_hand=True)

    def _tucked(self) -> Float[np.ndarray, "J"]:
        """The posture of the arm of an empty hand at rest."""
        if self._kind.tucked is None:
            return self.model.rest
        quat = np.array(self.turned(0, UP, FORWARDS))
        found = self.model.follow(self.model.rest, np.array([self._kind.tucked]), quat[None])
        return self.model.rest if found is None else found[-1]

    def arm_spheres(self, joints: Float[np.ndarray, "Q"], at_rest: bool) -> Float[np.ndarray, "S 4"]:
        """See `HandedBody.arm_spheres`."""
        return self._rest_spheres if at_rest else self._all_links.placed(self._posture(joints, False)[None])

    @functools.cached_property
    def _rest_spheres(self) -> Float[np.ndarray, "S 4"]:
        return self._all_links.placed(self._at_rest[None])

    def _posture(self, joints: Float[np.ndarray, "Q"], at_rest: bool) -> Float[np.ndarray, "J"]:
        """Of the arm. joints: of all robots, now."""
        return np.asarray(self._at_rest if at_rest else joints[self.model.joints], float)

    def command(self, senses: Senses, rows: Rows) -> Float[np.ndarray, "W n"]:
        action = np.zeros((len(senses.base_pos), self.size), np.float32)
        moves = rows["base"] != Base.STAY
        drive = super().command(senses, rows)
        for name in ("forward", "turn_left"):
            place = self._places(name)
            action[:, place] = np.where(moves[:, None], drive[:, place], 0.0)
        if "stays" in rows:
            acts, back = ~moves & (rows["hand"] >= 0), self._back_to(senses, rows["stays"])
            for name, command in zip(("forward", "turn_left"), back, strict=True):
                action[acts, self._places(name)] = command[acts]
        mine, move, turn = self._hand_step(senses, rows)
        if self._kind.drawn:
            move += self._carried_back(senses, moves & (rows["hand"] < 0))
        self._kind.write(action, self._places, mine, (move, turn), self.model, senses.joints)
        held = senses.held[:, 0].any(1)
        closed = np.where((rows["close"] < 0) | ~mine, held, rows["close"] > 0)
        action[:, self._places(self._close)] = np.where(closed, -1.0, 1.0)[:, None]
        return action

    def _back_to(
        self, senses: Senses, stays: Float[np.ndarray, "W 3"]
    ) -> tuple[Float[np.ndarray, "W"], Float[np.ndarray, "W"]]:
        """Commands of driving and turning that bring a base back, slowly, to where it stays: an arm that swings, or
        presses on something, turns its base, whose wheels only keep their speed."""
        offset, yaw = stays[:, :2] - senses.base_pos[:, :2], senses.yaw
        ahead = offset[:, 0] * np.cos(yaw) + offset[:, 1] * np.sin(yaw)
        left = (stays[:, 2] - yaw + np.pi) % (2 * np.pi) - np.pi
        return (
            np.where(np.abs(ahead) > ROLLED, np.clip(GAIN * ahead, -BACK, BACK), 0.0),
            np.where(np.abs(left) > ROLLED_TURN, np.clip(GAIN * left, -BACK, BACK), 0.0),
        )

    def _carried_back(self, senses: Senses, drives: Bool[np.ndarray, "W"]) -> Float[np.ndarray, "W 3"]:
        """m by which hands that carry something while the base drives are moved back to where they carry, sideways and
        up, base's frame: inverse kinematics draw an arm to its posture at rest, by millimetres in each agent step."""
        own = quat_rotate_inverse(senses.base_quat, grip_of(senses, 0, self.grips[0]) - senses.base_pos)
        left = np.clip(PULL * (self.carry[0] - np.asarray(own)), -DRAWN_BACK, DRAWN_BACK) * np.array([0.0, 1.0, 1.0])
        return np.where((drives & senses.held[:, 0].any(1))[:, None], left, 0.0)

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
        share = np.ones(len(mine))
        if "still" in rows:
            share = np.where(rows["keeps"] >= 0, YIELDS ** np.maximum(rows["still"] - 1, 0), 1.0)
        fastest = share * np.minimum(rows["speed"], FASTEST), share * TURN_FASTEST
        move, turn = (
            v * np.minimum(1.0, most / np.maximum(np.asarray(length(v)), 1e-6))[:, None]
            for v, most in zip((move, turn), fastest, strict=True)
        )
        return mine, move, turn

    def turned(self, hand: int, fingers: Direction, palm: Direction) -> tuple[float, float, float, float]:
        """Of a gripper: `palm` is where it points, `fingers` is from one finger to the other."""
        x, y = np.asarray(palm, float), np.asarray(fingers, float)
        w, x_, y_, z_ = np.asarray(matrix_to_quat(np.stack([x, y, np.cross(x, y)], axis=-1) @ self._grip.T), float)
        return (float(w), float(x_), float(y_), float(z_))

    def axes(self, hand: int, frame: Float[np.ndarray, "3 3"]) -> tuple[np.ndarray, np.ndarray]:
        own = frame @ self._grip
        return own[:, 1], own[:, 0]

    def hand_spheres(self, fingers: Direction, palm: Direction) -> Float[np.ndarray, "S 4"]:
        return np.column_stack([self._spheres[:, :3] @ _frame(fingers, palm).T, self._spheres[:, 3]])

    def hand_corners(self, fingers: Direction, palm: Direction) -> Float[np.ndarray, "n 3"]:
        return self._corners @ _frame(fingers, palm).T

    def prepared(self, program: Sequence[Phase]) -> list[Phase]:
        """A hand that goes to rest is moved there, one that keeps its orientation keeps that of the last phase, and one
        that keeps what it holds goes long ways in parts: inverse kinematics bring it off a straight line."""
        from dataclasses import replace

        found, quat, last = [], None, None
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
            goal = None if phase.hand < 0 or phase.pos is None or phase.in_body else np.array(phase.pos)
            if last is not None and goal is not None and phase.keeps >= 0:
                part = replace(phase, tolerance=max(phase.tolerance, PART_TOLERANCE), after="")
                found += [replace(part, pos=(float(x), float(y), float(z))) for x, y, z in in_parts(last, [goal])[:-1]]
            last = goal
            found.append(phase)
        return found

    def follower(
        self,
        joints: Float[np.ndarray, "Q"],
        at_rest: bool,
        base: tuple[Float[np.ndarray, "3"], float],
        quat: Sequence[float] | np.ndarray,
        obstacles: Obstacles,
    ) -> ArmFollower:
        """Whether the arm follows ways of its hand. joints: of all robots, now. base: position and direction."""
        q = self._posture(joints, at_rest)
        return ArmFollower(self.model, self._links, q, base, np.asarray(quat, float), obstacles)


REST_LIMIT = 80
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
        self._turns: dict[bytes, np.ndarray | None] = {}
        self._base = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
        self._quat = np.asarray(quat_multiply(quat_conjugate(self._base), quat), float)

    def _own(self, points: np.ndarray) -> np.ndarray:
        offset = np.asarray(points, float) - self._pos
        return np.asarray(quat_rotate_inverse(np.broadcast_to(self._base, (len(offset), 4)), offset), float)

    def reaches(self, point: Float[np.ndarray, "3"]) -> bool:
        """Whether there is a posture with the hand at a point of the world, clear of what is there."""
        found = self._model.solve(self._own(point[None])[0], self._quat, self._q)
        return any(self._clear(q[None]) for q in found[:POSTURES])

    def __call__(
        self,
        points: Sequence[np.ndarray],
        spheres: Float[np.ndarray, "S 4"],
        turned_at: Float[np.ndarray, "3"] | None = None,
    ) -> bool:
        """Whether the hand gets along points of the world from where it is, and links and hand have room. See
        `Follower`."""
        turned = None if turned_at is None else self._turned_at(np.asarray(turned_at, float))
        points = points if turned_at is None else in_parts(turned_at, points)
        found = self._followed(points, self._q if turned is None else turned[-1])
        if found is None or not self._clear(np.concatenate([found[EVERY::EVERY], found[-1:]])):
            return False
        return self._hand_is_clear(np.concatenate([found[HAND_EVERY::HAND_EVERY], found[-1:]]), spheres)

    def _turned_at(self, point: Float[np.ndarray, "3"]) -> Float[np.ndarray, "T J"] | None:
        """Joints while the hand turns at a point: many ways begin there."""
        key = point.tobytes()
        if key not in self._turns:
            self._turns[key] = self._followed([point], self._q)
        return self._turns[key]

    def passes(self, points: Sequence[np.ndarray]) -> bool:
        """See `Follower.passes`."""
        return self._followed(points, self._q) is not None

    def arrives(self, points: Sequence[np.ndarray]) -> bool:
        """See `Follower.arrives`."""
        found = self._followed(points, self._q)
        return found is not None and self._clear(found[-1:], STRAYS)

    def _followed(self, points: Sequence[np.ndarray], q: Float[np.ndarray, "J"]) -> Float[np.ndarray, "T J"] | None:
        own = self._own(np.array(points))
        return self._model.follow(q, own, np.tile(self._quat, (len(own), 1)))

    def _hand_is_clear(self, joints: Float[np.ndarray, "T J"], spheres: Float[np.ndarray, "S 4"]) -> bool:
        """Whether a hand, with spheres as if it were turned as it is to be, has room where joints bring it."""
        pos, quat = self._model.hand(joints)
        base = np.broadcast_to(self._base, quat.shape)
        middle = np.asarray(quat_rotate(base, pos), float) + self._pos
        off = quat_multiply(quat_multiply(base, quat), quat_conjugate(quat_multiply(self._base, self._quat)))
        centres = middle[:, None] + np.asarray(quat_rotate(off[:, None], spheres[None, :, :3]), float)
        radius = spheres[:, 3] - STRAYS
        radius = np.where(spheres[:, 3] < HELD, radius, np.maximum(radius, HELD))
        return self._obstacles.clear(np.column_stack([centres.reshape(-1, 3), np.tile(radius, len(joints))]))

    def _clear(self, joints: np.ndarray, less: float = 0.0) -> bool:
        """Whether links have room. less: m by which they may come nearer to what is around than they should."""
        spheres = self._links.placed(joints)
        turn = np.broadcast_to(self._base, (len(spheres), 4))
        centres = np.asarray(quat_rotate(turn, spheres[:, :3]), float) + self._pos
        return self._obstacles.clear(np.column_stack([centres, np.maximum(spheres[:, 3] - less, HELD)]))


def in_parts(start: Float[np.ndarray, "3"], points: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The same points with others between them, which are at most `PART` apart on straight lines."""
    found, before = list[np.ndarray](), np.asarray(start, float)
    for point in points:
        count = max(1, int(np.ceil(np.linalg.norm(point - before) / PART)))
        found += [before + k / count * (point - before) for k in range(1, count)] + [point]
        before = point
    return found


def _frame(fingers: Direction, palm: Direction) -> Float[np.ndarray, "3 3"]:
    """Of a gripper: where it points, from finger to finger, and the third axis, as columns."""
    x, y = np.asarray(palm, float), np.asarray(fingers, float)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _jaw(robot: TaskRobot) -> JawFrame | None:
    """`jaw_frame` of a robot's gripper."""
    if not isinstance(robot, UrdfRobot) or not robot.layout.grippers:
        return None
    return jaw_frame(robot.body, robot.layout.grippers[0])


def _gripper(
    scene: Scene, agent: int, hand: int, grip: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3 3"], float, Float[np.ndarray, "S 4"], Float[np.ndarray, "n 3"]]:
    """Of a gripper as it stands open at the start: where it points, from finger to finger, and the third axis, as
    columns in the palm's frame; m between the fingers; spheres about the grasp point in that frame, and corners of its
    geoms' boxes."""
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
    if (jaw := _jaw(robot)) is not None:
        across, ahead = jaw.across, jaw.ahead
    ahead = ahead - across * (ahead @ across)
    if isinstance(robot, UrdfRobot) and np.linalg.norm(ahead) > 1e-3:
        ahead = ahead / np.linalg.norm(ahead)
    else:  # `HandControl.two_fingers`
        ahead = np.array([1.0, 0.0, 0.0]) - across * across[0]
        ahead = ahead / np.linalg.norm(ahead)
    frame = np.stack([ahead, across, np.cross(ahead, across)], axis=-1)
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    found, corners = [], []
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    for geom in np.flatnonzero(collides & (tables.body_hand[model.geom_bodyid] == hand)):
        box, turned = model.geom_aabb[geom], data.geom_xmat[geom].reshape(3, 3)
        at = (box[:3] + signs * box[3:]) @ turned.T + data.geom_xpos[geom]
        corners.append(((at - pos) @ turn - grip) @ frame)
        own = geom_spheres(model, int(geom), 0.04, HELD + 1e-3)
        centres = own[:, :3] @ turned.T + data.geom_xpos[geom]
        local = ((centres - pos) @ turn - grip) @ frame
        found.append(np.column_stack([local, own[:, 3]]))
    return frame, opening, np.concatenate(found), np.concatenate(corners)
