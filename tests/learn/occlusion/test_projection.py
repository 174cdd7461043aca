"""Where in the picture a place is (`ig2mj.learn.occlusion.projection`)."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import ig2mj
from ig2mj.learn.occlusion.projection import camera_projection
from ig2mj.learn.perception import Perception

NAMES = ("privileged_state", "depth")


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["humanoid", "fetch"])
def test_objects_are_seen_where_the_lens_says(robot):
    env = ig2mj.make("SlicingFruit", robot, 8, "native", pool_size=4, observations=NAMES)
    state, lens = env.reset(3), camera_projection(env, Perception(env.observation_spaces, "rgbd", 64, (10, 64)))
    first = env.privileged_names.index("apple_0_pos_x")
    places = np.asarray(state.obs["privileged_state"])[:, first : first + 3]
    found = np.asarray(jax.jit(lens)(places[:, None]))[:, 0]
    distance = -((places - lens.pos) @ np.array(lens.matrix))[:, 2]
    inside = (np.abs(found) < 0.95).all(1)
    assert inside.sum() >= 2, "there is something to check"
    rows = np.round((found[:, 0] + 1) / 2 * 53 + 10).astype(int) * 2
    columns = np.round((found[:, 1] + 1) / 2 * 63).astype(int) * 2
    depth = np.asarray(state.obs["depth"])[np.arange(8), rows, columns, 0]
    ahead = (distance - depth)[inside]
    assert ((ahead > 0.0) & (ahead < 0.06)).all(), "its near side, less than its radius before its middle"
