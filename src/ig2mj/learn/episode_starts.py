"""What an episode of a file starts with, for people: poses of loose objects, states that are not usual, and what was
drawn for it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ig2mj.envs.registry import make
from ig2mj.learn.episodes import ALL, Episodes

BOOLEANS = ("toggled_on", "sliced")
"""Extended states of objects that are listed where they are true."""


def described(episodes: Episodes, number: int) -> dict[str, Any]:
    """Seed, poses (m, w-x-y-z, world frame) of loose objects, temperatures above the room's, what is on or sliced, and
    the values that were drawn."""
    task, robot = episodes.header["task"], next(iter(episodes.header["robots"]))
    env = make(task, robot=robot, engine="native", pool=episodes.pool)
    state = env.start_from(np.array([number]), [episodes.seeds[number]])
    world, tables = state.batch.world, env.scene.tables
    loose = np.flatnonzero(~np.asarray(tables.object_fixed))
    root = np.asarray(tables.object_root)[loose]
    pos, quat = (np.asarray(a)[0].astype(float) for a in (world.view.body_pos, world.view.body_quat))
    objects = {
        tables.object_names[o]: {"pos": pos[b].round(4).tolist(), "quat": quat[b].round(4).tolist()}
        for o, b in zip(loose, root, strict=True)
    }
    states: dict[str, Any] = {}
    for name in BOOLEANS:
        on = np.flatnonzero(np.asarray(getattr(world.states, name))[0])
        if len(on):
            states[name] = [tables.object_names[o] for o in on]
    warm = np.asarray(world.states.temperature)[0]
    usual = float(np.median(warm))
    states |= {
        f"temperature of {tables.object_names[o]}": round(float(warm[o]), 1)
        for o in np.flatnonzero(np.abs(warm - usual) > 1.0)
    }
    draws = episodes.described_draws(ALL, number, robot, tables.object_names)
    return {"number": number, "seed": episodes.seeds[number], "objects": objects, "states": states, "draws": draws}
