"""What an actor remembers of its episode (`ig2mj.learn.occlusion.object_memory`)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1]))
from small_envs import SeenPointMass

from ig2mj.agents.base import HandReading
from ig2mj.agents.fetch import Fetch
from ig2mj.agents.humanoid import Humanoid
from ig2mj.envs.observations import Space
from ig2mj.errors import Ig2mjError
from ig2mj.learn.action_distributions import mode
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.occlusion import glimpses
from ig2mj.learn.occlusion.object_memory import ObjectMemory, hand_numbers, make_memory
from ig2mj.learn.occlusion.projection import CameraProjection, with_object_targets
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.policies import Policy, depends_of
from ig2mj.scene.scene import load_scene

NAMES = [*(f"goal_pos_{c}" for c in "xyz"), *(f"goal_quat_{c}" for c in "wxyz")]


def depends(algorithm) -> dict:
    """What a policy of `made` depends on."""
    world = {"task": "PointMass", "robot": "point", "grasping": "physical", "actions": ["x", "y"], "privileged": []}
    return depends_of(world, algorithm.perception)


def made(memory: str = "poses", **settings) -> Any:
    """Of an actor that feels two numbers, the second of which says whether a hand holds something."""
    spaces = {**SeenPointMass.observation_spaces, "privileged_state": Space((7,), np.float32, -np.inf, np.inf)}
    axes = ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    ahead = CameraProjection((0.0, 0.0, 0.0), axes, (1.0, 1.0), 16, (0, 16))
    perception = Perception(spaces, "rgbd", 16, None, NAMES)
    config = DaggerConfig(**{"encoder": "glimpses", "actor_layers": (32,), "image_shift": 0, **settings})
    encoder = kept = None
    if config.encoder == "glimpses":
        perception = with_object_targets(perception, NAMES, ahead)
        encoder = glimpses.encoder_of(perception)
    if memory != "none":
        kept = make_memory(perception, [HandReading(1)], full=memory == "full")
    return Dagger(perception, 2, lambda state: state.goal, config, encoder=encoder, memory=kept)


def test_the_first_guess_is_kept_and_the_last_taking():
    """Of numbers 1 and 3 of a guess of four; of what is felt, number 1 is the grip."""
    memory, rng = ObjectMemory(3, [1, 3], [1]), np.random.default_rng(0)
    grip = np.array([[0, 0, 0, 1, 1, 0, 0, 1], [1, 1, 1, 1, 1, 1, 1, 1]]).T  # of two worlds
    begins = np.array([[1, 0, 0, 0, 0, 0, 1, 0], [1, 0, 0, 0, 0, 0, 0, 0]], bool).T
    felt = rng.normal(size=(8, 2, 3)).astype(np.float32)
    felt[:, :, 1] = 2.0 * grip - 1.0
    guess = rng.normal(size=(8, 2, 4)).astype(np.float32)
    kept, found = memory.blank(2), []
    for k in range(8):
        kept = memory.after(kept, begins[k], felt[k], guess[k])
        found.append(np.asarray(kept))
    first, taken = [0, 0, 0, 0, 0, 0, 6, 6], [0, 0, 0, 3, 3, 5, 6, 7]
    for k in range(8):
        for world, (f, t) in enumerate(((first[k], taken[k]), (0, 0))):
            requested = [*guess[f, world, [1, 3]], *guess[t, world, [1, 3]], *felt[t, world]]
            np.testing.assert_array_equal(found[k][world], np.array(requested, np.float32), err_msg=f"{k} {world}")
    mean, deviation = np.array([1.0, 0.0, 0.0]), np.array([0.5, 1.0, 0.01])
    normal = np.asarray(memory.normal(found[-1], felt[-1], mean, deviation))
    np.testing.assert_allclose(normal[:, :4], found[-1][:, :4])
    np.testing.assert_allclose(normal[:, 4], 2 * (found[-1][:, 4] - 1), rtol=1e-5)
    assert np.abs(normal).max() <= 10


def test_numbers_of_hands_are_where_the_controllers_say():
    spaces = {name: Space((size,), np.float32, -1.0, 1.0) for name, size in (("task_obs", 3), ("proprioception", 14))}
    perception = Perception(spaces)
    assert hand_numbers(perception, [HandReading(6, 0)]) == ((9,), (3,))
    assert hand_numbers(perception, [HandReading(12, 0), HandReading(13, 6)]) == ((15, 16), (3, 9))
    assert hand_numbers(perception, [HandReading(12, 0), HandReading(13)]) == ((15, 16), ()), "one hand lacks its pose"
    assert hand_numbers(Perception({"task_obs": spaces["task_obs"]}), [HandReading(0)]) == ((), ())


@pytest.mark.parametrize("robot", [Humanoid(), Fetch(proprioception="experiments")])
def test_controllers_say_where_their_hands_stand_in_proprioception(robot, tiny_home_folder):
    controller: Any = robot.controller(load_scene(tiny_home_folder, agents=[robot]).tables, 0)
    names = controller.proprioception_names
    for reading in controller.hand_readings:
        assert names[reading.holds].endswith(("is_grasping", "has_grasped"))
        assert names[reading.pose].endswith(("pos_x", "hand_x")) and names[reading.pose + 5].endswith("yaw")


def test_how_a_thing_lies_by_now_is_reckoned_from_how_it_lay_and_where_the_hand_that_took_it_is():
    """Two objects and two hands; the second hand takes something in step 1 and lets go of it in step 3."""
    rng, worlds = np.random.default_rng(0), 5
    memory = ObjectMemory(14, range(18), (12, 13), (0, 6), [[14, 15, 16], [17, 18, 19]])
    full = ObjectMemory.of({k: v for k, v in memory.card().items() if k != "whole"}, 14)
    assert memory.shown == 18 + 2 * 2 * 9 and ObjectMemory.of(memory.card(), 14).card() == memory.card()
    assert full.shown == full.size + 2 * 2 * 9, "files of before that was said show all that is remembered"
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
    kept = memory.blank(worlds)
    for k in range(5):
        seen = guess if k == 0 else rng.normal(size=guess.shape)  # what it guesses later does not count
        kept = memory.after(kept, np.full(worlds, k == 0), felt[k], seen.astype(np.float32))
        found = np.asarray(memory.carried(kept, felt[k], mean, deviation)).reshape(worlds, 2, 2, 9)
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
        shown = np.asarray(memory.normal(kept, felt[k], mean, deviation))
        assert shown.shape == (worlds, memory.shown) and np.abs(shown).max() <= 10
        more = np.asarray(full.normal(kept, felt[k], mean, deviation))
        np.testing.assert_array_equal(np.delete(more, np.s_[18:50], axis=1), shown)


@pytest.mark.slow
def test_labels_that_only_the_first_picture_tells_are_learnt():
    """The label is what was guessed in the first step; the picture of every later step is blank."""
    algorithm = made(action_bins=0)
    perception, imitation = algorithm.perception, algorithm.imitation
    learner, rng = jax.jit(algorithm.init)(jax.random.PRNGKey(0)), np.random.default_rng(0)
    pictures = rng.integers(0, 255, (64, 16 * 16 * 4)).astype(np.uint8)
    vector = np.zeros((64, perception.vector_size), np.float32)
    first, later = (
        Seen(jnp.asarray(vector), jnp.asarray(pictures)),
        Seen(jnp.asarray(vector), jnp.zeros((64, 1024), jnp.uint8)),
    )
    choose = jax.jit(imitation.choose)
    yes, no = np.ones(64, bool), np.zeros(64, bool)
    _, kept, _ = choose(learner.actor, learner.moments, first, algorithm.memory.blank(64), yes)
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


@pytest.mark.slow
def test_a_policy_file_remembers_as_what_was_trained(tmp_path):
    algorithm, env = made(), SeenPointMass(4)
    assert algorithm.memory is not None
    learner = jax.jit(algorithm.init)(jax.random.PRNGKey(0))
    Policy.of(algorithm, learner, depends(algorithm), {}).save(tmp_path / "policy.npz")
    policy = Policy.load(tmp_path / "policy.npz")
    assert policy.memory is not None and policy.memory.card() == algorithm.memory.card()
    play, choose = jax.jit(policy.player(algorithm.perception)), jax.jit(algorithm.imitation.choose)
    kept = also = algorithm.memory.blank(4)
    for k in range(4):
        obs = {**env.reset(k).obs, "privileged_state": jnp.ones((4, 7))}
        begins = np.array([k == 0, k == 0, k in (0, 2), True])
        action, kept = play(obs, kept, begins)
        head, also, _ = choose(learner.actor, learner.moments, algorithm.perception(obs), also, begins)
        np.testing.assert_allclose(kept, also, atol=0.02, err_msg="half precision")
        np.testing.assert_allclose(action, mode(head), atol=0.02)
    assert np.abs(np.asarray(kept)[0, :18] - np.asarray(kept)[3, :18]).max() > 0.05, "one saw another image"
    with pytest.raises(Ig2mjError, match="has a memory"):
        policy.actor(algorithm.perception)


def test_only_actors_that_act_on_a_prediction_have_a_memory():
    with pytest.raises(Ig2mjError, match="object_memory"):
        made(encoder="small")
    with pytest.raises(Ig2mjError, match="predicts no pose"):
        make_memory(Perception({"proprioception": Space((2,), np.float32, -1.0, 1.0)}), [HandReading(1)])
