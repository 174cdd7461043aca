"""The bimanual humanoid: a body, an eye, and two hands with five fingers each, floating, as in the paper's A.1."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.humanoid.controller import HumanoidController
from ig2mj.agents.humanoid.costume import costume
from ig2mj.agents.humanoid.frames import (
    BODY_HEIGHT,
    CAMERA_QUAT,
    EYE_POS,
    FINGERS,
    HAND_POS,
    HAND_QUAT,
    HANDS,
    PALM_BASE,
    PALM_CENTER,
    THUMB_START,
    TIP,
    mirrored,
)
from ig2mj.agents.humanoid.hand import HAND_LIFTS, add_hand
from ig2mj.agents.parts import (
    GEOM,
    Vector,
    add_pulled_joints,
    collision,
    exclude_all,
    extend_keyframes,
    material,
    multiply,
    normalized,
    rotate,
    visual,
)
from ig2mj.agents.task_robot import HandControl, TaskRobot
from ig2mj.agents.wrist_cameras import LEFT, RIGHT, add_wrist_camera
from ig2mj.errors import UnknownNameError
from ig2mj.looks.costume import Costume
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.tables import SceneTables

BODY = {"paper": (1.0, 50.0), "igibson": (15.0, 7500.0)}
"""kg and N of the body. The paper's 50 N belong to a light body, iGibson's 15 kg to 7,500 N."""

BODY_INERTIA = 0.05
"""kg m^2 for each kilogram, added to the body's turning."""

BODY_RADIUS, BODY_HALF = 0.2, 0.3
"""m: the capsule that collides; with its ends it is 1 m high, as iGibson's."""

NO_CONTACT = ("floors", "carpet")
"""Categories that the body passes through: it hovers, and its legs are not simulated."""

CLOTHS = {"grey": (0.25, 0.50, 0.60), "blue": (0.72, 0.38, 0.34)}
"""Colours of what it wears where homes are decorated."""

SHELL = {"grey": (0.90, 0.90, 0.92), "blue": (0.62, 0.74, 0.90)}
"""Colours, for two of them in one home."""

FIELD_OF_VIEW = 120.0
"""Degrees, vertical: that of the paper's experiments."""

LASER = (0.07, 0.0, -0.25)
"""m: before the column, 0.3 m above the floor while the body stands; iGibson's humanoid has no scanner."""

WRIST_EYE, WRIST_LOOKS_AT = (0.0, 0.10, 0.11), (0.0, -0.11, 0.02)
"""m, right hand's frame: the hand's camera under the wrist, and a point before the palm."""


def _control(hand: str) -> HandControl:
    """Position targets of one hand, displaced by so many m and rad in an action."""
    return HandControl(
        move=(f"{hand}_x", f"{hand}_y", f"{hand}_z"),
        turn=(f"{hand}_roll", f"{hand}_pitch", f"{hand}_yaw"),
        close=f"{hand}_trigger",
        move_scale=0.5,
        turn_scale=0.5,
        displaces=True,
        speed=0.5,
        opens=-1.0,
        opens_high=False,
        closed_empty=0.6,
        on_arm=False,
        two_fingers=False,
    )


