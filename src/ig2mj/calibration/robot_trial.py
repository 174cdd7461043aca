"""Trials of a converted robot in a home: it stands, drives a metre, and lifts a cube.

    result = try_robot(UrdfRobot.load("panda"), props)

The robot acts by its own controller. The cube lies on a post before it, at a height and a distance at which most of its
arm's postures hold something; inverse kinematics bring the gripper over it, or in front of it where the arm cannot
point down. Each try has another position and angle of the cube.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import pathlib
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float
from scipy import ndimage

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.urdf import UrdfRobot
from ig2mj.errors import EngineError
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.simulation import Simulation

STAND_SECONDS = 5.0
MOST_TILT, MOST_DRIFT, MOST_SAG = math.radians(5.0), 0.03, 0.05
"""rad, m, and rad or m: of the base and of the arm's joints, of a robot that stands."""

DISTANCE, MOST_DRIVE_SECONDS = 1.0, 20.0
"""m that a robot drives, and s that it may take."""

CUBE_MASS, LIFT, TRIES = 0.2, 0.08, 10
"""kg; m by which the cube must have risen when the hand rests; number of tries."""

RAISE = np.array([0.0, 0.0, 0.15])
"""m: by which the hand goes up."""

CUBES = (0.02, 0.03, 0.04)
"""m: edges. A gripper gets the largest that is at most `SHARE` of its opening."""

SHARE = 0.51

POST = 0.06
"""m: edge of the post."""

SPREAD, TURN = 0.012, math.radians(12)
"""m and rad: by which the cube's position and angle differ between tries."""

HOVER = 0.10
"""m between the gripper and the cube before it approaches."""

MOST_BEND = 1.0
"""rad or m: by which a joint moves between the cube and `HOVER` before it."""

SAMPLES = 4000
"""Postures of the arm among which the post's place is chosen."""

HEIGHTS = (0.1, 0.95)
"""m above the floor: of the cube."""

APPROACHES = {"from above": (0.0, -1.0), "obliquely": (math.sqrt(0.5), -math.sqrt(0.5)), "from the front": (1.0, 0.0)}
"""Directions in which a gripper comes to the cube: outwards and upwards, unit vectors."""

ALIGNED = math.cos(math.radians(45))
"""Cosine to an approach of postures that count for it."""

FEWEST, PLACES, NEAREST = 3, 12, 30
"""Postures with which an approach is tried; places tried for each; postures tried at each place."""

PropMaker = Callable[[float, float], pathlib.Path]
"""From edge and height (m) of an upright block to a folder of it as an object; a cube where they are equal."""


Watch = Callable[[Simulation, str], None]
"""What is shown the world, with the number of the try and of its stage."""


def unwatched(simulation: Simulation, stage: str) -> None:
    """Does nothing."""


@dataclasses.dataclass
class RobotTrial:
    """What a robot did.

    Attributes:
      stands: for five seconds. drives: m in the direction of "forward"; None: it has no wheels.
      lifted: of each try; empty: it has no gripper. approach: one of `APPROACHES`. cube: m, its edge.
      mode: of grasping. problem: why a trial could not be made.
    """

    stands: bool = False
    drives: float | None = None
    lifted: list[bool] = dataclasses.field(default_factory=list)
    approach: str = ""
    cube: float = 0.0
    mode: str = "physical"
    problem: str = ""

    @property
    def passed(self) -> bool:
        """It stands, drives where it has wheels, and lifts in eight of ten tries where it has a gripper."""
        drives = self.drives is None or self.drives >= DISTANCE
        return self.stands and drives and (not self.lifted or sum(self.lifted) >= 0.8 * len(self.lifted))


def try_robot(
    robot: UrdfRobot,
    prop: PropMaker,
    home: str = "small_home",
    tries: int = TRIES,
    mode: str = "physical",
    seed: int = 0,
    watch: Watch = unwatched,
) -> RobotTrial:
    """All trials of a robot. prop: makes the cube and its post. watch: is shown the world after each stage of a try."""
    result = RobotTrial(mode=mode)
    placed = find_place(robot, home)
    simulation = Simulation(load_scene(home, agents=[placed]))
    result.stands = _stands(simulation, placed)
    if robot.drives:
        simulation.reset()
        result.drives = _drives(simulation, placed)
    if robot.layout.grippers or robot.layout.suction:
        try:
            _lift(placed, prop, home, tries, mode, seed, result, watch)
        except EngineError as e:
            result.problem = str(e)
    return result


