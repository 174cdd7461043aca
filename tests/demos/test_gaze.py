"""Gaze in the metrics: that of an eye tracker where there was one, in the home's frame; broken arrays are refused."""

from __future__ import annotations

import shutil

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ig2mj
from ig2mj.demos import Recording, Replayer, record
from ig2mj.demos.gaze import measured_rays, statistics
from ig2mj.demos.metrics import metrics_of
from ig2mj.errors import InputError

PLACE, YAW = np.array([2.0, -1.0, 0.3]), 0.7
"""Of the play area in the home."""


@pytest.fixture(scope="module")
def env():
    return ig2mj.make("CookingMeat", engine="native", pool_size=4, whole_actions=True, period=1 / 30)


@pytest.fixture(scope="module")
def looked(env, tmp_path_factory):
    """Four steps in which a person looks at the steak from above, twice; then at nothing that is known; then up."""
    file, zero = tmp_path_factory.mktemp("gaze") / "person.h5", np.zeros((1, 28), np.float32)
    area = np.array([[*PLACE, YAW, 0.0]])
    back = Rotation.from_euler("z", -YAW)
    with record(env, file, devices={"gaze": np.zeros((1, 7)), "area": area}) as played:
        state = played.reset(0)
        steak = np.asarray(state.batch.world.view.object_com)[0, env.scene.object_index("steak_0")]
        eye = back.apply(steak + np.array([0.0, 0.0, 0.1]) - PLACE)
        for valid, direction in ((1, (0, 0, -2.0)), (1, (0, 0, -1)), (0, (0, 0, 0)), (1, (0, 0, 1))):
            played.devices["gaze"] = np.array([[valid, *eye, *direction]], float)
            state = played.step(state, zero)
    return file, steak


@pytest.mark.slow
def test_a_measured_gaze_is_turned_into_the_homes_frame(looked):
    with Recording(looked[0]) as recording:
        rays = measured_rays(recording.runs[0])
    assert rays is not None and rays.valid.tolist() == [True, True, False, True]
    assert rays.origin[0] == pytest.approx(looked[1] + [0, 0, 0.1], abs=1e-9)
    assert rays.direction[0] == pytest.approx([0, 0, -1])
    assert rays.at(2) is None and rays.at(4) is None  # not tracked; the last frame has no step after it


@pytest.mark.slow
def test_metrics_take_the_measured_gaze_and_say_so(env, looked):
    (found,) = metrics_of(looked[0], settle=0, env=env, incomplete=True)
    gaze = found["gaze"]
    assert gaze["measured"] is True and gaze["tracked"] == pytest.approx(3 / 5)
    assert gaze["objects"]["steak_0"] == pytest.approx(2 / 3) and gaze["fixations"] == 2
    assert gaze["mean_turn"] == 0.0  # before and after the gap nothing can be said


@pytest.mark.slow
def test_replayed_by_state_the_view_looks_where_the_head_looked(env, tmp_path):
    file, turn, looks = tmp_path / "head.h5", np.zeros((1, 28), np.float32), []
    turn[0, env.action_names.index("eye_yaw")] = 1.0
    with record(env, file) as played:
        state = played.reset(0)
        for _ in range(6):
            state = played.step(state, turn)
            looks.append(np.array(state.batch.world.view.agent.eye_quat)[0, 0])
    assert np.abs(looks[-1] - looks[0]).max() > 0.1
    found = []
    with Recording(file) as recording:
        replayer = Replayer(recording, "state", env=env)
        replayer(watch=lambda state, now, k: found.append(np.array(state.batch.world.view.agent.eye_quat)[0, 0]))
        alone = replayer.at(recording.runs[0], 6)  # in worlds of its own, not in those of the frame before
    assert np.stack(found[1:]) == pytest.approx(np.stack(looks), abs=1e-6)
    assert np.array_equal(np.asarray(alone.batch.world.view.agent.eye_quat)[0, 0], found[-1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value", "problem"),
    [("gaze", np.nan, "finite"), ("area", np.inf, "finite")],
)
def test_numbers_that_are_not_finite_are_refused_with_file_and_field(looked, tmp_path, name, value, problem):
    file = tmp_path / "broken.h5"
    shutil.copy(looked[0], file)
    with h5py.File(file, "r+") as opened:
        rows = opened[f"steps/devices/{name}"]
        assert isinstance(rows, h5py.Dataset)
        rows[0, 1] = value
    with Recording(file) as recording, pytest.raises(InputError, match=f"steps/devices/{name}.*{problem}"):
        measured_rays(recording.runs[0])


def test_turns_are_measured_between_frames_that_follow_each_other():
    axes = [np.array(v, float) for v in ((1, 0, 0), (0, 1, 0), (0, 1, 0), (0, 0, 0), (1, 0, 0))]
    found = statistics(["a", "b", "b", None, "a"], axes, seconds=0.5, measured=True)
    assert found["mean_turn"] == pytest.approx((np.pi / 2 + 0) / 2 / 0.5)
    assert found["fixations"] == 3 and found["tracked"] == 0.8 and found["objects"] == {"a": 0.5, "b": 0.5}


def test_without_eyes_there_is_no_gaze():
    assert statistics([None, None], [np.zeros(3)] * 2, 0.1, True) == {
        "measured": True,
        "tracked": 0.0,
        "objects": {},
        "fixations": 0,
        "mean_turn": 0.0,
    }
