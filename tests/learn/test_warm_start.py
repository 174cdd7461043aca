"""Training that begins with a policy's networks (`ig2mj.learn.warm_start`)."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from occlusion.test_object_memory import depends, made
from small_envs import SeenPointMass

from ig2mj.errors import InputError
from ig2mj.learn.policies import Policy
from ig2mj.learn.running_stats import RunningStats
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.warm_start import init_from_policy


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    """Of an actor that remembers nothing, as a file of it has it."""
    algorithm = made("none")
    rng = np.random.default_rng(0)
    samples = rng.normal(rng.normal(size=9), rng.uniform(0.5, 2.0, 9), (500, 9)).astype(np.float32)
    learner = jax.jit(algorithm.init)(jax.random.PRNGKey(7))
    learner = dataclasses.replace(learner, moments=RunningStats.initial(9).update(jnp.asarray(samples)))
    file = tmp_path_factory.mktemp("policy") / "policy.npz"
    Policy.of(algorithm, learner, depends(algorithm), {}).save(file)
    return algorithm, learner, Policy.load(file)


@pytest.mark.slow
def test_an_actor_with_a_memory_first_does_what_the_policy_does(policy):
    algorithm, learner, loaded = policy
    remembers = made("poses")
    begun = init_from_policy(remembers, loaded, 0)
    np.testing.assert_allclose(begun.moments.mean, learner.moments.mean, atol=1e-6)
    np.testing.assert_allclose(begun.moments.var, learner.moments.var, rtol=1e-3)
    seen = algorithm.perception({**SeenPointMass(4).reset(1).obs, "privileged_state": jnp.ones((4, 7))})
    begins = np.ones(4, bool)
    before, _, _ = jax.jit(algorithm.imitation.choose)(learner.actor, learner.moments, seen, jnp.zeros((4, 0)), begins)
    kept = remembers.memory.blank(4)
    after, kept, _ = jax.jit(remembers.imitation.choose)(begun.actor, begun.moments, seen, kept, begins)
    assert np.abs(np.asarray(kept)).max() > 0.01, "it remembers something"
    np.testing.assert_allclose(after, before, atol=0.01, err_msg="half precision")
    assert int(begun.updates) > 0, "it acts at once"


@pytest.mark.slow
def test_other_networks_and_files_without_scales_are_refused(policy):
    _, _, loaded = policy
    others = {"actor_layers": (16,)}, {"action_bins": 0}, {"actor_layers": (32, 32)}
    for settings, element in zip(others, ("choice", "choice", "trunk"), strict=True):
        with pytest.raises(InputError, match="actor_layers=32 action_bins=21") as found:
            init_from_policy(made(**settings), loaded, 0, "fruit.npz")
        assert element in str(found.value) and "fruit.npz" in str(found.value)
    with pytest.raises(InputError, match="scales"):
        init_from_policy(made(), dataclasses.replace(loaded, hidden=None), 0)
    recall = {"poses": [0], "grips": [0], "hands": [0], "places": [[0, 1, 2]]}  # of a file from before `whole` was said
    for more, setting in (({}, "full"), ({"whole": True}, "full"), ({"whole": False}, "poses")):
        net = {**loaded.card["net"], "recall": {**recall, **more}}
        with pytest.raises(InputError, match=f"action_bins=21 object_memory={setting}"):
            init_from_policy(made(actor_layers=(16,)), dataclasses.replace(loaded, card={**loaded.card, "net": net}), 0)


@pytest.mark.slow
def test_who_guesses_nothing_needs_no_scales_of_what_is_hidden(tmp_path):
    algorithm = made("none", encoder="small", aux_coef=0.0)
    learner = jax.jit(algorithm.init)(jax.random.PRNGKey(7))
    Policy.of(algorithm, learner, depends(algorithm), {}).save(tmp_path / "policy.npz")
    loaded = Policy.load(tmp_path / "policy.npz")
    assert loaded.hidden is None
    begun = init_from_policy(algorithm, loaded, 0)
    assert begun.moments.mean.shape == learner.moments.mean.shape and np.isfinite(begun.moments.mean).all()
    for ours, theirs in zip(jax.tree.leaves(begun.actor), jax.tree.leaves(learner.actor), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=2e-3, err_msg="half precision")


@pytest.mark.slow
def test_sac_begins_as_a_policy_whose_predicting_layers_are_not_in_its_file(tmp_path):
    """The actor does as the policy does; what critics alone see is scaled by what the run sees."""
    perception = made("none", encoder="small").perception
    config = SACConfig(encoder="small", actor_layers=(16,), critic_layers=(16,), image_shift=0)
    algorithm = SAC(perception, 2, config, begun=True)
    learner = jax.jit(algorithm.init)(jax.random.PRNGKey(7))
    samples = jnp.asarray(np.random.default_rng(0).normal(3.0, 2.0, (500, perception.vector_size)), jnp.float32)
    learner = dataclasses.replace(learner, moments=learner.moments.update(samples))
    Policy.of(algorithm, learner, depends(algorithm), {}).save(tmp_path / "policy.npz")
    loaded = Policy.load(tmp_path / "policy.npz")
    assert not any(name.startswith("guess/") for name in loaded.weights)
    begun = init_from_policy(algorithm, loaded, 0)
    seen = perception({**SeenPointMass(4).reset(1).obs, "privileged_state": jnp.ones((4, 7))})
    after, before = (algorithm._look(x.actor, x.moments, seen)[0] for x in (begun, learner))
    np.testing.assert_allclose(after, before, atol=0.01, err_msg="half precision")
    other = begun.moments.update(samples + 1.0)
    size = perception.actor_size
    np.testing.assert_allclose(
        other.mean[:size], learner.moments.mean[:size], atol=0.01, err_msg="of a million samples"
    )
    np.testing.assert_allclose(other.mean[size:], samples.mean(0)[size:] + 1.0, rtol=1e-4, err_msg="of these alone")
