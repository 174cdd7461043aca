"""A body of a TurtleBot's size that stands and does nothing, for MuJoCo and, the same, as an URDF for PyBullet.

Sizes follow iGibson's Turtlebot (2.4 kg, wheels of 38 mm radius, 23 cm apart); the shape
is a plain cylinder on two driven wheels and two slippery casters. Its wheels are actuated, so it never sleeps, as
iGibson's robots never do.
"""

from __future__ import annotations

import math
import pathlib

import mujoco
import numpy as np
from scipy import ndimage

from benchmarks.peers.bullet_description import BulletBody, BulletCamera
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.scene import Scene

MASS, WHEEL_MASS = 2.2, 0.1
RADIUS, HEIGHT, CLEARANCE = 0.177, 0.40, 0.02
WHEEL_RADIUS, WHEEL_WIDTH, WHEEL_SIDE = 0.038, 0.02, 0.115
CASTER_RADIUS, CASTER_AT = 0.019, 0.12
WHEEL_TORQUE = 1.0
EYE_HEIGHT, FOVY = 0.50, 90.0
"""Kilograms, metres, N m, degrees. The eye is above the body's middle."""

NAME = "turtlebot"
GAP = 0.003
BUILDING = ("walls", "floors", "ceilings")


def add_idle_robot(spec: mujoco.MjSpec, pos: tuple[float, float, float], yaw: float = 0.0) -> AgentEntry:
    """Adds the robot, its origin on the floor at `pos` (m, world), looking along `yaw` (rad), to a scene's spec."""
    free = [*pos, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]
    base = spec.worldbody.add_body(name=NAME, pos=list(pos), quat=free[3:])
    base.add_freejoint(name=f"{NAME}/free")
    middle = CLEARANCE + HEIGHT / 2
    _geom(base, 0, mujoco.mjtGeom.mjGEOM_CYLINDER, [RADIUS, HEIGHT / 2, 0], [0, 0, middle], MASS)
    for k, x in enumerate((CASTER_AT, -CASTER_AT)):
        _geom(base, k + 1, mujoco.mjtGeom.mjGEOM_SPHERE, [CASTER_RADIUS, 0, 0], [x, 0, CASTER_RADIUS], 0.0, slide=0.0)
    base.add_camera(
        name=f"{NAME}/eye", pos=[0, 0, EYE_HEIGHT], quat=[0.5, 0.5, -0.5, -0.5], fovy=FOVY
    )  # looks along +x, z up
    for side, y in (("left", WHEEL_SIDE), ("right", -WHEEL_SIDE)):
        wheel = base.add_body(
            name=f"{NAME}_{side}", pos=[0, y, WHEEL_RADIUS], quat=[math.sqrt(0.5), math.sqrt(0.5), 0, 0]
        )
        joint = f"{NAME}_{side}_joint"
        wheel.add_joint(name=joint, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], armature=1e-4)
        size = [WHEEL_RADIUS, WHEEL_WIDTH / 2, 0]
        _geom(wheel, 0, mujoco.mjtGeom.mjGEOM_CYLINDER, size, [0, 0, 0], WHEEL_MASS)
        motor = spec.add_actuator(
            name=f"{NAME}_{side}",
            target=joint,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            forcerange=[-WHEEL_TORQUE, WHEEL_TORQUE],
        )
        motor.set_to_velocity(kv=0.05)
        spec.add_exclude(bodyname1=NAME, bodyname2=wheel.name)
    for key in spec.keys:
        qpos, qvel, ctrl = list(key.qpos), list(key.qvel), list(key.ctrl)
        key.qpos = [*qpos, *free, 0.0, 0.0] if qpos else qpos
        key.qvel = [*qvel, *[0.0] * 8] if qvel else qvel
        key.ctrl = [*ctrl, 0.0, 0.0] if ctrl else ctrl
    return AgentEntry(name=NAME, body=NAME, camera=f"{NAME}/eye")


def write_robot_urdf(folder: pathlib.Path, pos: tuple[float, float, float], yaw: float = 0.0) -> BulletBody:
    """The same body as an URDF in `folder`, and where it goes."""
    middle = CLEARANCE + HEIGHT / 2
    parts = [(f'<cylinder radius="{RADIUS}" length="{HEIGHT}"/>', f"0 0 {middle}")]
    casters = [(f'<sphere radius="{CASTER_RADIUS}"/>', f"{x} 0 {CASTER_RADIUS}") for x in (CASTER_AT, -CASTER_AT)]
    wheel = [(f'<cylinder radius="{WHEEL_RADIUS}" length="{WHEEL_WIDTH}"/>', "0 0 0")]
    lines = [f'<robot name="{NAME}">', _link(NAME, MASS, middle, parts, 0.5)]
    for k, caster in enumerate(casters):
        lines += [_link(f"caster_{k}", 0.01, CASTER_RADIUS, [caster], 0.0)]
        lines += [
            f'<joint name="caster_{k}_joint" type="fixed"><parent link="{NAME}"/><child link="caster_{k}"/></joint>'
        ]
    for side, y in (("left", WHEEL_SIDE), ("right", -WHEEL_SIDE)):
        lines += [_link(side, WHEEL_MASS, 0.0, wheel, 0.5)]
        lines += [
            f'<joint name="{side}_joint" type="continuous"><parent link="{NAME}"/><child link="{side}"/>'
            f'<origin xyz="0 {y} {WHEEL_RADIUS}" rpy="{math.pi / 2} 0 0"/><axis xyz="0 0 1"/></joint>'
        ]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{NAME}.urdf").write_text("\n".join([*lines, "</robot>\n"]))
    file = f"{NAME}.urdf"
    quat = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return BulletBody(NAME, NAME, file, file, pos, quat, False, sleeps=False, motor_force=WHEEL_TORQUE)


