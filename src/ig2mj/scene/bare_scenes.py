"""Homes without robots that were loaded last.

Where a task fits into a home, what its start states are of, and where its robot stands is all asked of the home without
robots, which takes a third of a second to load. Only homes that ship are kept, with objects of the library: others may
change while the process runs.
"""

from __future__ import annotations

import functools
import os
import pathlib
import threading
from collections.abc import Sequence

from ig2mj.scene.paths import SHIPPED_HOMES, scene_folder
from ig2mj.scene.scene import Scene, load_scene

KEPT = 6
"""Homes: two of them with and without the objects of a task, and with all their models."""

_lock = threading.Lock()
"""Pools may be made in threads (`ig2mj sample-task all`); MuJoCo does not promise that two may parse XML at a time."""


def bare_scene(home: str | os.PathLike, objects: Sequence[str | os.PathLike] = ()) -> Scene:
    """A home with added objects and without robots. Arguments and errors as of `load_scene`."""
    folder, names = scene_folder(home), tuple(os.fspath(name) for name in objects)
    own = folder.parent != SHIPPED_HOMES or any(pathlib.Path(name.partition("@")[0]).exists() for name in names)
    with _lock:
        return load_scene(folder, objects=names) if own else _kept(folder, names)


@functools.lru_cache(maxsize=KEPT)
def _kept(folder: pathlib.Path, objects: tuple[str, ...]) -> Scene:
    return load_scene(folder, objects=objects)
