"""A batch that is stepped from Python: what was compiled once is not compiled again."""

from __future__ import annotations

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from navigating import small

import ig2mj
from ig2mj.envs.actor import Actor
from ig2mj.envs.rollout import play
from ig2mj.errors import ActionError
from ig2mj.process.compilation import XLA_EVENT
from ig2mj.process.gc_pause import compile_together
from ig2mj.sensors.base import SensorOptions

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

WORLDS = 2


@pytest.fixture(scope="module")
def env():
    return ig2mj.make(
        small("PointNavigation", target_dist=(1.0, 4.0)), worlds=WORLDS, engine="warp", pool_size=4,
        observations=("task_obs", "scan"), sensors=SensorOptions(scan_rays=9),
    )  # fmt: skip


@pytest.fixture
def compiled() -> Iterator[list[str]]:
    """Programs that XLA has compiled or found in its cache since."""
    found: list[str] = []

    def listen(event: str, duration_secs: float, **kwargs: str | int) -> None:
        if event == XLA_EVENT:
            found.append(str(kwargs.get("fun_name")))

    jax.monitoring.register_event_duration_secs_listener(listen)
    yield found
    jax.monitoring.unregister_event_duration_listener(listen)


def test_starts_from_rows_are_one_program(env, compiled):
    """They were 371, operations one by one, and two more each time."""
    action = np.zeros((WORLDS, *env.action_space.shape), np.float32)
    state = env.start_from(np.arange(WORLDS))
    assert len(compiled) <= 3
    state = env.step(state, action)
    compiled.clear()
    state = env.start_from(np.arange(WORLDS) + 1)
    for _ in range(2):
        state = env.step(state, action)
    assert not compiled
    assert np.asarray(state.info["steps"]).tolist() == [2, 2]
    assert (np.asarray(state.obs["scan"]) < 1).any()


def test_the_steps_of_an_actor_are_compiled_together_with_the_start(env, compiled, monkeypatch):
    """While kernels are being loaded, for which the engine's reset waits."""
    short = env.with_horizon(3)
    engine, reset, before = short.core.engine, short.core.engine.reset, list[str]()
    first = engine._first.traced(engine._template, engine._initial)
    monkeypatch.setattr(engine, "pending_reset_program", lambda: first)
    monkeypatch.setattr(engine, "reset", lambda: (before.extend(compiled), compiled.clear(), reset())[2])
    played = play(short, Actor(short, _still), WORLDS, in_order=True)
    assert {"jit(_load_fn)", "jit(_several_fn)"} <= set(before)
    assert not set(before) & set(compiled), "the calls find what was compiled"
    assert played.steps == 3 * WORLDS and short.following is None


def test_programs_of_a_start_are_compiled_before_it_is_asked_for(env, compiled, monkeypatch):
    """`start_programs`: the start, and what follows it; a start of the same shapes then compiles nothing."""
    short = env.with_horizon(4)
    engine, actor = short.core.engine, Actor(short, _still)
    pending = [engine._first.traced(engine._template, engine._initial)]
    monkeypatch.setattr(engine, "pending_reset_program", lambda: pending.pop() if pending else None)
    short.following = lambda state: [actor.traced(state, short.objective.outcomes)]
    compile_together(short.start_programs(rows=np.array([2, 3]), seed=[7, 8]))
    assert {"jit(_load_fn)", "jit(_several_fn)"} <= set(compiled)
    compiled.clear()
    assert not short.start_programs() and not compiled
    play(short, actor, WORLDS, in_order=True, seeds=[7, 8, 9, 10])
    assert not {"jit(_load_fn)", "jit(_several_fn)"} & set(compiled)


def _still(obs, kept, begins, key):
    return jnp.zeros((WORLDS, 2)), kept


def test_an_actor_takes_the_steps_that_python_would_take(env, compiled):
    """Twenty in a program; worlds whose episodes are over wait, and what is remembered begins anew with an episode."""

    def choose(obs, kept, begins, key):
        kept = jnp.where(begins[:, None], 0.0, kept) + 0.01
        ahead = jnp.abs(obs["task_obs"][:, 1]) < 0.5
        noise = 0.1 * jax.random.uniform(key, (WORLDS,))
        turn = jnp.clip(obs["task_obs"][:, 1], -0.3, 0.3) + noise + kept[:, 0]
        return jnp.stack([jnp.where(ahead, 0.8, 0.0), turn], 1), kept

    short = env.with_horizon(25)
    actor, stepwise = Actor(short, choose, 1), Actor(short, choose, 1, seed=7)
    by_python = play(short, lambda state: stepwise(state), 2, in_order=True)
    by_program = play(short, actor.seeded(7), 2, in_order=True)
    assert np.allclose(by_program.total, by_python.total, atol=1e-3)
    assert by_program.success == by_python.success and by_program.steps == by_python.steps
    assert 2 * 20 < by_program.steps <= 2 * 25
    compiled.clear()
    again = play(short, actor.seeded(8), 3, in_order=True, first=1)
    assert not compiled
    assert len(again.total) == len(again.success) == 3 and not again.outcomes
    wrong = Actor(short, _not_finite, parameters=jnp.float32(jnp.nan))
    with pytest.raises(ActionError, match="4 numbers of actions of PointNavigation are not finite"):
        play(short, wrong, 2, in_order=True)


def _not_finite(obs, kept, begins, key, much):
    return jnp.full((WORLDS, 2), much), kept
