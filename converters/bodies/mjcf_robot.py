"""`MjcfRobot`: the robot in a compiled MuJoCo model, as links that move: its parts, merged where they are fixed.

Axes of arrays are those of MuJoCo. Poses are 4x4.
"""

from __future__ import annotations

import dataclasses
import pathlib

import mujoco
import numpy as np

from ig2mj.errors import InputError

FREE, BALL, SLIDE, HINGE = (
    mujoco.mjtJoint.mjJNT_FREE,
    mujoco.mjtJoint.mjJNT_BALL,
    mujoco.mjtJoint.mjJNT_SLIDE,
    mujoco.mjtJoint.mjJNT_HINGE,
)

KINDS = {HINGE: "revolute", SLIDE: "prismatic"}

UPRIGHT = 0.99
"""Cosine to the vertical of a hinge that turns a base, and of what its slides are horizontal to."""

BASE = "base"
"""Name of a base that the file does not have: of an arm whose first joint is on the world."""


@dataclasses.dataclass
class MovingLink:
    """A link that a joint moves, or the base.

    Attributes:
      name: of the link. above: of the link that it hangs on; None: the base. pose: in that one's frame.
      joint: number of its joint; -1: the base. parts: numbers of bodies -> their pose in its frame.
    """

    name: str
    above: str | None
    pose: np.ndarray
    joint: int = -1
    parts: dict[int, np.ndarray] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Follower:
    """A joint that follows another: polynomial of the leader's distance from its reference (see MuJoCo's `joint`)."""

    joint: int
    leader: int
    coefficients: tuple[float, ...]


