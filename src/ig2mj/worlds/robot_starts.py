"""`RobotStarts`: other poses of a robot's base at the start of episodes, from which a task can be done.

Poses are drawn around the usual one when an environment is made, and kept where the robot meets nothing that it does
not meet at its usual start. An episode has one of them from which the objects of its row are within reach: no farther
than they are from the usual start, or than the farthest of the pool is. Bases with joints move by their coordinates,
pinned ones by `body_pos` and `body_quat` of the world's model.

Axes: W worlds, P rows, K poses, B bodies, O objects that a task is about.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.engine.layout import make_layout
from ig2mj.engine.model_fields import ModelFields, merged
from ig2mj.engine.snapshot import AgentsPart
from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.geometry.poses import namespace
from ig2mj.scene.scene import Scene
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.randomization import pick
from ig2mj.worlds.randomize import RobotStart

COUNT = 48
"""Poses that are kept, the usual one among them."""

TRIES = 400
"""Poses that are drawn for them."""

SEED = 60_000_011
"""Of the poses: the same ones in every process."""

DEEPER = 0.001
"""m by which the robot may reach into something at its start, unless it does so at its usual start."""

SLACK = 0.03
"""m by which objects may be farther away than from the usual start."""

NEAR = 0.35
"""m to the middle of an object from which on the base must not be nearer than at its usual start."""

ASIDE = math.radians(25.0)
"""rad to either side by which objects may lie farther out than seen from the usual start."""


@dataclasses.dataclass(frozen=True)
class _Root:
    """A body of the robot that hangs on the world: address of its first coordinate in the agents' part, -1: it is
    pinned; `turn`: address of a ball joint's; `controls`: of three positions, -1: none."""

    body: int
    qpos: int
    turn: int
    controls: tuple[int, ...]


