"""`KinematicStage`: one world in which household and robot are put where they are required, without physics."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import Controller
from ig2mj.engine.snapshot import Snapshot, fitted
from ig2mj.engine.view import PhysicsView
from ig2mj.engine.writes import joints
from ig2mj.geometry.host_rotations import quat_conjugate, quat_multiply, quat_rotate
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

Pose = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4"]]
"""Position in m and orientation w-x-y-z."""


class KinematicStage:
    """One world of the scene with the robot, in which everything is put where it is required; see `Stage`."""

    agent, num_worlds = 0, 1

    def __init__(self, scene: Scene):
        """`scene`: with the robot."""
        self.scene = scene
        self.model = StateModel.of_manifest(scene.tables, scene.manifest)
        robot = scene.agents[0]
        self.controller: Controller = robot.controller(scene.tables, 0)  # pyright: ignore[reportAttributeAccessIssue]
        self._query = SceneQuery(scene)
        self._start = self._query.save()
        self._states: ExtendedStates | None = None

    by_friction = False

    @property
    def view(self) -> PhysicsView:
        return self._query.view

    @property
    def states(self) -> ExtendedStates:
        assert self._states is not None
        return self._states

    def snapshot(self, world: int) -> Snapshot:
        return self._query.save()

    def act(self, action: np.ndarray) -> None:
        raise AssertionError("nothing acts on the kinematic rung")

    def ended(self, world: int) -> str | None:
        """See `Stage.ended`."""
        return None

    def load(self, physics: Snapshot, states: ExtendedStates) -> None:
        """Puts the household into a state of the bare scene."""
        one = jax.tree.map(np.asarray, physics)
        self._query.load(fitted(one, self._start, 1, self.scene.name))
        self._states = states

    def put(
        self,
        base: Pose,
        hands: Sequence[Pose],
        held: Sequence[tuple[str, Pose]],
        joints_of_arm: tuple[Sequence[str], Float[np.ndarray, "J"]] | None = None,
    ) -> None:
        """Puts the robot and what it holds somewhere, world frame.

        Args:
          joints_of_arm: names and positions (rad or m) of the joints that carry the hand; None: hands float.
        """
        tables, model = self.scene.tables, self.scene.model
        addresses, values = list[int](), list[float]()
        bodies = [int(tables.agent_body[0]), *(int(b) for b in tables.hand_body[tables.hand_agent == 0])]
        poses = (base, *hands)
        if joints_of_arm is not None:
            bodies, poses = bodies[:1], poses[:1]
            addresses += [int(model.joint(name).qposadr[0]) for name in joints_of_arm[0]]
            values += joints_of_arm[1].tolist()
        for body, pose in zip(bodies, poses, strict=True):
            addresses += self._addresses(body)
            values += self._coordinates(body, pose)
        self._query.write(joints(self.scene.model.nq, np.array(addresses), np.array(values)))
        for name, (pos, quat) in held:
            self._query.place(self.scene.object_index(name), pos, quat)

    def _addresses(self, body: int) -> list[int]:
        """Of the coordinates of a body that is free, or slides along three axes and turns freely."""
        model = self.scene.model
        first = int(model.jnt_qposadr[model.body_jntadr[body]])
        assert self._is_free(body) or self._kinds(body) == [int(mujoco.mjtJoint.mjJNT_SLIDE)] * 3 + [
            int(mujoco.mjtJoint.mjJNT_BALL)
        ]
        return list(range(first, first + 7))

    def _kinds(self, body: int) -> list[int]:
        model = self.scene.model
        return model.jnt_type[model.body_jntadr[body] : model.body_jntadr[body] + model.body_jntnum[body]].tolist()

    def _is_free(self, body: int) -> bool:
        return self._kinds(body) == [int(mujoco.mjtJoint.mjJNT_FREE)]

    def _coordinates(self, body: int, pose: Pose) -> list[float]:
        model = self.scene.model
        pos, quat = pose
        if self._is_free(body):
            return [*pos.tolist(), *quat.tolist()]
        first = int(model.body_jntadr[body])
        rest = model.body_quat[body]
        axes = np.stack([quat_rotate(rest, model.jnt_axis[first + k]) for k in range(3)])
        slides = model.qpos0[model.jnt_qposadr[first : first + 3]] + axes @ (pos - model.body_pos[body])
        return [*slides.tolist(), *quat_multiply(quat_conjugate(rest), quat).tolist()]
