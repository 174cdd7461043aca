"""Whether a snapshot belongs to a scene and a batch: by the lengths of its arrays, so that it works while tracing."""

from __future__ import annotations

import mujoco

from ig2mj.engine.base import Snapshot
from ig2mj.errors import EngineError


def check_snapshot(snapshot: Snapshot, model: mujoco.MjModel, num_units: int, num_worlds: int, scene: str) -> None:
    """Raises EngineError where the snapshot cannot be loaded.

    Args:
      model, num_units, scene: of the engine: compiled model, units of its layout, name of its scene.
      num_worlds: of the engine; a snapshot with a world axis must have as many.
    """
    lengths = {
        "qpos": (snapshot.qpos, model.nq),
        "ctrl": (snapshot.ctrl, model.nu),
        "eq_active": (snapshot.eq_active, model.neq),
        "tree_asleep": (snapshot.tree_asleep, model.ntree),
        "touching": (snapshot.touching, num_units),
    }
    for name, (array, length) in lengths.items():
        if array.shape[-1:] != (length,):
            raise EngineError(
                f"the snapshot does not fit scene '{scene}': {name} has length {array.shape[-1]}, the scene's {length} "
                f"(load it into the scene, with the agents, that it was saved from)"
            )
    if snapshot.qpos.ndim == 2 and snapshot.qpos.shape[0] != num_worlds:
        raise EngineError(f"{snapshot.qpos.shape[0]} snapshots do not fit {num_worlds} worlds (give one for each)")