# ---------------------------------------------------------------------------------------------------- standing, driving


def find_place(robot: UrdfRobot, home: str, candidates: int = 24, seed: int = 0) -> UrdfRobot:
    """The robot where it touches nothing and has the most free floor before it.

    Raises EngineError: there is no such place.
    """
    rooms = load_scene(home).rooms
    assert rooms is not None and rooms.traversable is not None
    room, size = np.asarray(ndimage.distance_transform_edt(np.pad(rooms.traversable, 1))), len(rooms.traversable)
    room = room[1:-1, 1:-1] * rooms.trav_resolution
    rng, found = np.random.default_rng(seed), []
    cells = np.argwhere(room > 0.3)
    for row, column in cells[rng.permutation(len(cells))[:400]]:
        x, y = (np.array([column, row]) + 0.5 - size / 2) * rooms.trav_resolution
        for yaw in np.arange(8) * (np.pi / 4):
            way = [(x + d * np.cos(yaw), y + d * np.sin(yaw)) for d in np.arange(0, 1.5, 0.1)]
            at = [
                (int(b / rooms.trav_resolution + size / 2), int(a / rooms.trav_resolution + size / 2)) for a, b in way
            ]
            inside = [room[i, j] if 0 <= i < size and 0 <= j < size else 0.0 for i, j in at]
            found.append((min(inside) + 0.3 * room[row, column], x, y, float(yaw)))
    for _, x, y, yaw in sorted(found, reverse=True)[:candidates]:
        placed = robot.at(float(x), float(y), yaw)
        if not _collisions(load_scene(home, agents=[placed])):
            return placed
    raise EngineError(f"robot '{robot.name}' touches something at {candidates} places of '{home}'")


def _collisions(scene: Scene, data: Any = None) -> bool:
    """The first robot touches something that is not a floor."""
    data = scene.start_data() if data is None else data
    tables = scene.tables
    agent = tables.body_agent[scene.model.geom_bodyid] == 0
    floors = np.array([c in ("floors", "carpet") for c in tables.object_categories])
    ground = (tables.geom_object >= 0) & floors[tables.geom_object]
    for contact in data.contact:
        one, two = contact.geom
        if agent[one] != agent[two] and contact.dist < 0 and not ground[two if agent[one] else one]:
            return True
    return False


def _stands(simulation: Simulation, robot: UrdfRobot) -> bool:
    """Nothing tilts, drifts or sags in five seconds without a command."""
    data, name = simulation.data, robot.name
    joints = [f"{name}_{joint}" for joint in robot.layout.arm]
    before, at = np.array(data.body(name).xpos), np.array([data.joint(j).qpos[0] for j in joints])
    upright = np.array(data.body(name).xmat).reshape(3, 3)[:, 2]
    simulation.robots.act(count=round(STAND_SECONDS / ACTION_PERIOD))
    data = simulation.data
    tilt = float(np.arccos(np.clip(upright @ np.array(data.body(name).xmat).reshape(3, 3)[:, 2], -1, 1)))
    sag = np.abs(np.array([data.joint(j).qpos[0] for j in joints]) - at)
    drift = float(np.linalg.norm(data.body(name).xpos - before))
    return bool(tilt < MOST_TILT and drift < MOST_DRIFT and (sag < MOST_SAG).all())


def _drives(simulation: Simulation, robot: UrdfRobot) -> float:
    """m in the direction in which the robot looks at the start."""
    data = simulation.data
    start, ahead = np.array(data.body(robot.name).xpos), np.array(data.body(robot.name).xmat).reshape(3, 3)[:, 0]
    gone = 0.0
    for _ in range(round(MOST_DRIVE_SECONDS / ACTION_PERIOD)):
        simulation.robots.act(forward=0.5)
        gone = float((simulation.data.body(robot.name).xpos - start) @ ahead)
        if gone >= DISTANCE:
            break
    return gone


