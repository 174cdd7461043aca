"""Spheres around the links of an arm (`LinkSpheres`), and paths in its joint space (`ArmWay`).

Axes: J joints of the arm, N postures, S spheres.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.agents.urdf.following import FollowingJoints
from ig2mj.geometry.host_rotations import (
    quat_rotate,
)
from ig2mj.planning.arm_model import ArmModel
from ig2mj.planning.clearance import HELD, Obstacles
from ig2mj.planning.hand_search import connect
from ig2mj.scene.scene import Scene

LINK_SPACING, LINK_RADIUS = 0.06, 0.025
"""m: between the middles of spheres in a link that is not round, and their radius at least."""

SLACK = 0.015
"""m by which links may seem to enter what is there: spheres are larger than links."""


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
        first = arm.chain.sources[min(arm.chain.upright(), len(arm.chain.slides) - 1)][0]
        root = own[first]
        self._following = FollowingJoints(model, [j.name for j in joints])
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
            self._following.put(data)
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


def _below(model: mujoco.MjModel, body: int, root: int) -> bool:
    while body > 0:
        if body == root:
            return True
        body = int(model.body_parentid[body])
    return False
