"""The trial of a robot's hand: it lifts a cube that lies on a post before it (`lift`).

Inverse kinematics bring the gripper over the cube, or in front of it where the arm cannot point down. The post stands
where most of the arm's postures hold something.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import pathlib
from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.urdf import UrdfRobot
from ig2mj.agents.urdf.controller import finger_speeds
from ig2mj.calibration.robot_hand import FREE_JOINTS, Arm, Hand, hand_of
from ig2mj.errors import EngineError
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.simulation import Simulation

LIFT, TRIES, NEEDED = 0.08, 10, 0.8
"""m by which the cube must have risen when the hand rests; number of tries, and share of them that must succeed."""

SHORT, PUSHED = 0.02, 0.02
"""m by which the hand stops short of the cube, and the cube is moved before the hand closes, in tries that fail so."""

TOUCHING = 1e-3
"""m between things that touch."""

RAISE = np.array([0.0, 0.0, 0.15])
"""m: by which the hand goes up."""

CUBES = (0.02, 0.03, 0.04)
"""m: edges. A gripper gets the largest that is at most `SHARE` of its opening."""

SHARE = 0.51

POST = 0.06
"""m: edge of the post."""

SPREAD, TURN = 0.012, math.radians(12)
"""m and rad: by which the cube's position and angle differ between tries."""

ON_POST = 0.25
"""Share of the edge of a post as narrow as the cube, by which the cube may be off its middle: it falls at a half."""

CLEAR_OF_POST = 0.005
"""m between fingertips and the post."""

HOVER = 0.10
"""m between the gripper and the cube before it approaches."""

STRAIGHT = 4
"""Parts of the way to the cube, each with a posture of its own at its end."""

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

OFF, OFF_FEW = 0.1, 0.5
"""rad between a hand's direction and its approach, of arms with six joints or more and with fewer; the latter then
approach along the direction that their hand has."""

TURNED_JOINTS = 5
"""Joints with which an arm can at least turn its hand about its approach."""

FEWEST, PLACES, NEAREST = 3, 12, 30
"""Postures with which an approach is tried; places tried for each; postures tried at each place."""

PropMaker = Callable[[float, float], pathlib.Path]
"""From edge and height (m) of an upright block to a folder of it as an object; a cube where they are equal."""


Watch = Callable[[Simulation, str], None]
"""What is shown the world, with the number of the try and of its stage."""


def unwatched(simulation: Simulation, stage: str) -> None:
    """Does nothing."""


@dataclasses.dataclass
class Lifting:
    """What a hand did.

    Attributes:
      lifted: of each try. reasons: why each failed; empty of those that did not. approach: one of `APPROACHES`.
      cube: m, its edge.
    """

    lifted: list[bool]
    reasons: list[str]
    approach: str
    cube: float