# ---------------------------------------------------------------------------------------------------- lifting


@dataclasses.dataclass(frozen=True)
class Hand:
    """A hand of a robot in a scene.

    Attributes:
      palm: its body. point: where it holds, in its frame. approach, across: unit vectors in its frame: towards what it
        holds, and from one finger to the other. opening: m. joints: of the arm that carries it. close: its action.
    """

    palm: str
    point: Float[np.ndarray, "3"]
    approach: Float[np.ndarray, "3"]
    across: Float[np.ndarray, "3"]
    opening: float
    joints: tuple[str, ...]
    close: str


class Arm:
    """An arm in the compiled scene: postures, and inverse kinematics by damped least squares."""

    def __init__(self, scene: Scene, robot: UrdfRobot, hand: Hand):
        self.scene, self.hand, self.model = scene, hand, scene.model
        self.data = scene.start_data()
        joints = [scene.model.joint(f"{robot.name}_{name}") for name in hand.joints]
        self._qpos = np.array([j.qposadr[0] for j in joints])
        self._dof = np.array([j.dofadr[0] for j in joints])
        self._low = np.array([j.range[0] if scene.model.jnt_limited[j.id] else -np.pi for j in joints])
        self._high = np.array([j.range[1] if scene.model.jnt_limited[j.id] else np.pi for j in joints])
        self._body = scene.model.body(hand.palm).id

    def put(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Grasp point, approach and finger axis in the world, with the arm's joints at q."""
        self.data.qpos[self._qpos] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        turn = self.data.xmat[self._body].reshape(3, 3)
        hand = self.hand
        return self.data.xpos[self._body] + turn @ hand.point, turn @ hand.approach, turn @ hand.across

    def random(self, rng: np.random.Generator) -> np.ndarray:
        """A posture within the limits, away from their ends."""
        span = self._high - self._low
        return self._low + span * (0.03 + 0.94 * rng.random(len(span)))

    def solve(
        self, q: np.ndarray, point: np.ndarray, approach: np.ndarray, across: np.ndarray | None, steps: int = 100
    ) -> tuple[np.ndarray, float, float]:
        """Posture near q that brings the hand there, and its errors: m and rad (of the approach)."""
        weight = 0.3
        for _ in range(steps):
            at, along, side = self.put(q)
            moves, turns = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
            mujoco.mj_jac(self.model, self.data, moves, turns, at, self._body)
            turn = np.cross(along, approach)
            if across is not None:
                turn = turn + np.cross(side, across if side @ across >= 0 else -across)
            error = np.concatenate([point - at, weight * turn])
            jacobian = np.concatenate([moves, weight * turns])[:, self._dof]
            if across is None:  # turning about the approach is free
                jacobian[3:] -= np.outer(along, along @ jacobian[3:])
            step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-4 * np.eye(6), error)
            q = np.clip(q + np.clip(step, -0.2, 0.2), self._low, self._high)
        at, along, _ = self.put(q)
        return q, float(np.linalg.norm(point - at)), float(np.arccos(np.clip(along @ approach, -1, 1)))

    def collides(self) -> bool:
        """The robot touches something in the posture that was put last."""
        mujoco.mj_collision(self.model, self.data)
        return _collisions(self.scene, self.data)


