"""Recordings of environments replay bit for bit; what is not the same is named; files that are broken are refused."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import subprocess
import sys

import h5py
import numpy as np
import pytest

import ig2mj
from ig2mj.cli import call
from ig2mj.demos import Recording, Replayer, record
from ig2mj.demos.compact import write_compact
from ig2mj.demos.metrics import metrics_of
from ig2mj.demos.observing import observe
from ig2mj.demos.origin import origin_of
from ig2mj.demos.writer import RunWriter
from ig2mj.envs.experts import expert_of
from ig2mj.errors import InputError
from ig2mj.scene.paths import SHIPPED_HOMES

ROWS, HORIZON = 4, 12


@pytest.fixture(scope="module")
def env(cooking_meat):
    return cooking_meat.with_horizon(HORIZON)


@pytest.fixture(scope="module")
def recorded(env, tmp_path_factory):
    """27 steps: two whole runs and the beginning of a third in each world; observations of all frames."""
    file = tmp_path_factory.mktemp("recordings") / "runs.h5"
    expert, rng, seen = expert_of(env), np.random.default_rng(0), []
    with record(env, file) as played:
        state = played.reset(3)
        seen.append(np.asarray(state.obs["proprioception"]))
        for step in range(27):
            noise = 0.3 * rng.standard_normal((2, env.action_space.shape[0]))
            state = played.step_autoreset(state, np.asarray(expert(state)) + noise)
            seen.append(np.asarray(state.obs["proprioception"]) if step < HORIZON - 1 else None)
    return file, seen


def changed(recorded, tmp_path):
    copy = tmp_path / "copy.h5"
    shutil.copy(recorded[0], copy)
    return copy


def test_a_recording_says_what_it_is_of_and_how_its_runs_ended(env, recorded):
    with Recording(recorded[0]) as recording:
        assert [run.frames for run in recording.runs] == [13, 13, 13, 13, 4, 4]
        assert [run.world for run in recording.runs] == [0, 1] * 3
        first = recording.runs[0]
        assert first.attributes["ended"] and 0 <= first.attributes["row"] < ROWS
        assert recording.header["scene_hash"] == env.scene.digest
        qpos = first.rows("frames/physics/agents/qpos", 0, 13)
        assert qpos.dtype == np.float64 and (qpos[1:] != qpos[:-1]).any()
        assert len(recording.arrays["frames/physics/agents/eq_data"]) == 1  # the same in all frames
        total = first.rows("steps/reward/total", 0, 12)
        terms = [first.rows(f"steps/{name}", 0, 12) for name in first.step_names if name.startswith("reward/")]
        assert sum(np.broadcast_to(t, 12) for t in terms) == pytest.approx(2 * total, abs=1e-4)


@pytest.mark.slow
def test_by_action_every_byte_of_every_frame_comes_out_the_same_on_another_number_of_threads(recorded):
    with Recording(recorded[0]) as recording:
        replayer = Replayer(recording, threads=1)
        assert replayer.warnings == []
        done = replayer(check=True)
        assert (done.runs, done.frames, done.differences) == (6, 60, [])
        alone = replayer(check=True, runs=recording.runs[3:4])  # the other world stands somewhere else
        assert (alone.runs, alone.differences) == (1, [])


def test_by_state_every_frame_is_there_and_can_be_observed(env, recorded):
    file, seen = recorded
    with Recording(file) as recording:
        found = []
        replayer = Replayer(recording, "state", env=env)
        replayer(watch=lambda state, runs, k: found.append(np.asarray(state.obs["proprioception"])))
        for k in range(HORIZON):
            assert found[k] == pytest.approx(seen[k], abs=1e-5), k


def test_the_first_difference_is_named_by_run_frame_object_and_field(env, recorded, tmp_path):
    copy = changed(recorded, tmp_path)
    joint = env.scene.model.joint("steak_0/free")
    with h5py.File(copy, "a") as opened:
        (first, _), *_ = opened["run_000002"].attrs["parts"]
        column = json.loads(opened.attrs["columns"]).index("frames/physics/scene/qpos")
        rows = np.asarray(opened["frames/physics/scene/qpos"])
        new = np.array(rows[opened["index"][first + 5, column]])
        new[joint.qposadr[0] + 2] = np.nextafter(new[joint.qposadr[0] + 2], 9)
        del opened["frames/physics/scene/qpos"]
        opened["frames/physics/scene/qpos"] = np.concatenate([rows, new[None]])
        opened["index"][first + 5, column] = len(rows)
    with Recording(copy) as recording:
        (found,) = Replayer(recording, env=env)(check=True).differences
    assert (found.run, found.frame, found.field) == ("run_000002", 5, "physics/scene/qpos")
    assert found.owner == "steak_0/free"
    assert str(found).startswith("run_000002, frame 5: physics/scene/qpos[")
    assert " of steak_0/free: " in str(found)


def test_measures_that_are_younger_than_a_recording_are_as_at_the_start(env, recorded, tmp_path):
    copy = changed(recorded, tmp_path)
    with h5py.File(copy, "a") as opened:
        opened.attrs["columns"] = opened.attrs["columns"].replace("measures/held", "measures/old")
        opened.move("frames/measures/held", "frames/measures/old")
    with Recording(copy) as recording:
        assert Replayer(recording, env=env)(check=True, runs=recording.runs[:2]).differences == []


def test_another_engine_version_is_refused_by_action_and_warned_of_by_state(env, recorded, tmp_path):
    copy = changed(recorded, tmp_path)
    with h5py.File(copy, "a") as opened:
        opened.attrs["mujoco"], opened.attrs["processor"] = "1.2.3", "abacus"
    with Recording(copy) as recording:
        with pytest.raises(InputError, match=r"cannot be replayed by action: mujoco was 1\.2\.3, and is \d") as refused:
            Replayer(recording, env=env)
        assert "\n" not in str(refused.value)
        warnings = Replayer(recording, "state", env=env).warnings
    assert [w.split(" was ")[0] for w in warnings] == ["mujoco", "processor"]


def test_another_version_of_the_package_or_other_names_change_nothing(env, recorded, tmp_path):
    copy = changed(recorded, tmp_path)
    with h5py.File(copy, "a") as opened:
        opened.attrs["ig2mj"], opened.attrs["scene"], opened.attrs["appearance_hash"] = "99.0", "palace", "red"
    with Recording(copy) as recording:
        replayer = Replayer(recording, env=env)
        assert replayer.warnings == [] and replayer(check=True).differences == []


def test_a_recording_of_format_2_is_bound_to_every_byte_and_replayed(env, recorded, tmp_path):
    copy = changed(recorded, tmp_path)
    with h5py.File(copy, "a") as opened:
        for name in ("period", "observations", "sensors", "appearance_hash", "not_made_with"):
            del opened.attrs[name]
        opened.attrs["version"] = 2
        for name in ("model_hash", "scene_hash", "task_hash"):
            assert opened.attrs[name] != origin_of(env, 2)[name] or name == "scene_hash"  # a known digest
            opened.attrs[name] = origin_of(env, 2)[name]
    with Recording(copy) as recording:
        assert recording.version == 2 and [run.complete for run in recording.runs] == [True] * 4 + [False] * 2
        replayer = Replayer(recording, env=env)
        assert replayer.warnings == [] and replayer(check=True, runs=recording.runs[:1]).differences == []
    with h5py.File(copy, "a") as opened:
        opened.attrs["task_hash"] = "of a text with other names of classes"
    with Recording(copy) as recording:
        assert [w.split(" was ")[0] for w in Replayer(recording, env=env).warnings] == ["task_hash"]
    with h5py.File(copy, "a") as opened:
        opened.attrs["model_hash"] = "of another model"
    with Recording(copy) as recording, pytest.raises(InputError, match="model_hash was of another model"):
        Replayer(recording, env=env)
    with h5py.File(copy, "a") as opened:
        opened.attrs["version"] = 99
    with pytest.raises(InputError, match="attribute version: is 99, and versions 2 and 3 can be read"):
        Recording(copy)


@pytest.mark.slow
def test_a_recording_outlives_a_change_of_looks_and_names(env, recorded, tmp_path):
    text, home = (SHIPPED_HOMES / "birch" / "scene.xml").read_text(), tmp_path / "painted"
    home.mkdir()
    for folder in ("meshes", "textures"):
        (tmp_path / folder).mkdir()
        for name in set(re.findall(r'file="([^"]*)"', text)):
            if (SHIPPED_HOMES / folder / name).exists():
                shutil.copy(SHIPPED_HOMES / folder / name, tmp_path / folder)
    text = re.sub(r'rgba="[^"]*"', 'rgba="0 1 0 1"', text).replace("<light ", '<camera name="new"/><light ')
    text = re.sub(r'material="[^"]*"', "", text)
    for file in ("manifest.json", "rooms.npz"):
        shutil.copy(SHIPPED_HOMES / "birch" / file, home)
    (home / "scene.xml").write_text(text)
    task = dataclasses.replace(env.task, name="Frying", summary="Fry.", home=str(home))
    other = ig2mj.make(task, worlds=2, engine="native", pool=env.core.starts.pool)
    with Recording(recorded[0]) as recording:
        replayer = Replayer(recording, env=other.with_horizon(HORIZON))
        assert replayer.warnings == []
        assert replayer.here["appearance_hash"] != recording.header["appearance_hash"]
        assert replayer(check=True).differences == []


@pytest.mark.slow
def test_a_thin_recording_has_actions_and_first_and_last_frames_and_comes_out_the_same(env, recorded, tmp_path):
    thin = tmp_path / "thin.h5"
    with Recording(recorded[0]) as recording:
        write_compact(recording, thin, recording.runs[1:4])
        actions, last = (
            recording.runs[2].all_rows("steps/action"),
            recording.runs[2].frame_rows(["states/temperature"], 12, 13),
        )
    assert thin.stat().st_size < recorded[0].stat().st_size
    with Recording(thin) as recording:
        run = recording.runs[1]
        assert [r.frames for r in recording.runs] == [13] * 3 and [r.world for r in recording.runs] == [1, 0, 1]
        assert np.array_equal(run.all_rows("steps/action"), actions)
        assert np.array_equal(run.frame_rows(["states/temperature"], 12, 13)[0], last[0])
        assert run.kept(0, 13).tolist() == [True] + [False] * 11 + [True]
        done = Replayer(recording, env=env)(check=True)
        assert (done.runs, done.differences) == (3, [])
        seen = []
        Replayer(recording, "state", env=env)(watch=lambda state, runs, k: seen.append((k, sorted(runs))))
        assert seen == [(0, [0, 1]), (12, [0, 1]), (0, [1]), (12, [1])]
    with h5py.File(thin, "a") as opened:
        column = json.loads(opened.attrs["columns"]).index("frames/states/temperature")
        opened["index"][12, column] = opened["index"][0, column]  # the last frame of the first run
    with Recording(thin) as recording:
        (found,) = Replayer(recording, env=env)(check=True).differences
    assert (found.run, found.frame) == ("run_000000", 12)
    with Recording(thin) as recording, pytest.raises(InputError, match="record it on this machine"):
        observe(Replayer(recording, env=env), lambda *run: None)


@pytest.mark.slow
def test_metrics_say_what_was_moved_reached_held_and_looked_at(env, recorded, tmp_path):
    found = metrics_of(recorded[0], settle=3, env=env)
    assert [run["frames"] for run in found] == [13, 13, 13, 13]
    with Recording(recorded[0]) as recording:
        frames = recording.runs[0].all_rows("frames/goal")
    first = found[0]
    assert first["goal"]["each_frame"] == pytest.approx(frames.mean(1)) and first["goal"]["start"] == 0
    hands = [env.scene.model.body(int(b)).name for b in env.scene.tables.hand_body]
    assert set(first["grasping"]) == set(hands) == set(first["workspace"])
    right = next(name for name in hands if "right" in name)
    assert 0.02 < first["path_length"][right] < 1.0  # 12 steps of at most 5 cm, from rest
    assert all(m <= first["path_length"][right] + 0.05 for name, m in first["path_length"].items() if name != right)
    low, high = np.array(first["workspace"][right])
    assert (high >= low).all() and np.abs(high).max() < 2
    assert sum(first["gaze"]["objects"].values()) == pytest.approx(1)
    assert set(first["gaze"]["objects"]) <= {*env.scene.object_names, "own body", ""}
    assert (
        first["kinematic_disarrangement"]["total"] >= sum(first["kinematic_disarrangement"]["objects"].values()) - 1e-6
    )
    json.dumps(found)


def test_a_world_that_stands_still_is_not_disarranged(env, tmp_path):
    file = tmp_path / "still.h5"
    with record(env, file) as played:
        state = played.reset(0)
        for _ in range(4):
            state = played.step(state, np.zeros((2, env.action_space.shape[0]), np.float32))
    runs = list(metrics_of(file, settle=0, env=env, incomplete=True))
    assert len(runs) == 2
    for run in runs:
        assert run["kinematic_disarrangement"]["total"] < 0.02
        assert run["logical_disarrangement"] == {"total": 0, "no_longer": [], "now": []}
        assert run["goal"]["delta"] == 0


def put(opened, name, values):
    del opened[name]
    opened[name] = values


def spoil(opened, what, tmp_path):
    run = opened["run_000001"]
    column = json.loads(opened.attrs["columns"]).index("steps/action")
    if what == "missing":
        del opened["frames/states/temperature"]
    elif what == "unnamed":
        opened.attrs["columns"] = opened.attrs["columns"].replace("states/temperature", "states/other")
        opened.move("frames/states/temperature", "frames/states/other")
    elif what == "rows":
        put(opened, "steps/action", np.asarray(opened["steps/action"])[:3])
    elif what == "text":
        put(opened, "frames/key", np.array(["a"] * 13, dtype=h5py.string_dtype()))
    elif what == "shape":
        put(opened, "frames/states/wetness", np.zeros((99, 3), np.float32))
    elif what == "outside":
        with h5py.File(tmp_path / "other.h5", "w") as other:
            other["x"] = np.zeros(1)
        del opened["frames/flags"]
        opened["frames/flags"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "/x")
    elif what == "claimed":
        run.attrs["frames"] = 10**9
    elif what == "claimed by the index":
        run.attrs["frames"], run.attrs["parts"] = 10**9, np.array([[0, 10**9]])
        names = opened["index"].shape[1]
        del opened["index"]
        opened.create_dataset("index", (10**9, names), np.int32, chunks=(200, names))
    elif what == "claimed by an array":
        del opened["frames/physics/time"]
        opened.create_dataset("frames/physics/time", (10**9,), np.float64, chunks=(200,))
    elif what == "huge rows":
        del opened["frames/physics/time"]
        huge = opened.create_dataset("frames/physics/time", (1, 10**9), np.float64, chunks=(1, 10**9), compression=1)
        assert huge.shape == (1, 10**9)
    elif what == "parts":
        run.attrs["parts"] = np.array([[0, -1]])
    elif what == "index":
        opened["index"][:, column] = -5
    elif what == "negative":
        run.attrs["frames"] = -1
    elif what == "not finite":
        opened["steps/action"][0] = np.nan


@pytest.mark.parametrize(
    ("what", "named"),
    [
        ("missing", r"frames/states/temperature: is missing"),
        ("unnamed", r"run_000000/frames/states/temperature: is missing"),
        ("rows", r"run_00000\d/steps/action: has 3 rows, and the index names others"),
        ("text", r"frames/key: is of type object"),
        ("shape", r"run_000000/frames/states/wetness: is float32\[3\], must be float32\[\d+\]"),
        ("outside", r"frames/flags: is missing"),
        ("claimed", r"run_000001/attribute frames: claims 1000000000 frames, and 13 are there"),
        ("claimed by the index", r"index: claims 1000000000 rows that are not there"),
        ("claimed by an array", r"frames/physics/time: claims 1000000000 rows"),
        ("huge rows", r"frames/physics/time: has chunks of 8000000000 bytes"),
        ("parts", r"run_000001/attribute parts: names frames that are not there"),
        ("index", r"run_00000\d/steps/action: has \d+ rows, and the index names others"),
        ("negative", r"run_000001/attribute frames: is -1"),
        ("not finite", r"run_00000\d/steps/action: has numbers that are not finite"),
    ],
)
def test_a_file_that_was_tampered_with_is_refused_with_file_and_field(env, recorded, tmp_path, what, named):
    copy = changed(recorded, tmp_path)
    with h5py.File(copy, "a") as opened:
        spoil(opened, what, tmp_path)
    with pytest.raises(InputError, match=named) as refused, Recording(copy) as recording:
        Replayer(recording, env=env)(check=True)
    assert str(copy) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [
        ("robot", "dalek", "no robot is named 'dalek'"),
        ("task", "../../etc/passwd", "no environment is named"),
        ("grasping", "glue", "no grasping mode is named"),
        ("worlds", 10**9, "1 to 65536 worlds"),
        ("made_with", '{"nonsense": 1}', "makes no environment"),
        ("made_with", '{"worlds": 3}', "makes no environment"),
        ("made_with", '{"variant": 77}', "cannot be made here"),
    ],
)
def test_an_environment_that_a_tampered_file_names_is_refused_with_file_and_field(
    recorded, tmp_path, attribute, value, words
):
    copy = changed(recorded, tmp_path)
    with h5py.File(copy, "a") as opened:
        opened.attrs[attribute] = value
    with Recording(copy) as recording, pytest.raises(InputError, match=words) as refused:
        Replayer(recording)
    assert str(refused.value).startswith(f"{copy}: ") and "\n" not in str(refused.value)
    assert f"attribute {attribute}" in str(refused.value) or "variant" in str(refused.value)


def test_truncated_and_foreign_files_end_in_one_line(recorded, tmp_path, capsys):
    cut, foreign, text = tmp_path / "cut.h5", tmp_path / "foreign.h5", tmp_path / "text.h5"
    content = recorded[0].read_bytes()
    cut.write_bytes(content[: len(content) // 2])
    text.write_text("hello")
    with h5py.File(foreign, "w") as opened:
        opened["x"] = np.zeros(3)
    for file in (cut, foreign, text, tmp_path / "none.h5"):
        assert call(["demos", "replay", str(file)]) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1 and str(file) in lines[0]


def test_a_place_that_cannot_be_written_says_why(tmp_path):
    """In the system's words, without those of HDF5."""
    for file, why in ((tmp_path / "none" / "x.h5", "No such file or directory"), (tmp_path, "Is a directory")):
        with pytest.raises(InputError, match=rf"cannot be written: {why} \(choose another place\)$"):
            RunWriter(file, {}, {}, ["a"], ["action"])
    file = tmp_path / "x.h5"
    with h5py.File(file, "w"), pytest.raises(InputError, match="it is open already"):
        RunWriter(file, {}, {}, ["a"], ["action"])


