"""What an actor remembers of its episode (`ig2mj.learn.recall`)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent))
from small_envs import SeenPointMass

from ig2mj.envs.observations import Space
from ig2mj.errors import Ig2mjError
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.heads import likeliest
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.policies import Policy, depends_of
from ig2mj.learn.projection import Lens
from ig2mj.learn.recall import Recall, grips_of, hands_of

NAMES = [*(f"goal_pos_{c}" for c in "xyz"), *(f"goal_quat_{c}" for c in "wxyz")]

FELT = ("left_hand_x", "left_hand_is_grasping")


def depends(algorithm) -> dict:
    """What a policy of `made` depends on."""
    world = {"task": "PointMass", "robot": "point", "grasping": "physical", "actions": ["x", "y"], "privileged": []}
    return depends_of(world, algorithm.perception)


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
    normal = np.asarray(recall.normal(found[-1], felt[-1], mean, deviation))
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


def test_robots_feel_where_a_hand_is_that_may_hold_something():
    from ig2mj.agents.fetch.proprioception import EXPERIMENTS

    names, sizes = ["task_obs", "proprioception"], [3, len(EXPERIMENTS)]
    grips = grips_of(names, sizes, EXPERIMENTS)
    assert hands_of(grips, names, sizes, EXPERIMENTS) == (3 + EXPERIMENTS.index("eef_0_pos_x"),)
    humanoid = [f"{side}_hand_{n}" for side in ("left", "right") for n in ("x", "y", "z", "roll", "pitch", "yaw")]
    humanoid += [f"{side}_hand_is_grasping" for side in ("left", "right")]
    grips = grips_of(["proprioception"], [14], humanoid)
    assert grips == (12, 13) and hands_of(grips, ["proprioception"], [14], humanoid) == (0, 6)
    assert hands_of((0,), ["proprioception"], [1], ["grasp_0"]) == () and made().perception.hands == ()


def test_how_a_thing_lies_by_now_is_reckoned_from_how_it_lay_and_where_the_hand_that_took_it_is():
    """Two objects and two hands; the second hand takes something in step 1 and lets go of it in step 3."""
    rng, worlds = np.random.default_rng(0), 5
    recall = Recall(14, range(18), (12, 13), (0, 6), [[14, 15, 16], [17, 18, 19]])
    whole = Recall.of({k: v for k, v in recall.card().items() if k != "whole"}, 14)
    assert recall.shown == 18 + 2 * 2 * 9 and Recall.of(recall.card(), 14).card() == recall.card()
    assert whole.shown == whole.size + 2 * 2 * 9, "files of before that was said show all that is remembered"
    mean, deviation = rng.normal(size=20).astype(np.float32), rng.uniform(0.5, 2.0, 20).astype(np.float32)
    felt = rng.uniform(-1, 1, (5, worlds, 14)).astype(np.float32)
    felt[..., 12], felt[..., 13] = -1.0, np.array([-1.0, 1.0, 1.0, -1.0, -1.0])[:, None]
    place = rng.normal(size=(worlds, 2, 3)).astype(np.float32)
    turns = Rotation.from_quat(rng.normal(size=(worlds * 2, 4)))
    columns = turns.as_matrix().reshape(worlds, 2, 3, 3)[..., :2].swapaxes(-1, -2)
    guess = np.concatenate(
        [(place - mean[14:].reshape(2, 3)) / deviation[14:].reshape(2, 3), np.sqrt(3) * columns.reshape(worlds, 2, 6)],
        axis=-1,
    ).reshape(worlds, 18)
    kept = recall.blank(worlds)
    for k in range(5):
        seen = guess if k == 0 else rng.normal(size=guess.shape)  # what it guesses later does not count
        kept = recall.after(kept, np.full(worlds, k == 0), felt[k], seen.astype(np.float32))
        found = np.asarray(recall.carried(kept, felt[k], mean, deviation)).reshape(worlds, 2, 2, 9)
        np.testing.assert_allclose(
            found[:, 0].reshape(worlds, 18), guess, atol=1e-5, err_msg="the hand that takes none"
        )
        expected = guess.reshape(worlds, 2, 9)
        if k in (1, 2):
            then, now = (Rotation.from_euler("xyz", felt[j, :, 9:12]) for j in (1, k))
            moved = [now.apply(then.inv().apply(place[:, o] - felt[1, :, 6:9])) + felt[k, :, 6:9] for o in range(2)]
            turned = [[(now * then.inv()).apply(np.sqrt(3) * columns[:, o, c]) for c in range(2)] for o in range(2)]
            moved = (np.stack(moved, 1) - mean[14:].reshape(2, 3)) / deviation[14:].reshape(2, 3)
            turned = np.transpose(np.array(turned), (2, 0, 1, 3)).reshape(worlds, 2, 6)
            expected = np.concatenate([moved, turned], axis=-1)
        np.testing.assert_allclose(found[:, 1], expected, atol=2e-5, err_msg=f"step {k}")
        shown = np.asarray(recall.normal(kept, felt[k], mean, deviation))
        assert shown.shape == (worlds, recall.shown) and np.abs(shown).max() <= 10
        more = np.asarray(whole.normal(kept, felt[k], mean, deviation))
        np.testing.assert_array_equal(np.delete(more, np.s_[18:50], axis=1), shown)


@pytest.mark.slow
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
    _, kept, _ = choose(learner.actor, learner.moments, first, algorithm.recall.blank(64), yes)
    _, same, _ = choose(learner.actor, learner.moments, later, kept, no)
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
    Policy.of(algorithm, learner, depends(algorithm), {}).save(tmp_path / "policy.npz")
    policy = Policy.load(tmp_path / "policy.npz")
    assert policy.recall is not None and policy.recall.card() == algorithm.recall.card()
    play, choose = jax.jit(policy.player(algorithm.perception)), jax.jit(algorithm._imitation.choose)
    kept = also = algorithm.recall.blank(4)
    for k in range(4):
        obs = {**env.reset(k).obs, "privileged_state": jnp.ones((4, 7))}
        begins = np.array([k == 0, k == 0, k in (0, 2), True])
        action, kept = play(obs, kept, begins)
        head, also, _ = choose(learner.actor, learner.moments, algorithm.perception(obs), also, begins)
        np.testing.assert_allclose(kept, also, atol=0.02, err_msg="half precision")
        np.testing.assert_allclose(action, likeliest(head), atol=0.02)
    assert np.abs(np.asarray(kept)[0, :18] - np.asarray(kept)[3, :18]).max() > 0.05, "one looked at another picture"
    with pytest.raises(Ig2mjError, match="remembers"):
        policy.actor(algorithm.perception)


def test_only_actors_that_guess_remember():
    for settings in ({"net": "places"}, {"net": "small"}):
        with pytest.raises(Ig2mjError, match="recall=1"):
            made(**settings)
