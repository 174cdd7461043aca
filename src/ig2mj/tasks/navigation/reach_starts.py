"""Start states of reaching for a robot that is bolted to the floor: it stands where most floor is free, and its goals
are points that its first hand reaches without touching anything.

iGibson's Reaching sends a robot that drives to points up to ten metres away; an arm on a fixed base reaches as far as
it is long.

Axes: P rows.
"""

from __future__ import annotations

import jax
import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.snapshot import fitted
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.navigation.floor import FloorMap
from ig2mj.tasks.navigation.starts import NavigationStarts, still_household
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.pools import COUNT, SEEDS
from ig2mj.tasks.task import GROUND
from ig2mj.worlds.pool import Pool

POSTURES = 2000
"""Postures tried for each goal."""

LOWEST = 0.05
"""m: least height of a goal above the floor."""


def standing_spot(bare: Scene) -> tuple[float, float]:
    """World x and y, m, of the place with most free floor round it. Raises EngineError: the home has no map."""
    from scipy.ndimage import distance_transform_edt

    floor = _floor(bare)
    room = np.asarray(distance_transform_edt(np.pad(floor.free, 1)))[1:-1, 1:-1]
    x, y = floor.centres(np.argwhere(room == room.max())[:1])[0]
    return float(x), float(y)


def make_reach_starts(
    task: NavigationTask, bare: Scene, scene: Scene, states: ExtendedStates, split: str, count: int | None = None
) -> NavigationStarts:
    """Start states of a reaching task for a fixed arm, the same for the same split. Arguments as of `make_starts`.

    Raises:
      UnknownNameError: no such split. EngineError: the robot's hand reaches no free point.
    """
    if split not in SEEDS:
        raise UnknownNameError("split", split, SEEDS)
    rng, count = np.random.default_rng(SEEDS[split]), count or COUNT[split]
    engine = NativeEngine(scene, 1)
    base = fitted(still_household(bare), engine._start, 1, scene.name)
    arm = _ReachingArm(scene, np.asarray(base.whole("qpos")))
    first = arm.hand()
    goals = np.array([arm.free_point(rng, task) for _ in range(count)])
    physics = jax.tree.map(lambda a: np.broadcast_to(a, (count, *np.shape(a))), base)
    one = jax.tree.map(np.asarray, states)
    worn = jax.tree.map(lambda a: np.broadcast_to(a[0], (count, *a.shape[1:])), one)
    floor = _floor(bare)
    fields = np.zeros((count, *floor.free.shape), np.float32)
    shortest = np.linalg.norm(goals - first, axis=1).astype(np.float32)
    return NavigationStarts(Pool(physics, worn), floor, goals.astype(np.float32), fields, shortest)


def _floor(bare: Scene) -> FloorMap:
    rooms = bare.rooms
    if rooms is None or rooms.traversable is None:
        raise EngineError(f"'{bare.name}' has no map of its free floor (rooms.npz)")
    return FloorMap.of_cells(np.asarray(rooms.traversable, bool), rooms.trav_resolution)


class _ReachingArm:
    """The first robot's first hand in a settled household, and the joints that carry it."""

    def __init__(self, scene: Scene, qpos: Float[np.ndarray, "nq"]):
        tables, model = scene.tables, scene.model
        self._name, self._model, self._data = scene.name, model, mujoco.MjData(model)
        self._data.qpos[:] = self._start = np.array(qpos, float)
        self._body = int(tables.hand_body[np.flatnonzero(tables.hand_agent == 0)[0]])
        driven = {int(model.actuator_trnid[a, 0]) for a in range(model.nu) if model.actuator_trntype[a] == 0}
        joints, body = [], self._body
        while body:
            own = model.body_jntadr[body] + np.arange(model.body_jntnum[body])
            joints += [int(j) for j in own if int(j) in driven]
            body = int(model.body_parentid[body])
        self._address = model.jnt_qposadr[joints]
        limited = model.jnt_limited[joints] != 0
        self._low = np.where(limited, model.jnt_range[joints, 0], -np.pi)
        self._high = np.where(limited, model.jnt_range[joints, 1], np.pi)
        self._agent = tables.body_agent[model.geom_bodyid] == 0
        ground = np.isin(np.array(tables.object_categories), GROUND)
        self._ground = (tables.geom_object >= 0) & ground[tables.geom_object]

    def hand(self) -> Float[np.ndarray, "3"]:
        """m, world frame."""
        mujoco.mj_kinematics(self._model, self._data)
        return self._data.xpos[self._body].copy()

    def free_point(self, rng: np.random.Generator, task: NavigationTask) -> Float[np.ndarray, "3"]:
        """A point where the hand is in a posture in which the robot touches nothing. Raises EngineError."""
        for _ in range(POSTURES):
            self._data.qpos[self._address] = self._low + rng.random(len(self._low)) * (self._high - self._low)
            point = self.hand()
            if LOWEST <= point[2] <= max(task.target_height[1], 1.5) and not self._touches():
                return point
        raise EngineError(f"{task.name}: the robot's hand reaches no free point where it stands in '{self._name}'")

    def _touches(self) -> bool:
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        geom, apart = self._data.contact.geom, self._data.contact.dist
        own = self._agent[geom]
        other = geom[own.any(1) & ~own.all(1) & (apart <= 0)]
        return bool((~(self._ground[other] | self._agent[other])).any())
