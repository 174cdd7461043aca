"""Copies of one world of the native engine: another world in memory, and a world from saved arrays."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from ig2mj.engine.native.contacts import KnownForces
from ig2mj.engine.native.nonfinite import why_lost
from ig2mj.engine.native.one_world import NativeWorld
from ig2mj.engine.native.view_rows import FIELDS
from ig2mj.engine.snapshot import FULLY_AWAKE, Snapshot
from ig2mj.engine.view import PhysicsView

_OWN = frozenset({"data", "rows", "_copied", "_cvel", "_numbers", "_from_outside", "_plans"})
"""Attributes of a world that refer to its own memory. All others are numbers, shared constants, and objects that
worlds replace and never change."""


def clone(world: NativeWorld, rows: dict[str, np.ndarray]) -> NativeWorld:
    """Another world in exactly the same state.

    Args:
      rows: its rows of the working arrays, which hold copies of those of `world` already.
    """
    new = NativeWorld(world.statics, world.model_slot, rows, world.number)
    mujoco.mj_copyData(new.data, world.model, world.data)
    for name, value in vars(world).items():
        if name not in _OWN:
            setattr(new, name, value)
    return new


def restore(world: NativeWorld, snapshot: Snapshot, view: PhysicsView) -> None:
    """Puts a world where a saved one was.

    Of a world that is not finite only the poses of the view are kept, and it stays lost until it is loaded.

    Args:
      snapshot: of this world, without the world axis. view: of all worlds.
    """
    model, data = world.model, world.data
    position, velocity = np.asarray(snapshot.whole("qpos")), np.asarray(snapshot.whole("qvel"))
    if np.abs(position).max(initial=0.0) < mujoco.mjMAXVAL and np.abs(velocity).max(initial=0.0) < mujoco.mjMAXVAL:
        world.load(snapshot)
        force, fingers = np.asarray(view.link_force)[world.number], np.asarray(view.agent.finger_force)[world.number]
        world.rows["link_force"][:] = force
        world._has_force = bool(force.any())
        pressing: Any = [KnownForces(fingers)] if fingers.any() else []
        world.pressing = pressing
        return
    calm = {name: np.zeros_like(snapshot.whole(name)) for name in ("qvel", "act", "ctrl", "qacc_warmstart")}
    world.load(snapshot.with_whole(qpos=model.qpos0, tree_asleep=np.full(model.ntree, FULLY_AWAKE, np.int32), **calm))
    data.qpos[:], data.qvel[:] = position, velocity
    world.lost = why_lost(world.number, model, data)
    world._none_awake = False  # no time passes
    for name in FIELDS:
        world.rows[name][:] = np.asarray(getattr(view, name))[world.number]