class MjcfRobot:
    """See the module's text.

    Attributes:
      model: compiled. links: by name, parents first. base: name of the first.
      omnidirectional: its file moves the base by slides and a hinge. floats: by a free joint.
      followers: joints that follow others. tendons_as_joints: equalities of tendons that are among those.
      warnings: what is left out, one line each.
    """

    def __init__(self, model: mujoco.MjModel, file: pathlib.Path):
        """Raises InputError: there is no robot in the model, or a part of it moves as no robot's here can."""
        self.model, self._file = model, file
        self.omnidirectional = self.floats = False
        self.links: dict[str, MovingLink] = {}
        self.warnings: list[str] = []
        self.tendons_as_joints: set[int] = set()
        self._mover: dict[int, str] = {}
        self._find()
        self.base = next(iter(self.links))
        self.actuated = self._actuated()
        self.followers = self._followers()

    # ---------------------------------------------------------------------------------------------- bodies

    def _find(self) -> None:
        model, tops = self.model, [b for b in range(1, self.model.nbody) if self.model.body_parentid[b] == 0]
        moved = {int(model.body_rootid[model.jnt_bodyid[j]]) for j in range(model.njnt) if self._is_scalar(j)}
        driven = {int(model.body_rootid[b]) for b in map(self._body_of_actuator, range(model.nu)) if b > 0}
        robots = [b for b in tops if (b in moved or b in driven) and model.body_mocapid[b] < 0]
        if not robots:
            robots = [b for b in tops if model.body_mocapid[b] < 0][:1]
        if not robots:
            raise InputError(self._file, "has no body that could be a robot", fix="name the file of a robot")
        for top in tops:
            if top not in robots and model.body_mocapid[top] < 0:
                self.warnings.append(f"body '{self._body_name(top)}' is no part of the robot: it is left out")
        first = robots[0]
        if len(robots) == 1 and (base := self._own_base(first)) is not None:
            self._add_base(first, base)
        else:
            self.links[BASE] = MovingLink(BASE, None, np.eye(4))
            for geom in range(model.ngeom):
                if model.geom_bodyid[geom] == 0 and not is_endless(model, geom):
                    self.links[BASE].parts[0] = np.eye(4)
            self._mover[0] = BASE
            for top in robots:
                self._add(top, BASE)

    def _own_base(self, top: int) -> int | None:
        """The body that is the base: the first one, or the last that joints of a planar base move; None: the world."""
        model, found, at = self.model, [], top
        while True:
            joints = self._joints(at)
            if any(self._kind(j) == FREE for j in joints):
                self.floats = True
                return at
            planar = [j for j in joints if self._planar(j)]
            if len(planar) < len(joints) or len(found) + len(planar) > 3:
                break
            found += planar
            kinds = sorted(int(self._kind(j)) for j in found)
            if kinds == sorted((int(SLIDE), int(SLIDE), int(HINGE))):
                self.omnidirectional = True
                return at
            below = [b for b in range(at + 1, model.nbody) if model.body_parentid[b] == at]
            if len(below) != 1:
                break
            at = below[0]
        return top if not self._joints(top) else None

    def _planar(self, joint: int) -> bool:
        """A slide along the floor, or a hinge about the vertical. All frames above are upright."""
        axis = self.model.jnt_axis[joint]
        vertical = abs(float(axis[2]))
        if self._kind(joint) == HINGE:
            return vertical > UPRIGHT and not self.model.jnt_limited[joint]
        return self._kind(joint) == SLIDE and vertical < 1 - UPRIGHT

    def _add_base(self, top: int, base: int) -> None:
        name = self._body_name(base)
        self.links[name] = MovingLink(name, None, np.eye(4))
        pose, at, above = np.eye(4), base, []
        while at != top:
            pose = pose @ np.linalg.inv(self._pose(at))
            at = int(self.model.body_parentid[at])
            above.append((at, pose))
        for body, where in [(base, np.eye(4)), *above]:
            self.links[name].parts[body] = where
            self._mover[body] = name
        inside = {base, *(b for b, _ in above)}
        for body in inside:
            for child in self._children(body):
                if child not in inside:
                    self._add(child, name)

    def _add(self, body: int, above: str) -> None:
        """A body and everything below it. `above`: the link that moves its parent."""
        parent = int(self.model.body_parentid[body])
        pose = self.links[above].parts.get(parent, np.eye(4)) @ self._pose(body)
        joints = self._joints(body)
        if not joints:
            self.links[above].parts[body] = pose
            self._mover[body] = above
        mover, offset = above, np.zeros(3)
        for number, joint in enumerate(joints):
            if self._kind(joint) not in KINDS:
                kind = "ball" if self._kind(joint) == BALL else "free"
                problem = f"joint '{self._joint_name(joint)}' is a {kind} joint between parts of the robot"
                raise InputError(self._file, problem, fix="use hinges and slides")
            last = number == len(joints) - 1
            name = self._body_name(body) if last else f"{self._body_name(body)}_{self._joint_name(joint)}"
            anchor = np.array(self.model.jnt_pos[joint])
            shifted = np.eye(4)
            shifted[:3, 3] = anchor - offset
            self.links[name] = MovingLink(name, mover, (pose if number == 0 else np.eye(4)) @ shifted, joint)
            mover, offset = name, anchor
            if last:
                own = np.eye(4)
                own[:3, 3] = -anchor
                self.links[name].parts[body] = own
                self._mover[body] = name
        for child in self._children(body):
            self._add(child, mover)

    def _children(self, body: int) -> list[int]:
        return [b for b in range(body + 1, self.model.nbody) if self.model.body_parentid[b] == body]

    def _pose(self, body: int) -> np.ndarray:
        return pose_of(self.model.body_pos[body], self.model.body_quat[body])

    def _joints(self, body: int) -> list[int]:
        first = int(self.model.body_jntadr[body])
        return list(range(first, first + int(self.model.body_jntnum[body])))

    def _kind(self, joint: int) -> mujoco.mjtJoint:
        return mujoco.mjtJoint(int(self.model.jnt_type[joint]))

    def _is_scalar(self, joint: int) -> bool:
        return self._kind(joint) in (HINGE, SLIDE)

    def _body_name(self, body: int) -> str:
        return self.model.body(body).name or f"link_{body}"

    def _joint_name(self, joint: int) -> str:
        return self.model.joint(joint).name or f"{self._body_name(int(self.model.jnt_bodyid[joint]))}_joint"

    def joint_name(self, joint: int) -> str:
        """Its name, or one made from its body's."""
        return self._joint_name(joint)

    def place(self, body: int) -> tuple[str, np.ndarray] | None:
        """The link that moves a body, and the body's pose in its frame; None: it is no part of the robot."""
        mover = self._mover.get(body)
        return None if mover is None else (mover, self.links[mover].parts.get(body, np.eye(4)))

    @property
    def joints(self) -> dict[int, str]:
        """Number of each joint -> the link that it moves."""
        return {link.joint: link.name for link in self.links.values() if link.joint >= 0}

    # ---------------------------------------------------------------------------------------------- motors

    def _body_of_actuator(self, actuator: int) -> int:
        joints = self._joints_of_actuator(actuator)
        return int(self.model.jnt_bodyid[next(iter(joints))]) if joints else 0

    def _joints_of_actuator(self, actuator: int) -> dict[int, float]:
        """Joints that an actuator acts on -> by which share: its gear, or the tendon's coefficients."""
        model = self.model
        kind, target = mujoco.mjtTrn(int(model.actuator_trntype[actuator])), int(model.actuator_trnid[actuator, 0])
        if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
            return {target: float(model.actuator_gear[actuator, 0]) or 1.0}
        if kind == mujoco.mjtTrn.mjTRN_TENDON:
            return self._joints_of_tendon(target) or {}
        return {}

    def _actuated(self) -> dict[int, float]:
        """Joints with a motor -> its largest force or torque; 0: not limited."""
        model, found = self.model, {}
        for actuator in range(model.nu):
            joints = self._joints_of_actuator(actuator)
            for joint, share in list(joints.items())[:1]:
                found[joint] = max(found.get(joint, 0.0), self._force(actuator) * abs(share))
        for joint in found:
            if model.jnt_actfrclimited[joint]:
                limit = float(np.abs(model.jnt_actfrcrange[joint]).max())
                found[joint] = min(found[joint] or np.inf, limit)
        return found

    def _force(self, actuator: int) -> float:
        model = self.model
        if model.actuator_forcelimited[actuator]:
            return float(np.abs(model.actuator_forcerange[actuator]).max())
        if model.actuator_ctrllimited[actuator] and not model.actuator_biasprm[actuator, 1:3].any():
            return float(np.abs(model.actuator_ctrlrange[actuator]).max() * abs(model.actuator_gainprm[actuator, 0]))
        return 0.0

    def _followers(self) -> list[Follower]:
        """By equalities, and by tendons that pull several joints with one motor."""
        model, known, found = self.model, self.joints, []
        for eq in np.flatnonzero(model.eq_active0 > 0):
            kind, coefficients = mujoco.mjtEq(int(model.eq_type[eq])), tuple(float(c) for c in model.eq_data[eq, :5])
            one, two = int(model.eq_obj1id[eq]), int(model.eq_obj2id[eq])
            if kind == mujoco.mjtEq.mjEQ_TENDON and (pair := self._as_joints(one, two, coefficients)) is not None:
                one, two, coefficients = pair
                self.tendons_as_joints.add(int(eq))
            elif kind != mujoco.mjtEq.mjEQ_JOINT:
                continue
            if one not in known or two not in known:
                continue
            straight = coefficients[1] != 0 and not any(coefficients[2:])
            if one in self.actuated and two not in self.actuated and straight:
                one, two = two, one
                coefficients = (-coefficients[0] / coefficients[1], 1 / coefficients[1], 0.0, 0.0, 0.0)
            found.append(Follower(one, two, coefficients))
        for actuator in range(model.nu):
            joints = self._joints_of_actuator(actuator)
            tied = {f.joint for f in found} | {f.leader for f in found}
            (leader, share), *others = list(joints.items()) or [(-1, 1.0)]
            for joint, coefficient in others:
                if joint not in tied and joint in known and leader in known:
                    found.append(Follower(joint, leader, (0.0, float(np.sign(coefficient * share)), 0.0, 0.0, 0.0)))
        seen: set[int] = set()
        return [f for f in found if not (f.joint in seen or seen.add(f.joint))]

    def _as_joints(
        self, one: int, two: int, coefficients: tuple[float, ...]
    ) -> tuple[int, int, tuple[float, ...]] | None:
        """An equality of tendons as one between two joints: of a tendon that is a sum of two, and of two tendons of one
        joint each; None of others."""
        first, second = self._joints_of_tendon(one), self._joints_of_tendon(two) if two >= 0 else {}
        if first is None or second is None:
            return None
        if len(first) == 2 and not second:
            (leader, by), (joint, share) = first.items()
            return joint, leader, (coefficients[0] / share, -by / share, 0.0, 0.0, 0.0)
        if len(first) == len(second) == 1:
            (joint, share), (leader, by) = *first.items(), *second.items()
            return joint, leader, tuple(c * by**k / share for k, c in enumerate(coefficients))
        return None

    def _joints_of_tendon(self, tendon: int) -> dict[int, float] | None:
        """Joints whose positions a tendon adds up -> their factors; None: it runs through the air."""
        model = self.model
        wraps = model.tendon_adr[tendon] + np.arange(model.tendon_num[tendon])
        if np.any(model.wrap_type[wraps] != int(mujoco.mjtWrap.mjWRAP_JOINT)):
            return None
        return {int(model.wrap_objid[w]): float(model.wrap_prm[w]) for w in wraps}

    # ---------------------------------------------------------------------------------------------- what is in links

    def inertia(self, link: MovingLink) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass (kg), centre [3] (m) and inertia [3, 3] about it (kg m2) in the link's frame."""
        model, mass, moment = self.model, 0.0, np.zeros(3)
        pieces = []
        for body, pose in link.parts.items():
            own = pose @ pose_of(model.body_ipos[body], model.body_iquat[body])
            kg = float(model.body_mass[body]) if body else 0.0
            mass, moment = mass + kg, moment + kg * own[:3, 3]
            pieces.append((kg, own, np.diag(model.body_inertia[body])))
        centre = moment / mass if mass else np.zeros(3)
        total = np.zeros((3, 3))
        for kg, own, inertia in pieces:
            away = own[:3, 3] - centre
            total += own[:3, :3] @ inertia @ own[:3, :3].T + kg * (away @ away * np.eye(3) - np.outer(away, away))
        return mass, centre, total

    def frames(self) -> dict[str, tuple[str, np.ndarray]]:
        """Bodies, sites and cameras -> the link that moves them, and their pose in its frame; cameras look along x."""
        found: dict[str, tuple[str, np.ndarray]] = {name: (name, np.eye(4)) for name in self.links}
        model = self.model
        for body in self._mover:
            place = self.place(body)
            if body and place is not None and self._body_name(body) not in found:
                found[self._body_name(body)] = place
        turned = np.eye(4)
        turned[:3, :3] = np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0]], float)  # camera's axes: x right, y up
        for kind, count, at, pos, quat, turn in (
            ("site", model.nsite, model.site_bodyid, model.site_pos, model.site_quat, np.eye(4)),
            ("camera", model.ncam, model.cam_bodyid, model.cam_pos, model.cam_quat, turned),
        ):
            for number in range(count):
                name = model.site(number).name if kind == "site" else model.camera(number).name
                place = self.place(int(at[number])) if at[number] else None
                if not name or place is None:
                    continue
                name = f"{name}_{kind}" if name in found or (kind == "camera" and "cam" not in name.lower()) else name
                found[name] = place[0], place[1] @ pose_of(pos[number], quat[number]) @ turn
        return found

    def start(self) -> dict[str, float]:
        """Positions of joints in the keyframe "home", else in the first; none where there is none."""
        model = self.model
        if not model.nkey:
            return {}
        names = [model.key(k).name for k in range(model.nkey)]
        key = names.index("home") if "home" in names else 0
        following = {f.joint for f in self.followers}
        return {
            self._joint_name(joint): float(model.key_qpos[key, model.jnt_qposadr[joint]])
            for joint in self.joints
            if joint not in following
        }


def is_endless(model: mujoco.MjModel, geom: int) -> bool:
    """A floor, a height field, or something so large that it is no part of a robot."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    return kind in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD) or model.geom_rbound[geom] > 2.0


def pose_of(pos: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """4x4 of a position and a quaternion (w, x, y, z)."""
    pose, turn = np.eye(4), np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.asarray(quat, float))
    pose[:3, :3], pose[:3, 3] = turn.reshape(3, 3), pos
    return pose
