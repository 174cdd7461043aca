"""The light of a home by day and by night: fixed directions, so that every renderer computes the same.

Light indoors is soft: an ambient part, a warm key light, and fill from other directions, so that no side is near black.
Nothing casts shadows; those of furniture and corners are in textures (`surfaces`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

SUN = "sun"
"""Name of the light that homes have."""

Vector = tuple[float | int, float | int, float | int]


@dataclasses.dataclass(frozen=True)
class Light:
    """Attributes: ambient: rgb from everywhere. lamps: direction in which light goes (unit length not needed), rgb.
    outside: factor of the garden's colours. glow: emission of lamps. sun: whether it falls through windows."""

    ambient: Vector
    lamps: tuple[tuple[Vector, Vector], ...]
    outside: Vector
    glow: float | int
    sun: bool


KEY = (0.46, 0.60, -0.75)
"""Direction of the sun's light."""

DAY = Light(
    ambient=(0.66, 0.655, 0.65),
    lamps=(
        (KEY, (0.33, 0.31, 0.26)),
        ((-0.75, -0.45, -0.30), (0.17, 0.18, 0.19)),
        ((0.1, -0.2, 1.0), (0.28, 0.27, 0.25)),
    ),
    outside=(1.0, 1.0, 1.0),
    glow=0.55,
    sun=True,
)
NIGHT = Light(
    ambient=(0.45, 0.40, 0.34),
    lamps=(
        ((0.25, 0.35, -0.9), (0.42, 0.34, 0.22)),
        ((-0.6, -0.3, -0.3), (0.18, 0.145, 0.10)),
        ((0.1, -0.2, 1.0), (0.32, 0.27, 0.19)),
    ),
    outside=(0.20, 0.24, 0.36),
    glow=1.0,
    sun=False,
)


def set_light(spec: mujoco.MjSpec, light: Light) -> None:
    """Replaces the light of a scene that is not compiled yet. Its own lights keep their numbers."""
    head = spec.visual.headlight
    head.ambient, head.diffuse, head.specular = light.ambient, [0.0] * 3, [0.0] * 3
    own = list(spec.lights)
    sun = next((one for one in own if one.name == SUN), None)
    for one in own:
        one.castshadow = False
        if one is not sun:
            one.active = False
    rest = list(light.lamps)
    if sun is not None:
        _set(sun, *rest.pop(0))
    for number, lamp in enumerate(rest):
        _set(spec.worldbody.add_light(name=f"ig2mj/light_{number}"), *lamp)


def _set(one, direction: Vector, colour: Vector) -> None:
    one.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    one.dir = np.asarray(direction) / np.linalg.norm(direction)
    one.diffuse, one.ambient, one.specular = colour, [0.0] * 3, [0.0] * 3
    one.castshadow, one.active = False, True


@dataclasses.dataclass(frozen=True)
class Bulb:
    """A lamp that is on. Attributes: pos: m, world. rgb: 0..1. reach: attenuation: constant, linear, quadratic."""

    pos: tuple[float, ...]
    rgb: tuple[float, ...]
    reach: tuple[float, ...]


def shade(
    normals: np.ndarray,
    light: Light,
    emission: float | int = 0.0,
    points: np.ndarray | None = None,
    bulbs: Sequence[Bulb] = (),
) -> np.ndarray:
    """What falls on surfaces with these normals [V, 3], rgb of 0..1 [V, 3]. points: [V, 3], m, needed for bulbs."""
    total = np.tile(np.asarray(light.ambient) + emission, (len(normals), 1))
    for direction, colour in light.lamps:
        d = np.asarray(direction) / np.linalg.norm(direction)
        total += np.maximum(-(normals @ d), 0)[:, None] * np.asarray(colour)
    for bulb in bulbs:
        assert points is not None, "the light of bulbs depends on where a surface is"
        to = np.asarray(bulb.pos) - points
        far = np.maximum(np.linalg.norm(to, axis=1), 1e-6)
        strength = np.maximum((normals * to).sum(1) / far, 0) / (np.array(bulb.reach) @ [far**0, far, far**2])
        total += strength[:, None] * np.asarray(bulb.rgb)
    return np.clip(total, 0, 1)


def linear_lights(light: Light) -> tuple[np.ndarray, np.ndarray]:
    """Ambient rgb [3] and each lamp's rgb [n, 3] with which a renderer that computes in linear colours comes nearest
    to `shade`: of all directions of a surface, the mean square error is the least."""
    k = np.arange(400) + 0.5
    z, angle = 1 - 2 * k / len(k), np.pi * (1 + 5**0.5) * k
    normals = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], 1)
    directions = np.array([np.asarray(d) / np.linalg.norm(d) for d, _ in light.lamps])
    parts = np.column_stack([np.ones(len(normals)), np.maximum(-(normals @ directions.T), 0)])
    found = np.linalg.lstsq(parts, shade(normals, light) ** 2.2, rcond=None)[0]
    return np.maximum(found[0], 0), np.maximum(found[1:], 0)
