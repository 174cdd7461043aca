"""`Entry`: one line of the catalogue, that is one category that can be built."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Callable, Mapping
from typing import Any

from ..shapes.materials import Material

Family = Callable[..., None]

AG_MASS = 5.0
"""kg: lighter free objects may be held by assisted grasping (`enable_ag`)."""


@dataclasses.dataclass(frozen=True)
class Entry:
    """One line of the catalogue.

    Attributes:
      category: iGibson's category name.
      build: the family function; called as build(builder, **options).
      size: real (depth x, width y, height z) in metres as it stands; the front looks along +x.
      mass: kilograms of a model of that size, contents included.
      count: how many models. extra: further ones, numbered on, for the object library alone: no home has them, and
        the category's mean size and mass do not count them.
      fixed: furniture that is screwed or too heavy to be free in a scene.
      rest: "any" (put down on any stable side), "standing" (mostly as built) or "upright" (only as built).
      vary: each edge is multiplied by a random factor of 1 +- vary; uniform: all three by the same.
      wide: extra models vary twice as much.
      flesh: material of the cut faces; given for sliceable categories, whose models then come with halves.
      two_hands: may be held by assisted grasping, where it is free, although it is heavier than `AG_MASS` or mostly
        fixed: two hands carry it.
      options: further keyword arguments of `build`.
    """

    category: str
    build: Family
    size: tuple[float, float, float]
    mass: float
    count: int = 3
    fixed: bool = False
    extra: int = 0
    rest: str = "any"
    vary: float = 0.08
    uniform: bool = False
    wide: bool = False
    flesh: Callable[[random.Random], Material] | None = None
    two_hands: bool = False
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def enable_ag(self) -> bool:
        return self.two_hands or (not self.fixed and self.mass <= AG_MASS)
