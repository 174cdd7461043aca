"""Scan, lidar and occupancy grid on a CUDA device (`make test-gpu`): the native engine's, in every world of a batch."""

from __future__ import annotations

import copy
import functools

import numpy as np
import pytest
from perceiving import Perceiving

from ig2mj.agents.base import Robot
from ig2mj.agents.fetch import Fetch
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.engine.base import Write

pytestmark = [pytest.mark.gpu, pytest.mark.timeout(900), pytest.mark.usefixtures("gpu")]

WORLDS, START = 64, (1.2, -1.2, 0)
LASERS = ("scan", "lidar", "occupancy_grid")
OPTIONS = {"scan_rays": 121, "scan_angle": 240.0, "lidar_columns": 40}
SIDES = {"scan": 1e-3, "lidar": 5e-3, "occupancy_grid": 0.1}
SHARE = {"scan": 0.98, "lidar": 0.98, "occupancy_grid": 0.98}
"""How near a reading has to be to the native one, and what share of them: rays that graze an edge may miss it."""


def alike(native: np.ndarray, warp: np.ndarray, name: str) -> bool:
    """Whether enough of the readings are near enough."""
    return bool((np.abs(native.astype(float) - warp.astype(float)) <= SIDES[name]).mean() >= SHARE[name])


@functools.cache
def batch(kind: type[Robot]) -> Perceiving:
    """The robot in all worlds of the Warp engine; made once, since it compiles for a minute."""
    return Perceiving("birch", kind(pos=START), "warp", WORLDS)


@pytest.mark.parametrize("kind", [TurtleBot, Fetch])
def test_lasers_of_a_batch_are_those_of_the_native_engine(kind):
    native, warp = Perceiving("birch", kind(pos=START)), batch(kind)
    # Warp's worlds begin 0.3 s after the native one's: Fetch has come to rest on its wheels, 6 mm higher and tilted.
    native.physics = native.engine.load(native.physics, warp.engine.export(warp.physics, 0))
    here, there = native.see(*LASERS, **OPTIONS), warp.see(*LASERS, **OPTIONS)
    for name in LASERS:
        assert there[name].shape[0] == WORLDS
        assert (there[name] == there[name][:1]).all(), f"{name} is not the same in equal worlds"
        assert alike(here[name][0], there[name][0], name), name
    assert (here["scan"] < 1).mean() > 0.05, "walls are in range"


def test_each_world_sees_its_own(gpu):
    """A chair before the laser in every other world shortens the rays there, and there only."""
    warp = copy.copy(batch(TurtleBot))  # with physics of its own
    free = warp.see("scan", **OPTIONS)["scan"]
    tables, view = warp.scene.tables, warp.engine.view(warp.physics)
    loose = np.flatnonzero(~tables.object_fixed & ~tables.object_parked)
    size = np.asarray(view.aabb_high - view.aabb_low)[0]
    tall = loose[np.argmax(size[loose, 2])]
    mask, pos = np.zeros((WORLDS, tables.num_objects), bool), np.array(view.object_pos)
    mask[1::2, tall] = True
    lift = float(np.asarray(view.object_pos - view.aabb_low)[0, tall, 2])
    pos[:, tall] = (2.0, -1.2, lift + 0.01)
    warp.physics = warp.engine.write(
        warp.physics, Write(object_mask=mask, object_pos=pos, object_quat=np.array(view.object_quat))
    )
    seen = warp.see("scan", **OPTIONS)["scan"]
    np.testing.assert_array_equal(seen[0::2], free[0::2])
    assert (seen[1::2] < free[1::2] - 0.01).any(1).all()
