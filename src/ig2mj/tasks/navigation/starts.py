"""Start states of navigation tasks: a settled household, the robot anywhere on free floor, a goal.

As in iGibson: start and goal are free places of one floor, `target_dist` apart along it, the robot is turned at random,
and what is put or opened at random has come to rest. All doors between rooms stand open.

Axes: P rows.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence

import jax
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.snapshot import Snapshot, fitted
from ig2mj.engine.writes import joints
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.sampling.bystanders import Bystanders
from ig2mj.sampling.joints import JointMover
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import OPENINGS
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.navigation.floor import FloorMap
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.pools import COUNT, SEEDS
from ig2mj.tasks.task import GROUND
from ig2mj.worlds.pool import Pool

DOORS = ("door",)
"""Categories that stand wide open."""

OPEN_CHANCE = 0.5
"""Of each joint of furniture (iGibson's tasks)."""

SETTLE_SECONDS = 5.0
REST_SECONDS = 0.5
"""Of physics, until a robot that stands on the floor is at rest."""

TRIES = 100
"""Places tried for a goal, a start or a loose object."""

YAWS = 4
"""Directions in which a robot is tried in every cell; it can stand where it can in one of them."""

BITS = 15
"""Bits of `contype` and `conaffinity` below which there are as many others."""

ROBOT_SEPARATION = 0.8
"""m between robots at the start, and from loose objects to the robot."""


@dataclasses.dataclass(frozen=True, eq=False)
class NavigationStarts:
    """What episodes begin with.

    Attributes:
      pool: physics and states. floor: where the robot can stand.
      goals: m, world frame. fields: distance of each cell of the floor to the row's goal. shortest: m, from the start.
    """

    pool: Pool
    floor: FloorMap
    goals: Float[np.ndarray, "P 3"]
    fields: Float[np.ndarray, "P h w"]
    shortest: Float[np.ndarray, "P"]


def make_starts(
    task: NavigationTask, bare: Scene, scene: Scene, states: ExtendedStates, split: str, count: int | None = None
) -> NavigationStarts:
    """Start states of a task, the same for the same split.

    Args:
      bare: the household without robots; scene: the same with the task's robots. states: extended states of one world.
      split: "train" or "held_out". count: P; None: as many as pools of that split have.

    Raises:
      UnknownNameError: no such split. EngineError: the robot finds no place, or no goal at the distance.
    """
    if split not in SEEDS:
        raise UnknownNameError("split", split, SEEDS)
    rng, count = np.random.default_rng(SEEDS[split]), count or COUNT[split]
    households = _Households(task, bare)
    engine = NativeEngine(scene, 1)
    base = fitted(households.still, engine._start, 1, scene.name)
    places = Places(scene, np.asarray(base.whole("qpos")))
    floor = places.floor()
    cells = floor.cells
    goals, fields, shortest = np.zeros((count, 3)), [], np.zeros(count)
    rows = []
    for begin in range(0, count, 64):  # fields of one chunk at a time
        picked = cells[rng.integers(len(cells), size=min(64, count - begin))]
        fields.append(floor.distances(picked))
        goals[begin : begin + len(picked), :2] = floor.centres(picked)
    fields = np.concatenate(fields)
    goals[:, 2] = rng.uniform(*task.target_height, size=count)
    for k in range(count):
        away = fields[k][floor.free]
        fit = np.flatnonzero((away >= task.target_dist[0]) & (away <= task.target_dist[1]))
        if not len(fit):
            raise EngineError(f"{task.name}: no free floor of '{scene.name}' is {task.target_dist} m from a goal")
        chosen = _place(places, floor, cells[fit], rng)
        shortest[k] = away[fit[chosen.cell]]
        robots = [chosen.pose]
        for _ in range(task.others):
            other = _place(places, floor, cells, rng, robots)
            robots.append(other.pose)
        keep_off = np.array([pose[:2] for pose in robots])
        for _ in range(TRIES):
            household = households.draw(rng, floor, cells, keep_off)
            if household is None or places.stand_in(_with_household(base, household), robots):
                break
        else:
            raise EngineError(
                f"no start without collisions: in {TRIES} arrangements of '{scene.name}' an object hits a robot"
            )
        rows.append((household, robots))
    physics = _snapshots(base, rows, places, engine)
    one = jax.tree.map(np.asarray, states)
    worn = jax.tree.map(lambda a: np.broadcast_to(a[0], (count, *a.shape[1:])), one)
    return NavigationStarts(Pool(physics, worn), floor, goals.astype(np.float32), fields, shortest.astype(np.float32))


@dataclasses.dataclass(frozen=True)
class _Placed:
    cell: int
    pose: tuple[float, float, float]  # x, y, yaw


def _place(
    places: Places,
    floor: FloorMap,
    cells: np.ndarray,
    rng: np.random.Generator,
    others: Sequence[tuple[float, float, float]] = (),
) -> _Placed:
    """A place in one of the cells, turned at random, where robot number `len(others)` touches nothing."""
    taken = np.array([pose[:2] for pose in others]).reshape(-1, 2)
    for _ in range(TRIES):
        cell = int(rng.integers(len(cells)))
        xy = floor.centres(cells[cell][None])[0]
        pose = float(xy[0]), float(xy[1]), float(rng.uniform(-np.pi, np.pi))
        if len(taken) and np.linalg.norm(taken - xy, axis=1).min() < ROBOT_SEPARATION:
            continue
        if places.stands(len(others), pose):
            return _Placed(cell, pose)
    raise EngineError(
        f"no start without collisions: a robot of the task collides at {TRIES} positions of '{places.scene.name}'"
    )


def _snapshots(base: Snapshot, rows: list, places: Places, engine: NativeEngine) -> Snapshot:
    """One row for each pair of a household (None: the base's) and poses of the robots."""
    whole = [base if household is None else _with_household(base, household) for household, _ in rows]
    if all(household is None for household, _ in rows):
        physics = jax.tree.map(lambda a: np.broadcast_to(a, (len(rows), *np.shape(a))), base)
    else:
        physics = jax.tree.map(lambda *a: np.stack(a), *whole)
    qpos = np.array(physics.whole("qpos"))
    for k, (_, robots) in enumerate(rows):
        for number, pose in enumerate(robots):
            qpos[k, places.address[number] : places.address[number] + 7] = places.free_joint(number, pose)
    physics = physics.with_whole(qpos=qpos)
    heights = [address + 2 for address in places.address]
    qpos[:, heights] += _sunk(engine, jax.tree.map(lambda a: np.array(a[0]), physics), heights)
    return physics.with_whole(qpos=qpos)


def _sunk(engine: NativeEngine, start: Snapshot, heights: list[int]) -> Float[np.ndarray, "n"]:
    """How much higher robots come to rest than they stand in this start state, m.

    Their weight presses them about a tenth of a millimetre into the floor. A robot that only touches it has contacts in
    double precision and none in single precision, and then rears up otherwise as it drives off: by 0.05 rad after half
    a second.
    """
    physics = engine.load(engine.reset(), start)
    before = np.asarray(start.whole("qpos"))[heights]
    for _ in range(round(REST_SECONDS / (engine.substeps * engine.timestep))):
        physics, _ = engine.step(physics)
    return np.asarray(engine.export(physics, 0).whole("qpos"))[heights] - before


def _with_household(base: Snapshot, household: Snapshot) -> Snapshot:
    return dataclasses.replace(base, scene=household.scene, time=household.time)


class Places:
    """Where the robots of a scene can stand in its settled household."""

    def __init__(self, scene: Scene, qpos: Float[np.ndarray, "nq"]):
        self.scene, tables, model = scene, scene.tables, scene.model
        joints = [int(model.body_jntadr[b]) for b in tables.agent_body]
        self.address = [int(model.jnt_qposadr[j]) for j in joints]
        agent = tables.body_agent[model.geom_bodyid]
        self._agent, self._apart = agent, _apart(model, tables.body_agent >= 0)
        self._data, self._start = mujoco.MjData(self._apart), np.array(qpos, float)
        ground = np.isin(np.array(tables.object_categories), GROUND)
        self._ground = (tables.geom_object >= 0) & ground[tables.geom_object]
        self._away = np.array([1000.0, 1000.0, 0.0])
        self._data.qpos[:] = self._start
        for number in range(len(joints)):
            self._hide(number)

    def _hide(self, number: int) -> None:
        at = self.address[number]
        self._data.qpos[at : at + 3] = self._away + np.array([10.0 * number, 0.0, 0.0])

    def free_joint(self, number: int, pose: tuple[float, float, float]) -> Float[np.ndarray, "7"]:
        """Coordinates of a robot's free joint at x, y (m) and yaw (rad), at its start's height."""
        x, y, yaw = pose
        height = self._start[self.address[number] + 2]
        return np.array([x, y, height, np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])

    def stands(self, number: int, pose: tuple[float, float, float]) -> bool:
        """Whether a robot touches nothing but the ground there."""
        model, data = self._apart, self._data
        at = self.address[number]
        data.qpos[at : at + 7] = self.free_joint(number, pose)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        geom, apart = data.contact.geom, data.contact.dist
        own = self._agent[geom] == number
        other = geom[own.any(1) & ~own.all(1) & (apart <= 0)]
        self._hide(number)
        return bool((self._ground[other] | (self._agent[other] == number)).all())

    def stand_in(self, household: Snapshot, robots: Sequence[tuple[float, float, float]]) -> bool:
        """Whether robots at these poses touch nothing but the ground in another household of the scene."""
        still = np.array(self._data.qpos)
        self._data.qpos[:] = np.asarray(household.whole("qpos"))
        for number in range(len(self.address)):
            self._hide(number)
        found = all(self.stands(number, pose) for number, pose in enumerate(robots))
        self._data.qpos[:] = still
        return found

    def object_positions(self, names: Sequence[str]) -> Float[np.ndarray, "n 3"]:
        """Origins of objects in the settled household, world frame, m."""
        mujoco.mj_kinematics(self.scene.model, self._data)
        return self._data.xpos[[self.scene.tables.object_root[self.scene.object_index(n)] for n in names]]

    def floor(self, near: Float[np.ndarray, "n 2"] | None = None) -> FloorMap:
        """Where the first robot can stand. `near`: see `FloorMap.of_cells`."""
        rooms = self.scene.rooms
        if rooms is None or rooms.traversable is None:
            raise EngineError(f"'{self.scene.name}' has no map of its free floor (rooms.npz)")
        size, resolution = len(rooms.traversable), rooms.trav_resolution
        free = np.zeros((size, size), bool)
        for row, column in np.argwhere(rooms.traversable):
            x, y = (np.array([column, row]) + 0.5 - size / 2) * resolution
            free[row, column] = any(self.stands(0, (x, y, 2 * np.pi * k / YAWS)) for k in range(YAWS))
        try:
            return FloorMap.of_cells(free, resolution, near)
        except ValueError:
            raise EngineError(f"there is no free floor for the robot in '{self.scene.name}'") from None


def _apart(model: mujoco.MjModel, robots: Bool[np.ndarray, "b"]) -> mujoco.MjModel:
    """A model in which bodies meet robots only: contacts within the household would take most of the time of looking
    where a robot stands.

    MuJoCo looks for contacts of two geoms if a bit of `contype` of one is in `conaffinity` of the other. Types of
    robots and affinities of the household stay in the low bits; the others are moved to the high ones. A model that
    uses those itself is returned as it is.
    """
    if ((model.geom_contype | model.geom_conaffinity) >> BITS).any():
        return model
    found = copy.copy(model)
    for of, robot in (("geom", robots[model.geom_bodyid]), ("body", robots)):
        types, affinities = getattr(found, f"{of}_contype"), getattr(found, f"{of}_conaffinity")
        types[~robot] <<= BITS
        affinities[robot] <<= BITS
    return found


class _Households:
    """The household of a task, at rest with its doors open; `still`: with nothing put about or opened.

    Furniture that is opened at random shoves nothing, and what lies in drawers goes along; what would is left closed.
    """

    def __init__(self, task: NavigationTask, bare: Scene):
        self._task, self._scene = task, bare
        self._query = SceneQuery(bare, NativeEngine(bare, 1))
        categories = np.array(bare.tables.object_categories)[bare.tables.openable_object]
        self._joints = np.flatnonzero(np.isin(categories, task.opened))
        self.still = _settled_with_open_doors(self._query)

    def draw(
        self, rng: np.random.Generator, floor: FloorMap, cells: np.ndarray, keep_off: Float[np.ndarray, "n 2"]
    ) -> Snapshot | None:
        """The household of a row; None: the still one. `keep_off`: where the robots stand."""
        task = self._task
        if not len(self._joints) and not task.objects:
            return None
        opened = self._joints[rng.random(len(self._joints)) < OPEN_CHANCE]
        spots: dict[str, np.ndarray] = {}
        taken = keep_off
        for addition in self._scene.additions[: len(task.objects)]:
            for _ in range(TRIES):
                xy = floor.centres(cells[rng.integers(len(cells), size=1)])[0]
                if np.linalg.norm(taken - xy, axis=1).min() >= ROBOT_SEPARATION:
                    break
            else:
                raise EngineError(f"{task.name}: no free floor is left for '{addition.name}'")
            taken = np.concatenate([taken, xy[None]])
            spots[addition.name] = np.array([*xy, rng.uniform(-np.pi, np.pi)])
        for _ in range(TRIES):
            found = self._put_down(self._opened(opened, rng), spots)
            if found is not None:
                return found
        raise EngineError(
            f"{task.name}: every arrangement of opened furniture and objects on the floor moves something"
        )

    def _opened(self, joints: Int[np.ndarray, "n"], rng: np.random.Generator) -> Snapshot:
        """The still household with joints at random places of their range, one object after another, at rest."""
        tables, query = self._scene.tables, self._query
        closed, end = tables.openable_closed, tables.openable_open
        query.load(self.still)
        positions = np.array(query.view.joint_pos, float)
        for owner in np.unique(tables.openable_object[joints]):
            mine = joints[tables.openable_object[joints] == owner]
            moves = np.isin(np.arange(len(closed)), mine)[None]
            mover = JointMover(query, int(owner))
            for _ in range(OPENINGS):
                positions[0, mine] = closed[mine] + rng.random(len(mine)) * (end - closed)[mine]
                if not mover.shoved_by(mover.plan(positions, moves)):
                    break
                query.load(mover.before)
        return query.save()

    def _put_down(self, household: Snapshot, spots: dict[str, np.ndarray]) -> Snapshot | None:
        """The household with additions on the floor, at rest; None where they move something. Places: x, y, yaw."""
        query, tables = self._query, self._scene.tables
        query.load(household)
        others, view = Bystanders(query, household), query.view
        moved = np.zeros((1, tables.num_objects), bool)
        pos, quat = np.array(view.object_pos), np.array(view.object_quat)
        for name, (x, y, yaw) in spots.items():
            k = self._scene.object_index(name)
            lift = float(view.object_pos[0, k, 2] - view.aabb_low[0, k, 2])
            moved[0, k], pos[0, k], quat[0, k] = True, (x, y, lift + 0.005), _turned(yaw, quat[0, k])
        query.write(Write(object_mask=moved, object_pos=pos, object_quat=quat))
        query.settle(SETTLE_SECONDS)
        return None if (others.shoved() & ~moved[0]).any() else query.save()


def still_household(bare: Scene) -> Snapshot:
    """A scene without robots at rest, all doors between rooms wide open."""
    return _settled_with_open_doors(SceneQuery(bare, NativeEngine(bare, 1)))


def _settled_with_open_doors(query: SceneQuery) -> Snapshot:
    """The scene at rest, all doors between rooms wide open."""
    tables, model = query.scene.tables, query.scene.model
    doors = np.isin(np.array(tables.object_categories)[tables.openable_object], DOORS)
    query.write(joints(model.nq, tables.openable_qposadr[doors], tables.openable_open[doors]))
    query.settle(SETTLE_SECONDS)
    return query.save()


def _turned(yaw: float, quat: Float[np.ndarray, "4"]) -> Float[np.ndarray, "4"]:
    out = np.zeros(4)
    mujoco.mju_mulQuat(out, np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)]), quat.astype(float))
    return out
