"""The observation of a BDDL activity: what it says of the objects that the activity is about."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj.predicates.compile import GoalStatus


@pytest.mark.slow
def test_the_state_says_how_far_an_activitys_doors_are_open():
    env = ig2mj.make("activity/locking_every_door", worlds=1, engine="native", pool_size=1)
    tables, names = env.scene.tables, list(env.privileged_names)
    doors = [env.scene.object_index(name) for name in ("door_0", "door_2")]
    own = np.flatnonzero(np.isin(tables.openable_object, doors))
    columns = [names.index(f"{name}_leaf_joint_open") for name in ("door_0", "door_2")]
    state = env.reset(0)
    assert np.asarray(state.obs["privileged_state"])[0, columns].min() > 0.1

    world, objective = state.batch.world, env.objective
    goal = len([name for name in names if name.startswith("holds_")])
    status = GoalStatus(np.zeros(1, bool), np.zeros(1, np.float32), np.zeros((1, goal), bool))
    now = objective.measure(world.view, world.states, status, None)
    for share in (0.0, 0.5):
        joints = tables.openable_closed + share * (tables.openable_open - tables.openable_closed)
        view = dataclasses.replace(world.view, joint_pos=jnp.asarray(world.view.joint_pos).at[:, own].set(joints[own]))
        seen = objective.observe(view, world.states, now, status, jnp.ones(1))
        np.testing.assert_allclose(np.asarray(seen["privileged_state"])[0, columns], share, atol=1e-6)
