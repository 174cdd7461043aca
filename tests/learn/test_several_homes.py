"""Trainings in several homes: what differs from a training in one, and what does not."""

from __future__ import annotations

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from small_envs import PointMass

from ig2mj.learn.collect import Transition
from ig2mj.learn.iteration import OneDevice, SeveralHomes
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.progress import Window
from ig2mj.learn.replay import Replay
from ig2mj.learn.running_stats import RewardScale
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.train import Run, train
from ig2mj.process.compilation import XLA_EVENT
from ig2mj.process.gc_pause import Compiled

SMALL = {"actor_layers": (4,), "critic_layers": (4,), "num_atoms": 5, "batch_size": 8, "policy_delay": 1}
SPACES = PointMass(1).observation_spaces


class Homes:
    """What a training reads of a `HomesEnvironment`."""

    pure = True

    def __init__(self, *worlds: int):
        self.envs = [PointMass(count) for count in worlds]
        self.homes, self.num_worlds = [f"home_{k}" for k in range(len(worlds))], sum(worlds)

    def seed_of(self, home: int, seed: int) -> int:
        return seed + 1000 * home


def sac() -> SAC:
    config = SACConfig(rollout_length=2, utd_ratio=1, buffer_size=64, n_step=1, **SMALL)
    return SAC(Perception(SPACES), 2, config)


def iterations(step, algorithm, count: int):
    """Learner, buffer, worlds and the sums of each iteration, the first half without updates."""
    learner = jax.jit(algorithm.init)(jax.random.PRNGKey(0))
    buffer, play, found = step.buffer(), step.begin(3), []
    for k in range(count):
        key = jax.random.PRNGKey(k)
        learner, buffer, play, sums, _, _ = step(learner, buffer, play, key, 0.1, k >= count // 2)
        found.append(sums)
    return learner, buffer, play, found


@pytest.mark.slow
def test_one_home_in_a_list_is_learned_exactly_as_alone():
    algorithm = sac()
    alone = iterations(OneDevice(PointMass(4), algorithm, programs=2), algorithm, 6)
    listed = iterations(SeveralHomes(Homes(4), algorithm), algorithm, 6)
    for mine, other in zip(jax.tree.leaves(listed[:2]), jax.tree.leaves(alone[:2]), strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-5, atol=1e-6)
    assert [s["reward"] for s in listed[3]] == pytest.approx([s["reward"] for s in alone[3]], rel=1e-5)


@pytest.mark.slow
def test_homes_take_turns_and_fill_their_own_part_of_the_buffer():
    algorithm = sac()
    homes = SeveralHomes(Homes(4, 4), algorithm)
    assert homes.turns == 2
    _, buffer, plays, sums = iterations(homes, algorithm, 3)
    replay = buffer.replay
    assert replay.head.tolist() == [4, 2] == replay.size.tolist() and replay.reward.shape[1] == 8
    written = np.abs(np.asarray(replay.vector)).sum(-1) > 0
    assert written[:4, :4].all() and written[:2, 4:].all() and not written[4:].any() and not written[2:, 4:].any()
    assert [s["steps"] for s in sums] == [8, 8, 8]  # two steps of the four worlds of one home
    assert [int(play.steps.max()) for play in plays] == [4, 2]


@pytest.mark.slow
@pytest.mark.parametrize("in_turn", [True, False])
def test_all_programs_of_all_homes_are_compiled_together_before_the_first_starts(monkeypatch, in_turn):
    class Awaiting(PointMass):
        """Offers its start's program, as an environment does whose engine is loading kernels."""

        def pending_programs(self, seed):
            return [Compiled(self._start_fn).traced(jax.random.PRNGKey(seed))]

    compiled, once = list[str](), list[list[str]]()

    def note(event: str, duration_secs: float, **about: str | int) -> None:
        if event == XLA_EVENT:
            compiled.append(str(about.get("fun_name")))

    env = Homes(4, 4)
    env.envs = [Awaiting(4), Awaiting(4)]
    for part in env.envs:
        reset = part.reset
        monkeypatch.setattr(part, "reset", lambda seed, reset=reset: (once.append(list(compiled)), reset(seed))[1])
    jax.monitoring.register_event_duration_secs_listener(note)
    train(env, sac(), Run(iterations=4, homes_in_turn=in_turn, quiet=True))
    for name, count in (("jit(collect)", 2), ("jit(learn)", 1)):
        assert once[0].count(name) == compiled.count(name) == count, "the calls find what was compiled"


def test_homes_that_cannot_take_turns_are_stepped_together():
    on_policy = PPO(Perception(SPACES), 2, PPOConfig(actor_layers=(4,), critic_layers=(4,)))
    assert SeveralHomes(Homes(4, 4), on_policy).turns == 1
    assert SeveralHomes(Homes(4, 3), sac()).turns == 1
    assert SeveralHomes(Homes(4, 4), sac(), in_turn=False).turns == 1


def test_steps_of_a_group_are_followed_by_steps_of_the_same_group():
    """Three groups of two worlds; rewards are the number of the group, and the vector counts its own steps."""
    replay = Replay.empty(4, 6, Perception(SPACES), 2, groups=3)
    insert, none = jax.jit(Replay.insert), jnp.zeros((2, 2), bool)
    for turn in range(7):
        group, first = turn % 3, 2 * (turn // 3)
        vector = jnp.broadcast_to(jnp.array([first, first + 1.0])[:, None, None], (2, 2, 4))
        seen = Seen(vector, jnp.zeros((2, 2, 0), jnp.uint8))
        told = Transition(seen, vector[..., :2], {}, jnp.full((2, 2), float(group)), none, none, seen)
        replay = insert(replay, told, jnp.int32(group))
    assert replay.head.tolist() == [2, 0, 0] and replay.size.tolist() == [4, 4, 4]
    sample = jax.jit(lambda kept, key: kept.sample(key, 300, 2, 0.5))(replay, jax.random.PRNGKey(0))
    group = np.asarray(sample.reward) / 1.5  # of two steps
    assert set(group) == {0.0, 1.0, 2.0}
    start, after = (np.asarray(seen.vector)[:, 0] for seen in (sample.seen, sample.after))
    np.testing.assert_array_equal(after, start + 1)
    assert set(start[group == 0]) == {2, 3, 4} and set(start[group == 2]) == {0, 1, 2}


def test_returns_of_a_group_are_its_own():
    scale, no = RewardScale.initial(4), jnp.zeros((1, 2), bool)
    for group in (0, 1, 1):
        scale = scale.update(jnp.full((1, 2), 1.0 + group), no, 0.5, group=group)
    np.testing.assert_allclose(scale.running, [1.0, 1.0, 3.0, 3.0])


def test_success_is_reported_of_each_home():
    window = Window(0.0, 1, 1.0)
    of_birch = {"episodes/birch": 4.0, "success/birch": 3.0, "episodes/elm": 0.0, "success/elm": 0.0}
    window.add({"episodes": 4.0, "steps": 10.0, "success": 3.0, "reward": 5.0, **of_birch})
    row = window.mean()
    assert row == {"success": 0.75, "reward": 0.5, "success/birch": 0.75, "success/elm": None}
