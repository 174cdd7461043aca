"""`RobotBody`: the MJCF of a converted robot, compiled alone, and figures taken from it."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Collection, Mapping
from typing import Any

import mujoco
import numpy as np

from ig2mj.agents.kinematics import Chain
from ig2mj.agents.urdf.description import Description, RobotJoint
from ig2mj.agents.urdf.layout import Gripper, Layout
from ig2mj.agents.urdf.linkages import close_linkages
from ig2mj.agents.urdf.references import (
    couplings_of,
)
from ig2mj.errors import InputError
from ig2mj.scene.mjcf_files import read_mjcf

MODEL_FILE = "object.xml"

SCALAR = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)

GLIDE_SPEED, GLIDE_TURN, GLIDE_ACCELERATION = 1.0, 2.0, 4.0
"""m/s, rad/s and m/s2: most of an omnidirectional base."""

ROUND = (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE)

EDGE_POINTS = 11
"""Of each line between two corners of a shape, its ends among them."""

SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


class RobotBody:
    """A converted robot compiled alone, at joint positions 0.

    Attributes:
      file: its MJCF. description: what `robot.json` says of it. model: compiled; not to be changed.
      height: m of the base's frame above the floor that it stands on, at joint positions 0. base: the root link.
      couplings: joints that follow others (`<mimic>`), by name.
    """

    def __init__(self, folder: pathlib.Path, description: Description):
        """Raises InputError: its file is missing, is not MJCF, or is not the description's."""
        self.base = description.base
        self.file, self.description = folder / MODEL_FILE, description
        read_mjcf(self.file)
        try:
            self.model = mujoco.MjModel.from_xml_path(str(self.file))
        except (ValueError, OSError) as e:
            raise InputError(self.file, f"MuJoCo cannot load it: {e}", fix="convert the robot again") from e
        self._data = mujoco.MjData(self.model)
        self._data.qpos[:] = self.model.qpos0
        mujoco.mj_forward(self.model, self._data)
        for name, known in (
            *((j.name, self._joint_names()) for j in description.joints),
            *((link, self.links()) for link in {f.on for f in description.frames.values()}),
        ):
            if name not in known:
                raise InputError(self.file, f"has no '{name}' of robot.json", fix="convert the robot again")
        if any(joint.type == "floating" for joint in description.joints):
            raise InputError(self.file, "a floating joint cuts the robot in two", fix="fix it to the base")
        self._scalar = [j for j in range(self.model.njnt) if int(self.model.jnt_type[j]) in map(int, SCALAR)]
        prefix = f"{description.name}_"
        self.couplings = {
            coupling.follower.removeprefix(prefix): dataclasses.replace(
                coupling, leader=coupling.leader and coupling.leader.removeprefix(prefix)
            )
            for coupling in couplings_of(self.model)
        }
        self.height = float(self.model.body(self._own(description.base)).pos[2])

    def _own(self, link: str) -> str:
        """The body of a link in the file."""
        name = self.description.name
        return name if link == self.description.base else f"{name}_{link}"

    def _joint_names(self) -> set[str]:
        prefix = f"{self.description.name}_"
        return {self.model.joint(j).name.removeprefix(prefix) for j in range(self.model.njnt)}

    def links(self) -> set[str]:
        """Links that move, and the base."""
        names = {self.model.body(b).name for b in range(self.model.nbody)}
        return {link for link in self.description.frames if self._own(link) in names}

    def check(self, layout: Layout) -> None:
        """Raises InputError where a joint of the layout cannot be what it is to be."""
        for kind, names in (("arm", layout.arm), ("gripper", layout.gripper), ("wheels", layout.wheels)):
            for name in names:
                joint = self.model.joint(f"{self.description.name}_{name}")
                if int(joint.type[0]) not in map(int, SCALAR):
                    raise InputError(self.file, f"joint '{name}' neither turns nor slides", element=kind)
                if kind == "gripper" and not self.model.jnt_limited[joint.id]:
                    raise InputError(self.file, f"joint '{name}' has no two ends", element=kind)
        for name, value in layout.start.items():
            low, high = self.limits(name)
            if not low <= value <= high:
                raise InputError(self.file, f"joint '{name}' goes from {low:g} to {high:g}, not to {value:g}")

    def limits(self, joint: str) -> tuple[float, float]:
        """rad or m; infinite where it has none."""
        found = self.model.joint(f"{self.description.name}_{joint}")
        if not self.model.jnt_limited[found.id]:
            return -np.inf, np.inf
        return float(found.range[0]), float(found.range[1])

    def moved(self, joint: str) -> float:
        """kg m2 or kg that a joint moves, with the joints that follow it, at joint positions 0."""
        rates = {joint: 1.0}
        for name in self.couplings:
            rates[name] = self._rate(name, joint)
        one, moments = np.zeros(self.model.nv), np.zeros(self.model.nv)
        for name, rate in rates.items():
            one[int(self.model.joint(f"{self.description.name}_{name}").dofadr[0])] = rate
        mujoco.mj_mulM(self.model, self._data, moments, one)
        return float(one @ moments - one**2 @ self.model.dof_armature)

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
        positions = {name: self.start_of(name, layout) for name in self.scalar_names}
        data = self.posed(positions)
        prefix = f"{self.description.name}_"
        return [
            float(data.qpos[self.model.joint(prefix + name).qposadr[0]]) if name in self._passive else at
            for name, at in positions.items()
        ]

    @functools.cached_property
    def _passive(self) -> list[str]:
        """Joints that nothing moves but what they are tied to."""
        return [j.name for j in self.description.joints if j.passive and j.name not in self.couplings]

    def hub(self, joint: str) -> np.ndarray:
        """Where a joint's axis is [3], in the base's frame, m."""
        found = self._data.joint(f"{self.description.name}_{joint}")
        return self._base_turn.T @ (found.xanchor - self._data.body(self._own(self.base)).xpos)

    def axis(self, joint: str) -> np.ndarray:
        """Unit vector [3] along a joint's axis, in the base's frame."""
        return self._base_turn.T @ self._data.joint(f"{self.description.name}_{joint}").xaxis

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
        return min((z for z in map(self.lowest, self.links()) if z is not None), default=0.0)

    def standing(self, layout: Layout) -> float:
        """m of the base's frame above what it stands on: on the lowest point of its base and, where it drives, of its
        wheels, wherever its arms hang."""
        links = [self.base]
        if layout.drives:
            moved = {*layout.arm, *layout.gripper}
            links += [link for link in self.links() if not self.joints_to({link}) & moved]
        lows = [low for low in map(self.lowest, links) if low is not None]
        if layout.drives:
            return -min(lows, default=-self.height)
        return max(-min(lows, default=0.0), 0.0)

    def moved_by(self, joints: Collection[str]) -> list[str]:
        """Links that any of these joints moves."""
        requested = set(joints)
        return [link for link in self.links() if self.joints_to({link}) & requested]

    def joints_to(self, links: Collection[str]) -> set[str]:
        """Joints between the base and these links."""
        above, found = {j.child: j for j in self.description.joints}, set()
        for link in links:
            while link in above:
                found.add(above[link].name)
                link = above[link].parent
        return found

    def drive(self, layout: Layout) -> tuple[float, float, float]:
        """Radius of the wheels and distance between both sides (m), and their largest speed (rad/s)."""
        hubs = np.array([self.pose(self.description.joint(name).child)[0] for name in layout.wheels])
        left, right = hubs.reshape(2, -1, 3).mean(1)
        radius = float(np.mean(hubs[:, 2])) + self.standing(layout)
        speed = min(self.description.joint(name).speed for name in layout.wheels)
        return radius, float(np.linalg.norm(left - right)), speed

    def glide(self, layout: Layout) -> tuple[float, float, float]:
        """Largest speeds of an omnidirectional base (m/s and rad/s), and the force that drives it (N)."""
        speed, arm, push = GLIDE_SPEED, 0.0, 0.0
        if layout.wheels:
            joints = [self.description.joint(name) for name in layout.wheels]
            hubs = np.array([self.hub(joint.name) for joint in joints])
            radius = max(float(np.mean(hubs[:, 2])) + self.standing(layout), 0.01)
            arm = float(np.linalg.norm(hubs[:, :2] - hubs[:, :2].mean(0), axis=1).mean())
            speed = min(GLIDE_SPEED, radius * min(joint.speed for joint in joints))
            push = sum(joint.force for joint in joints) / radius
        return speed, min(GLIDE_TURN, speed / max(arm, 0.1)), min(push or np.inf, self.mass * GLIDE_ACCELERATION)

    @property
    def mass(self) -> float:
        """kg of the whole robot."""
        return float(self.model.body_subtreemass[self.model.body(self._own(self.base)).id])

    @property
    def centre(self) -> np.ndarray:
        """Centre of mass [3] in the base's frame, m."""
        base = self.model.body(self._own(self.base)).id
        return self._base_turn.T @ (self._data.subtree_com[base] - self._data.xpos[base])

    def yaw_inertia(self) -> float:
        """kg m2 of the whole robot about the vertical through its base."""
        total = 0.0
        for link in self.links():
            body = self.model.body(self._own(link)).id
            away = self._data.xipos[body] - self._data.body(self._own(self.base)).xpos
            turn = self._data.ximat[body].reshape(3, 3)
            own = turn @ np.diag(self.model.body_inertia[body]) @ turn.T
            total += float(own[2, 2] + self.model.body_mass[body] * (away[0] ** 2 + away[1] ** 2))
        return total

    def wheel_signs(self, layout: Layout) -> np.ndarray:
        """1 for a wheel whose joint turns about the robot's y axis, -1 for one that turns the other way."""
        names = [f"{self.description.name}_{name}" for name in layout.wheels]
        left = self._data.body(self._own(self.base)).xmat.reshape(3, 3)[:, 1]
        return np.array([1.0 if self._data.joint(n).xaxis @ left >= 0 else -1.0 for n in names])

    def fingers(self, gripper: Gripper) -> list[str]:
        """Links that a gripper's joints move, those of joints that follow them, and passive ones of a linkage on the
        same hand; in the order of the file's."""
        robot, hand = self.description, self.frame(gripper.hand)[0]
        above = {joint.child: joint for joint in robot.joints}

        def belongs(joint: RobotJoint) -> bool:
            if not joint.passive:
                return robot.leader(joint.name) in gripper.joints
            return joint.parent == hand or (joint.parent in above and belongs(above[joint.parent]))

        return [joint.child for joint in robot.joints if belongs(joint)]

    def branch(self, link: str, gripper: Gripper) -> str:
        """The first link of the finger that a finger's link belongs to."""
        above, inner = {j.child: j.parent for j in self.description.joints}, set(self.fingers(gripper))
        while above.get(link) in inner:
            link = above[link]
        return link

    def has_shape(self, link: str) -> bool:
        """It collides."""
        body = self.model.body(self._own(link)).id
        return bool(np.any((self.model.geom_bodyid == body) & (self.model.geom_contype > 0)))

    def frame(self, link: str) -> tuple[str, np.ndarray, np.ndarray]:
        """The link that moves a link, and where it is in that one's frame: m, w-x-y-z."""
        entry, quat = self.description.frames[link], np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.array(entry.axes).ravel())
        return entry.on, np.array(entry.pos), quat

    def box(self, link: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre and half size [3] of the collision geometry in the link's frame; m."""
        model, corners = self.model, []
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
        base, body = data.body(self._own(self.description.base)), data.body(self._own(link))
        turn = base.xmat.reshape(3, 3).T
        return turn @ (body.xpos - base.xpos), turn @ body.xmat.reshape(3, 3)

    def posed(self, positions: Mapping[str, float]) -> mujoco.MjData:
        """The robot with joints at these positions, those that follow them where they put them, others at 0, and
        linkages closed."""
        data, prefix = mujoco.MjData(self.model), f"{self.description.name}_"
        data.qpos[:] = self.model.qpos0
        for name in self.scalar_names:
            data.qpos[self.model.joint(prefix + name).qposadr[0]] = self._position(name, positions)
        mujoco.mj_kinematics(self.model, data)
        close_linkages(self.model, data, [prefix + name for name in self._passive])
        return data

    @functools.cached_property
    def scalar_names(self) -> list[str]:
        """Hinges and slides, in the model's order."""
        prefix = f"{self.description.name}_"
        return [self.model.joint(j).name.removeprefix(prefix) for j in self._scalar]

    def points(self, link: str) -> np.ndarray:
        """Corners [n, 3] of a link's collision geometry, in its frame, m: vertices of meshes, corners of the boxes
        round other shapes; of spheres the ends of their axes."""
        return np.concatenate([np.zeros((0, 3)), *self._corners(link)])

    def edge_points(self, link: str) -> np.ndarray:
        """Points [n, 3] on and in a link's collision geometry, in its frame, m: `EDGE_POINTS` on each line between two
        corners of a shape."""
        shares, found = np.linspace(0, 1, EDGE_POINTS)[:, None, None], [self.points(link)]
        for corners in self._corners(link):
            one, two = np.triu_indices(len(corners), 1)
            found.append((corners[one] + shares * (corners[two] - corners[one])).reshape(-1, 3))
        return np.concatenate(found)

    def _corners(self, link: str) -> list[np.ndarray]:
        """See `points`: of each shape."""
        model, found = self.model, []
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
        return found

    def _geoms(self, names: Collection[str], agent: str) -> list[int]:
        """Collision geoms of links, by their bodies' names in a scene."""
        links = {self.base if name == agent else name.removeprefix(f"{agent}_") for name in names}
        bodies = {self.model.body(self._own(link)).id for link in links}
        return [
            g for g in range(self.model.ngeom) if self.model.geom_bodyid[g] in bodies and self.model.geom_contype[g] > 0
        ]

    def gap(self, some: Collection[str], others: Collection[str], agent: str, data: Any) -> float:
        """m between the nearest points of two groups of links, by their bodies' names in a scene. data: of `posed`."""
        fromto = np.zeros(6)
        pairs = [(one, two) for one in self._geoms(some, agent) for two in self._geoms(others, agent)]
        return min((mujoco.mj_geomDistance(self.model, data, *pair, 0.5, fromto) for pair in pairs), default=0.0)

    def free_way(
        self, sides: tuple[Collection[str], Collection[str]], agent: str, point: np.ndarray, way: np.ndarray, data: Any
    ) -> float | None:
        """m of free line through a point between two groups of links, by their bodies' names in a scene; None: it meets
        none of one group, or the point lies inside of one.

        Args:
          point: in the base's frame. way: unit vector from the first group to the second. data: of `posed`.
        """
        base = data.body(self._own(self.base))
        turn = base.xmat.reshape(3, 3)
        start, along, total = base.xpos + turn @ point, turn @ way, 0.0
        for names, direction in zip(sides, (-along, along), strict=True):
            geoms = self._geoms(names, agent)
            ahead = {g: self._ray(g, start, direction, data) for g in geoms}
            if any(at >= 0 and self._ray(g, start, -direction, data) >= 0 for g, at in ahead.items()):
                return None
            if not (hits := [at for at in ahead.values() if at >= 0]):
                return None
            total += min(hits)
        return total

    def _ray(self, geom: int, start: np.ndarray, direction: np.ndarray, data: Any) -> float:
        """m to a geom; -1 where the ray does not meet it."""
        model, kind = self.model, mujoco.mjtGeom(int(self.model.geom_type[geom]))
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            return mujoco.mj_rayMesh(model, data, geom, start, direction)
        pos, turn = data.geom_xpos[geom], data.geom_xmat[geom]
        return mujoco.mju_rayGeom(pos, turn, model.geom_size[geom], start, direction, kind)

    def chain(self, layout: Layout, hand: str) -> Chain | None:
        """The arm's joints from the base to a hand, frames parallel at joint positions 0; None where there are none."""
        link, _, _ = self.frame(hand)
        body, path = self.model.body(self._own(link)).id, []
        named = {f"{self.description.name}_{name}": name for name in layout.arm}
        while body > 0:
            for joint in range(
                self.model.body_jntadr[body], self.model.body_jntadr[body] + self.model.body_jntnum[body]
            ):
                if self.model.joint(joint).name in named:
                    path.insert(0, joint)
            body = int(self.model.body_parentid[body])
        if not path:
            return None
        base = self._data.body(self._own(self.description.base))
        turn = base.xmat.reshape(3, 3).T
        anchors = (self._data.xanchor[path] - base.xpos) @ turn.T
        names = [named[self.model.joint(j).name] for j in path]
        bounds = np.array([self.limits(name) for name in names])
        return Chain(
            origin=np.diff(anchors, axis=0, prepend=np.zeros((1, 3))),
            axis=self._data.xaxis[path] @ turn.T,
            slides=np.isin(self.model.jnt_type[path], [int(mujoco.mjtJoint.mjJNT_SLIDE)]),
            lower=bounds[:, 0],
            upper=bounds[:, 1],
            tip=self.pose(link)[0] - anchors[-1],
        )

    def chain_joints(self, layout: Layout, hand: str) -> list[int]:
        """Which of the arm's joints are those of a hand's chain, by their place in the layout."""
        link, _, _ = self.frame(hand)
        above, found = {j.child: j for j in self.description.joints}, []
        while link in above:
            joint = above[link]
            if joint.name in layout.arm:
                found.insert(0, layout.arm.index(joint.name))
            link = joint.parent
        return found
