"""Saved extended states of iGibson (the `states` JSON, iGibson's dataset format) in ig2mj's names.

The manifest's `ObjectEntry.state` then holds, each only where the source had it:

    temperature, max_temperature   degrees C; no max_temperature where the source says -Infinity (never heated yet)
    wetness                        droplets: the soaking threshold for a soaked object, else 0
    toggled_on, press_count        the switch, and for how many steps a finger has been at it
    sliced                         bool
    dust, stain                    particles: null (cleaned), or {"body", "pos", "quat"} in that body's frame
    stain_sizes                    [x, y, z] of each stain particle, m
    water                          {"steps_since_drop": int or null, "drops": [null or [x, y, z] in the world]}
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..base.transforms import quat_from_rotation, rotation_from_wxyz, wxyz

#: Particles saved farther from their object than this (m) were saved while it was parked elsewhere (sliced.py).
MAX_PARTICLE_DISTANCE = 10.0

#: Link name as saved (or None for the base) -> MJCF body and its 4x4 world pose.
LinkFrame = Callable[[str | None], tuple[str, np.ndarray]]


def convert_states(
    states: Mapping[str, Any], soaking_threshold: float, link_frame: LinkFrame
) -> tuple[dict[str, Any], list[str]]:
    """Turns one object's saved states into ours; values of the wrong form are left out with a warning.

    Args:
      states: class name -> dump, as in the file.
      soaking_threshold: droplets at which the object counts as soaked.
      link_frame: where the object's links are in the start state: particles are saved in the world's frame.

    Returns:
      the state, and warnings.
    """
    found: dict[str, Any] = {}
    warnings: list[str] = []
    for name, value in states.items():
        convert = _CONVERTERS.get(name)
        if convert is None or value is None:
            continue
        try:
            found.update(convert(value, soaking_threshold, link_frame))
        except (TypeError, ValueError, KeyError, IndexError) as e:
            warnings.append(f"saved state '{name}' has an unexpected form and is left out: {e}")
    return found, warnings


def _temperature(value: Any, *_: Any) -> dict[str, Any]:
    return _finite("temperature", value)


def _max_temperature(value: Any, *_: Any) -> dict[str, Any]:
    return _finite("max_temperature", value)


def _finite(name: str, value: Any) -> dict[str, Any]:
    number = float(value)
    return {name: number} if math.isfinite(number) else {}


def _soaked(value: Any, threshold: float, _: LinkFrame) -> dict[str, Any]:
    return {"wetness": float(threshold) if value else 0.0}


def _toggled(value: Any, *_: Any) -> dict[str, Any]:
    if isinstance(value, Mapping):
        return {"toggled_on": bool(value["value"]), "press_count": int(value.get("hand_in_marker_steps", 0))}
    return {"toggled_on": bool(value)}


def _sliced(value: Any, *_: Any) -> dict[str, Any]:
    return {"sliced": bool(value)}


def _dusty(value: Any, _: float, link_frame: LinkFrame) -> dict[str, Any]:
    return {"dust": _particles(value["particles"], link_frame)}


def _stained(value: Any, _: float, link_frame: LinkFrame) -> dict[str, Any]:
    particles = value["particles"]
    if not isinstance(particles, Mapping):
        return {"stain": _particles(particles, link_frame)}
    found: dict[str, Any] = {"stain": _particles(particles["dirt_dump"], link_frame)}
    sizes = particles.get("random_bbox_dims")
    if sizes is not None:
        found["stain_sizes"] = [_vector(size) for size in sizes]
    return found


def _water(value: Any, *_: Any) -> dict[str, Any]:
    steps = value.get("steps_since_last_drop_step")
    steps = int(steps) if steps is not None and math.isfinite(float(steps)) else None
    drops = [None if pose is None else _vector(pose[0]) for pose in value.get("particle_poses", [])]
    return {"water": {"steps_since_drop": steps, "drops": drops}}


def _particles(dump: Any, link_frame: LinkFrame) -> list[dict[str, Any] | None]:
    """World poses (x, y, z, w quaternions) into the frames of the bodies that carry them."""
    particles: list[dict[str, Any] | None] = []
    for entry in dump:
        if entry is None:
            particles.append(None)
            continue
        link, position, quat = entry
        body, frame = link_frame(link)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation_from_wxyz(wxyz(np.asarray(quat))), _vector(position)
        local = np.linalg.inv(frame) @ pose
        if np.linalg.norm(local[:3, 3]) > MAX_PARTICLE_DISTANCE:
            raise ValueError(f"a particle lies {np.linalg.norm(local[:3, 3]):.0f} m from its object")
        particles.append(
            {"body": body, "pos": _rounded(local[:3, 3]), "quat": _rounded(quat_from_rotation(local[:3, :3]))}
        )
    return particles


def _rounded(values: np.ndarray) -> list[float]:
    """To 1 micrometre, so that the same scene gives the same bytes."""
    return [round(float(v), 6) + 0.0 for v in values]


def _vector(values: Any) -> list[float]:
    vector = np.asarray(values, dtype=float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ValueError(f"{values!r} is not a position")
    return _rounded(vector)


_CONVERTERS: dict[str, Callable[..., dict[str, Any]]] = {
    "Temperature": _temperature,
    "MaxTemperature": _max_temperature,
    "Soaked": _soaked,
    "ToggledOn": _toggled,
    "Sliced": _sliced,
    "Dusty": _dusty,
    "Stained": _stained,
    "WaterSource": _water,
}
