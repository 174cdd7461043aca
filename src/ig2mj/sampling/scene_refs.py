"""References to the scene that jobs sample in: loaded by name where a job runs, or lent to jobs of this process."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

from ig2mj.scene.scene import Scene, load_scene

_lent: dict[tuple[str, tuple[str, ...]], Scene] = {}


def named(scene: Scene) -> dict[str, Any]:
    """Arguments of `load_scene` that find the scene on any machine that has it, for a job.

    `scene`: its name if it ships, else its folder. `objects`: what was added to it.
    """
    return {"scene": scene.portable_name, "objects": scene.requested}


def check_of(scene: Scene) -> tuple[str, dict[str, Any]]:
    """`JobSet.check`: every machine has the same scene."""
    return "ig2mj.scene.scene:digest_of", named(scene)


@contextlib.contextmanager
def lent(scene: Scene) -> Iterator[None]:
    """During the block, jobs that run in this process use this scene object."""
    key = scene.portable_name, tuple(scene.requested)
    _lent[key] = scene
    try:
        yield
    finally:
        del _lent[key]


def scene_named(scene: str, objects: Sequence[str]) -> Scene:
    """The scene of `named`. Raises as `load_scene`."""
    found = _lent.get((scene, tuple(objects)))
    return found if found is not None else load_scene(scene, objects=tuple(objects))
