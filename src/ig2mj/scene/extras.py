"""Further states that a scene asks for, among what `load_scene(objects=...)` takes: "with:NAME".

    with:on_fire                          flammable objects burn
    with:broken                           breakable objects break
    with:attached:lamp_bulb_0>lamp_0      the first object can be attached to the second
    with:attached:lamp_bulb_0>lamp_0@0,0,0.3   only at a place, m, in the frame of the second's main body

A scene that asks for none has no arrays, programs or constraints for them. Each pair that can be attached is an
equality constraint, compiled switched off: a weld between the main bodies.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import mujoco

from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.scene.manifest import Manifest

PREFIX = "with:"
ON_FIRE, BROKEN, ATTACHED = "on_fire", "broken", "attached"
EXTRAS = (ON_FIRE, BROKEN, ATTACHED)
FORM = "with:on_fire, with:broken or with:attached:CHILD>PARENT[@X,Y,Z]"

TIME_CONSTANT = 0.02
"""s in which a joint takes back what it was pulled apart, MuJoCo's default."""

IMPEDANCE = (0.91, 0.91, 0.001)
"""MuJoCo's solimp. It yields 1 cm for each 250 N and kilogram of what is attached: there it gives way
(`ig2mj.states.definitions.attached`)."""


class Pair(NamedTuple):
    """What can be attached to what, by name, and where: m, frame of the parent's main body; None: anywhere."""

    child: str
    parent: str
    place: tuple[float, float, float] | None = None


def is_extra(requested: object) -> bool:
    """Whether a value of `objects` asks for a further state."""
    return isinstance(requested, str) and requested.startswith(PREFIX)


def read_extras(requested: Iterable[str | os.PathLike]) -> tuple[list[str], list[str | os.PathLike]]:
    """Further states in values of `objects`, without the prefix, and the other values. Raises Ig2mjError."""
    extras, others = list[str](), list[str | os.PathLike]()
    for value in requested:
        if is_extra(value):
            extras.append(_checked(str(value).removeprefix(PREFIX)))
        else:
            others.append(value)
    return extras, others


def extras_as_text(extras: Iterable[str]) -> list[str]:
    """Values of `objects` for further states."""
    return [PREFIX + extra for extra in extras]


def attached_as_text(child: str, parent: str) -> str:
    """The value of `objects` by which an object can be attached to another."""
    return f"{PREFIX}{ATTACHED}:{child}>{parent}"


def _checked(extra: str) -> str:
    name, colon, pair = extra.partition(":")
    child, arrow, where = pair.partition(">")
    parent, at, place = where.partition("@")
    if name not in EXTRAS or (name == ATTACHED) != bool(child and arrow and parent) or (name != ATTACHED and colon):
        raise Ig2mjError(f"'{PREFIX}{extra}' is no further state: {FORM}")
    if name == ATTACHED and child == parent:
        raise Ig2mjError(f"'{PREFIX}{extra}': '{child}' cannot be attached to itself")
    if at and _place(place) is None:
        raise Ig2mjError(f"'{PREFIX}{extra}': a place is three numbers, X,Y,Z, in metres")
    return extra


def _place(text: str) -> tuple[float, float, float] | None:
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError:
        return None
    return (x, y, z) if all(map(math.isfinite, (x, y, z))) else None


def names_of(extras: Sequence[str]) -> tuple[str, ...]:
    """The states of a scene with these extras."""
    found = {extra.partition(":")[0] for extra in extras}
    return tuple(name for name in EXTRAS if name in found)


def pairs_of(extras: Sequence[str]) -> list[Pair]:
    """What can be attached to what. A pair that is named twice has the place that is named last."""
    own = [extra.removeprefix(f"{ATTACHED}:") for extra in extras if extra.startswith(f"{ATTACHED}:")]
    found: dict[tuple[str, str], Pair] = {}
    for child, _, where in (pair.partition(">") for pair in own):
        parent, _, place = where.partition("@")
        found[child, parent] = Pair(child, parent, _place(place))
    return list(found.values())


def joint_name(child: str, parent: str) -> str:
    """Of the constraint by which an object is attached to another."""
    return f"attached/{child}/{parent}"


def add_joints(spec: mujoco.MjSpec, manifest: Manifest) -> None:
    """Adds the constraints of pairs that can be attached to a scene that is not compiled yet.

    Raises:
      UnknownNameError: the scene has no such object. Ig2mjError: a child is fixed.
    """
    entries = {o.name: o for o in manifest.objects}
    for child, parent, _ in pairs_of(manifest.extras):
        for name in (child, parent):
            if name not in entries:
                raise UnknownNameError("object", name, entries)
        if entries[child].fixed:
            raise Ig2mjError(f"'{child}' is fixed: it cannot be attached to '{parent}' (name the loose one first)")
        spec.add_equality(
            name=joint_name(child, parent),
            type=mujoco.mjtEq.mjEQ_WELD,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=entries[parent].bodies[0],
            name2=entries[child].bodies[0],
            active=False,
            solref=[TIME_CONSTANT, 1.0],
            solimp=[*IMPEDANCE, 0.5, 2.0],
        )
