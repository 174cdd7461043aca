"""The functional environment: its promises, its rewards from the first step on, and a steak that can be cooked."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.errors import ActionError, EngineError, UnknownNameError
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.testing import api_test

ROWS = 4


@pytest.fixture(scope="module")
def env():
    return ig2mj.make("ig2mj/CookingMeat-v0", worlds=2, pool_size=ROWS)


def numbers(env, state, name):
    at = [env.privileged_names.index(f"{name}_{axis}") for axis in "xyz"]
    return np.asarray(state.obs["privileged_state"])[:, at]


def test_every_promise_is_kept(env):
    api_test(env)


def test_the_first_step_counts(env):
    """In iGibson the baseline is taken after it (spec 2.6)."""
    state = env.reset(0)
    before = np.asarray(state.measures.distances).sum(1)
    action = np.zeros((2, 6), np.float32)
    action[:, :3] = np.sign(numbers(env, state, "steak_0_pos") - numbers(env, state, "hand_1_pos"))
    state = env.step(state, action)
    gained = before - np.asarray(state.measures.distances).sum(1)
    assert np.asarray(state.reward) == pytest.approx(gained, abs=1e-5)
    assert (np.asarray(state.reward) > 0.005).all()


def test_a_world_is_the_same_in_a_batch_of_any_size(env):
    """Random streams belong to seed, world and episode."""
    alone = ig2mj.make("CookingMeat", worlds=1, pool_size=ROWS)
    seen = [np.asarray(e.reset(5).obs["privileged_state"])[0] for e in (alone, env)]
    assert np.array_equal(*seen)


def test_a_hand_that_sticks_to_the_steak_carries_it_to_the_burner(env):
    state, over = env.reset(0), np.zeros(2, bool)
    total = np.zeros(2)
    for _ in range(80):
        hand, steak = numbers(env, state, "hand_1_pos"), numbers(env, state, "steak_0_pos")
        held = np.asarray(state.info["held"])
        level = np.linalg.norm((steak - hand)[:, :2], axis=1, keepdims=True) < 0.06
        above = steak + np.where(level, -0.05, 0.1) * (0, 0, 1)
        goal = np.where(held[:, None], hand + numbers(env, state, "end_1") - steak + (0, 0, 0.03), above)
        action = np.zeros((2, 6), np.float32)
        action[:, :3] = np.clip((goal - hand) / 0.05, -1, 1)
        state = env.step(state, action)
        total += np.where(over, 0.0, np.asarray(state.reward))
        over |= np.asarray(state.terminated)
        if over.all():
            break
    assert over.any(), "no steak was cooked within eight seconds"
    assert (total[over] > 1.5).all()  # 1 for the goal, and the ways of hand and steak
    assert not np.asarray(state.info["flags"]).any()


def test_what_cannot_be_done_is_refused_by_name(env):
    for options, kind in (
        ({"name": "CookingMeet"}, UnknownNameError),
        ({"robot": "tortoise"}, UnknownNameError),
        ({"grasping": "glue"}, UnknownNameError),
        ({"worlds": 0}, EngineError),
    ):
        with pytest.raises(kind):
            ig2mj.make(**{"name": "CookingMeat", **options})
    with pytest.raises(UnknownNameError, match="near matches: CookingMeat"):
        ig2mj.make("ig2mj/CookingMeet")
    with pytest.raises(ActionError, match=r"\(2, 6\)"):
        env.step(env.reset(0), np.zeros((2, 7)))


def test_pictures_are_refused_where_the_engine_draws_none():
    with pytest.raises(EngineError, match="warp"):
        ig2mj.make("CookingMeat", engine="native", observations=("rgb",), pool_size=ROWS)


def test_the_paper_s_runs_had_easier_thresholds():
    """Any force cuts, and three quarters of the stains may stay (spec 0.1)."""
    from ig2mj.envs.setups import rules_of

    task = ACTIVITIES["SlicingFruit"]
    scene = load_scene(task.home, objects=task.objects)
    apple = scene.object_index("apple_0")
    stated, eased = (rules_of(task, scene, paper_rl=p).model.parameters for p in (False, True))
    assert (stated.slice_force[apple], eased.slice_force[apple]) == (10.0, 0.0)
    stainable = np.isfinite(stated.stained_threshold)
    assert set(eased.stained_threshold[stainable].tolist()) == {0.75}
    assert np.isinf(eased.stained_threshold[~stainable]).all()
