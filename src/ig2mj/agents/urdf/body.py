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
from ig2mj.agents.urdf.link_shapes import LinkShapes
from ig2mj.agents.urdf.linkages import close_linkages
from ig2mj.agents.urdf.references import couplings_of
from ig2mj.errors import InputError
from ig2mj.scene.mjcf_files import read_mjcf

MODEL_FILE = "object.xml"

SCALAR = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


class RobotBody:
    """A converted robot compiled alone, at joint positions 0.

    Attributes:
      file: its MJCF. description: what `robot.json` says of it. model: compiled; not to be changed.
      height: m of the base's frame above the floor that it stands on, at joint positions 0. base: the root link.
      couplings: joints that follow others (`<mimic>`), by name. shapes: collision geometry of its links.
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
        self.shapes = LinkShapes(self.model, self.base, self._own)
        self._data = mujoco.MjData(self.model)
        self._data.qpos[:] = self.model.qpos0
        mujoco.mj_forward(self.model, self._data)
        for name, known in (
            *((j.name, self._joint_names()) for j in description.joints),
            *((j.child, self.links()) for j in description.joints),
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

    def lever(self, joint: str) -> float:
        """m from a joint's axis to the farthest point of what it moves, at joint positions 0."""
        hub, axis, found = self.hub(joint), self.axis(joint), 0.01
        for link in self.moved_by([joint]):
            pos, turn = self.pose(link)
            if len(points := self.shapes.points(link)):
                away = pos + points @ turn.T - hub
                away = away - (away @ axis)[:, None] * axis
                found = max(found, float(np.linalg.norm(away, axis=1).max()))
        return found

    def axis(self, joint: str) -> np.ndarray:
        """Unit vector [3] along a joint's axis, in the base's frame."""
        return self._base_turn.T @ self._data.joint(f"{self.description.name}_{joint}").xaxis

    @property
    def _base_turn(self) -> np.ndarray:
        return self._data.body(self._own(self.base)).xmat.reshape(3, 3)

    def lowest(self, link: str) -> float | None:
        """m: height in the base's frame of a link's lowest point; None where it has no shape."""
        points, (pos, turn) = self.shapes.points(link), self.pose(link)
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

    def frame(self, link: str) -> tuple[str, np.ndarray, np.ndarray]:
        """The link that moves a link, and where it is in that one's frame: m, w-x-y-z."""
        entry, quat = self.description.frames[link], np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.array(entry.axes).ravel())
        return entry.on, np.array(entry.pos), quat

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

    def chain(self, layout: Layout, hand: str) -> Chain | None:
        """The arm's joints from the base to a hand, and those between them that follow one of the arm's; frames
        parallel at joint positions 0. None where there are none."""
        link, _, _ = self.frame(hand)
        moved = [layout.arm[k] for k in self.chain_joints(layout, hand)]
        body, path = self.model.body(self._own(link)).id, []
        sources = {f"{self.description.name}_{name}": (k, 1.0, 0.0) for k, name in enumerate(moved)}
        for name in self.couplings:
            leader = self._leader(name)
            if leader in moved:
                at = self._position(name, {}), self._position(name, {leader: 1.0})
                sources[f"{self.description.name}_{name}"] = (moved.index(leader), at[1] - at[0], at[0])
        while body > 0:
            for joint in range(
                self.model.body_jntadr[body], self.model.body_jntadr[body] + self.model.body_jntnum[body]
            ):
                if self.model.joint(joint).name in sources:
                    path.insert(0, joint)
            body = int(self.model.body_parentid[body])
        if not path:
            return None
        base = self._data.body(self._own(self.description.base))
        turn = base.xmat.reshape(3, 3).T
        anchors = (self._data.xanchor[path] - base.xpos) @ turn.T
        follows = tuple(sources[self.model.joint(j).name] for j in path)
        bounds = np.array([self.limits(name) for name in moved])
        each = tuple((k, 1.0, 0.0) for k in range(len(path)))
        return Chain(
            origin=np.diff(anchors, axis=0, prepend=np.zeros((1, 3))),
            axis=self._data.xaxis[path] @ turn.T,
            slides=np.isin(self.model.jnt_type[path], [int(mujoco.mjtJoint.mjJNT_SLIDE)]),
            lower=bounds[:, 0],
            upper=bounds[:, 1],
            tip=self.pose(link)[0] - anchors[-1],
            follows=None if follows == each else follows,
        )

    def _leader(self, joint: str) -> str:
        """The joint that a joint follows, over others; itself where it follows none."""
        while (coupling := self.couplings.get(joint)) is not None and coupling.leader is not None:
            joint = coupling.leader
        return joint

    def chain_joints(self, layout: Layout, hand: str) -> list[int]:
        """Which of the arm's joints move a hand, themselves or by others that follow them, by their place in the
        layout; those nearer to the base first."""
        link, _, _ = self.frame(hand)
        above, found = {j.child: j for j in self.description.joints}, []
        while link in above:
            joint = above[link]
            leader = self._leader(joint.name)
            if leader in layout.arm:
                at = layout.arm.index(leader)
                found = [at, *(k for k in found if k != at)]
            link = joint.parent
        return found
