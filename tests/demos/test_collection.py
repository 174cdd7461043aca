"""Demonstrations are recordings: labelled, observed, replayed bit for bit; files of 0.1.0 are converted or refused."""

from __future__ import annotations

import json
import pathlib

import h5py
import numpy as np
import pytest

from ig2mj.cli import call
from ig2mj.demos import Recording, Replayer, find_recording
from ig2mj.demos.collection import FAILED, collect
from ig2mj.demos.compact import write_compact
from ig2mj.demos.convert import convert
from ig2mj.demos.metrics import metrics_of
from ig2mj.envs.experts import expert_of
from ig2mj.envs.observations import Space
from ig2mj.errors import InputError
from ig2mj.learn.demos import about, load_demos
from ig2mj.learn.perception import Perception
from ig2mj.learn.policies import world_of


@pytest.fixture(scope="module")
def collected(cooking_meat, tmp_path_factory):
    file = tmp_path_factory.mktemp("collected") / "meat.h5"
    found = collect(cooking_meat, expert_of(cooking_meat), file, 2, noise=0.1, disturbed=0.02)
    assert found["kept"] == 2
    return file, found["failed"]


@pytest.mark.slow
def test_a_collection_holds_successful_runs_with_labels_and_observations(cooking_meat, collected):
    file, failed = collected
    with Recording(file) as recording:
        assert recording.value(FAILED, int) == failed
        assert len(recording.runs) == 2
        for run in recording.runs:
            assert run.success and run.complete
            action, label = run.all_rows("steps/action"), run.all_rows("steps/label")
            assert 0.01 < np.abs(label - action).mean() < 0.5, "actions have noise and disturbances, labels have none"
            assert set(run.obs_names) == set(cooking_meat.observation_spaces)
            assert run.all_rows("obs/proprioception").shape[0] == run.frames == len(action) + 1
            assert run.kept(0, 4).tolist() == [True, False, False, False]


@pytest.mark.slow
def test_a_collection_replays_bit_for_bit_with_the_recorded_observations(cooking_meat, collected):
    with Recording(collected[0]) as recording:
        recorded = {run.name: run.all_rows("obs/proprioception") for run in recording.runs}

        def watch(state, runs, frame):
            for world, run in runs.items():
                seen = np.asarray(state.obs["proprioception"])[world]
                assert seen == pytest.approx(recorded[run.name][frame], abs=1e-5), (run.name, frame)

        done = Replayer(recording, env=cooking_meat)(check=True, watch=watch)
    assert done.runs == 2 and not done.differences


@pytest.mark.slow
def test_networks_learn_from_recorded_and_from_replayed_observations_alike(cooking_meat, collected, tmp_path):
    file, _ = collected
    perception = Perception(cooking_meat.observation_spaces)
    read = load_demos(file, perception, world_of(cooking_meat))
    bare = tmp_path / "bare.h5"
    bare.write_bytes(file.read_bytes())
    with h5py.File(bare, "a") as opened:
        columns = json.loads(opened.attrs["columns"])
        opened.attrs["columns"] = json.dumps([c.replace("obs/", "steps/was_") for c in columns])
        for name in list(opened["obs"]):
            opened.move(f"obs/{name}", f"steps/was_{name}")
    replayed = load_demos(bare, perception)
    for a, b in ((read.seen, replayed.seen), (read.after, replayed.after)):
        assert np.asarray(a.vector) == pytest.approx(np.asarray(b.vector), abs=1e-4)
    assert np.array_equal(read.label, replayed.label) and np.array_equal(read.action, replayed.action)


@pytest.mark.slow
def test_metrics_of_a_compact_recording_are_of_all_frames(cooking_meat, collected):
    for run in metrics_of(collected[0], settle=0, env=cooking_meat):
        assert len(run["goal"]["each_frame"]) == run["frames"] > 10
        assert run["goal"]["each_frame"][-1] == 1.0


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_all_recordings_of_a_folder_are_measured_and_replayed_on_two_processes(tmp_path, capsys):
    """One of them is broken: it is named, and the others are done."""
    for name in ("a", "b"):
        with Recording(find_recording("GraspingBook")) as recording:
            write_compact(recording, tmp_path / f"{name}.h5", recording.runs[:2])
    (tmp_path / "c.h5").write_bytes(b"nothing")
    assert call(["demos", "metrics", str(tmp_path), "--jobs", "2", "--settle", "0", "--json"]) == 2
    done = capsys.readouterr()
    measured = [json.loads(line) for line in done.out.splitlines()]
    assert [(pathlib.Path(run["file"]).name, run["success"]) for run in measured] == [
        ("a.h5", True),
        ("a.h5", True),
        ("b.h5", True),
        ("b.h5", True),
    ]
    assert "c.h5: is not an HDF5 file" in done.err
    assert call(["demos", "replay", str(tmp_path), "--jobs", "2", "--by", "state"]) == 2
    assert capsys.readouterr().out.count("2 runs, ") == 2


