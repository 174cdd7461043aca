"""What robots are built of: collision and visual geoms, materials, force-limited servos, poses that need no JAX."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np
from jaxtyping import Float

CONTACT_GAP = 0.003
"""Metres, as on every collision geom of a scene."""

PULL_RATE = 90.0
"""1/s: natural frequency of the critically damped servos that pull a floating part to its target.

A saturated servo has no implicit damping. It must not jump across the band of velocities in which it is not saturated,
of width 2 F / (2 m PULL_RATE), within a step of 1/120 s, in which it gains F / (120 m): the rate must stay below 120.
"""

GEOM = mujoco.mjtGeom

Vector = Sequence[float | int] | np.ndarray


def material(spec: mujoco.MjSpec, name: str, rgb: Vector, shininess: float = 0.5, specular: float = 0.4) -> str:
    """Adds a material once and returns its name."""
    if spec.material(name) is None:
        spec.add_material(name=name, rgba=[*rgb, 1.0], shininess=shininess, specular=specular)
    return name


def visual(
    body: mujoco.MjsBody,
    shape: GEOM,
    size: Vector,
    material: str,
    pos: Vector = (0, 0, 0),
    quat: Vector = (1, 0, 0, 0),
    end: Vector | None = None,
) -> None:
    """A geom to look at, `<body>/visual_<i>`; from `pos` to `end` where that is given (capsules and cylinders)."""
    number = sum(geom.name.startswith(f"{body.name}/visual_") for geom in body.geoms)
    body.add_geom(
        name=f"{body.name}/visual_{number}",
        type=shape,
        size=_padded(size),
        material=material,
        mass=0.0,
        contype=0,
        conaffinity=0,
        group=0,
        **_placed(pos, quat, end),
    )


def collision(
    body: mujoco.MjsBody,
    shape: GEOM,
    size: Vector,
    mass: float | int = 0.0,
    pos: Vector = (0, 0, 0),
    quat: Vector = (1, 0, 0, 0),
    end: Vector | None = None,
    friction: float = 1.0,
    frictionless: bool = False,
) -> None:
    """A geom that collides, `<body>/collision_<i>` in group 3.

    Of two geoms the larger friction counts in MuJoCo; a frictionless one has priority, whatever it slides on.
    """
    number = sum(geom.name.startswith(f"{body.name}/collision_") for geom in body.geoms)
    body.add_geom(
        name=f"{body.name}/collision_{number}",
        type=shape,
        size=_padded(size),
        mass=mass,
        friction=[friction, 0.005, 0.0001],
        condim=1 if frictionless else 3,
        priority=1 if frictionless else 0,
        gap=CONTACT_GAP,
        margin=0.0,
        group=3,
        **_placed(pos, quat, end),
    )


def set_inertia(body: mujoco.MjsBody, mass: float, com: Vector, full: Vector) -> None:
    """Gives a body its inertia. `full`: kg m^2 about the centre of mass, in URDF's order xx, xy, xz, yy, yz, zz."""
    xx, xy, xz, yy, yz, zz = full
    body.explicitinertial = True
    body.mass = mass
    body.ipos = list(com)
    body.fullinertia = [xx, yy, zz, xy, xz, yz]


def servo(
    spec: mujoco.MjSpec,
    joint: str,
    stiffness: float,
    damping: float,
    force: float,
    name: str = "",
    constant: float = 0.0,
    axis: int = 0,
) -> None:
    """Adds an actuator with force `stiffness * (ctrl - position) - damping * velocity + constant`, limited to `force`.

    Without stiffness it is a velocity servo: `damping * (ctrl - velocity) + constant`. On a ball joint it acts about
    the `axis` (0, 1, 2) of the child's frame.
    """
    added = spec.add_actuator(
        name=name or joint,
        target=joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        forcerange=[-force, force],
    )
    added.gainprm[0] = stiffness or damping
    added.biasprm[:3] = [constant, -stiffness, -damping]
    added.gear[:] = 0.0
    added.gear[axis] = 1.0


