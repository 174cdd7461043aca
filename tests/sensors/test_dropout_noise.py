"""Dropout noise: a share of readings is missing, in each world and sensor another."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from perceiving import Perceiving

from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.sensors.dropout import dropout


def keys(count, seed=0):
    return jax.random.key_data(jax.random.split(jax.random.key(seed), count)).astype(jnp.uint32)


def test_the_rate_is_the_share_that_is_replaced():
    lost = np.asarray(dropout(keys(4), "depth", jnp.ones((4, 100, 100)), 0.2, 0.0)) == 0
    assert lost.mean((1, 2)) == pytest.approx(np.full(4, 0.2), abs=0.02)
    assert not (lost[0] == lost[1]).all()


def test_worlds_sensors_and_keys_have_streams_of_their_own():
    readings = jnp.ones((3, 500))
    lost = np.asarray(dropout(keys(3), "scan", readings, 0.3, 0.0)) == 0
    alone = np.asarray(dropout(keys(3)[:1], "scan", readings[:1], 0.3, 0.0)) == 0
    np.testing.assert_array_equal(alone[0], lost[0])
    other = np.asarray(dropout(keys(3), "depth", readings, 0.3, 0.0)) == 0
    later = np.asarray(dropout(keys(3, 1), "scan", readings, 0.3, 0.0)) == 0
    assert (other != lost).any(1).all() and (later != lost).any(1).all()


def test_a_scan_drops_out_to_the_end_of_its_range(tiny_home_folder):
    """As in iGibson: depth 0, scan 1."""
    world = Perceiving(tiny_home_folder, TurtleBot(pos=(0, -1.2, 0)))
    clean = world.see("scan", scan_rays=400)["scan"][0]
    noisy = world.see("scan", scan_rays=400, scan_noise_rate=0.25, keys=keys(1))["scan"][0]
    hit = clean < 1
    assert (noisy[hit] == 1).mean() == pytest.approx(0.25, abs=0.07)
    np.testing.assert_array_equal(noisy[noisy < 1], clean[noisy < 1])
