"""A batch that is stepped from Python: what was compiled once is not compiled again."""

from __future__ import annotations

from collections.abc import Iterator

import jax
import numpy as np
import pytest
from navigating import small

import ig2mj
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
        if event == "/jax/core/compile/backend_compile_duration":
            found.append(event)

    jax.monitoring.register_event_duration_secs_listener(listen)
    yield found
    jax.monitoring.unregister_event_duration_listener(listen)


def test_starts_from_rows_are_one_program(env, compiled):
    """They were 371, and two more each time: operations one by one, 30 s before the first step."""
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
