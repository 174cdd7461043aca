"""Demonstrations that ship: small, of every activity, of successes, and replayed to the last byte."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from ig2mj.demos import Recording, Replayer, find_recording, shipped
from ig2mj.demos.model_hash import physics_hash
from ig2mj.demos.origin import origin_of_machine
from ig2mj.demos.shipped import folder
from ig2mj.demos.task_hash import task_hash
from ig2mj.errors import UnknownNameError
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.task import place_robot

MEGABYTES = 10


def test_there_are_32_successes_of_each_activity_in_ten_megabytes():
    assert shipped() == sorted(ACTIVITIES)
    assert sum(file.stat().st_size for file in folder().iterdir()) < MEGABYTES * 1e6
    for name in shipped():
        with Recording(find_recording(name)) as recording:
            assert recording.header["task"] == name and recording.header["robot"] == "humanoid"
            assert len(recording.runs) == 32
            for run in recording.runs:
                assert run.attributes["success"] and run.attributes["terminated"]
                action = run.all_rows("steps/action")
                assert len(action) == run.frames - 1 and np.abs(action).max() <= 1
                label = run.all_rows("steps/label")
                assert label.shape == action.shape and np.abs(label).max() <= 1
                assert 0.01 < np.abs(label - action).mean() < 0.5  # disturbed, and mostly the expert's
                assert run.all_rows("steps/success").tolist() == [False] * (len(action) - 1) + [True]


def test_they_are_of_the_activities_as_they_are_now():
    """Else they are refused by action: `make demonstrations` records them again."""
    for name in shipped():
        task = ACTIVITIES[name]
        scene = load_scene(task.home, agents=[place_robot(task, "humanoid")[1]], objects=task.objects)
        with Recording(find_recording(name)) as recording:
            assert recording.header["task_hash"] == task_hash(task, "humanoid", scene.object_names)
            assert recording.header["model_hash"] == physics_hash(scene.model)
            assert recording.header["scene_hash"] == scene.digest


def test_a_name_that_does_not_ship_is_an_error_with_near_matches():
    with pytest.raises(UnknownNameError, match="GraspingBook"):
        find_recording("GraspingBok")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ACTIVITIES))
def test_they_replay_by_state_and_where_the_processor_is_the_same_by_action(name):
    with Recording(find_recording(name)) as recording:
        replayer, ends = Replayer(recording, "state"), []

        def watch(state, now, frame):
            ends.extend(bool(np.asarray(state.status.holds)[w]) for w, run in now.items() if frame == run.frames - 1)

        replayer(watch=watch)
        assert ends == [True] * 32
        runs = recording.runs[:8]
        done = Replayer(recording, env=replayer.env)(check=True, runs=runs)
        here = origin_of_machine()
        if all(recording.header[key] == here[key] for key in ("processor", "processor_features", "jax")):
            assert done.differences == []
        assert done.runs == 8


@pytest.mark.slow
def test_the_example_clones_a_policy_that_succeeds(repository):
    command = [sys.executable, "examples/imitate.py", "GraspingBook"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=repository)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split("; ")[-1].split()[0]) >= 24, done.stdout


def test_the_example_has_60_lines(repository):
    assert len((repository / "examples" / "imitate.py").read_text().splitlines()) <= 60
