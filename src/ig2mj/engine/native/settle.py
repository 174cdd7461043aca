"""Settling: a scene stepped with the native engine until it rests."""

from __future__ import annotations

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.scene.scene import Scene

SETTLE_SECONDS = 10.0


def settle(scene: Scene, seconds: float = SETTLE_SECONDS) -> Snapshot:
    """The scene's initial state, stepped until every object sleeps, or for `seconds` of simulated time.

    Agents keep their controls of the initial state; they never sleep and are not waited for.

    Raises:
      EngineError: the scene blows up.
    """
    engine = NativeEngine(scene)
    physics = engine.reset()
    for _ in range(round(seconds / (engine.substeps * engine.timestep))):
        physics, view = engine.step(physics)
        if not view.awake.any():
            break
    return engine.export(physics, 0)
