"""TurtleBot 2: two driven wheels, two casters, a camera. The robot of iGibson's navigation tasks and of table A.6.

Figures: iGibson's drive and the maker's Kobuki base (masses, places of
wheels, casters and plates). Geometry is our own, of primitives. The base frame is on the floor between the wheels,
x forward, z up.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.controllers import (
    compiled_eye,
    differential_drive,
    discrete_drive,
    drive_limits,
    scale_command,
    wheel_odometry,
)
from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.parts import (
    GEOM,
    Vector,
    collision,
    extend_keyframes,
    material,
    normalized,
    servo,
    set_inertia,
    visual,
)
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.agents.turtlebot_costume import costume
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.looks.costume import Costume
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.tables import SceneTables

WHEEL_RADIUS, AXLE = 0.038, 0.23
"""m: iGibson's. The Kobuki's own wheels have 0.0352 m; its description puts them 0.23 m apart."""

MAX_SPEED = 0.7
"""m/s: the maker's figure for the Kobuki."""

MAX_WHEEL = MAX_SPEED / WHEEL_RADIUS
"""rad/s."""

WHEEL_TORQUE, WHEEL_DAMPING = 1.5, 0.5
"""N m, and N m s: limit and gain of a wheel's velocity servo."""

BASE_MASS, WHEEL_MASS, STACK_MASS = 2.4, 0.3, 1.2
"""kg: base with the small battery (the maker's figure); a wheel with its motor; plates, poles, camera. The maker's
model has 0.01 kg for a wheel and for a plate, with which it would neither drive nor tip over as the robot does."""

BASE_RADIUS = 0.1775
PLATES = ((0.10, 0.150), (0.168, 0.150), (0.377, 0.150))
"""m: height and radius of the three plates."""

FIELD_OF_VIEW, EYE_POS = 90.0, (0.06, 0.0, 0.445)
"""Degrees, vertical; m."""

LASER = (0.16, 0.0, 0.36)
"""m: height of iGibson's scan link; before the poles of the plates, so that nothing stands in its 240 degrees."""


@dataclasses.dataclass(frozen=True, eq=False)
class TurtleBot(TaskRobot):
    """The robot. `pos`, `quat`: its base on the floor. `discrete`: actions are one number, 0 to 4."""

    name: str = "turtlebot"
    pos: Vector = (0, 0, 0)
    quat: Vector = (1, 0, 0, 0)
    discrete: bool = False

    drives = True

    def attach(self, spec: mujoco.MjSpec, pos: Vector | None = None, quat: Vector | None = None) -> AgentEntry:
        pos, quat = self.pos if pos is None else pos, normalized(self.quat if quat is None else quat)
        base = spec.worldbody.add_body(name=self.name, pos=list(pos), quat=list(quat))
        base.add_freejoint(name=f"{self.name}/free")
        mass = BASE_MASS + STACK_MASS
        low = 0.25 * mass * BASE_RADIUS**2
        set_inertia(base, mass, (0, 0, 0.10), (low + 0.03, 0, 0, low + 0.03, 0, 2 * low))
        collision(base, GEOM.mjGEOM_CYLINDER, (BASE_RADIUS,), 0, (0, 0, 0.016), end=(0, 0, 0.105), friction=0.25)
        collision(base, GEOM.mjGEOM_CYLINDER, (0.155,), 0, (-0.01, 0, 0.105), end=(-0.01, 0, 0.38), friction=0.25)
        collision(base, GEOM.mjGEOM_BOX, (0.035, 0.14, 0.03), 0, (0.0, 0, 0.44), friction=0.25)
        for x in (0.115, -0.135):  # casters
            collision(base, GEOM.mjGEOM_SPHERE, (0.0165,), 0, (x, 0, 0.0165), frictionless=True)
        base.add_camera(name=f"{self.name}/eye", pos=list(EYE_POS), quat=[0.5, 0.5, -0.5, -0.5], fovy=FIELD_OF_VIEW)
        dark = material(spec, f"{self.name}/body", (0.10, 0.10, 0.11), 0.6, 0.5)
        _draw(base, dark, material(spec, f"{self.name}/poles", (0.75, 0.76, 0.78), 0.9, 0.8))
        rubber = material(spec, f"{self.name}/rubber", (0.05, 0.05, 0.05), 0.1, 0.1)
        for side, y in (("left", AXLE / 2), ("right", -AXLE / 2)):
            wheel = base.add_body(name=f"{self.name}_wheel_{side}", pos=[0, y, WHEEL_RADIUS])
            wheel.add_joint(
                name=f"{wheel.name}_joint", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], armature=0.002
            )
            around, along = 0.25 * WHEEL_MASS * WHEEL_RADIUS**2, 0.5 * WHEEL_MASS * WHEEL_RADIUS**2
            set_inertia(wheel, WHEEL_MASS, (0, 0, 0), (around, 0, 0, along, 0, around))
            collision(wheel, GEOM.mjGEOM_SPHERE, (WHEEL_RADIUS,), 0, friction=1.0)
            visual(wheel, GEOM.mjGEOM_CYLINDER, (WHEEL_RADIUS,), rubber, (0, -0.0103, 0), end=(0, 0.0103, 0))
            servo(spec, f"{wheel.name}_joint", 0.0, WHEEL_DAMPING, WHEEL_TORQUE, name=wheel.name)
            spec.add_exclude(bodyname1=self.name, bodyname2=wheel.name)
        extend_keyframes(spec, [*map(float, pos), *quat, 0.0, 0.0], 8, [0.0, 0.0])
        return AgentEntry(name=self.name, body=self.name, camera=f"{self.name}/eye", laser=LASER)

    def hand_rays(self) -> tuple[HandRays, ...]:
        return ()

    def costume(self) -> Costume:
        """What people see of it: see `ig2mj.agents.turtlebot_costume`."""
        return costume(self.name, PLATES)

    def controller(self, tables: SceneTables, agent: int, period: float = ACTION_PERIOD) -> TurtleBotController:
        return TurtleBotController(agent, tables, self.discrete)


