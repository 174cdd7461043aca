"""How states look in the browser: colours of objects, and particles on their surfaces.

Axes: O objects, N particles.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from ig2mj.sensors.tints import DUST_COLOUR, STAIN_COLOUR, TINTS, UNTINTED, WATER_COLOUR, tints
from ig2mj.states import particles
from ig2mj.states.definitions.temperature import AMBIENT_TEMPERATURE
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.web.geometry import PLAIN, Look

COLOURS = ("states", "temperature", "wetness", "plain")
"""What the colours of objects tell: what a camera sees and how hot, cold or wet something is; one of these alone, on
grey; or nothing."""

HOT, COLD, WET = (1.0, 0.25, 0.05), (0.45, 0.75, 1.0), (0.05, 0.25, 0.85)
_GREY = (0.72, 0.72, 0.72)
HOTTEST, COLDEST = 200.0, -20.0
"""Degrees Celsius at which an object has all of its colour: what ovens and freezers of the abilities reach."""
LEVELS = 8
"""Steps of a colour: an object that warms up is sent again as often as this, not all the time."""


def looks_of(model: StateModel, states: ExtendedStates, row: int, colours: str = "states") -> dict[int, Look]:
    """How each object looks that does not look plain; `colours` is one of `COLOURS`."""
    if colours == "plain":
        return {}
    p, found = model.parameters, {}
    temperature, wetness = np.asarray(states.temperature)[row], np.asarray(states.wetness)[row]
    tint = np.asarray(tints(model, states))[row] if colours == "states" else None
    soakable = p.has("soakable")
    for o in range(model.tables.num_objects):
        heat, water = _heat(float(temperature[o])) if p.thermal[o] else 0.0, _water(float(wetness[o]))
        if tint is not None:
            if tint[o] != UNTINTED:
                look = TINTS[tint[o]]
                found[o] = Look(look.weight, look.colour, look.brightness)
            elif heat:
                found[o] = Look(0.55 * abs(heat), HOT if heat > 0 else COLD)
            elif water and soakable[o]:
                found[o] = Look(0.5 * water, WET)
        elif colours == "temperature":
            found[o] = Look(0.9, _mixed(_GREY, HOT if heat > 0 else COLD, abs(heat)))
        else:
            found[o] = Look(0.9, _mixed(_GREY, WET, water if soakable[o] else 0.0))
    return {o: look for o, look in found.items() if look != PLAIN}


def _heat(temperature: float) -> float:
    """-1 (as cold as it gets) .. 0 (room temperature) .. 1 (as hot as it gets), in steps; a little shows soon."""
    end = HOTTEST if temperature > AMBIENT_TEMPERATURE else COLDEST
    share = (temperature - AMBIENT_TEMPERATURE) / abs(end - AMBIENT_TEMPERATURE)
    share = float(np.sign(share) * np.sqrt(abs(share)))
    return float(np.clip(np.trunc(share * LEVELS) / LEVELS, -1, 1)) if np.isfinite(share) else 0.0


def _water(wetness: float) -> float:
    """0 (dry) .. 1, in steps; a drop shows, ten are all."""
    return float(np.clip(np.ceil(wetness / 10 * LEVELS) / LEVELS, 0, 1)) if np.isfinite(wetness) else 0.0


def _mixed(a: tuple[float, ...], b: tuple[float, ...], share: float) -> tuple[float, float, float]:
    x, y, z = ((1 - share) * p + share * q for p, q in zip(a, b, strict=True))
    return x, y, z


@dataclasses.dataclass(frozen=True)
class Patches:
    """Particles of one kind on one body, in its frame (metres).

    Attributes: scale: half sizes along x, y and the normal.
    """

    pos: Float[np.ndarray, "N 3"]
    quat: Float[np.ndarray, "N 4"]
    scale: Float[np.ndarray, "N 3"]
    rgb: tuple[float, float, float]
    round: bool


def patches_of(model: StateModel, states: ExtendedStates, row: int) -> Mapping[tuple[str, int], Patches]:
    """Dust and stains by kind and MuJoCo body. They stand still in the frame of the body that they stick to."""
    p, found = model.parameters, {}
    sizes = particles.stain_sizes(model.tables.object_bbox[p.stain_rows]) / 2
    for kind, rows in (("dust", states.dust), ("stain", states.stain)):
        alive = np.asarray(rows.alive)[row]
        if not alive.any():
            continue
        body, pos, normal = (np.asarray(getattr(rows, name))[row][alive] for name in ("body", "pos", "normal"))
        if kind == "dust":
            scale = np.full((len(pos), 3), particles.DUST_RADIUS)
        else:
            edge = np.broadcast_to(sizes, alive.shape)[alive]
            scale = np.stack([edge, edge, np.full(len(edge), particles.STAIN_THICKNESS / 2)], 1)
        rgb = DUST_COLOUR if kind == "dust" else STAIN_COLOUR
        for b in np.unique(body):
            here = body == b
            found[kind, int(b)] = Patches(pos[here], upright(normal[here]), scale[here], rgb, kind == "dust")
    return found


def drops_of(states: ExtendedStates, row: int) -> Float[np.ndarray, "N 3"]:
    """Water drops in the air, world frame."""
    return np.asarray(states.water.pos)[row][np.asarray(states.water.active)[row]].astype(np.float32)


def upright(normal: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 4"]:
    """Rotations (w-x-y-z) that turn the z axis into these directions, the short way."""
    n = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    quat = np.stack([1 + n[:, 2], -n[:, 1], n[:, 0], np.zeros(len(n))], 1)
    quat[n[:, 2] < -0.9999] = [0, 1, 0, 0]
    return quat / np.linalg.norm(quat, axis=-1, keepdims=True)


__all__ = ["COLOURS", "WATER_COLOUR", "Patches", "drops_of", "looks_of", "patches_of", "upright"]
