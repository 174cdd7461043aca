"""`watch_physics`: where a core's time goes, physics or the rest."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from jaxtyping import Float

from ig2mj.engine.base import Physics
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.worlds.core import Core


def watch_physics(core: Core, watch: Callable[[], AbstractContextManager[Any]]) -> None:
    """Takes every physics step of a core inside a context; a second call replaces the first.

    Meaningful next to an engine whose steps run in Python (`Engine.program`). The core itself has no such hook: a world
    at rest steps in two microseconds, and an empty context takes a part of one.
    """

    def watched(physics: Physics, ctrl: Float[Array, "W nu"] | None = None) -> tuple[Physics, PhysicsView]:
        with watch():
            return core.engine.step(physics, ctrl)

    core._physics_step = watched