def hand_of(robot: UrdfRobot) -> Hand:
    """The robot's first hand that can hold something. Raises EngineError: no arm carries one."""
    rays, layout, body = robot.hand_rays(), robot.layout, robot.body
    if not rays:
        raise EngineError(f"robot '{robot.name}' has no hand that can hold something")
    links = [*(one.hand for one in layout.grippers), *layout.suction]
    ray = rays[0]
    link = next(k for k in links if robot.body_name(body.frame(k)[0]) == ray.palm)
    joints = tuple(layout.arm[k] for k in body.chain_joints(layout, link))
    if not joints:
        raise EngineError(f"no joint of robot '{robot.name}' moves its hand")
    open_data = body.posed({name: body.start_of(name, layout) for name in layout.gripper})
    palm_link = body.frame(link)[0]
    pos, turn = body.pose(palm_link, open_data)

    def inner(names: tuple[str, ...], points: np.ndarray) -> np.ndarray:
        placed = []
        for name, point in zip(names, points, strict=True):
            other = name.removeprefix(f"{robot.name}_") if name != robot.name else body.base
            at, turned = body.pose(other, open_data)
            placed.append(turn.T @ (at + turned @ point - pos))
        return np.mean(placed, axis=0)

    one, two = inner(ray.start_bodies, ray.starts), inner(ray.end_bodies, ray.ends)
    suction = link in layout.suction
    point = ray.grasp_point if suction else (one + two) / 2
    across = two - one
    opening = float(np.linalg.norm(across))
    across = across / max(opening, 1e-9)
    if ray.palm not in ray.end_bodies:  # else a finger hangs on what it closes against
        opening = body.gap({*ray.start_bodies}, {*ray.end_bodies}, robot.name, open_data)
    if suction:
        approach = across
        across = np.cross(approach, np.eye(3)[int(np.argmin(np.abs(approach)))])
        across, opening = across / np.linalg.norm(across), CUBES[-1] / SHARE
    else:
        approach = point - across * (point @ across)
        approach = approach / max(float(np.linalg.norm(approach)), 1e-9)
    single = len(layout.grippers) == 1
    close = f"{link}_suction" if suction else "gripper" if single else f"{link}_gripper"
    return Hand(ray.palm, point, approach, across, opening, joints, close)


def _lift(
    robot: UrdfRobot,
    prop: PropMaker,
    home: str,
    tries: int,
    mode: str,
    seed: int,
    result: RobotTrial,
    watch: Watch = unwatched,
) -> None:
    hand, rng = hand_of(robot), np.random.default_rng(seed)
    fits = [edge for edge in CUBES if edge <= SHARE * hand.opening]
    if not fits:
        raise EngineError(f"the fingers of robot '{robot.name}' open by {1000 * hand.opening:.0f} mm only")
    edge = result.cube = fits[-1]
    bare = Arm(load_scene(home, agents=[robot]), robot, hand)
    for name, point, approach, postures in _places(bare, rng, robot):
        found = _grasp(bare, point, approach, postures)
        if found is None:
            continue
        height = round(float(point[2]) - edge / 2, 3)
        cube, post = prop(edge, edge), prop(POST if name == "from above" else edge, height)
        objects = [f"{post}@fixed:{point[0]:.4f},{point[1]:.4f},{height / 2:.4f},0", str(cube)]
        if not _in_the_way(Arm(load_scene(home, agents=[robot], objects=objects), robot, hand), *found):
            result.approach = name
            break
    else:
        raise EngineError(f"robot '{robot.name}' reaches no place where a cube could lie before it")
    q, hover = found
    start = {**robot.layout.start, **dict(zip(hand.joints, map(float, hover), strict=True))}
    ready = dataclasses.replace(robot, layout=dataclasses.replace(robot.layout, start=start))
    scene = load_scene(home, agents=[ready], objects=objects)
    simulation = Simulation(scene, grasping=mode)
    loose = scene.additions[-1].name
    arm = Arm(scene, ready, hand)
    side = arm.put(q)[2].copy()
    yaw = math.atan2(side[1], side[0])
    for _ in range(tries):
        simulation.reset()
        shift = np.array([*rng.uniform(-SPREAD, SPREAD, 2), 0.0])
        turn = yaw + rng.uniform(-TURN, TURN)
        spot = point + shift
        simulation.set_object_pose(loose, spot, (math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)))
        simulation.robots.act(count=3)
        low = float(simulation.object_pose(loose)[0][2])
        axis = _kept(side, q)
        grasp, _, _ = arm.solve(q, spot, approach, axis)
        before, _, _ = arm.solve(grasp, spot - HOVER * approach, approach, axis)
        raised, _, _ = arm.solve(grasp, spot + RAISE, approach, axis)
        move = functools.partial(_move, simulation, hand)
        for stage, (posture, grip, settle) in enumerate(
            ((before, 1.0, 3), (grasp, 1.0, 5), (grasp, -1.0, 10), (raised, -1.0, 10))
        ):
            move(posture, grip, settle)
            watch(simulation, f"{len(result.lifted)}_{stage}")
        result.lifted.append(float(simulation.object_pose(loose)[0][2]) > low + LIFT)