def add_pulled_joints(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    mass: float,
    inertia: float,
    force: float,
) -> None:
    """Lets a body of the world float, pulled to where its six controls say, each axis with at most `force`.

    Three slides along the world's axes, whose coordinates are the body's world position; a ball joint. Actuators
    `<body>_x`, `_y`, `_z`: position, m, world frame; `<body>_wx`, `_wy`, `_wz`: angular velocity, rad/s, body frame.
    Turning is by velocity since three angles of position would lock at some orientation: the controller turns the
    angle that is left into a velocity. The weight is carried by the force upwards, which counts against the limit.

    Args:
      mass: kg of everything that hangs on the body.
      inertia: kg m^2, added to the ball joint.
      force: N, and N m for turning (Bullet's limit of a fixed constraint is on each of its six rows).
    """
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.array(body.quat, np.float64))
    weight = -mass * float(spec.option.gravity[2])
    name = body.name
    for k, (axis, letter) in enumerate(zip(turn.reshape(3, 3), "xyz", strict=True)):  # world axes seen from the body
        body.add_joint(
            name=f"{name}_{letter}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=list(axis), ref=float(body.pos[k])
        )
        stiffness, damping = mass * PULL_RATE**2, 2 * mass * PULL_RATE
        servo(spec, f"{name}_{letter}", stiffness, damping, force, constant=weight if letter == "z" else 0.0)
    body.add_joint(name=f"{name}_turn", type=mujoco.mjtJoint.mjJNT_BALL, armature=inertia)
    for k, letter in enumerate("xyz"):
        servo(spec, f"{name}_turn", 0.0, 2 * inertia * PULL_RATE, force, name=f"{name}_w{letter}", axis=k)


def extend_keyframes(spec: mujoco.MjSpec, qpos: Vector, dofs: int, controls: Vector) -> None:
    """Extends a scene's keyframes by the joints and actuators of an attached robot, which come last.

    A scene without keyframes gets one, of its zero pose: else all servos would pull to 0 until the first action. To be
    called when the robot's actuators have been added.
    """
    if not spec.keys:
        spec.add_key(name="start")
    for key in spec.keys:
        for field, values in (("qpos", qpos), ("qvel", [0.0] * dofs), ("ctrl", controls)):
            present = list(getattr(key, field))
            if field == "ctrl" and not present:  # a scene without actuators has none in its keyframes
                present = [0.0] * (len(spec.actuators) - len(values))
            if present or field == "ctrl":
                setattr(key, field, [*present, *values])


def exclude_all(spec: mujoco.MjSpec, bodies: Iterable[str]) -> None:
    """No two of these bodies collide."""
    names = list(bodies)
    for k, one in enumerate(names):
        for other in names[k + 1 :]:
            spec.add_exclude(bodyname1=one, bodyname2=other)


def multiply(a: Vector, b: Vector) -> Float[np.ndarray, "4"]:
    """Product of two quaternions, on the host."""
    out = np.zeros(4)
    mujoco.mju_mulQuat(out, np.asarray(a, np.float64), np.asarray(b, np.float64))
    return out


def rotate(quat: Vector, vector: Vector) -> Float[np.ndarray, "3"]:
    """A vector turned by a quaternion, on the host."""
    out = np.zeros(3)
    mujoco.mju_rotVecQuat(out, np.asarray(vector, np.float64), np.asarray(quat, np.float64))
    return out


def normalized(v: Vector) -> np.ndarray:
    return np.asarray(v, np.float64) / np.linalg.norm(v)


def _padded(size: Vector) -> list[float]:
    return [*size, *[0.0] * (3 - len(size))]


def _placed(pos: Vector, quat: Vector, end: Vector | None) -> dict:
    return {"pos": list(pos), "quat": list(quat)} if end is None else {"fromto": [*pos, *end]}
