"""A hand that floats: six joints move the palm, ten bend its fingers, all actuated. The simplest robot that acts.

The palm's frame is that of BehaviorRobot's right hand (iGibson's behavior_robot.py): fingers point along
-z, the palm faces -y, the thumb is on the +x side. Three slides along the world's axes and three hinges (x, then y,
then z) carry it. Position servos limited to the paper's 300 N drive them, each axis by itself, as in Bullet.

The damping of the slides lies in their joints and not in the servos' limited force, so that a hand whose target jumps
across the house moves at most at 300 N / 136 N s/m = 2.2 m/s along each axis; near its target it moves as with a damped
servo. With the damping inside the limit it reached 50 m/s and threw objects out of the house (docs/notes/lost.md).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.parts import Vector
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.tables import SceneTables

HAND_FORCE = 300.0
"""Newtons (newton metres for turning) of each axis (paper, appendix A.3)."""

FINGER_TORQUE = 3.0
"""Newton metres of each finger joint (iGibson's behavior_robot.py)."""

FINGER_CLOSED, THUMB_CLOSED = 1.2, 0.6
"""Radians at which fingers and thumb are closed; open is 0 (iGibson's behavior_robot.py)."""

FRICTION = 2.5
"""Sliding friction of palm and fingers (iGibson's behavior_robot.py)."""

PALM_MASS, SEGMENT_MASS = 1.0, 0.1
"""Kilograms (iGibson's behavior_robot.py)."""

CONTACT_GAP = 0.003
"""Metres, as on every collision geom of a scene."""

PALM_HALF = (0.042, 0.012, 0.045)
SEGMENTS = (0.042, 0.034)
"""Metres: half size of the palm; lengths of a finger's two segments."""

ARMATURE = 0.02
"""kg m^2 added to the palm's turning joints, so that a servo of a light hand stays stable at 1/120 s."""

STIFFNESS_RATE = 0.08 * 120**2
"""1/s^2. A servo's stiffness is this times the inertia it moves: Bullet closes 0.08 of the error in a physics step."""

_FINGERS = {"index": 0.03, "middle": 0.01, "ring": -0.01, "pinky": -0.03}  # place on the palm's edge, x in metres


@dataclasses.dataclass(frozen=True, eq=False)
class FloatingHand:
    """The robot. `pos` and `quat` (world frame, m, w-x-y-z): its palm at joint positions 0."""

    name: str = "hand"
    pos: Vector = (0, 0, 1)
    quat: Vector = (1, 0, 0, 0)

    def attach(self, spec: mujoco.MjSpec, pos: Vector | None = None, quat: Vector | None = None) -> AgentEntry:
        return add_floating_hand(spec, self.name, self.pos if pos is None else pos, self.quat if quat is None else quat)

    def hand_rays(self) -> tuple[HandRays, ...]:
        return ()

    def controller(self, tables: SceneTables, agent: int, period: float = ACTION_PERIOD) -> HandController:
        return HandController(agent)


class HandController:
    """An action is the controls: where palm and fingers are to go, see `hand_ctrl`. It has no proprioception."""

    moves_eye = False
    action_names: tuple[str, ...] = (
        *("x", "y", "z", "roll", "pitch", "yaw"),
        *(f"{f}_{s}" for f in ("thumb", "index", "middle", "ring", "pinky") for s in ("proximal", "distal")),
    )
    action_high: np.ndarray = np.array([100.0] * 3 + [np.pi] * 3 + [THUMB_CLOSED] * 2 + [FINGER_CLOSED] * 8)
    action_low: np.ndarray = np.array([-100.0] * 3 + [-np.pi] * 3 + [0.0] * 10)
    proprioception_names: tuple[str, ...] = ()

    def __init__(self, agent: int):
        self.agent = agent

    @property
    def action_size(self) -> int:
        return len(self.action_names)

    def initial(self, num_worlds: int) -> Float[Array, "W 16"]:
        """The last controls."""
        return jnp.zeros((num_worlds, self.action_size), jnp.float32)

    def control(
        self, action: Float[Array, "W 16"], view: PhysicsView, state: Float[Array, "W 16"]
    ) -> tuple[Float[Array, "W 16"], Float[Array, "W 16"]]:
        ctrl = jnp.clip(jnp.asarray(action, jnp.float32), self.action_low, self.action_high)
        return ctrl, ctrl

    def grip(self, state: Float[Array, "W 16"]) -> Float[Array, "W 1"]:
        """Mean over the fingers."""
        return jnp.mean(state[:, 6:] / self.action_high[6:], axis=1, keepdims=True)

    def lag(self, view: PhysicsView, state: Float[Array, "W 16"]) -> Float[Array, "W 1"]:
        """Its grasps are not assisted."""
        return jnp.zeros((state.shape[0], 1), jnp.float32)

    def eye(self, view: PhysicsView, state: Float[Array, "W 16"]) -> tuple[Float[Array, "W 3"], Float[Array, "W 4"]]:
        return view.agent.eye_pos[:, self.agent], view.agent.eye_quat[:, self.agent]

    def proprioception(self, view: PhysicsView, state: Float[Array, "W 16"]) -> Float[Array, "W 0"]:
        return jnp.zeros((state.shape[0], 0), jnp.float32)


def add_floating_hand(
    spec: mujoco.MjSpec,
    name: str = "hand",
    pos: Vector = (0, 0, 1),
    quat: Vector = (1, 0, 0, 0),
) -> AgentEntry:
    """Adds a hand to a scene that is not compiled yet.

    Actuators, in this order: `<name>_x`, `_y`, `_z` (m, from `pos`, world axes), `<name>_roll`, `_pitch`, `_yaw` (rad),
    then proximal and distal joint of thumb, index, middle, ring, pinky (rad, 0 open). The hand stays where its controls
    say, at zero controls at `pos`, `quat`; gravity is compensated.

    Args:
      spec: of the scene; changed in place.
      name: of the agent and its palm's body; prefix of everything else.
      pos, quat: world frame, m and w-x-y-z, of the palm at joint positions 0.

    Returns:
      The manifest's entry: base body, eye camera, finger bodies.
    """
    palm = spec.worldbody.add_body(name=name, pos=list(pos), quat=list(quat), gravcomp=1)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.array(quat, np.float64) / np.linalg.norm(quat))
    world_axes = turn.reshape(3, 3)  # rows: the world's axes in the palm's frame, where joint axes are given
    servos: list[tuple[str, float, float, float]] = []  # joint, stiffness, limit of its force, damping ratio
    mass = PALM_MASS + 10 * SEGMENT_MASS
    critical = 2 * mass * np.sqrt(STIFFNESS_RATE)  # N s/m
    for axis, letter in zip(world_axes, "xyz", strict=True):
        joint = f"{name}_{letter}"
        palm.add_joint(name=joint, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=list(axis), damping=[critical, 0.0, 0.0])
        servos.append((joint, mass * STIFFNESS_RATE, HAND_FORCE, 0.0))
    for axis, word in zip(np.eye(3), ("roll", "pitch", "yaw"), strict=True):
        palm.add_joint(name=f"{name}_{word}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=list(axis), armature=ARMATURE)
        servos.append((f"{name}_{word}", ARMATURE * STIFFNESS_RATE, HAND_FORCE, 1.0))
    _solid(palm, mujoco.mjtGeom.mjGEOM_BOX, PALM_HALF, PALM_MASS)
    palm.add_camera(name=f"{name}/eye", pos=[0.0, 0.08, 0.12], fovy=60.0)

    unit = np.rad2deg(1.0) if spec.compiler.degree else 1.0  # MjSpec takes ranges in the compiler's unit
    fingers = []
    down = np.array([0.0, 0.0, -1.0])
    for finger in ("thumb", *_FINGERS):
        if finger == "thumb":
            root, along, axis = (
                np.array([PALM_HALF[0], -0.015, 0.02]),
                np.array([0.5, -0.6, -0.62]),
                np.array([0, 0, -1.0]),
            )
        else:
            root, along, axis = np.array([_FINGERS[finger], 0.0, -PALM_HALF[2]]), down, np.array([-1.0, 0, 0])
        along = along / np.linalg.norm(along)
        closed = THUMB_CLOSED if finger == "thumb" else FINGER_CLOSED
        parent, place = palm, root
        for segment, length in zip(("proximal", "distal"), SEGMENTS, strict=True):
            body = parent.add_body(name=f"{name}_{finger}_{segment}", pos=list(place), gravcomp=1)
            joint = f"{name}_{finger}_{segment}_joint"
            body.add_joint(
                name=joint,
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=list(axis),
                range=[-0.05 * unit, (closed + 0.05) * unit],
                limited=mujoco.mjtLimited.mjLIMITED_TRUE,
                armature=0.002,
            )
            servos.append((joint, 0.002 * STIFFNESS_RATE, FINGER_TORQUE, 1.0))
            _solid(body, mujoco.mjtGeom.mjGEOM_CAPSULE, (0.009, 0, 0), SEGMENT_MASS, end=along * length)
            fingers.append(body.name)
            parent, place = body, along * length

    for joint, stiffness, limit, ratio in servos:
        servo = spec.add_actuator(
            name=joint.removesuffix("_joint"),
            target=joint,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            forcerange=[-limit, limit],
        )
        servo.set_to_position(kp=stiffness, dampratio=ratio)
    bodies = [name, *fingers]
    for k, one in enumerate(bodies):
        for other in bodies[k + 1 :]:
            spec.add_exclude(bodyname1=one, bodyname2=other)
    for key in spec.keys:  # the hand's joints come last, at zero
        for field in ("qpos", "qvel", "ctrl"):
            values = list(getattr(key, field))
            if values:
                setattr(key, field, [*values, *[0.0] * len(servos)])
    eye = f"{name}/eye"
    return AgentEntry(
        name=name, body=name, camera=eye, fingers=fingers, hands=[name], wrist_cameras={"right_wrist": eye}
    )


def hand_ctrl(offset: Vector = (0, 0, 0), turn: Vector = (0, 0, 0), closed: float | int = 0) -> np.ndarray:
    """Controls [16] of one floating hand.

    Args:
      offset: m, world axes, from the hand's initial position.
      turn: roll, pitch, yaw in radians.
      closed: 0 open hand, 1 closed hand.
    """
    fingers = np.full(10, FINGER_CLOSED)
    fingers[:2] = THUMB_CLOSED
    return np.concatenate([np.asarray(offset, np.float64), np.asarray(turn, np.float64), fingers * closed])


def _solid(
    body: mujoco.MjsBody,
    shape: mujoco.mjtGeom,
    size: Sequence[float | int],
    mass: float,
    end: np.ndarray | None = None,
) -> None:
    """A collision geom, and the same geom to look at; from the body's origin to `end` where given."""
    place = {} if end is None else {"fromto": [0.0, 0.0, 0.0, *end]}
    body.add_geom(
        name=f"{body.name}/collision_0",
        type=shape,
        size=list(size),
        mass=mass,
        friction=[FRICTION, 0.005, 0.0001],
        gap=CONTACT_GAP,
        margin=0.0,
        group=3,
        **place,
    )
    body.add_geom(
        name=f"{body.name}/visual_0",
        type=shape,
        size=list(size),
        mass=0.0,
        contype=0,
        conaffinity=0,
        group=0,
        rgba=[0.85, 0.65, 0.55, 1.0],
        **place,
    )
