"""Does a model look like a thing of this world? Warnings about wrong units, wrong masses and shapes that do not fit."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..base.description import ObjectModel
from ..bodies.assembly import MIN_MASS, Assembly, BodyPlan
from ..bodies.kinematics import model_bounds

SMALLEST, LARGEST = 1e-3, 20.0
"""Metres along each axis: what is thinner or larger is likely to be in another unit, or too thin for contacts."""
LIGHTEST, HEAVIEST = 5.0, 20_000.0
"""kg per m3 of the collision geometry: foam board, and a little more than gold."""
MOST_RATIO = 2.0
"""Collision box against visual box along an axis, either way."""
SLACK = 0.02
"""Metres by which the two boxes may always differ."""
BUILDING = ("walls", "floors", "ceilings")
"""Categories of building parts: as large and as thin as a house has them, and they do not move."""


def implausible(model: ObjectModel, assembly: Assembly) -> list[str]:
    """Warnings about a scaled model, one line each."""
    collision, visual = model_bounds(model), model_bounds(model, visuals=True)
    if collision is None:
        return ["has no collision geometry: nothing touches it" if visual is not None else "has no geometry at all"]
    if model.category in BUILDING:
        return []
    odd = [*_odd_extents(model, collision), *_boxes_apart(collision, visual)]
    return [*odd, *_odd_densities(assembly), *_far_centres(assembly)]


def _odd_extents(model: ObjectModel, box: np.ndarray) -> list[str]:
    size = box[1] - box[0]
    unit = f"are its meshes in another unit? (<mesh scale=...> in {model.file.name})"
    if size.max() > LARGEST or size.max() < SMALLEST:
        return [f"is {size.max():.3g} m across: {unit}"]
    if size.min() < SMALLEST:
        return [f"is {size.min() * 1000:.2g} mm thin, and contacts want {SMALLEST * 1000:g} mm"]
    return []


def _boxes_apart(collision: np.ndarray, visual: np.ndarray | None) -> list[str]:
    if visual is None:
        return []
    solid, drawn = collision[1] - collision[0], visual[1] - visual[0]
    ratio = np.maximum(solid, 1e-6) / np.maximum(drawn, 1e-6)
    apart = (np.maximum(ratio, 1 / ratio) > MOST_RATIO) & (np.abs(solid - drawn) > SLACK)
    if not apart.any():
        return []
    axis = int(np.argmax(np.where(apart, np.abs(np.log(ratio)), 0.0)))
    return [f"is {solid[axis]:.3g} m along {'xyz'[axis]} where it collides, and {drawn[axis]:.3g} m where it is seen"]


def _odd_densities(assembly: Assembly) -> list[str]:
    """Of each body that has a mass of its own and collision geometry; the worst three are named."""
    found = []
    for body in assembly.bodies:
        volume = _volume(body)
        if volume <= 0 or body.inertial.mass <= MIN_MASS:
            continue
        density = body.inertial.mass / volume
        if not LIGHTEST <= density <= HEAVIEST:
            found.append((abs(np.log(density / 1000.0)), body.name, body.inertial.mass, density))
    found.sort(reverse=True)
    return [
        f"link '{name}' weighs {mass:.3g} kg, {density:.3g} kg/m3 of its collision geometry"
        for _, name, mass, density in found[:3]
    ]


def _far_centres(assembly: Assembly) -> list[str]:
    """Of bodies whose centre of mass lies further outside the box of their collision geometry than it is large."""
    found = []
    for body in assembly.bodies:
        if not body.collisions or body.inertial.mass <= MIN_MASS:
            continue
        points = np.concatenate([piece.vertices for piece in body.collisions])
        low, high, centre = points.min(axis=0), points.max(axis=0), body.inertial.pose[:3, 3]
        outside = float(np.linalg.norm(np.maximum(np.maximum(low - centre, centre - high), 0.0)))
        if outside > np.linalg.norm(high - low) + SLACK:
            found.append(f"link '{body.name}' has its centre of mass {outside:.3g} m outside of its collision geometry")
    return found[:3]


def _volume(body: BodyPlan) -> float:
    volume = 0.0
    for piece in body.collisions:
        try:
            volume += ConvexHull(piece.vertices).volume
        except (QhullError, ValueError):
            continue  # flat
    return volume