def lift(
    robot: UrdfRobot, prop: PropMaker, home: str, tries: int, mode: str, seed: int, watch: Watch = unwatched
) -> Lifting:
    """Tries of a robot that stands where it is tried (`find_place`). Raises EngineError: none can be made."""
    hand, rng = hand_of(robot), np.random.default_rng(seed)
    fits = [edge for edge in CUBES if edge <= SHARE * hand.opening]
    if not fits:
        raise EngineError(f"the fingers of robot '{robot.name}' open by {1000 * hand.opening:.0f} mm only")
    edge = fits[-1]
    bare = Arm(load_scene(home, agents=[robot]), robot, hand)
    for name, point, approach, postures in _places(bare, rng, robot):
        held = _grasp(bare, point, approach, postures)
        if held is None:
            continue
        found, approach = held[:2], held[2]
        height = round(float(point[2]) - edge / 2, 3)
        width = POST if name == "from above" else edge
        cube, post = prop(edge, edge), prop(width, height)
        objects = [f"{post}@fixed:{point[0]:.4f},{point[1]:.4f},{height / 2:.4f},0", str(cube)]
        scene = load_scene(home, agents=[robot], objects=objects)
        if not _stands_in_furniture(scene) and not _in_the_way(Arm(scene, robot, hand), *found):
            result = Lifting([], [], name, edge)
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
    spread = min(SPREAD, ON_POST * width)
    for _ in range(tries):
        simulation.reset()
        shift = np.array([*rng.uniform(-spread, spread, 2), 0.0])
        turn = yaw + rng.uniform(-TURN, TURN)
        spot = point + shift
        simulation.set_object_pose(loose, spot, (math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)))
        simulation.robots.act(count=3)
        low = float(simulation.object_pose(loose)[0][2])
        axis, held = _kept(side, q), spot - _higher(hand, edge, approach) * approach
        grasp, _, _ = arm.solve(q, held, approach, axis)
        before, _, _ = arm.solve(grasp, held - HOVER * approach, approach, axis)
        raised, _, _ = arm.solve(grasp, held + RAISE, approach, axis)
        way, at = [], before
        for left in np.linspace(1, 0, STRAIGHT + 1)[1:]:  # joints that turn evenly would lead the hand along an arc
            at, _, _ = arm.solve(at, held - left * HOVER * approach, approach, axis)
            way.append(at)
        move, reason = functools.partial(_move, simulation, hand), ""
        closing = 10 + math.ceil(_closing_time(robot) / ACTION_PERIOD)
        for stage, (postures, grip, settle) in enumerate(
            (([before], 1.0, 3), (way, 1.0, 5), (way[-1:], -1.0, closing), ([raised], -1.0, 10))
        ):
            for posture in postures[:-1]:
                move(posture, grip, 0)
            move(postures[-1], grip, settle)
            watch(simulation, f"{len(result.lifted)}_{stage}")
            reason = reason or _fault(stage, simulation, hand, loose, spot, held)
        result.lifted.append(float(simulation.object_pose(loose)[0][2]) > low + LIFT)
        result.reasons.append("" if result.lifted[-1] else reason or "the cube slips out of the hand")
    return result


def _fault(stage: int, simulation: Simulation, hand: Hand, cube: str, spot: np.ndarray, held: np.ndarray) -> str:
    """What went wrong in a stage of a try, as far as it can be seen then. spot, held: where the cube lay, and where the
    hand was to take it."""
    at = simulation.object_pose(cube)[0]
    if stage == 1:
        palm = simulation.data.body(hand.palm)
        short = float(np.linalg.norm(palm.xpos + palm.xmat.reshape(3, 3) @ hand.point - held))
        if short > SHORT:
            return f"the hand stops {1000 * short:.0f} mm before the cube"
    if stage in (0, 1) and float(np.linalg.norm((at - spot)[:2])) > PUSHED:
        return "the hand pushes the cube away"
    if stage == 2 and not _touched(simulation, cube):
        return "the fingers close without touching the cube"
    return ""


def _higher(hand: Hand, edge: float, approach: np.ndarray) -> float:
    """m by which a hand stays away from the cube, against its approach, so that its fingers, which are longer than the
    cube is high, keep clear of the post that it lies on: they hold it nearer to their ends."""
    return max(hand.beyond + CLEAR_OF_POST - edge / 2, 0.0) if approach[2] < -0.5 else 0.0


def _touched(simulation: Simulation, cube: str) -> bool:
    """A part of a robot touches an object."""
    tables, data = simulation.scene.tables, simulation.data
    own = tables.geom_object == tables.object_names.index(cube)
    agents = tables.body_agent[simulation.scene.model.geom_bodyid] >= 0
    pairs = [(int(a), int(b)) for a, b in (contact.geom for contact in data.contact if contact.dist < TOUCHING)]
    return any((own[a] and agents[b]) or (own[b] and agents[a]) for a, b in pairs)