@dataclasses.dataclass(frozen=True, eq=False)
class Humanoid(TaskRobot):
    """The robot.

    Attributes:
      pos, quat: start of the body's middle in the world, m and w-x-y-z; the floor is `BODY_HEIGHT` below it.
      compat: "paper" (50 N, 1 kg) or "igibson" (7,500 N, 15 kg).
      grasp_flags: proprioception has 22 numbers instead of 20: for each hand whether it holds something.
      look: "grey" or "blue": tint of the shell.
    """

    name: str = "humanoid"
    pos: Vector = (0, 0, BODY_HEIGHT)
    quat: Vector = (1, 0, 0, 0)
    compat: str = "paper"
    grasp_flags: bool = True
    look: str = "grey"

    stands = BODY_HEIGHT
    hand_lifts = HAND_LIFTS
    hand_controls = tuple(_control(hand) for hand in HANDS)

    def __post_init__(self) -> None:
        if self.compat not in BODY:
            raise UnknownNameError("preset of the humanoid", self.compat, BODY)
        if self.look not in SHELL:
            raise UnknownNameError("look of the humanoid", self.look, SHELL)

    def attach(self, spec: mujoco.MjSpec, pos: Vector | None = None, quat: Vector | None = None) -> AgentEntry:
        pos = np.asarray(self.pos if pos is None else pos, np.float64)
        quat = normalized(np.asarray(self.quat if quat is None else quat))
        white = material(spec, f"{self.name}/shell", SHELL[self.look], 0.7, 0.5)
        dark = material(spec, f"{self.name}/joints", (0.16, 0.17, 0.19), 0.4, 0.3)
        accent = material(spec, f"{self.name}/accent", (0.10, 0.42, 0.72), 0.8, 0.6)

        mass, force = BODY[self.compat]
        body = spec.worldbody.add_body(name=self.name, pos=list(pos), quat=list(quat))
        add_pulled_joints(spec, body, mass, BODY_INERTIA * mass, force)
        collision(
            body, GEOM.mjGEOM_CAPSULE, (BODY_RADIUS,), mass, (0, 0, -BODY_HALF), end=(0, 0, BODY_HALF), friction=0.5
        )
        body.add_camera(name=f"{self.name}/eye", pos=list(EYE_POS), quat=list(CAMERA_QUAT), fovy=FIELD_OF_VIEW)
        _draw_body(body, white, dark, accent)
        hands = [
            add_hand(
                spec,
                f"{self.name}_{hand}",
                number,
                pos + rotate(quat, HAND_POS[number]),
                multiply(quat, HAND_QUAT[number]),
                white,
                dark,
            )
            for number, hand in enumerate(HANDS)
        ]
        wrists = {
            wrist: add_wrist_camera(spec.body(hands[number].palm), self.name, wrist, *_wrist_view(number))
            for number, wrist in enumerate((LEFT, RIGHT))
        }
        for parts in hands:
            exclude_all(spec, [parts.palm, *parts.links])
            for part in (parts.palm, *parts.links):
                spec.add_exclude(bodyname1=self.name, bodyname2=part)
        fingers = len(hands[0].joints)
        qpos, controls = [*pos, 1.0, 0.0, 0.0, 0.0], [*pos, 0.0, 0.0, 0.0]
        for at in HAND_POS:
            place = pos + rotate(quat, at)
            qpos += [*place, 1.0, 0.0, 0.0, 0.0, *[0.0] * fingers]
            controls += [*place, 0.0, 0.0, 0.0, *[0.0] * fingers]
        extend_keyframes(spec, qpos, len(controls), controls)
        return AgentEntry(
            name=self.name,
            body=self.name,
            camera=f"{self.name}/eye",
            fingers=[link for parts in hands for link in parts.links],
            hands=[parts.palm for parts in hands],
            no_contact={self.name: list(NO_CONTACT)},
            assisted=True,
            laser=LASER,
            wrist_cameras=wrists,
        )

    def hand_rays(self) -> tuple[HandRays, ...]:
        """Sixteen rays: thumb tip and middle, palm middle and base to the four other finger tips (paper A.1)."""
        rays = []
        for number, hand in enumerate(HANDS):
            palm = f"{self.name}_{hand}"
            rays.append(
                HandRays(
                    palm=palm,
                    grasp_point=mirrored(number, PALM_CENTER),
                    start_bodies=(f"{palm}_thumb_middle",) * 2 + (palm,) * 2,
                    starts=mirrored(number, (*THUMB_START, PALM_CENTER, PALM_BASE)),
                    end_bodies=tuple(f"{palm}_{finger}_middle" for finger in FINGERS[1:]),
                    ends=mirrored(number, (TIP,) * 4),
                )
            )
        return tuple(rays)

    def costume(self) -> Costume:
        """What people see of it: see `ig2mj.agents.humanoid.costume`."""
        return costume(self.name, CLOTHS[self.look])

    def controller(self, tables: SceneTables, agent: int, period: float = ACTION_PERIOD) -> HumanoidController:
        return HumanoidController(tables, agent, period, self.grasp_flags)


def _wrist_view(hand: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of a hand's camera: where it is, what it looks at and what is up, in the hand's frame; on the palm's side."""
    return mirrored(hand, WRIST_EYE), mirrored(hand, WRIST_LOOKS_AT), np.array([0.0, 0.0, -1.0])


def _draw_body(body: mujoco.MjsBody, shell: str, dark: str, accent: str) -> None:
    """A robot that hovers: foot ring, column, chest, neck, and a head whose face ends just behind the eye."""
    visual(body, GEOM.mjGEOM_CYLINDER, (0.17,), shell, (0, 0, -0.47), end=(0, 0, -0.43))
    visual(body, GEOM.mjGEOM_ELLIPSOID, (0.17, 0.17, 0.07), shell, (0, 0, -0.43))
    visual(body, GEOM.mjGEOM_CYLINDER, (0.174,), accent, (0, 0, -0.455), end=(0, 0, -0.448))
    visual(body, GEOM.mjGEOM_CYLINDER, (0.15,), dark, (0, 0, -0.485), end=(0, 0, -0.47))
    visual(body, GEOM.mjGEOM_CAPSULE, (0.055,), dark, (0, 0, -0.38), end=(0, 0, -0.12))
    visual(body, GEOM.mjGEOM_ELLIPSOID, (0.115, 0.15, 0.20), shell, (-0.01, 0, 0.05))
    visual(body, GEOM.mjGEOM_CAPSULE, (0.075,), shell, (-0.01, -0.12, 0.165), end=(-0.01, 0.12, 0.165))
    visual(body, GEOM.mjGEOM_ELLIPSOID, (0.045, 0.105, 0.095), dark, (0.070, 0, 0.10))
    visual(body, GEOM.mjGEOM_ELLIPSOID, (0.012, 0.022, 0.022), accent, (0.112, 0, 0.105))
    for side in (-1, 1):
        visual(body, GEOM.mjGEOM_SPHERE, (0.062,), dark, (-0.01, 0.185 * side, 0.165))
        visual(body, GEOM.mjGEOM_ELLIPSOID, (0.018, 0.008, 0.028), dark, (-0.055, 0.098 * side, 0.40))
    visual(body, GEOM.mjGEOM_CAPSULE, (0.035,), dark, (-0.035, 0, 0.22), end=(-0.045, 0, 0.32))
    visual(body, GEOM.mjGEOM_ELLIPSOID, (0.092, 0.095, 0.105), shell, (-0.055, 0, 0.40))
    visual(body, GEOM.mjGEOM_ELLIPSOID, (0.055, 0.078, 0.045), dark, (-0.012, 0, 0.405))
    for side in (-1, 1):
        visual(body, GEOM.mjGEOM_ELLIPSOID, (0.010, 0.014, 0.014), accent, (0.032, 0.030 * side, 0.410))
