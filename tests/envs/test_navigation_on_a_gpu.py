"""Navigation and reaching on Warp on a CUDA device (`make test-gpu`): promises kept, goals reached, lasers seen."""

from __future__ import annotations

import numpy as np
import pytest
from navigating import column, driver, small

import ig2mj
from ig2mj.envs.actor import STEPS, Tally
from ig2mj.sensors.base import SensorOptions
from ig2mj.testing import api_test

pytestmark = [pytest.mark.gpu, pytest.mark.timeout(900), pytest.mark.usefixtures("gpu")]

WORLDS, ROWS = 32, 16


@pytest.fixture(scope="module")
def point(gpu):
    task = small("PointNavigation", target_dist=(1.0, 4.0))
    observations = ("proprioception", "privileged_state", "task_obs", "scan", "lidar", "bump")
    sensors = SensorOptions(scan_rays=61, lidar_columns=20)
    return ig2mj.make(task, worlds=WORLDS, engine="warp", pool_size=ROWS, observations=observations, sensors=sensors)


def test_every_promise_is_kept(point):
    """Natively, with noise of a rounding (1e-7 to 1e-6 m) in every step, up to 4 of 16 worlds go apart in 8 steps."""
    api_test(point, within=1e-3, astray=0.25)


def test_who_follows_the_way_arrives_in_every_world(point):
    state, actor = point.reset(3), driver(point)
    tally, scans = Tally.begun(state), []
    for steps in (1, 5, *[STEPS] * 10):
        state, tally = actor.several(state, tally, steps)
        scans.append(np.asarray(state.obs["scan"]))
    assert np.asarray(tally.success).mean() >= 0.95, "single precision may drive one into a corner"
    metrics = point.metrics(state)
    assert metrics["overflow"] == 0 and metrics["not_finite"] == 0
    moved = np.abs(scans[0] - scans[1]).max(axis=(1, 2))
    assert (moved > 1e-3).mean() > 0.9, "what the laser sees changes as the robot drives"


def test_the_first_steps_are_those_of_the_native_engine(point):
    native = ig2mj.make(
        small("PointNavigation", target_dist=(1.0, 4.0)), worlds=1, engine="native", pool_size=ROWS,
        observations=("privileged_state", "scan"), sensors=SensorOptions(scan_rays=61),
    )  # fmt: skip
    row = 5
    here, there = native.start_from(np.array([row])), point.start_from(np.full(WORLDS, row))
    forward = np.array([[0.6, 0.2]], np.float32)
    for _ in range(5):
        here, there = native.step(here, forward), point.step(there, np.tile(forward, (WORLDS, 1)))
    for name in ("goal_x", "goal_y", "way_left"):
        ours, theirs = column(native, here, name), column(point, there, name)
        assert np.abs(theirs - ours).max() < 0.02, name
    far = np.abs(np.asarray(here.obs["scan"])[0] - np.asarray(there.obs["scan"])[0])
    assert (far < 0.02).mean() > 0.95


def test_fetch_reaches_and_rearranges_on_warp(gpu):
    for name in ("Reaching", "RoomRearrangement"):
        env = ig2mj.make(name, worlds=8, engine="warp", pool_size=4)
        state = env.reset(0)
        for _ in range(5):
            state = env.step(state, np.zeros((8, *env.action_space.shape), np.float32))
        assert np.isfinite(np.asarray(state.reward)).all() and (np.asarray(state.info["flags"]) == 0).all(), name
        env.close()
