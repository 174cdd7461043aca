"""Scripted experts solve the six activities through the action space of their environments."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj.envs.experts import expert_of, make_expert
from ig2mj.envs.rollout import play
from ig2mj.errors import EngineError
from ig2mj.tasks.activities import ACTIVITIES


def played(name: str, robot: str, rows: int, worlds: int = 4, grasping: str | None = None) -> float:
    """Share of the first held-out states that the expert solves, each played once."""
    env = ig2mj.make(name, robot, worlds, "native", grasping, split="held_out", pool_size=rows)
    return float(np.mean(play(env, expert_of(env), rows, in_order=True).success))


@pytest.mark.slow
def test_the_humanoid_cooks_the_meat():
    assert played("CookingMeat", "humanoid", 4) == 1.0


LEAST = {
    ("CookingMeat", "humanoid"): 0.95,
    ("GraspingBook", "humanoid"): 0.95,
    ("SoakingTowel", "humanoid"): 0.95,
    ("BimanualPickAndPlace", "humanoid"): 0.95,
    ("CleaningStainedShelf", "humanoid"): 0.95,
    ("SlicingFruit", "humanoid"): 0.95,
    ("CookingMeat", "fetch"): 0.95,
    ("GraspingBook", "fetch"): 0.95,
    ("CleaningStainedShelf", "fetch"): 0.95,
    ("SoakingTowel", "fetch"): 0.95,
    ("SlicingFruit", "fetch"): 0.95,
}
"""Share of held-out states that each expert solves, at least (docs/guide/experts.md has what was measured)."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "robot"), LEAST)
def test_experts_solve_held_out_states(name, robot):
    assert played(name, robot, 48, worlds=16) >= LEAST[name, robot]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "robot", "grasping"),
    [
        ("GraspingBook", "fetch", "physical"),
        ("GraspingBook", "humanoid", "physical"),
        ("CleaningStainedShelf", "fetch", "physical"),
        ("CookingMeat", "fetch", "physical"),
        ("SoakingTowel", "fetch", "assisted"),
        ("SoakingTowel", "humanoid", "assisted"),
        ("SlicingFruit", "humanoid", "assisted"),
        ("SoakingTowel", "fetch", "physical"),
        ("SlicingFruit", "fetch", "physical"),
    ],
)
def test_experts_also_solve_tasks_without_mittens(name, robot, grasping):
    assert played(name, robot, 16, worlds=16, grasping=grasping) >= 0.8


def test_every_activity_has_an_expert():
    assert [name for name, task in ACTIVITIES.items() if task.expert is None] == []


@pytest.mark.slow
def test_an_expert_is_a_pure_function_of_each_world():
    """It may be traced, and what it does in a world does not depend on other worlds or on what it saw before."""
    env = ig2mj.make("CookingMeat", worlds=4, engine="native", split="held_out", pool_size=4)
    expert = make_expert(env)
    state = env.start_from(np.arange(4))
    for _ in range(5):
        state = env.step(state, expert_of(env)(state))
    seen = jax.tree.map(lambda a: jnp.array(a), (state.batch.world.view, state.batch.world.states))
    compiled = jax.jit(expert)
    first = np.asarray(compiled(*seen))
    assert first.shape == (4, 6) and np.isfinite(first).all() and np.abs(first).max() <= 1.0
    other_way_round = jax.tree.map(lambda a: a[::-1], seen)
    np.testing.assert_allclose(np.asarray(compiled(*other_way_round))[::-1], first, atol=1e-6)
    np.testing.assert_allclose(np.asarray(expert(*seen)), first, atol=1e-5)
    assert np.array_equal(np.asarray(compiled(*seen)), first)


def test_rows_that_a_pool_has_not_are_refused():
    env = ig2mj.make("CookingMeat", worlds=4, engine="native", split="held_out", pool_size=4)
    with pytest.raises(EngineError, match="from 0 to 3"):
        env.start_from(np.arange(1, 5))
    with pytest.raises(EngineError, match="4 rows"):
        env.start_from(np.arange(3))