@pytest.fixture
def old(tmp_path):
    """A file of `ig2mj demos collect` of version 0.1.0: two runs of three steps."""
    file, rng = tmp_path / "old.h5", np.random.default_rng(0)
    world = {"task": "reach", "robot": "fetch", "grasping": "mitten", "actions": ["x", "y"], "privileged": ["p"]}
    with h5py.File(file, "w") as out:
        out.attrs["format"], out.attrs["version"] = "ig2mj demonstrations", 1
        out.attrs["world"] = json.dumps(world)
        out.attrs["spaces"] = json.dumps({"proprioception": [[3], "float32"], "rgb": [[4, 4, 3], "uint8"]})
        for run in ("run_000000", "run_000001"):
            for name in ("action", "label"):
                out[f"{run}/{name}"] = rng.random((3, 2)).astype(np.float32)
            out[f"{run}/reward"] = np.arange(3, dtype=np.float32)
            out[f"{run}/terminated"], out[f"{run}/truncated"] = np.array([False, False, True]), np.zeros(3, bool)
            out[f"{run}/obs/proprioception"] = rng.random((4, 3)).astype(np.float32)
            out[f"{run}/obs/rgb"] = rng.integers(0, 255, (4, 4, 4, 3)).astype(np.uint8)
            out[run].attrs["success"] = True
    return file


def test_a_demonstrations_file_of_0_1_0_is_converted_to_learn_from(old, tmp_path, capsys):
    new = tmp_path / "new.h5"
    assert call(["demos", "convert", str(old), str(new)]) == 0
    assert "2 runs to learn from" in capsys.readouterr().out
    world, spaces = about(new)
    assert world["robot"] == "fetch" and world["privileged"] == ["p"]
    assert spaces["rgb"] == Space((4, 4, 3), np.uint8, -np.inf, np.inf)
    demos = load_demos(new, Perception(spaces))
    with h5py.File(old) as opened:
        for name in ("action", "label", "reward", "terminated"):
            both = np.concatenate([opened[f"run_00000{k}/{name}"][:] for k in (0, 1)])
            assert np.array_equal(getattr(demos, name), both)
        after = np.concatenate([opened[f"run_00000{k}/obs/proprioception"][1:] for k in (0, 1)])
        assert np.array_equal(demos.after.vector, after)
        with Recording(new) as recording:
            assert np.array_equal(recording.runs[1].all_rows("obs/rgb"), opened["run_000001/obs/rgb"][:])
            with pytest.raises(InputError, match=r"holds no frames of the world: it was converted \(.*train --demos"):
                Replayer(recording)


@pytest.mark.slow
def test_what_is_no_demonstrations_file_is_not_converted(old, collected, tmp_path):
    with pytest.raises(InputError, match=r"is a demonstrations file of ig2mj 0\.1\.0 .*demos convert .*old\.h5 NEW"):
        Recording(old)
    with pytest.raises(InputError, match=r"is a recording of format 3, which this version of ig2mj reads"):
        convert(collected[0], tmp_path / "new.h5")
    with h5py.File(old, "a") as opened:
        del opened["run_000001/label"]
        opened["run_000001/label"] = np.zeros((2, 2), np.float32)
    with pytest.raises(InputError, match=r"run_000001/label: has 2 rows of a run of 3 steps"):
        convert(old, tmp_path / "new.h5")
    assert not (tmp_path / "new.h5").exists()
    with h5py.File(old, "a") as opened:
        opened.attrs["version"] = 7
    with pytest.raises(InputError, match=r"is no demonstrations file of ig2mj 0\.1\.0"):
        convert(old, tmp_path / "new.h5")