def _grasp(
    arm: Arm, point: np.ndarray, approach: np.ndarray, postures: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Postures that hold at a point, and `HOVER` before it; None where neither is reached without touching anything, or
    the hand cannot go up from there."""
    for q in postures:
        q, off, turned = arm.solve(q, point, approach, None)
        _, _, side = arm.put(q)
        if off > 0.004 or turned > 0.1 or abs(side[2]) > 0.2 or arm.collides():
            continue
        hover, off, _ = arm.solve(q, point - HOVER * approach, approach, _kept(side, q))
        arm.put(hover)
        if off > 0.01 or arm.collides() or np.abs(hover - q).max() > MOST_BEND:
            continue
        if arm.solve(q, point + RAISE, approach, _kept(side, q))[1] < 0.01:
            return q, hover
    return None


def _kept(side: np.ndarray, q: np.ndarray) -> np.ndarray | None:
    """The finger axis that postures near q are to keep; None: the arm has too few joints to choose it."""
    return side.copy() if len(q) >= 6 else None


def _in_the_way(arm: Arm, grasp: np.ndarray, hover: np.ndarray) -> bool:
    """The post touches the robot before the cube, at it, or between."""
    for share in (0.0, 0.5, 1.0):
        arm.put(grasp + share * (hover - grasp))
        if arm.collides():
            return True
    return False


def _places(
    arm: Arm, rng: np.random.Generator, robot: UrdfRobot
) -> Iterator[tuple[str, np.ndarray, np.ndarray, list[np.ndarray]]]:
    """Approaches, each with places of the cube, the direction of the approach, and postures that hold near there."""
    base = arm.data.body(robot.name).xpos.copy()
    ahead = arm.data.body(robot.name).xmat.reshape(3, 3)[:, 0].copy()
    rows = []
    for _ in range(SAMPLES):
        q = arm.random(rng)
        at, along, side = arm.put(q)
        rows.append((q, at.copy(), along.copy(), side.copy()))
    for name, (outward, upward) in APPROACHES.items():
        good = []
        for q, at, along, side in rows:
            away = (at - base) * (1, 1, 0)
            reach = float(np.linalg.norm(away))
            wanted = outward * away / max(reach, 1e-9) + np.array([0, 0, upward])
            level = HEIGHTS[0] < at[2] < HEIGHTS[1] and abs(side[2]) < 0.5
            free = not robot.drives or away @ ahead > 0.3 * reach  # a wheel is no place for a post
            if level and free and along @ wanted > ALIGNED and reach > 0.12:
                good.append((q, at, wanted))
        if len(good) < FEWEST:
            continue
        points = np.array([at for _, at, _ in good])
        near = (np.linalg.norm(points[:, None] - points[None], axis=-1) < 0.15).sum(1)
        for k in np.argsort(-near)[:: max(1, len(good) // PLACES)][:PLACES]:
            order = np.argsort(np.linalg.norm(points - points[k], axis=1))[:NEAREST]
            yield name, points[k], good[k][2] / np.linalg.norm(good[k][2]), [good[i][0] for i in order]


def _move(simulation: Simulation, hand: Hand, q: np.ndarray, grip: float, settle: int = 3, speed: float = 0.5) -> None:
    """Brings the arm's servos to q, all joints at once, and waits."""
    robots, robot = simulation.robots, simulation.scene.agents[0]
    assert isinstance(robot, UrdfRobot)
    places = [robot.layout.arm.index(name) for name in hand.joints]
    speeds = np.array([robot.description.joint(name).speed for name in hand.joints]) * ACTION_PERIOD
    for _ in range(200):
        now = np.asarray(robots.controllers[0].arm)[0][places]
        left = q - now
        if np.abs(left).max() < 1e-3:
            break
        share = min(1.0, speed / max(float(np.abs(left / speeds).max()), 1e-9))
        moves = {**dict(zip(hand.joints, left / speeds * share, strict=True)), hand.close: grip}
        robots.act(np.array([moves.get(name, 0.0) for name in robots.action_names]))
    robots.act(np.array([grip if name == hand.close else 0.0 for name in robots.action_names]), settle)
