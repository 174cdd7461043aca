"""`RobotBody`: the MJCF of a converted robot: figures taken from it, and how it is added to a scene."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Collection, Mapping
from typing import Any

import mujoco
import numpy as np

from ig2mj.agents.kinematics import Chain
from ig2mj.agents.parts import Vector, multiply, rotate
from ig2mj.agents.urdf.description import Description, RobotJoint
from ig2mj.agents.urdf.layout import Gripper, Layout
from ig2mj.agents.urdf.references import (
    BASE,
    OBJECT,
    couplings_of,
    keep_relations,
    name_base,
    named_spec,
    rebase_joint_equalities,
)
from ig2mj.errors import InputError
from ig2mj.scene.mjcf_files import read_mjcf

MODEL_FILE = "object.xml"

SCALAR = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)

GLIDE_SPEED, GLIDE_TURN, GLIDE_ACCELERATION = 1.0, 2.0, 4.0
"""m/s, rad/s and m/s2: most of an omnidirectional base."""

ROUND = (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE)

SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


class RobotBody:
    """A converted robot compiled alone, at joint positions 0.

    Attributes:
      height: m of the base's frame above the floor that it stands on, at joint positions 0. base: the root link.
      couplings: joints that follow others (`<mimic>`), by name.
    """

    def __init__(self, folder: pathlib.Path, description: Description):
        """Raises InputError: its file is missing, is not MJCF, or is not the description's."""
        self.base = description.base
        self._file, self._description = folder / MODEL_FILE, description
        read_mjcf(self._file)
        try:
            self._model = mujoco.MjModel.from_xml_path(str(self._file))
        except (ValueError, OSError) as e:
            raise InputError(self._file, f"MuJoCo cannot load it: {e}", fix="convert the robot again") from e
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:] = self._model.qpos0
        mujoco.mj_forward(self._model, self._data)
        for name, known in (
            *((j.name, self._joint_names()) for j in description.joints),
            *((link, self._links()) for link in {f.on for f in description.frames.values()}),
        ):
            if name not in known:
                raise InputError(self._file, f"has no '{name}' of robot.json", fix="convert the robot again")
        if any(joint.type == "floating" for joint in description.joints):
            raise InputError(self._file, "a floating joint cuts the robot in two", fix="fix it to the base")
        self._scalar = [j for j in range(self._model.njnt) if int(self._model.jnt_type[j]) in map(int, SCALAR)]
        prefix = f"{description.name}_"
        self.couplings = {
            coupling.follower.removeprefix(prefix): dataclasses.replace(
                coupling, leader=coupling.leader and coupling.leader.removeprefix(prefix)
            )
            for coupling in couplings_of(self._model)
        }
        self.height = float(self._model.body(self._own(description.base)).pos[2])

    def _own(self, link: str) -> str:
        """The body of a link in the file."""
        name = self._description.name
        return name if link == self._description.base else f"{name}_{link}"

    def _joint_names(self) -> set[str]:
        prefix = f"{self._description.name}_"
        return {self._model.joint(j).name.removeprefix(prefix) for j in range(self._model.njnt)}

    def _links(self) -> set[str]:
        names = {self._model.body(b).name for b in range(self._model.nbody)}
        return {link for link in self._description.frames if self._own(link) in names}

    def check(self, layout: Layout) -> None:
        """Raises InputError where a joint of the layout cannot be what it is to be."""
        for kind, names in (("arm", layout.arm), ("gripper", layout.gripper), ("wheels", layout.wheels)):
            for name in names:
                joint = self._model.joint(f"{self._description.name}_{name}")
                if int(joint.type[0]) not in map(int, SCALAR):
                    raise InputError(self._file, f"joint '{name}' neither turns nor slides", element=kind)
                if kind == "gripper" and not self._model.jnt_limited[joint.id]:
                    raise InputError(self._file, f"joint '{name}' has no two ends", element=kind)
        for name, value in layout.start.items():
            low, high = self.limits(name)
            if not low <= value <= high:
                raise InputError(self._file, f"joint '{name}' goes from {low:g} to {high:g}, not to {value:g}")

    def limits(self, joint: str) -> tuple[float, float]:
        """rad or m; infinite where it has none."""
        found = self._model.joint(f"{self._description.name}_{joint}")
        if not self._model.jnt_limited[found.id]:
            return -np.inf, np.inf
        return float(found.range[0]), float(found.range[1])

    def moved(self, joint: str) -> float:
        """kg m2 or kg that a joint moves, with the joints that follow it, at joint positions 0."""
        rates = {joint: 1.0}
        for name in self.couplings:
            rates[name] = self._rate(name, joint)
        one, moments = np.zeros(self._model.nv), np.zeros(self._model.nv)
        for name, rate in rates.items():
            one[int(self._model.joint(f"{self._description.name}_{name}").dofadr[0])] = rate
        mujoco.mj_mulM(self._model, self._data, moments, one)
        return float(one @ moments - one**2 @ self._model.dof_armature)

    def _rate(self, joint: str, leader: str) -> float:
        """How fast a joint goes per speed of one that it follows, over others; 0 where it does not."""
        rate = 1.0
        while joint != leader:
            coupling = self.couplings.get(joint)
            if coupling is None or coupling.leader is None:
                return 0.0
            joint, rate = coupling.leader, rate * float(coupling.coefficients[1])
        return rate

    def start_of(self, joint: str, layout: Layout) -> float:
        """Position of a joint at the start, within its limits; a gripper is open. A joint that follows another is where
        that one puts it."""
        coupling = self.couplings.get(joint)
        if coupling is not None:
            return coupling.position(0.0 if coupling.leader is None else self.start_of(coupling.leader, layout))
        low, high = self.limits(joint)
        if joint in layout.gripper and joint not in layout.start:
            opens_high = next((g.closes_low(joint) for g in layout.grippers if joint in g.joints), True)
            return high if opens_high else low
        return float(np.clip(layout.start.get(joint, 0.0), low, high))

    def _position(self, joint: str, positions: Mapping[str, float]) -> float:
        """Of a joint where those that lead are at these positions, others at 0."""
        coupling = self.couplings.get(joint)
        if coupling is None:
            return positions.get(joint, 0.0)
        return coupling.position(0.0 if coupling.leader is None else self._position(coupling.leader, positions))

    def start(self, layout: Layout) -> list[float]:
        """Positions of all hinges and slides at the start, in the model's order."""
        prefix = f"{self._description.name}_"
        return [self.start_of(self._model.joint(j).name.removeprefix(prefix), layout) for j in self._scalar]

    def hub(self, joint: str) -> np.ndarray:
        """Where a joint's axis is [3], in the base's frame, m."""
        found = self._data.joint(f"{self._description.name}_{joint}")
        return self._base_turn.T @ (found.xanchor - self._data.body(self._own(self.base)).xpos)

    def axis(self, joint: str) -> np.ndarray:
        """Unit vector [3] along a joint's axis, in the base's frame."""
        return self._base_turn.T @ self._data.joint(f"{self._description.name}_{joint}").xaxis

    @property
    def _base_turn(self) -> np.ndarray:
        return self._data.body(self._own(self.base)).xmat.reshape(3, 3)

    def lowest(self, link: str) -> float | None:
        """m: height in the base's frame of a link's lowest point; None where it has no shape."""
        points, (pos, turn) = self.points(link), self.pose(link)
        return None if not len(points) else float((pos[2] + points @ turn[2]).min())

    @functools.cached_property
    def lowest_point(self) -> float:
        """m: the same of the whole robot; 0 where nothing has a shape."""
        return min((z for z in map(self.lowest, self._links()) if z is not None), default=0.0)

    def standing(self, layout: Layout) -> float:
        """m of the base's frame above what it stands on: on the lowest point of its base and, where it drives, of its
        wheels, wherever its arms hang."""
        links = [self.base]
        if layout.drives:
            moved = {*layout.arm, *layout.gripper}
            links += [link for link in self._links() if not self.joints_to({link}) & moved]
        lows = [low for low in map(self.lowest, links) if low is not None]
        if layout.drives:
            return -min(lows, default=-self.height)
        return max(-min(lows, default=0.0), 0.0)

    def moved_by(self, joints: Collection[str]) -> list[str]:
        """Links that any of these joints moves."""
        wanted = set(joints)
        return [link for link in self._links() if self.joints_to({link}) & wanted]

    def joints_to(self, links: Collection[str]) -> set[str]:
        """Joints between the base and these links."""
        above, found = {j.child: j for j in self._description.joints}, set()
        for link in links:
            while link in above:
                found.add(above[link].name)
                link = above[link].parent
        return found

    def drive(self, layout: Layout) -> tuple[float, float, float]:
        """Radius of the wheels and distance between both sides (m), and their largest speed (rad/s)."""
        hubs = np.array([self.pose(self._description.joint(name).child)[0] for name in layout.wheels])
        left, right = hubs.reshape(2, -1, 3).mean(1)
        radius = float(np.mean(hubs[:, 2])) + self.standing(layout)
        speed = min(self._description.joint(name).speed for name in layout.wheels)
        return radius, float(np.linalg.norm(left - right)), speed

    def glide(self, layout: Layout) -> tuple[float, float, float]:
        """Largest speeds of an omnidirectional base (m/s and rad/s), and the force that drives it (N)."""
        speed, arm, push = GLIDE_SPEED, 0.0, 0.0
        if layout.wheels:
            joints = [self._description.joint(name) for name in layout.wheels]
            hubs = np.array([self.hub(joint.name) for joint in joints])
            radius = max(float(np.mean(hubs[:, 2])) + self.standing(layout), 0.01)
            arm = float(np.linalg.norm(hubs[:, :2] - hubs[:, :2].mean(0), axis=1).mean())
            speed = min(GLIDE_SPEED, radius * min(joint.speed for joint in joints))
            push = sum(joint.force for joint in joints) / radius
        return speed, min(GLIDE_TURN, speed / max(arm, 0.1)), min(push or np.inf, self.mass * GLIDE_ACCELERATION)

    @property
    def mass(self) -> float:
        """kg of the whole robot."""
        return float(self._model.body_subtreemass[self._model.body(self._own(self.base)).id])

    @property
    def centre(self) -> np.ndarray:
        """Centre of mass [3] in the base's frame, m."""
        base = self._model.body(self._own(self.base)).id
        return self._base_turn.T @ (self._data.subtree_com[base] - self._data.xpos[base])

    def yaw_inertia(self) -> float:
        """kg m2 of the whole robot about the vertical through its base."""
        total = 0.0
        for link in self._links():
            body = self._model.body(self._own(link)).id
            away = self._data.xipos[body] - self._data.body(self._own(self.base)).xpos
            turn = self._data.ximat[body].reshape(3, 3)
            own = turn @ np.diag(self._model.body_inertia[body]) @ turn.T
            total += float(own[2, 2] + self._model.body_mass[body] * (away[0] ** 2 + away[1] ** 2))
        return total

    def wheel_signs(self, layout: Layout) -> np.ndarray:
        """1 for a wheel whose joint turns about the robot's y axis, -1 for one that turns the other way."""
        names = [f"{self._description.name}_{name}" for name in layout.wheels]
        left = self._data.body(self._own(self.base)).xmat.reshape(3, 3)[:, 1]
        return np.array([1.0 if self._data.joint(n).xaxis @ left >= 0 else -1.0 for n in names])

    def fingers(self, gripper: Gripper) -> list[str]:
        """Links that a gripper's joints move, those of joints that follow them, and passive ones of a linkage on the
        same hand; in the order of the file's."""
        robot, hand = self._description, self.frame(gripper.hand)[0]
        above = {joint.child: joint for joint in robot.joints}

        def belongs(joint: RobotJoint) -> bool:
            if not joint.passive:
                return robot.leader(joint.name) in gripper.joints
            return joint.parent == hand or (joint.parent in above and belongs(above[joint.parent]))

        return [joint.child for joint in robot.joints if belongs(joint)]

    def branch(self, link: str, gripper: Gripper) -> str:
        """The first link of the finger that a finger's link belongs to."""
        above, inner = {j.child: j.parent for j in self._description.joints}, set(self.fingers(gripper))
        while above.get(link) in inner:
            link = above[link]
        return link

    def has_shape(self, link: str) -> bool:
        """It collides."""
        body = self._model.body(self._own(link)).id
        return bool(np.any((self._model.geom_bodyid == body) & (self._model.geom_contype > 0)))

    def frame(self, link: str) -> tuple[str, np.ndarray, np.ndarray]:
        """The link that moves a link, and where it is in that one's frame: m, w-x-y-z."""
        entry, quat = self._description.frames[link], np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.array(entry.axes).ravel())
        return entry.on, np.array(entry.pos), quat

    def box(self, link: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre and half size [3] of the collision geometry in the link's frame; m."""
        model, corners = self._model, []
        body = model.body(self._own(link)).id
        for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype > 0)):
            centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            matrix = turn.reshape(3, 3)
            middle, reach = model.geom_pos[geom] + matrix @ centre, np.abs(matrix) @ half
            corners += [middle - reach, middle + reach]
        if not corners:
            return np.zeros(3), np.full(3, 0.01)
        low, high = np.min(corners, 0), np.max(corners, 0)
        return (low + high) / 2, (high - low) / 2

    def pose(self, link: str, data: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """Position [3] and rotation matrix of a link that moves, in the base's frame. data: of `posed`."""
        data = self._data if data is None else data
        base, body = data.body(self._own(self._description.base)), data.body(self._own(link))
        turn = base.xmat.reshape(3, 3).T
        return turn @ (body.xpos - base.xpos), turn @ body.xmat.reshape(3, 3)

    def posed(self, positions: Mapping[str, float]) -> mujoco.MjData:
        """The robot with joints at these positions, those that follow them where they put them, others at 0."""
        data, prefix = mujoco.MjData(self._model), f"{self._description.name}_"
        data.qpos[:] = self._model.qpos0
        for name in self._scalar_names:
            data.qpos[self._model.joint(prefix + name).qposadr[0]] = self._position(name, positions)
        mujoco.mj_kinematics(self._model, data)
        return data

    @functools.cached_property
    def _scalar_names(self) -> list[str]:
        prefix = f"{self._description.name}_"
        return [self._model.joint(j).name.removeprefix(prefix) for j in self._scalar]

    def points(self, link: str) -> np.ndarray:
        """Corners [n, 3] of a link's collision geometry, in its frame, m: vertices of meshes, corners of the boxes
        round other shapes; of spheres the ends of their axes."""
        model, found = self._model, [np.zeros((0, 3))]
        body = model.body(self._own(link)).id
        for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype > 0)):
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            mesh = int(model.geom_dataid[geom])
            if mesh >= 0:
                first = model.mesh_vertadr[mesh]
                corners = np.array(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], float)
            elif mujoco.mjtGeom(int(model.geom_type[geom])) == mujoco.mjtGeom.mjGEOM_SPHERE:
                corners = np.concatenate([np.eye(3), -np.eye(3)]) * model.geom_size[geom, 0]
            elif mujoco.mjtGeom(int(model.geom_type[geom])) in ROUND:
                radius, half = model.geom_size[geom, :2]
                if mujoco.mjtGeom(int(model.geom_type[geom])) == mujoco.mjtGeom.mjGEOM_CAPSULE:
                    half += radius
                around = np.arange(16) * (np.pi / 8)
                ring = np.stack([np.cos(around) * radius, np.sin(around) * radius, np.full(16, half)], 1)
                corners = np.concatenate([ring, ring * (1, 1, -1)])
            else:
                corners = SIGNS * model.geom_aabb[geom, 3:] + model.geom_aabb[geom, :3]
            found.append(model.geom_pos[geom] + corners @ turn.reshape(3, 3).T)
        return np.concatenate(found)

    def gap(self, some: Collection[str], others: Collection[str], agent: str, data: Any) -> float:
        """m between the nearest points of two groups of links, by their bodies' names in a scene. data: of `posed`."""
        model, fromto = self._model, np.zeros(6)

        def geoms(names: Collection[str]) -> list[int]:
            links = {self.base if name == agent else name.removeprefix(f"{agent}_") for name in names}
            bodies = {model.body(self._own(link)).id for link in links}
            return [g for g in range(model.ngeom) if model.geom_bodyid[g] in bodies and model.geom_contype[g] > 0]

        pairs = [(one, two) for one in geoms(some) for two in geoms(others)]
        return min((mujoco.mj_geomDistance(model, data, *pair, 0.5, fromto) for pair in pairs), default=0.0)

    def chain(self, layout: Layout, hand: str) -> Chain | None:
        """The arm's joints from the base to a hand, frames parallel at joint positions 0; None where there are none."""
        link, _, _ = self.frame(hand)
        body, path = self._model.body(self._own(link)).id, []
        named = {f"{self._description.name}_{name}": name for name in layout.arm}
        while body > 0:
            for joint in range(
                self._model.body_jntadr[body], self._model.body_jntadr[body] + self._model.body_jntnum[body]
            ):
                if self._model.joint(joint).name in named:
                    path.insert(0, joint)
            body = int(self._model.body_parentid[body])
        if not path:
            return None
        base = self._data.body(self._own(self._description.base))
        turn = base.xmat.reshape(3, 3).T
        anchors = (self._data.xanchor[path] - base.xpos) @ turn.T
        names = [named[self._model.joint(j).name] for j in path]
        bounds = np.array([self.limits(name) for name in names])
        return Chain(
            origin=np.diff(anchors, axis=0, prepend=np.zeros((1, 3))),
            axis=self._data.xaxis[path] @ turn.T,
            slides=np.isin(self._model.jnt_type[path], [int(mujoco.mjtJoint.mjJNT_SLIDE)]),
            lower=bounds[:, 0],
            upper=bounds[:, 1],
            tip=self.pose(link)[0] - anchors[-1],
        )

    def chain_joints(self, layout: Layout, hand: str) -> list[int]:
        """Which of the arm's joints are those of a hand's chain, by their place in the layout."""
        link, _, _ = self.frame(hand)
        above, found = {j.child: j for j in self._description.joints}, []
        while link in above:
            joint = above[link]
            if joint.name in layout.arm:
                found.insert(0, layout.arm.index(joint.name))
            link = joint.parent
        return found

    def add_to(
        self, spec: mujoco.MjSpec, name: str, pos: Vector, quat: Vector, fixed: bool, layout: Layout
    ) -> dict[str, mujoco.MjsBody]:
        """Adds the robot to a scene, its joints at the layout's start: bodies by link. `fixed`: bolted to the world.

        What of its file ties joints and bodies to each other comes along. Its keyframes, its motors and what measures
        those do not: an agent has a start and servos of its own. Its excludes neither: no two bodies collide anyway.
        """
        own, prefix = named_spec(self._file, self._description.name, name), f"{self._description.name}_"
        own_start = {
            joint: self.start_of(joint.removeprefix(prefix), layout)
            for joint in (self._model.joint(j).name for j in self._scalar)
        }
        keep_relations(own, self._model, own_start)
        motors = (OBJECT.mjOBJ_ACTUATOR, OBJECT.mjOBJ_UNKNOWN)  # of unknown objects: clocks and user's data
        measuring = [s for s in own.sensors if s.objtype in motors or s.reftype == OBJECT.mjOBJ_ACTUATOR]
        for element in (*own.excludes, *own.keys, *measuring, *own.actuators):
            own.delete(element)
        base = own.body(BASE)
        base.pos, base.quat = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
        own.nkey = spec.nkey
        for mine, scenes in ((own.option, spec.option), (own.visual.map, spec.visual.map)):
            _agree(mine, scenes)
        frame = spec.worldbody.add_frame(pos=list(pos), quat=list(quat))
        added = frame.attach_body(base, name, "")
        name_base(spec, added, name)
        for joint in added.joints:
            if joint.type == mujoco.mjtJoint.mjJNT_FREE and fixed:
                spec.delete(joint)
        for joint, value in own_start.items():
            _bend(spec.joint(f"{name}_{joint.removeprefix(prefix)}"), value)
        rebase_joint_equalities(
            spec,
            {
                f"{name}_{follower}": dataclasses.replace(
                    coupling, leader=None if coupling.leader is None else f"{name}_{coupling.leader}"
                )
                for follower, coupling in self.couplings.items()
            },
        )
        bodies = {f"{name}_{link}": link for link in self._links()} | {name: self._description.base}
        return {bodies[body.name]: body for body in (added, *added.find_all("body")) if body.name in bodies}


def _bend(joint: mujoco.MjsJoint, q: float) -> None:
    """Poses the joint's body as at position `q`, which becomes the joint's reference.

    Without it a scene whose keyframes have no positions would start with the robot at joint positions 0.
    """
    body, turned, by = joint.parent, np.array([1.0, 0.0, 0.0, 0.0]), q - joint.ref
    if joint.type == mujoco.mjtJoint.mjJNT_SLIDE:
        body.pos = body.pos + rotate(body.quat, np.asarray(joint.axis) * by)
    else:
        mujoco.mju_axisAngle2Quat(turned, np.asarray(joint.axis), by)
        body.quat = multiply(body.quat, turned)
    joint.ref = q


def _agree(mine: Any, scenes: Any) -> None:
    """Takes over all settings: MuJoCo warns where a part has others than the whole."""
    for name in dir(scenes):
        value = getattr(scenes, name)
        if name.startswith("_") or callable(value):
            continue
        if isinstance(value, np.ndarray):
            getattr(mine, name)[:] = value
        else:
            setattr(mine, name, value)
