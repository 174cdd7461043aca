"""Where objects are that transition rules have used up, or have not made yet: on a slab far outside the house.

A scene has the slab only if a rule in use (`ig2mj.knowledge.transitions`) uses up or makes one of its objects.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.knowledge.transitions import Transition, stands_for, transitions_of
from ig2mj.scene.manifest import BUILDING, Manifest

SLAB = "parking_of_rules"

CELL = 0.8
"""m between the middles of what stands on the slab."""

FAR = 90.0
"""m from the origin to the slab, along -y."""


def rules_in_use(substances: Sequence[str], categories: Sequence[str]) -> tuple[Transition, ...]:
    """The transition rules of a scene with these substances and objects."""
    return transitions_of(substances, set(categories))


def changing(rules: Sequence[Transition], categories: Sequence[str], fixed: Sequence[bool]) -> list[int]:
    """Objects that rules use up or make, by index. `categories`, `fixed`: of all objects."""
    kinds = {kind for rule in rules for kind, _ in rule.objects} | {rule.output for rule in rules if rule.count}
    if not kinds:
        return []
    matching = {c for c in set(categories) - BUILDING if any(stands_for(kind, c) for kind in kinds)}
    return [o for o, category in enumerate(categories) if category in matching and not fixed[o]]


def places(count: int) -> Float[np.ndarray, "N 3"]:
    """Points on the slab for so many objects, m, world frame."""
    columns = max(math.ceil(math.sqrt(count)), 1)
    number = np.arange(count)
    x, y = (number % columns - (columns - 1) / 2) * CELL, -FAR - (number // columns) * CELL
    return np.stack([x, y, np.zeros(count)], axis=-1)


def add_parking(spec: mujoco.MjSpec, manifest: Manifest) -> None:
    """Adds the slab to a scene that is not compiled yet, if a rule in use needs it."""
    if not manifest.substances:
        return
    categories = [o.category for o in manifest.objects]
    count = len(
        changing(rules_in_use(manifest.substances, categories), categories, [o.fixed for o in manifest.objects])
    )
    if not count:
        return
    points = places(count)
    low, high = points.min(0) - CELL, points.max(0) + CELL
    body = spec.worldbody.add_body(name=SLAB, pos=[*((low + high)[:2] / 2).tolist(), -0.1])
    half = (high - low)[:2] / 2
    body.add_geom(
        name=f"{SLAB}/collision_0", type=mujoco.mjtGeom.mjGEOM_BOX, size=[*half.tolist(), 0.1], group=3, gap=0.003
    )
