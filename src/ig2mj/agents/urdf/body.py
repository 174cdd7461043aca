"""`RobotBody`: the MJCF of a converted robot: figures taken from it, and how it is added to a scene."""

from __future__ import annotations

import pathlib
from typing import Any

import mujoco
import numpy as np

from ig2mj.agents.kinematics import Chain
from ig2mj.agents.parts import Vector
from ig2mj.agents.urdf.description import Description
from ig2mj.agents.urdf.layout import Layout
from ig2mj.errors import InputError
from ig2mj.scene.mjcf_files import read_mjcf

MODEL_FILE = "object.xml"

SCALAR = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


class RobotBody:
    """A converted robot compiled alone, at joint positions 0.

    Attributes:
      height: m of the base's frame above the floor that it stands on. base: the root link.
    """

    def __init__(self, folder: pathlib.Path, description: Description):
        """Raises InputError: its file is missing, is not MJCF, or is not the description's."""
        self.base = description.base
        self._file, self._description = folder / MODEL_FILE, description
        try:
            self._model = self._spec().compile()
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
        self.height = float(self._model.body(self._own(description.base)).pos[2])

    def _spec(self) -> mujoco.MjSpec:
        read_mjcf(self._file)
        spec = mujoco.MjSpec.from_file(str(self._file))
        meshes, textures = self._file.parent / spec.meshdir, self._file.parent / spec.texturedir
        for mesh in spec.meshes:
            if mesh.file:
                mesh.file = str((meshes / mesh.file).resolve())
        for texture in spec.textures:
            if texture.file:
                texture.file = str((textures / texture.file).resolve())
        return spec

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
        """kg m2 or kg that a joint moves, at joint positions 0."""
        dof = int(self._model.joint(f"{self._description.name}_{joint}").dofadr[0])
        one, moments = np.zeros(self._model.nv), np.zeros(self._model.nv)
        one[dof] = 1.0
        mujoco.mj_mulM(self._model, self._data, moments, one)
        return float(moments[dof] - self._model.dof_armature[dof])

    def start_of(self, joint: str, layout: Layout) -> float:
        """Position of a joint at the start, within its limits; a gripper is open."""
        low, high = self.limits(joint)
        if joint in layout.gripper and joint not in layout.start:
            return high if layout.closed == "lower" else low
        return float(np.clip(layout.start.get(joint, 0.0), low, high))

    def start(self, layout: Layout) -> list[float]:
        """Positions of all hinges and slides at the start, in the model's order."""
        prefix = f"{self._description.name}_"
        return [
            self.start_of(self._model.joint(j).name.removeprefix(prefix), layout)
            for j in range(self._model.njnt)
            if int(self._model.jnt_type[j]) in map(int, SCALAR)
        ]

    def drive(self, layout: Layout) -> tuple[float, float, float]:
        """Radius of the wheels and distance between them (m), and their largest speed (rad/s)."""
        hubs = [self.pose(self._description.joint(name).child)[0] for name in layout.wheels]
        radius = float(np.mean([hub[2] for hub in hubs])) + self.height
        speed = min(self._description.joint(name).speed for name in layout.wheels)
        return radius, float(np.linalg.norm(hubs[0] - hubs[1])), speed

    def wheel_signs(self, layout: Layout) -> np.ndarray:
        """1 for a wheel whose joint turns about the robot's y axis, -1 for one that turns the other way."""
        names = [f"{self._description.name}_{name}" for name in layout.wheels]
        left = self._data.body(self._own(self.base)).xmat.reshape(3, 3)[:, 1]
        return np.array([1.0 if self._data.joint(n).xaxis @ left >= 0 else -1.0 for n in names])

    def fingers(self, layout: Layout) -> list[str]:
        """Links that the gripper's joints move."""
        return [self._description.joint(name).child for name in layout.gripper]

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

    def pose(self, link: str) -> tuple[np.ndarray, np.ndarray]:
        """Position [3] and rotation matrix of a link that moves, in the base's frame."""
        base, body = self._description.base, self._data.body(self._own(link))
        turn = self._data.body(self._own(base)).xmat.reshape(3, 3).T
        return turn @ (body.xpos - self._data.body(self._own(base)).xpos), turn @ body.xmat.reshape(3, 3)

    def chain(self, layout: Layout) -> Chain | None:
        """The arm's joints from the base to the hand, frames parallel at joint positions 0; None without a hand."""
        if layout.hand is None:
            return None
        link, _, _ = self.frame(layout.hand)
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

    def chain_joints(self, layout: Layout) -> list[int]:
        """Which of the arm's joints are those of the chain, by their place in the layout."""
        link, _, _ = self.frame(layout.hand or "")
        above, found = {j.child: j for j in self._description.joints}, []
        while link in above:
            joint = above[link]
            if joint.name in layout.arm:
                found.insert(0, layout.arm.index(joint.name))
            link = joint.parent
        return found

    def add_to(
        self, spec: mujoco.MjSpec, name: str, pos: Vector, quat: Vector, fixed: bool
    ) -> dict[str, mujoco.MjsBody]:
        """Adds the robot to a scene: bodies by link. `fixed`: bolted to the world."""
        own = self._spec()
        for element in (*own.excludes, *own.keys):
            own.delete(element)
        base = own.body(self._own(self._description.base))
        base.pos, base.quat = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
        own.nkey = spec.nkey
        for mine, scenes in ((own.option, spec.option), (own.visual.map, spec.visual.map)):
            _agree(mine, scenes)
        frame = spec.worldbody.add_frame(pos=list(pos), quat=list(quat))
        added = frame.attach_body(base, f"{name}:", "")
        prefix = f"{name}:{self._description.name}"
        for element in (added, *added.find_all("body"), *added.find_all("joint"), *added.find_all("geom")):
            element.name = f"{name}{element.name.removeprefix(prefix)}"
        for joint in added.joints:
            if joint.type == mujoco.mjtJoint.mjJNT_FREE and fixed:
                spec.delete(joint)
        bodies = {f"{name}_{link}": link for link in self._links()} | {name: self._description.base}
        return {bodies[body.name]: body for body in (added, *added.find_all("body"))}


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
