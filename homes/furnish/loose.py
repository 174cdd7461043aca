"""Small objects put on something or into it."""

from __future__ import annotations

import functools
from collections.abc import Iterable

import numpy as np

from ..objects.catalogue import find
from ..shapes.surfaces import Surface, insides, tops
from .arrangement import AIR, FLAT
from .placed import Placed, lying, yaw
from .room import RoomBase

MOST_POSES = 8  # stable orientations of a model at most (poses.MOST)


class LooseKit(RoomBase):
    """Puts objects on tops, and in cupboards, fridges, drawers and shelves."""

    def on(self, host: Placed, category: str, *, index: int | None = None, at: tuple[float, float] | str | None = None,
           degrees: float | None = None, scale: float = 1.0, tries: int = 24, surface: Surface | None = None,
           highest: bool = False, stand: int | None = None) -> Placed | None:  # fmt: skip
        """Puts something on top of another.

        Args:
          at: x, y in the host's frame, or "middle" of the surface; None: anywhere it fits.
          degrees: its yaw against the host's front; None: any.
          surface: which; default: one of the host's tops, the largest first. highest: the highest first.
          stand: number of its stable orientation; default: as built where it is stable so.
        """
        index = self.home.index(category) if index is None else index
        found = [surface] if surface else tops(host.category, host.index, host.seed)
        if highest:
            found = sorted(found, key=lambda s: -s.z)
        return self._put(host, category, index, found[:4], at, degrees, scale, tries, stand)

    def inside(self, host: Placed, category: str, *, index: int | None = None, degrees: float | None = None,
               scale: float = 1.0, tries: int = 24, surface: Surface | None = None,
               stand: int | None = None) -> Placed | None:  # fmt: skip
        """Puts something into a cupboard, a fridge, a drawer, on a shelf: under something of the same object."""
        index = self.home.index(category) if index is None else index
        found = [surface] if surface else self.shuffled(list(insides(host.category, host.index, host.seed)))
        return self._put(host, category, index, found[:6], None, degrees, scale, tries, stand)

    def _put(self, host, category, index, found: Iterable[Surface], at, degrees, scale, tries, stand) -> Placed | None:
        resting_pose = resting(category, index, stand, self.home.seed)
        for surface in found:
            for _ in range(1 if at is not None and degrees is not None else tries):
                angle = self.rng.uniform(-180, 180) if degrees is None else degrees
                thing = self.thing(category, index, np.zeros(3), host.rotation @ yaw(angle) @ resting_pose)
                x0, y0, x1, y1 = (v * host.scale for v in surface.rect)
                if isinstance(at, str):
                    x, y = (x0 + x1) / 2, (y0 + y1) / 2
                else:
                    x, y = at if at is not None else (self.rng.uniform(x0, x1), self.rng.uniform(y0, y1))
                thing.scale, thing.host = scale, host.name
                local = thing.box()
                spot = host.world(np.array([x, y, surface.z * host.scale]) / host.scale)
                middle = local.mean(0)
                thing.position = np.array([spot[0] - middle[0], spot[1] - middle[1], spot[2] + AIR - local[0, 2]])
                if (at is None or host.category in FLAT) and not _within(thing, host, surface):
                    self.problem = self.problem or f"reaches beyond {host.name}"
                    continue
                if surface.inside and local[1, 2] - local[0, 2] > surface.room - 0.004:
                    self.problem = self.problem or f"is too high for {host.name}"
                    break
                if problem := self.home.things.obstacle(
                    thing, ignore=(host.name, host.host or ""), ways=host.category in FLAT
                ):
                    self.problem = self.problem or problem
                    continue
                if host.category in FLAT:  # what stands on a carpet stands in a robot's way
                    if not self.home.ground.allows(thing):
                        continue
                    self.home.ground.occupy(thing)
                thing.name = self.home.things.name(category)
                return self.home.things.put(thing)
        return None


@functools.cache
def resting(category: str, index: int, stand: int | None = None, seed: int = 0) -> np.ndarray:
    """Rotation [3, 3] in which a model is put down: as built where that is one of its stable orientations."""
    if stand is not None:
        return lying(category, index, stand, seed)
    if find(category).rest == "upright":
        return np.eye(3)
    for number in range(MOST_POSES):
        turn = lying(category, index, number, seed)
        if np.allclose(turn, np.eye(3), atol=0.02):
            return turn
    return lying(category, index, 0, seed)


def _within(thing: Placed, host: Placed, surface: Surface) -> bool:
    """Whether an object's box, seen from the host, stays on the surface."""
    points = np.concatenate(thing.hulls())
    local = (points - host.position) @ host.rotation / host.scale
    low, high = local[:, :2].min(0), local[:, :2].max(0)
    x0, y0, x1, y1 = surface.rect
    over = 0.0 if surface.inside else 0.006
    return bool(low[0] >= x0 - over and low[1] >= y0 - over and high[0] <= x1 + over and high[1] <= y1 + over)
