"""What an actor remembers of its episode (`ig2mj.learn.recall`)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from small_envs import SeenPointMass

from ig2mj.envs.observations import Space
from ig2mj.errors import Ig2mjError
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.heads import likeliest
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.policies import Policy
from ig2mj.learn.projection import Lens
from ig2mj.learn.recall import Recall, grips_of

NAMES = [*(f"goal_pos_{c}" for c in "xyz"), *(f"goal_quat_{c}" for c in "wxyz")]

FELT = ("left_hand_x", "left_hand_is_grasping")


def made(**settings) -> Any:
    """Of an actor that feels two numbers, the second of which says whether a hand holds something."""
    spaces = {**SeenPointMass.observation_spaces, "privileged_state": Space((7,), np.float32, -np.inf, np.inf)}
    ahead = Lens((0.0, 0.0, 0.0), ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), (1.0, 1.0), 16, (0, 16))
    perception = Perception(spaces, "rgbd", 16, None, NAMES, ahead, FELT)
    settings = {"net": "glimpses", "recall": 1, "actor": (32,), "shift": 0, **settings}
    return Dagger(perception, 2, lambda state: state.goal, DaggerConfig(**settings))


def test_the_first_guess_is_kept_and_the_last_taking():
    """Of numbers 1 and 3 of a guess of four; of what is felt, number 1 is the grip."""
    recall, rng = Recall(3, [1, 3], [1]), np.random.default_rng(0)
    grip = np.array([[0, 0, 0, 1, 1, 0, 0, 1], [1, 1, 1, 1, 1, 1, 1, 1]]).T  # of two worlds
    begins = np.array([[1, 0, 0, 0, 0, 0, 1, 0], [1, 0, 0, 0, 0, 0, 0, 0]], bool).T
    felt = rng.normal(size=(8, 2, 3)).astype(np.float32)
    felt[:, :, 1] = 2.0 * grip - 1.0
    guess = rng.normal(size=(8, 2, 4)).astype(np.float32)
    kept, found = recall.blank(2), []
    for k in range(8):
        kept = recall.after(kept, begins[k], felt[k], guess[k])
        found.append(np.asarray(kept))
    first, taken = [0, 0, 0, 0, 0, 0, 6, 6], [0, 0, 0, 3, 3, 5, 6, 7]
    for k in range(8):
        for world, (f, t) in enumerate(((first[k], taken[k]), (0, 0))):
            wanted = [*guess[f, world, [1, 3]], *guess[t, world, [1, 3]], *felt[t, world]]
            np.testing.assert_array_equal(found[k][world], np.array(wanted, np.float32), err_msg=f"{k} {world}")
    mean, deviation = np.array([1.0, 0.0, 0.0]), np.array([0.5, 1.0, 0.01])
    normal = np.asarray(recall.normal(found[-1], mean, deviation))
    np.testing.assert_allclose(normal[:, :4], found[-1][:, :4])
    np.testing.assert_allclose(normal[:, 4], 2 * (found[-1][:, 4] - 1), rtol=1e-5)
    assert np.abs(normal).max() <= 10


def test_robots_feel_whether_a_hand_holds_something():
    from ig2mj.agents.fetch.proprioception import EXPERIMENTS

    sizes = [3, len(EXPERIMENTS), 5]
    found = grips_of(["task_obs", "proprioception", "privileged_state"], sizes, EXPERIMENTS)
    assert found == (3 + EXPERIMENTS.index("has_grasped"),)
    assert grips_of(["task_obs"], [3], EXPERIMENTS) == ()
    assert made().perception.grips == (1,)


def test_labels_that_only_the_first_picture_tells_are_learnt():
    """The label is what was guessed in the first step; the picture of every later step is blank."""
    algorithm = made(choices=0)
    perception, imitation = algorithm.perception, algorithm._imitation
    learner, rng = jax.jit(algorithm.init)(jax.random.PRNGKey(0)), np.random.default_rng(0)
    pictures = rng.integers(0, 255, (64, 16 * 16 * 4)).astype(np.uint8)
    vector = np.zeros((64, perception.vector_size), np.float32)
    first, later = (
        Seen(jnp.asarray(vector), jnp.asarray(pictures)),
        Seen(jnp.asarray(vector), jnp.zeros((64, 1024), jnp.uint8)),
    )
    choose = jax.jit(imitation.choose)
    yes, no = np.ones(64, bool), np.zeros(64, bool)
    _, kept = choose(learner.actor, learner.moments, first, algorithm.recall.blank(64), yes)
    _, same = choose(learner.actor, learner.moments, later, kept, no)
    np.testing.assert_array_equal(kept, same)
    assert np.ptp(np.asarray(kept)[:, :3], axis=0).min() > 0, "pictures differ"
    label = jnp.tanh(3 * (kept[:, :2] - kept[:, :2].mean(0)) / kept[:, :2].std(0))

    @jax.jit
    def update(learner: Any, key: Any) -> tuple[Any, Any]:
        return imitation.update(learner, later, label, key, jnp.float32(3e-3), None, kept)

    losses = []
    for key in jax.random.split(jax.random.PRNGKey(1), 150):
        learner, found = update(learner, key)
        losses.append(float(found["actor_loss"]))
    assert losses[-1] < 0.1 * losses[0]


def test_a_policy_file_remembers_as_what_was_trained(tmp_path):
    algorithm, env = made(), SeenPointMass(4)
    assert algorithm.recall is not None
    learner = jax.jit(algorithm.init)(jax.random.PRNGKey(0))
    Policy.of(algorithm, learner, {"actions": ["x", "y"], "picture": [16, 16, 4]}, {}).save(tmp_path / "policy.npz")
    policy = Policy.load(tmp_path / "policy.npz")
    assert policy.recall is not None and policy.recall.card() == algorithm.recall.card()
    play, choose = jax.jit(policy.player(algorithm.perception)), jax.jit(algorithm._imitation.choose)
    kept = also = algorithm.recall.blank(4)
    for k in range(4):
        obs = {**env.reset(k).obs, "privileged_state": jnp.ones((4, 7))}
        begins = np.array([k == 0, k == 0, k in (0, 2), True])
        action, kept = play(obs, kept, begins)
        head, also = choose(learner.actor, learner.moments, algorithm.perception(obs), also, begins)
        np.testing.assert_allclose(kept, also, atol=0.02, err_msg="half precision")
        np.testing.assert_allclose(action, likeliest(head), atol=0.02)
    assert np.abs(np.asarray(kept)[0, :18] - np.asarray(kept)[3, :18]).max() > 0.05, "one looked at another picture"
    with pytest.raises(Ig2mjError, match="remembers"):
        policy.actor(algorithm.perception)


def test_only_actors_that_guess_remember():
    for settings in ({"net": "places"}, {"net": "small"}):
        with pytest.raises(Ig2mjError, match="recall=1"):
            made(**settings)
