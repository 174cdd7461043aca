"""`Environment.render`: images of states, of lists of states and of recordings."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.errors import EngineError, StaleStateError, UnknownNameError
from ig2mj.viewer import FreeView

SIZE = {"width": 64, "height": 48}


@pytest.fixture(scope="module")
def env():
    return ig2mj.make("PointNavigation", {"worlds": 2, "pool_size": 2, "engine": "native"})


def drive(env, steps: int) -> list:
    """Copies of the states of an episode in which robots turn and drive."""
    state = env.reset(0)
    states = [env.fork(state)]
    for _ in range(steps):
        state = env.step(state, np.full((2, *env.action_space.shape), 1.0, np.float32))
        states.append(env.fork(state))
    return states


@pytest.mark.slow
def test_a_state_is_one_image_and_can_be_stepped_afterwards(env):
    state = env.start_from(np.arange(2))
    image = env.render(state, world=1, **SIZE)
    assert image.shape == (48, 64, 3) and image.dtype == np.uint8 and image.std() > 5
    assert not np.array_equal(image, env.render(state, world=0, **SIZE)), "worlds have starts of their own"
    assert np.array_equal(image, env.render(state, world=1, **SIZE))
    env.step(state, np.zeros((2, *env.action_space.shape), np.float32))
    with pytest.raises(StaleStateError):
        env.render(state)


def test_a_list_of_states_is_a_stack_of_images(env):
    states = drive(env, 3)
    images = env.render(states, **SIZE)
    assert images.shape == (4, 48, 64, 3) and images.dtype == np.uint8
    assert np.array_equal(images[2], env.render(states[2], **SIZE))
    assert not np.array_equal(images[0], images[3])
    assert env.render([], **SIZE).shape == (0, 48, 64, 3)


def test_cameras_have_names_or_stand_anywhere(env):
    state = env.reset(0)
    names = [env.mj_model.camera(k).name for k in range(env.mj_model.ncam)]
    own = env.render(state, camera=names[0], **SIZE)
    above = env.render(state, camera=FreeView((0, 0, 0), 8.0, elevation=-90), **SIZE)
    assert not np.array_equal(own, above)
    with pytest.raises(UnknownNameError, match="camera"):
        env.render(state, camera="nowhere", **SIZE)


def test_a_recording_is_a_stack_of_images_of_one_run(env, tmp_path):
    file = tmp_path / "run.h5"
    recorder = ig2mj.record(env, file)
    state = recorder.reset(0)
    shown = [env.render(state, world=1, **SIZE)]
    for _ in range(3):
        state = recorder.step(state, np.full((2, *env.action_space.shape), 1.0, np.float32))
        shown.append(env.render(state, world=1, **SIZE))
    recorder.close()
    with ig2mj.demos.Recording(file) as recording:
        assert [run.world for run in recording.runs] == [0, 1]
        found = env.render(recording, run=1, **SIZE)
    assert np.array_equal(found, np.stack(shown))
    assert env.render(file, **SIZE).shape == (4, 48, 64, 3)
    with pytest.raises(EngineError, match="the recording has runs 0 to 1"):
        env.render(str(file), run=2)


def test_what_has_no_image_is_refused(env):
    state = env.reset(0)
    for world in (2, -1):
        with pytest.raises(EngineError, match="worlds 0 to 1"):
            env.render(state, world=world)
    with pytest.raises(EngineError, match="not of dict"):
        env.render({})
    with pytest.raises(UnknownNameError, match="no recording is named 'nothing'"):
        env.render("nothing")


def test_metrics_of_a_state_are_success_and_the_reward_terms(env):
    state = env.reset(0)
    assert set(state.metrics) == {"success", *(f"reward/{name}" for name in env.objective.terms)}
    assert all(np.shape(array) == (2,) for array in state.metrics.values())
