"""`Split`: which start states, models, homes and instructions episodes take.

| split | start states | models | homes | instructions |
|---|---|---|---|---|
| `train` | train | train | the task's own, or `TRAIN_HOMES` | train |
| `held_out` | held out | train | as train | train |
| `held_out:objects` | held out | held out | as train | train |
| `held_out:homes` | held out | train | `HELD_OUT_HOMES` | train |
| `held_out:all` | held out | held out | `HELD_OUT_HOMES` | held out |

`ig2mj.Randomize` says whether models and instructions vary at all; the split says within which of them. Models of a
category are divided 75 to 25 by a hash of their names. A category of fewer than `FEWEST` models is not divided: both
parts have all of them (`undivided`).
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Mapping, Sequence

from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.tasks.spots import home_and_place

TRAIN_HOMES = ("birch", "cedar", "alder", "larch", "linden", "maple", "rowan", "spruce")
"""Homes that policies are trained in."""

HELD_OUT_HOMES = ("elm", "juniper", "poplar", "willow")
"""Homes that they have not seen."""

FEWEST = 4
"""Models of a category that is divided, at least."""

PART = 4
"""One model in so many is held out."""


@dataclasses.dataclass(frozen=True)
class Split:
    """Parts of each kind, "train" or "held_out". Attributes: name: as `make` takes it."""

    name: str
    starts: str = "train"
    models: str = "train"
    homes: str = "train"
    instructions: str = "train"

    @classmethod
    def of(cls, name: str) -> Split:
        """By its name. Raises UnknownNameError: there is no such split; with near matches."""
        if name not in SPLITS:
            raise UnknownNameError("split", str(name), SPLITS)
        return SPLITS[name]

    def check_home(self, home: object) -> None:
        """Raises EngineError: this home is not of the split, which says that homes are held out."""
        name = home_and_place(home)[0] if isinstance(home, str) else home
        if self.homes == "held_out" and home is not None and name not in HELD_OUT_HOMES:
            raise EngineError(
                f"split='{self.name}' takes held-out homes ({', '.join(HELD_OUT_HOMES)}), and home='{home}' is none "
                "(leave home out, or take split='held_out')"
            )


_OUT = "held_out"
SPLITS: dict[str, Split] = {
    split.name: split
    for split in (
        Split("train"),
        Split("held_out", _OUT),
        Split("held_out:objects", _OUT, models=_OUT),
        Split("held_out:homes", _OUT, homes=_OUT),
        Split("held_out:all", _OUT, _OUT, _OUT, _OUT),
    )
}
"""All splits by name."""


def rank(name: str) -> int:
    """Of a model among those of its category: the same on every machine."""
    return int.from_bytes(hashlib.blake2b(name.encode(), digest_size=8).digest(), "big")


def models_of(models: Sequence[str], part: str, joined: Mapping[str, str] | None = None) -> list[str]:
    """The models of a category in a part of it, in their own order: the quarter with the smallest hashes is held out.

    Args:
      models: names. joined: models of the user's by name, and the part that each is to belong to.

    Raises:
      EngineError: the part is empty.
    """
    joined = joined or {}
    own = [name for name in models if name not in joined]
    if len(own) < FEWEST:
        found = [name for name in models if joined.get(name, part) == part]
    else:
        out = set(sorted(own, key=rank)[: max(1, len(own) // PART)])
        kept = [name for name in own if (name in out) == (part == "held_out")]
        found = [name for name in models if name in kept or joined.get(name) == part]
    if not found:
        raise EngineError(f"no model is {part.replace('_', ' ')} of {', '.join(models) or 'an empty category'}")
    return found


@functools.cache
def undivided() -> tuple[str, ...]:
    """Categories of the object library with fewer than `FEWEST` models, in both parts of which are all of them."""
    from ig2mj.scene.library import library

    return tuple(category for category, models in library().items() if len(models) < FEWEST)
