"""The homes of the dataset: the small one and the sixteen; writing their scenes into a dataset root."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.errors import UnknownNameError

from ..furnish import small_home
from ..furnish.clearances import blocked
from ..furnish.home import furnish_home
from ..furnish.kit import HomeInProgress
from ..plans.shipped import DRAWINGS, plan
from .scene_writer import write_scene


def home_names() -> list[str]:
    """All homes, the small one first."""
    return [small_home.NAME, *sorted(DRAWINGS)]


def furnished(name: str, seed: int = 0) -> HomeInProgress:
    """A home with everything in it. Raises UnknownNameError."""
    if name == small_home.NAME:
        return small_home.furnish(seed)
    if name not in DRAWINGS:
        raise UnknownNameError("home", name, home_names())
    return furnish_home(plan(name, seed), DRAWINGS[name].objects, seed, DRAWINGS[name].pieces)


def build_homes(
    root: pathlib.Path, names: Iterable[str] | None = None, seed: int = 0, progress: ProgressCallback = no_progress
) -> dict[str, int]:
    """Writes `scenes/<name>` of homes into a dataset root whose objects were built with the same seed.

    Args:
      names: which; None: all.

    Returns:
      name -> number of things, walls, floors and ceilings not counted.
    """
    chosen = list(names) if names is not None else home_names()
    for name in chosen:
        if name not in home_names():
            raise UnknownNameError("home", name, home_names())
    counts = {}
    for done, name in enumerate(chosen):
        progress(done, len(chosen), name)
        home = furnished(name, seed)
        jams = blocked(home.plan, home.things.things.values())
        assert not jams, f"{name}: no room to open: {jams}"
        write_scene(root, home.plan, home.things, seed)
        counts[name] = len(home.things.things)
    return counts


def categories_of(home: HomeInProgress) -> list[str]:
    """That a home needs of the dataset, halves not counted."""
    return sorted({thing.category for thing in home.things.things.values()})