def eye_camera(pos: tuple[float, float, float], yaw: float) -> BulletCamera:
    """The robot's eye."""
    x, y, z = pos
    eye = (x, y, z + EYE_HEIGHT)
    return BulletCamera(eye, (x + math.cos(yaw), y + math.sin(yaw), z + EYE_HEIGHT), FOVY)


def free_place(scene: Scene) -> tuple[tuple[float, float, float], float]:
    """A place on the floor with the most room around it, and the direction to the home's middle.

    From the home's traversability map where it has one, else from the boxes of its objects; the floor is z = 0.

    Returns:
      position [3] (m), yaw (rad).
    """
    rooms = scene.rooms
    if rooms is not None and rooms.traversable is not None and rooms.traversable.any():
        free, resolution = rooms.traversable, rooms.trav_resolution
        origin = -np.array(free.shape[::-1]) / 2 * resolution
    else:
        free, origin, resolution = _free_floor(scene)
    clear = np.asarray(ndimage.distance_transform_edt(np.pad(free, 1)))[1:-1, 1:-1]
    row, column = np.unravel_index(int(np.argmax(clear)), clear.shape)
    x, y = origin + (np.array([column, row]) + 0.5) * resolution
    rows, columns = np.nonzero(free)
    middle = origin + (np.array([columns.mean(), rows.mean()]) + 0.5) * resolution
    yaw = math.atan2(middle[1] - y, middle[0] - x)
    return (float(x), float(y), 0.0), yaw


def _free_floor(scene: Scene, resolution: float = 0.1) -> tuple[np.ndarray, np.ndarray, float]:
    """Where on the floor no object's box stands: [rows, columns] bool, the map's corner, metres per cell."""
    engine = NativeEngine(scene, 1)
    view = engine.view(engine.reset())
    low, high = np.array(view.aabb_low[0]), np.array(view.aabb_high[0])
    building = np.isin(scene.tables.object_categories, BUILDING)
    floor = np.isin(scene.tables.object_categories, "floors")
    area = floor if floor.any() else ~building
    corner, end = low[area, :2].min(axis=0), high[area, :2].max(axis=0)
    shape = np.maximum(1, np.ceil((end - corner) / resolution).astype(int))[::-1]
    free = np.ones(shape, bool)
    for a, b in zip(low[~building, :2] - corner, high[~building, :2] - corner, strict=True):
        first, last = np.clip(np.floor(np.array([a, b]) / resolution), 0, None)
        free[int(first[1]) : int(last[1]) + 1, int(first[0]) : int(last[0]) + 1] = False
    return free, corner, resolution


def _geom(
    body: mujoco.MjsBody,
    number: int,
    shape: mujoco.mjtGeom,
    size: list[float],
    pos: list[float],
    mass: float,
    slide: float = 0.25,
) -> None:
    body.add_geom(
        name=f"{body.name}/collision_{number}",
        type=shape,
        size=size,
        pos=pos,
        mass=mass,
        friction=[slide, 0.005, 0.0001],
        gap=GAP,
        group=3,
    )
    body.add_geom(
        name=f"{body.name}/visual_{number}",
        type=shape,
        size=size,
        pos=pos,
        mass=0.0,
        contype=0,
        conaffinity=0,
        group=0,
        rgba=[0.2, 0.2, 0.25, 1.0],
    )


def _link(name: str, mass: float, middle: float, shapes: list[tuple[str, str]], friction: float) -> str:
    inertia = f'<inertia ixx="{mass / 50}" iyy="{mass / 50}" izz="{mass / 50}" ixy="0" ixz="0" iyz="0"/>'
    geometry = "".join(
        f'<{kind}><origin xyz="{at}"/><geometry>{shape}</geometry></{kind}>'
        for shape, at in shapes
        for kind in ("collision", "visual")
    )
    return (
        f'<link name="{name}"><contact><lateral_friction value="{friction}"/></contact>'
        f'<inertial><origin xyz="0 0 {middle}"/><mass value="{mass}"/>{inertia}</inertial>{geometry}</link>'
    )
