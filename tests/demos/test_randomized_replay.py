"""A recording of an environment whose physics differs between episodes replays bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.demos.reader import Recording
from ig2mj.demos.replay import Replayer


@pytest.mark.slow
def test_a_recording_of_randomized_physics_replays(tmp_path):
    file = tmp_path / "run.h5"
    env = ig2mj.make(
        "PointNavigation", "turtlebot", 2, "native", home="small_home", horizon=4, randomize={"physics": True}
    )
    recorded, rng = ig2mj.record(env, file), np.random.default_rng(0)
    state = recorded.reset(3)
    for _ in range(6):  # an episode ends, and the next one has other physics
        state = recorded.step(state, rng.uniform(-1, 1, (2, *env.action_space.shape)).astype(np.float32))
    recorded.close()
    with Recording(file) as recording:
        assert recording.value("made_with", dict)["randomize"]["physics"]["mass"] == [0.8, 1.25]
        replayer = Replayer(recording)
        assert replayer.env.config.randomize.as_dict() == ig2mj.Randomize(physics=True).as_dict()
        found = replayer()
    assert found.differences == [] and (found.runs, found.frames) == (2, 10)