def _grasp(
    arm: Arm, point: np.ndarray, approach: np.ndarray, postures: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Postures that hold at a point, and `HOVER` before it, and the direction from the latter to the former; None where
    neither is reached without touching anything, or the hand cannot go up from there."""
    few = len(postures[0]) < FREE_JOINTS
    requested = approach
    for q in postures:
        q, off, turned = arm.solve(q, point, requested, None)
        _, along, side = arm.put(q)
        if off > 0.004 or turned > (OFF_FEW if few else OFF) or abs(side[2]) > 0.2 or arm.collides():
            continue
        approach = along.copy() if few else requested
        hover, off, _ = arm.solve(q, point - HOVER * approach, approach, _kept(side, q))
        arm.put(hover)
        if off > 0.01 or arm.collides() or np.abs(hover - q).max() > MOST_BEND:
            continue
        if arm.solve(q, point + RAISE, approach, _kept(side, q))[1] < 0.01:
            return q, hover, approach
    return None


def _kept(side: np.ndarray, q: np.ndarray) -> np.ndarray | None:
    """The finger axis that postures near q are to keep, as far as the arm's joints allow it; None: it has too few."""
    return side.copy() if len(q) >= TURNED_JOINTS else None


def _in_the_way(arm: Arm, grasp: np.ndarray, hover: np.ndarray) -> bool:
    """The post touches the robot before the cube, at it, or between."""
    for share in (0.0, 0.5, 1.0):
        arm.put(grasp + share * (hover - grasp))
        if arm.collides():
            return True
    return False


def _stands_in_furniture(scene: Scene) -> bool:
    """The post, the first of the two things that were added, touches something that is neither floor nor robot."""
    data, tables = scene.start_data(), scene.tables
    post, cube = (tables.object_names.index(added.name) for added in scene.additions)
    mujoco.mj_forward(scene.model, data)
    for pair in (contact.geom for contact in data.contact if contact.dist < 0):
        objects = [int(tables.geom_object[g]) for g in pair]
        other = next((o for o in objects if o != post), post)
        if post in objects and other not in (cube, -1) and tables.object_categories[other] not in ("floors", "carpet"):
            return True
    return False


def _places(
    arm: Arm, rng: np.random.Generator, robot: UrdfRobot
) -> Iterator[tuple[str, np.ndarray, np.ndarray, list[np.ndarray]]]:
    """Approaches, each with places of the cube, the direction of the approach, and postures that hold near there; of a
    robot that drives first those in front of it."""
    base = arm.data.body(robot.name).xpos.copy()
    ahead = arm.data.body(robot.name).xmat.reshape(3, 3)[:, 0].copy()
    rows = []
    for _ in range(SAMPLES):
        q = arm.random(rng)
        at, along, side = arm.put(q)
        rows.append((q, at.copy(), along.copy(), side.copy()))
    sides = (True, False) if robot.drives else (False,)
    for (name, (outward, upward)), in_front in itertools.product(APPROACHES.items(), sides):
        good = []
        for q, at, along, side in rows:
            away = (at - base) * (1, 1, 0)
            reach = float(np.linalg.norm(away))
            requested = outward * away / max(reach, 1e-9) + np.array([0, 0, upward])
            level = HEIGHTS[0] < at[2] < HEIGHTS[1] and abs(side[2]) < 0.5
            free = not in_front or away @ ahead > 0.3 * reach
            if level and free and along @ requested > ALIGNED and reach > 0.12:
                good.append((q, at, requested))
        if len(good) < FEWEST:
            continue
        points = np.array([at for _, at, _ in good])
        near = (np.linalg.norm(points[:, None] - points[None], axis=-1) < 0.15).sum(1)
        for k in np.argsort(-near)[:: max(1, len(good) // PLACES)][:PLACES]:
            order = np.argsort(np.linalg.norm(points - points[k], axis=1))[:NEAREST]
            yield name, points[k], good[k][2] / np.linalg.norm(good[k][2]), [good[i][0] for i in order]


def _closing_time(robot: UrdfRobot) -> float:
    """s that the slowest finger takes from one limit to the other."""
    ways = [float(np.ptp(robot.body.limits(name))) for name in robot.layout.gripper]
    speeds = finger_speeds(robot.description, robot.layout, robot.body)
    return max((way / float(speed) for way, speed in zip(ways, speeds, strict=True)), default=0.0)


def _move(simulation: Simulation, hand: Hand, q: np.ndarray, grip: float, settle: int = 3, speed: float = 0.5) -> None:
    """Brings the arm's servos to q, all joints at once, and waits for `settle` agent steps."""
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
    if settle:
        robots.act(np.array([grip if name == hand.close else 0.0 for name in robots.action_names]), settle)