class TurtleBotController:
    """Actions of -1 to 1 are the drive's largest speeds forwards and to the left; or one of five discrete ones."""

    moves_eye = False

    def __init__(self, agent: int, tables: SceneTables, discrete: bool = False):
        self.action_names: tuple[str, ...]
        self.action_low: np.ndarray
        self.action_high: np.ndarray
        self.agent, self._discrete = agent, discrete
        self._wheels = np.flatnonzero(tables.agent_joint_agent == agent)
        self._limits = drive_limits(WHEEL_RADIUS, AXLE, MAX_WHEEL)
        self._choices = discrete_drive(WHEEL_RADIUS, AXLE, MAX_WHEEL)
        if discrete:
            self.action_names = ("choice",)
            self.action_low, self.action_high = np.zeros(1), np.full(1, len(self._choices) - 1.0)
        else:
            self.action_names = ("forward", "turn_left")
            self.action_low, self.action_high = -np.ones(2), np.ones(2)
        self.proprioception_names: tuple[str, ...] = ("dd_base_lin_vel", "dd_base_ang_vel")

    @property
    def action_size(self) -> int:
        return len(self.action_names)

    def initial(self, num_worlds: int) -> Float[Array, "W 0"]:
        """It remembers nothing."""
        return jnp.zeros((num_worlds, 0), jnp.float32)

    def control(
        self, action: Float[Array, "W n"], view: PhysicsView, state: Float[Array, "W 0"]
    ) -> tuple[Float[Array, "W 2"], Float[Array, "W 0"]]:
        if self._discrete:
            row = jnp.clip(jnp.round(jnp.asarray(action)[:, 0]), 0, len(self._choices) - 1).astype(jnp.int32)
            command = jnp.asarray(self._choices, jnp.float32)[row]
        else:
            command = scale_command(action, self.action_low, self.action_high, -self._limits, self._limits)
        return differential_drive(command, WHEEL_RADIUS, AXLE, MAX_WHEEL), state

    def grip(self, state: Float[Array, "W 0"]) -> Float[Array, "W 0"]:
        """It has no hands."""
        return state

    def lag(self, view: PhysicsView, state: Float[Array, "W 0"]) -> Float[Array, "W 0"]:
        """It has no hands."""
        return state

    def eye(self, view: PhysicsView, state: Float[Array, "W 0"]) -> tuple[Float[Array, "W 3"], Float[Array, "W 4"]]:
        return compiled_eye(view, self.agent)

    def proprioception(self, view: PhysicsView, state: Float[Array, "W 0"]) -> Float[Array, "W 2"]:
        """Speed forwards (m/s) and to the left (rad/s), computed from the wheels. (iGibson forgets the radius in the
        second one.)"""
        return wheel_odometry(view.agent.joint_vel[:, self._wheels], WHEEL_RADIUS, AXLE)


def _draw(base: mujoco.MjsBody, dark: str, metal: str) -> None:
    """Base with bumper, three plates on poles, the camera on top."""
    visual(base, GEOM.mjGEOM_CYLINDER, (0.172,), dark, (0, 0, 0.018), end=(0, 0, 0.095))
    visual(base, GEOM.mjGEOM_ELLIPSOID, (0.172, 0.172, 0.018), dark, (0, 0, 0.095))
    visual(base, GEOM.mjGEOM_CYLINDER, (0.1775,), metal, (0, 0, 0.034), end=(0, 0, 0.040))
    visual(base, GEOM.mjGEOM_CYLINDER, (0.1775,), dark, (0, 0, 0.040), end=(0, 0, 0.068))
    for height, radius in PLATES:
        visual(base, GEOM.mjGEOM_CYLINDER, (radius,), dark, (-0.01, 0, height + 0.009), end=(-0.01, 0, height + 0.015))
    for low, high, spots in (
        (0.09, 0.11, ((0.105, 0.082), (0.055, 0.12), (-0.055, 0.12))),
        (0.115, 0.177, ((0.038, 0.13), (-0.055, 0.125))),
        (0.183, 0.387, ((0.038, 0.13), (-0.055, 0.125))),
    ):
        for x, y in spots:
            for side in (-1, 1):
                visual(base, GEOM.mjGEOM_CYLINDER, (0.006,), metal, (x, side * y, low), end=(x, side * y, high))
    visual(base, GEOM.mjGEOM_CYLINDER, (0.014,), dark, (0.0, 0, 0.39), end=(0.0, 0, 0.42))
    visual(base, GEOM.mjGEOM_BOX, (0.030, 0.14, 0.019), dark, (0.0, 0, 0.442))
    for y in (-0.06, -0.02, 0.03):
        visual(base, GEOM.mjGEOM_CYLINDER, (0.011,), metal, (0.028, y, 0.442), end=(0.033, y, 0.442))