class RobotStarts:
    """See the module's text. `draw`, `fitted` and `moved` may be part of a compiled program.

    Attributes:
      offsets: [K, 3] x and y (m) and yaw (rad), in the frame of the usual start, which comes first.
    """

    def __init__(self, scene: Scene, names: Sequence[str], settings: RobotStart, start: AgentsPart):
        """
        Args:
          names: objects that the task is about. start: of one world, at the usual start.

        Raises:
          EngineError: there is no other pose at which the robot has room.
        """
        self._scene, self._model = scene, scene.model
        self._names = [name for name in dict.fromkeys(names) if name in scene.object_names]
        self._data, layout = scene.start_data(), make_layout(scene.model, scene.tables)
        self._sizes = layout.scene_sizes
        self._address = layout.object_qposadr
        own = int(scene.tables.agent_body[0])
        self._place = self._data.xpos[own].copy()
        ahead = self._data.xmat[own].reshape(3, 3)[:, 0]
        self._yaw = math.atan2(ahead[1], ahead[0])
        self._roots = _roots(scene, self._sizes)
        self._pinned = any(root.qpos < 0 for root in self._roots)
        rng = np.random.default_rng(SEED)
        angle, far = rng.uniform(0, 2 * math.pi, TRIES), settings.shift * np.sqrt(rng.uniform(0, 1, TRIES))
        turn = math.radians(settings.turn) * rng.uniform(-1, 1, TRIES)
        drawn = np.stack([far * np.cos(angle), far * np.sin(angle), turn], axis=1)
        usual, kept = self._meets(np.zeros(3)), [np.zeros(3)]
        for offset in drawn:
            if len(kept) == COUNT:
                break
            if self._inside(offset) and not (self._meets(offset) - usual):
                kept.append(offset)
        if len(kept) == 1:
            raise EngineError(
                f"randomize: robot_start: in '{scene.name}' the robot has no room but at its usual start "
                "(smaller shift and turn, or another home)"
            )
        self.offsets = np.array(kept, np.float32)
        self._start = start
        self._agents = self._coordinates(start, self.offsets)

    def draw(self, key: UInt[Array, "W 2"]) -> Int[Array, "W"]:
        """Number of the pose of worlds whose episodes have these keys."""
        return pick(key, "robot_start", len(self.offsets))

    def fitted(self, choice: Int[Array, "W"], row: Int[Array, "W"], reach: Bool[np.ndarray, "P K"]) -> Array:
        """The first pose from the drawn one on from which the row's objects are within reach. [W]"""
        turns = (choice[:, None] + jnp.arange(len(self.offsets))) % len(self.offsets)
        good = jnp.take_along_axis(jnp.asarray(reach)[row], turns, axis=1)
        found = jnp.take_along_axis(turns, jnp.argmax(good, axis=1)[:, None], axis=1)[:, 0]
        return jnp.where(good.any(1), found, 0)

    def moved(self, rows: Pool, choice: Int[Array, "W"]) -> Pool:
        """Rows of the bare scene with the robot at these poses."""
        return self._with(rows, [jnp.asarray(table)[choice] for table in self._agents])

    def moved_by(self, rows: Pool, offsets: Float[np.ndarray, "W 3"]) -> Pool:
        """`moved` with poses of their own. On the host."""
        return self._with(rows, self._coordinates(self._start, offsets))

    def _with(self, rows: Pool, tables: Sequence[Array]) -> Pool:
        physics = rows.physics
        qpos, ctrl, pos, quat = tables

        def spread(array: Array) -> Array:
            return namespace(qpos).broadcast_to(array, (qpos.shape[0], *np.shape(array)))

        agents = dataclasses.replace(jax.tree.map(spread, self._start), qpos=qpos, ctrl=ctrl)
        fields = physics.model_fields
        if self._pinned:
            fields = merged(fields, ModelFields(body_pos=pos, body_quat=quat))
        return dataclasses.replace(rows, physics=dataclasses.replace(physics, agents=agents, model_fields=fields))

    def reach(self, pool: Pool) -> Bool[np.ndarray, "P K"]:
        """Whether the objects of each row are within reach from each pose. On the host."""
        qpos = np.asarray(pool.physics.scene.qpos, float)
        far, aside = (np.array([of(offset) for offset in self.offsets]) for of in (self._far(qpos), self._aside(qpos)))
        most = np.maximum(far[0], np.quantile(far[0], 0.95, axis=0)) + SLACK  # [P, O]
        least = np.minimum(far[0], NEAR)
        widest = np.maximum(np.abs(aside[0]), np.quantile(np.abs(aside[0]), 0.95, axis=0)) + ASIDE
        good = (far <= most) & (far >= least) & (np.abs(aside) <= widest)
        good = good.all(-1).T
        good[:, 0] = True
        return good

    def _pose(self, offset: np.ndarray) -> tuple[np.ndarray, float]:
        """The base's position and heading."""
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        x, y, turn = map(float, offset)
        return self._place + np.array([c * x - s * y, s * x + c * y, 0.0]), self._yaw + turn

    def _positions(self, qpos: Float[np.ndarray, "P nq"]) -> Float[np.ndarray, "P O 2"]:
        """Of the objects: origins of loose ones, middles of what is fixed."""
        found = []
        for name in self._names:
            number = self._scene.object_index(name)
            address = int(self._address[number])
            if address >= 0:
                found.append(qpos[:, address : address + 2])
            else:
                own = self._scene.tables.geom_object == number
                middle = self._data.geom_xpos[own][:, :2]
                found.append(np.tile(0.5 * (middle.min(0) + middle.max(0)), (len(qpos), 1)))
        return np.stack(found, axis=1) if found else np.zeros((len(qpos), 0, 2))

    def _far(self, qpos: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """m from the base to the objects [P, O], by the base's offset."""
        there = self._positions(qpos)
        return lambda offset: np.linalg.norm(there - self._pose(offset)[0][:2], axis=-1)

    def _aside(self, qpos: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """rad by which they lie to the left of where the robot faces [P, O], by the base's offset."""
        there = self._positions(qpos)

        def of(offset: np.ndarray) -> np.ndarray:
            place, yaw = self._pose(offset)
            away = there - place[:2]
            return (np.arctan2(away[..., 1], away[..., 0]) - yaw + math.pi) % (2 * math.pi) - math.pi

        return of

    def _inside(self, offset: np.ndarray) -> bool:
        rooms = self._scene.rooms
        return rooms is None or bool(rooms.index_at(self._pose(offset)[0][None, :2])[0] >= 0)

    def _meets(self, offset: np.ndarray) -> set[tuple[int, int]]:
        """Pairs of the robot's and other things' owners that reach into each other with the base there."""
        model, data = copy.copy(self._model), mujoco.MjData(self._model)
        data.qpos[:] = self._data.qpos
        first = self._sizes["qpos"]
        for root, (pos, quat, ball) in zip(self._roots, self._placed(offset), strict=True):
            if root.qpos < 0:
                model.body_pos[root.body], model.body_quat[root.body] = pos, quat
                continue
            at = first + root.qpos
            data.qpos[at : at + 3] = pos
            turn = first + root.turn
            data.qpos[turn : turn + 4] = ball
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        agent = self._scene.tables.body_agent[model.geom_bodyid] >= 0
        pairs = data.contact.geom[data.contact.dist < -DEEPER] if data.ncon else np.zeros((0, 2), int)
        mixed = pairs[agent[pairs].sum(1) == 1]
        return {(int(model.geom_bodyid[a]), int(model.geom_bodyid[b])) for a, b in mixed}

    def _placed(self, offset: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Position and orientation of each root, and the coordinates of its ball or free joint's turn."""
        place, yaw = self._pose(offset)
        angle = yaw - self._yaw
        turn = np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])
        c, s = math.cos(angle), math.sin(angle)
        found = []
        for root in self._roots:
            pos, quat = self._data.xpos[root.body], self._data.xquat[root.body]
            x, y, _ = pos - self._place
            there = np.array([place[0] + c * x - s * y, place[1] + s * x + c * y, pos[2]])
            faces, ball = np.zeros(4), np.zeros(4)
            mujoco.mju_mulQuat(faces, turn, quat)
            if root.turn == root.qpos + 3 and root.controls == ():
                ball = faces  # of a free joint
            else:
                back = np.zeros(4)
                mujoco.mju_negQuat(back, self._model.body_quat[root.body])
                mujoco.mju_mulQuat(ball, back, faces)
            found.append((there, faces, ball))
        return found

    def _coordinates(self, start: AgentsPart, offsets: Float[np.ndarray, "n 3"]) -> tuple[np.ndarray, ...]:
        """qpos, ctrl of the agents' part, body_pos and body_quat with each offset, [n, ...]."""
        tables = []
        for offset in offsets:
            qpos, ctrl = np.array(start.qpos), np.array(start.ctrl)
            pos, quat = np.array(self._model.body_pos, np.float32), np.array(self._model.body_quat, np.float32)
            elsewhere = zip(self._roots, self._placed(offset), strict=True) if np.any(offset) else ()
            for root, (there, faces, ball) in elsewhere:  # the usual start keeps its last digits
                if root.qpos < 0:
                    pos[root.body], quat[root.body] = there, faces
                    continue
                qpos[root.qpos : root.qpos + 3], qpos[root.turn : root.turn + 4] = there, ball
                for k, control in enumerate(root.controls):
                    ctrl[control] = there[k]
            tables.append((qpos, ctrl, pos, quat))
        return tuple(np.stack(table) for table in zip(*tables, strict=True))


def is_pinned(scene: Scene) -> bool:
    """Part of the first robot has no joint to the world: engines must have `engine.model_fields.POSES` per world."""
    sizes = make_layout(scene.model, scene.tables).scene_sizes
    return any(root.qpos < 0 for root in _roots(scene, sizes))


def _roots(scene: Scene, sizes: Mapping[str, int]) -> list[_Root]:
    """Bodies of the first robot that hang on the world. Raises EngineError: one moves in another way."""
    model, tables = scene.model, scene.tables
    first, controls = sizes["qpos"], sizes["ctrl"]
    joint_type = mujoco.mjtJoint
    found = []
    for body in np.flatnonzero((tables.body_agent == 0) & (model.body_parentid == 0)):
        joints = int(model.body_jntadr[body]) + np.arange(int(model.body_jntnum[body]))
        kinds = [int(model.jnt_type[j]) for j in joints]
        address = [int(model.jnt_qposadr[j]) - first for j in joints]
        if kinds == [int(joint_type.mjJNT_FREE)]:
            found.append(_Root(int(body), address[0], address[0] + 3, ()))
        elif kinds == [int(joint_type.mjJNT_SLIDE)] * 3 + [int(joint_type.mjJNT_BALL)]:
            own = [
                next(
                    a
                    for a in range(model.nu)
                    if model.actuator_trnid[a, 0] == joint and model.actuator_biasprm[a, 1] != 0
                )
                for joint in joints[:3]
            ]
            found.append(_Root(int(body), address[0], address[3], tuple(a - controls for a in own)))
        else:  # it has none, or turns and slides with the pinned body
            found.append(_Root(int(body), -1, -1, ()))
    if not found:
        raise EngineError(f"randomize: robot_start: the robot of '{scene.name}' has no body that hangs on the world")
    return found