KILLED = """
import os, signal, sys
import numpy as np
from ig2mj.demos.writer import RunWriter

about = {name: "" for name in ("mujoco", "scene", "scene_hash", "model_hash")}
writer = RunWriter(sys.argv[1], about, {}, ["a", "late"], ["action"])
writer.begin({0: {}}, [], [np.zeros((1, 3)), np.zeros((1, 2))])
for k in range(1, 451):
    writer.add([], [np.full((1, 3), k / 7), np.full((1, 2), float(k > 300))], [np.full((1, 2), k)])
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_process_that_is_killed_loses_no_more_than_200_frames(tmp_path):
    file = tmp_path / "killed.h5"
    done = subprocess.run([sys.executable, "-c", KILLED, str(file)], check=False)
    assert done.returncode < 0
    with Recording(file) as recording:
        (run,) = recording.runs
        assert 251 <= run.frames <= 451
        assert not run.attributes["ended"]
        last = run.frames - 200
        assert run.rows("frames/a", last, run.frames)[:, 0] == pytest.approx(np.arange(last, run.frames) / 7)
        late = np.concatenate([run.rows("frames/late", k, min(k + 200, run.frames)) for k in range(0, run.frames, 200)])
        assert (late[:, 0] == (np.arange(run.frames) > 300)).all()


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2, 8])
def test_a_fresh_process_comes_to_the_same_bytes(recorded, threads):
    command = [sys.executable, "-m", "ig2mj", "demos", "replay", str(recorded[0]), "--check", "--threads", str(threads)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "6 runs, 60 frames by action, all the same" in done.stdout


@pytest.mark.slow
def test_what_devices_say_is_recorded_and_a_run_goes_on_past_success(env, tmp_path):
    file, head = tmp_path / "person.h5", np.zeros((2, 8))
    driven = ig2mj.make("CookingMeat", worlds=2, engine="native", pool_size=ROWS, whole_actions=True, period=1 / 30)
    assert driven.action_names[0] == "body_x" and driven.action_space.shape == (28,)
    with record(driven.with_horizon(3), file, devices={"head": head}, past_success=True) as played:
        state = played.reset(0)
        for step in range(5):
            played.devices["head"] = np.full((2, 8), step / 8)
            state = played.step(state, np.full((2, 28), 0.05 * step))
        assert np.asarray(state.truncated).all()
    with Recording(file) as recording:
        assert [run.frames for run in recording.runs] == [6, 6]
        assert recording.runs[0].rows("steps/devices/head", 0, 5)[:, 0].tolist() == [0, 1 / 8, 2 / 8, 3 / 8, 4 / 8]
        assert recording.runs[0].attributes["success"] is False
        assert Replayer(recording)(check=True).differences == []  # made again with the same actions and period
