"""What ties parts of a robot's MJCF to each other, kept when the robot is added to a scene.

Equalities, tendons and sensors name joints and bodies, which get the agent's names (`named_spec`). MuJoCo measures
equalities and tendons from where all joints are at their references; the robot stands at its start there, and not where
its file was made, so that these are expressed in numbers that hold wherever the references are (`keep_relations`,
`rebase_joint_equalities`).
"""

from __future__ import annotations

import dataclasses
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping

import mujoco
import numpy as np

from ig2mj.scene.mjcf_files import read_mjcf
from ig2mj.scene.mjcf_text import make_absolute, rename

BASE = "/base"
"""What the base body is called after the agent's name until it has that name alone."""

EQUALITY, OBJECT = mujoco.mjtEq, mujoco.mjtObj


@dataclasses.dataclass(frozen=True)
class Coupling:
    """A joint that follows another: follower - follower_ref = sum of coefficients[k] x (leader - leader_ref)^k.

    Attributes:
      leader: None where the follower is held in one place. follower_ref, leader_ref: references, rad or m.
    """

    follower: str
    leader: str | None
    coefficients: np.ndarray
    follower_ref: float = 0.0
    leader_ref: float = 0.0

    def position(self, leader: float) -> float:
        """Of the follower, rad or m, where the leader is."""
        return self.follower_ref + float(np.polynomial.Polynomial(self.coefficients)(leader - self.leader_ref))

    def about(self, follower_ref: float, leader_ref: float) -> np.ndarray:
        """The coefficients [5] of the same relation for other references."""
        shift = np.polynomial.Polynomial([leader_ref - self.leader_ref, 1.0])
        moved = np.polynomial.Polynomial(self.coefficients)(shift).coef
        moved = np.concatenate([moved, np.zeros(5 - len(moved))]) if len(moved) < 5 else moved
        moved[0] += self.follower_ref - follower_ref
        return moved


def couplings_of(model: mujoco.MjModel) -> list[Coupling]:
    """The equalities between joints of a model."""
    found = []
    for eq in np.flatnonzero((model.eq_type == int(EQUALITY.mjEQ_JOINT)) & (model.eq_active0 > 0)):
        one, two = int(model.eq_obj1id[eq]), int(model.eq_obj2id[eq])
        found.append(
            Coupling(
                model.joint(one).name,
                None if two < 0 else model.joint(two).name,
                np.array(model.eq_data[eq, :5]),
                float(model.qpos0[model.jnt_qposadr[one]]),
                0.0 if two < 0 else float(model.qpos0[model.jnt_qposadr[two]]),
            )
        )
    return found


def named_spec(file: pathlib.Path, old: str, agent: str) -> mujoco.MjSpec:
    """A robot's MJCF in which everything has the name that, with the agent's name before it, it gets in a scene.

    The base `old` becomes `BASE`, `<old>_link` becomes `_link`; what has another name gets a colon before it, and so do
    assets and default classes, which other robots may have, too.
    """
    assert agent, "a robot has a name"

    def named(value: str) -> str:
        if value == old:
            return BASE
        return value.removeprefix(old) if value.startswith((f"{old}_", f"{old}/")) else f":{value}"

    root = read_mjcf(file)
    make_absolute(root, file.parent)
    rename(root, named, lambda asset: f":{asset}")
    return mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))


def name_base(spec: mujoco.MjSpec, body: mujoco.MjsBody, agent: str) -> None:
    """Gives the base of a robot that was added its name, the agent's, also where it is referred to."""
    old = f"{agent}{BASE}"
    body.name = agent
    for element, attributes in (
        *((e, ("name1", "name2")) for e in spec.equalities if e.objtype == OBJECT.mjOBJ_BODY),
        *((s, ("objname",)) for s in spec.sensors if s.objtype in (OBJECT.mjOBJ_BODY, OBJECT.mjOBJ_XBODY)),
        *((s, ("refname",)) for s in spec.sensors if s.reftype in (OBJECT.mjOBJ_BODY, OBJECT.mjOBJ_XBODY)),
        *((c, ("targetbody",)) for c in (*spec.cameras, *spec.lights)),
        *((e, ("bodyname1", "bodyname2")) for e in spec.excludes),
    ):
        for attribute in attributes:
            if getattr(element, attribute) == old:
                setattr(element, attribute, agent)


def keep_relations(spec: mujoco.MjSpec, model: mujoco.MjModel, start: Mapping[str, float]) -> None:
    """Writes out what MuJoCo would measure at the joints' references, so that it holds when those are at the start.

    Args:
      spec: of the robot, not yet added. model: the same compiled, with the references of its file.
      start: positions of hinges and slides at the start, by the model's names.
    """
    for tendon, spring in zip(spec.tendons, model.tendon_lengthspring, strict=True):
        tendon.springlength = spring
    at_start = mujoco.MjData(model)
    for name, value in start.items():
        at_start.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_fwdPosition(model, at_start)
    for number, equality in enumerate(spec.equalities):
        data, ids = model.eq_data[number], (int(model.eq_obj1id[number]), int(model.eq_obj2id[number]))
        on_bodies = equality.objtype == OBJECT.mjOBJ_BODY
        if equality.type == EQUALITY.mjEQ_WELD and on_bodies:
            equality.data[:] = data
        elif equality.type == EQUALITY.mjEQ_CONNECT and on_bodies and ids[1] > 0:
            names = []
            for body, pos in zip((equality.name1, equality.name2), (data[:3], data[3:6]), strict=True):
                names.append(f":connect_{number}_{len(names)}")
                spec.body(body).add_site(name=names[-1], pos=pos, size=[1e-3] * 3, rgba=[0.0] * 4)
            equality.objtype, equality.name1, equality.name2 = OBJECT.mjOBJ_SITE, *names
        elif equality.type == EQUALITY.mjEQ_TENDON:
            old, new = (
                [0.0 if i < 0 else float(of[i]) for i in ids] for of in (model.tendon_length0, at_start.ten_length)
            )
            equality.data[:5] = Coupling("", "", np.array(data[:5]), old[0], old[1]).about(new[0], new[1])


def rebase_joint_equalities(spec: mujoco.MjSpec, couplings: Mapping[str, Coupling]) -> None:
    """Writes the relations between joints for the references that they have now.

    couplings: by the scene's names of followers, with the scene's names of leaders.
    """
    for equality in spec.equalities:
        coupling = couplings.get(equality.name1) if equality.type == EQUALITY.mjEQ_JOINT else None
        if coupling is not None:
            leader_ref = 0.0 if coupling.leader is None else float(spec.joint(coupling.leader).ref)
            equality.data[:5] = coupling.about(float(spec.joint(equality.name1).ref), leader_ref)
