"""What states look like besides colours: steam of what is hot, smoke of what is burnt, frost, drops, lamps that glow;
and substances (`ig2mj.viewer.substance_marks`).

They are marks (`ig2mj.viewer.state_marks`): drawn in images, videos and windows for people, and in no robot's camera.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.sensors.substance_slots import STEAMS
from ig2mj.sensors.tints import TINTS, WATER_COLOUR
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.viewer.state_marks import Mark, tint_of_objects
from ig2mj.viewer.substance_marks import substance_marks

PUFFS, RISE, PERIOD = 14, 0.26, 1.6
"""Number of puffs, m to which they rise, and s of one's rise."""

STEAM, SMOKE, FROST, GLOW = (
    (0.98, 0.98, 1.0, 0.13),
    (0.22, 0.22, 0.22, 0.18),
    (0.93, 0.97, 1.0, 0.95),
    (1.0, 0.86, 0.55, 0.20),
)
"""rgba."""

CRYSTALS, DROPS = 34, 26
"""Numbers of frost crystals and of drops on one object."""

FLAT = 0.7
"""Height as a share of the lesser width below which an object is flat, such as a towel."""

LIGHTS = ("lamp", "candle")
"""Words in categories of what glows when it is on."""

_NAMES = tuple(tint.predicate.name for tint in TINTS)


def effects(
    model: StateModel,
    states: ExtendedStates,
    view: PhysicsView,
    world: int = 0,
    time: float | int = 0.0,
    tint: Int[np.ndarray, "O"] | None = None,
) -> list[Mark]:
    """Marks of one world. time: s, by which steam moves. tint: `tint_of_objects`; None: it is computed."""
    found = list[Mark]()
    tint = tint_of_objects(model, states, world) if tint is None else tint
    temperature = np.asarray(states.temperature)[world]
    tables, thermal = model.tables, model.parameters.thermal
    low, high = (np.asarray(getattr(view, name))[world] for name in ("aabb_low", "aabb_high"))
    for k in range(tables.num_objects):
        if tables.object_parked[k] or (tables.object_fixed[k] and _NAMES[tint[k]] != "toggled_on"):
            continue
        state = _NAMES[tint[k]] if tint[k] >= 0 else ""
        if thermal[k] and np.isfinite(temperature[k]) and temperature[k] > STEAMS:
            found += _rising(low[k], high[k], SMOKE if state == "burnt" else STEAM, k, time)
        if state == "frozen":
            found += _on_surface(low[k], high[k], CRYSTALS, FROST, k, frost=True)
        elif state == "soaked":
            found += _on_surface(low[k], high[k], DROPS, (*WATER_COLOUR, 0.75), k, frost=False)
        elif state == "toggled_on" and any(word in tables.object_categories[k] for word in LIGHTS):
            top = np.array([*(low[k] + high[k])[:2] / 2, high[k][2] - 0.1])
            for radius in (0.05, 0.09, 0.14):
                found.append(Mark(mujoco.mjtGeom.mjGEOM_SPHERE, (radius,) * 3, top, np.eye(3), GLOW))
    return found + substance_marks(model, states, view, world, time)


def _rising(low: np.ndarray, high: np.ndarray, rgba: tuple[float, ...], seed: int, time: float | int) -> list[Mark]:
    """Puffs above a box that widen and fade as they rise."""
    middle, wide = (low + high) / 2, 0.25 * float(min((high - low)[:2]))
    puffs = []
    for k in range(PUFFS):
        share = (k / PUFFS + time / PERIOD) % 1.0
        angle = 2.4 * k + seed + 2.0 * share
        sway = min(wide, 0.05) * (0.6 + share)
        pos = np.array(
            [middle[0] + sway * math.cos(angle), middle[1] + sway * math.sin(angle), high[2] + 0.01 + RISE * share]
        )
        size = 0.012 + 0.026 * share
        faded = (rgba[0], rgba[1], rgba[2], rgba[3] * (1 - share) * min(1.0, 6 * share + 0.3))
        puffs.append(Mark(mujoco.mjtGeom.mjGEOM_ELLIPSOID, (size, size, 1.35 * size), pos, np.eye(3), faded))
    return puffs


def _on_surface(
    low: np.ndarray, high: np.ndarray, count: int, rgba: tuple[float, ...], seed: int, frost: bool
) -> list[Mark]:
    """Crystals or drops on the upper part of the ellipsoid in a box; on the top of what is flat."""
    rng = np.random.default_rng(seed)
    middle, half = (low + high) / 2, (high - low) / 2
    marks = []
    for _ in range(count):
        z, angle = float(rng.uniform(-0.2, 0.97)), float(rng.uniform(0, 2 * math.pi))
        level = math.sqrt(1 - z * z)
        out = np.array([level * math.cos(angle), level * math.sin(angle), z])
        if half[2] < FLAT * min(half[:2]):
            out = np.array([*rng.uniform(-0.85, 0.85, 2), 1.0])
        normal = out / np.maximum(half, 1e-4) * ((0.0, 0.0, 1.0) if out[2] == 1.0 else (1.0, 1.0, 1.0))
        axes = _frame(normal / np.linalg.norm(normal), angle)
        pos = middle + half * out
        if frost:
            size = (
                float(rng.uniform(0.0015, 0.004)),
                float(rng.uniform(0.0015, 0.004)),
                float(rng.uniform(0.002, 0.007)),
            )
            marks.append(Mark(mujoco.mjtGeom.mjGEOM_BOX, size, pos, axes, (rgba[0], rgba[1], rgba[2], rgba[3])))
        else:
            r = float(rng.uniform(0.0025, 0.0055))
            marks.append(
                Mark(mujoco.mjtGeom.mjGEOM_ELLIPSOID, (r, r, 0.6 * r), pos, axes, (rgba[0], rgba[1], rgba[2], rgba[3]))
            )
    return marks


def _frame(normal: Float[np.ndarray, "3"], turn: float) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix whose third column is the normal."""
    x = np.cross([math.cos(turn), math.sin(turn), 0.3], normal)
    x /= max(float(np.linalg.norm(x)), 1e-9)
    return np.stack([x, np.cross(normal, x), normal], axis=1)
