"""Recordings in the formats of other projects: what is in them is what happened."""

from __future__ import annotations

import copy
import functools
import json
from typing import Any

import av
import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

import ig2mj
from ig2mj.cli import call
from ig2mj.demos import Recording, Replayer, record
from ig2mj.demos.igibson import export_igibson, read_igibson
from ig2mj.demos.lerobot import export_lerobot
from ig2mj.demos.metrics import metrics_of
from ig2mj.demos.robomimic import export_robomimic
from ig2mj.demos.selection import chosen_runs, left_out
from ig2mj.demos.videos import EpisodeVideos
from ig2mj.envs.config import Overrides
from ig2mj.envs.experts import expert_of
from ig2mj.errors import InputError
from ig2mj.sensors.base import SensorOptions

HORIZON = 5


@pytest.fixture(scope="module")
def recorded(cooking_meat, tmp_path_factory):
    """Two runs of five steps, begun anew at the end; observations and actions of every step."""
    folder = tmp_path_factory.mktemp("exports")
    env = cooking_meat.with_horizon(HORIZON)
    expert, seen = expert_of(env), []
    with record(env, folder / "runs.h5") as played:
        state = played.reset(1)
        for _ in range(HORIZON):
            view = state.batch.world.view
            pos = {
                name: np.asarray(view.object_pos)[:, env.scene.object_index(name)] for name in env.scene.object_names
            }
            seen.append((np.asarray(state.obs["privileged_state"]), np.asarray(expert(state)), pos))
            state = played.step(state, seen[-1][1])
        played.reset(state)
    return folder, env, seen


@pytest.fixture(scope="module")
def mixed(recorded):
    """In each of two worlds a complete run of five steps, and one that is cut off after two."""
    folder, env, _ = recorded
    with record(env, folder / "mixed.h5") as played:
        state, zero = played.reset(2), np.zeros((2, env.action_space.shape[0]), np.float32)
        for _ in range(HORIZON + 2):
            state = played.step_autoreset(state, zero)
    return folder / "mixed.h5", env


@pytest.fixture(scope="module")
def exported(recorded):
    folder, env, seen = recorded
    with Recording(folder / "runs.h5") as recording:
        done = export_robomimic(Replayer(recording, env=env), folder / "robomimic.h5")
    assert done.differences == []
    return folder / "robomimic.h5", seen


def test_every_run_of_more_than_one_frame_is_a_demonstration(exported):
    file, seen = exported
    with h5py.File(file) as opened:
        data: Any = opened["data"]
        assert sorted(data) == ["demo_0", "demo_1"]
        assert data.attrs["total"] == 2 * HORIZON
        about = json.loads(data.attrs["env_args"])
        assert about["env_name"] == "ig2mj/CookingMeat-v0" and about["type"] == 2
        for world in range(2):
            demo = data[f"demo_{world}"]
            assert demo.attrs["num_samples"] == HORIZON
            assert {len(demo[name]) for name in ("actions", "rewards", "dones", "states")} == {HORIZON}
            assert np.array_equal(demo["actions"], np.stack([action[world] for _, action, _ in seen]))
            assert np.array_equal(demo["obs/privileged_state"], np.stack([obs[world] for obs, *_ in seen]))
            assert list(demo["dones"]) == [0] * (HORIZON - 1) + [1]
            for name in demo["obs"]:
                assert np.array_equal(demo["obs"][name][1:], demo["next_obs"][name][:-1])


def test_robomimics_filter_keys_name_demonstrations(exported):
    with h5py.File(exported[0]) as opened:
        masks = {name: [n.decode() for n in names] for name, names in opened["mask"].items()}
    assert masks == {"complete": ["demo_0", "demo_1"], "train": ["demo_0"], "valid": ["demo_1"]}


def test_a_demonstration_says_how_its_environment_is_made_again(exported, recorded):
    with h5py.File(exported[0]) as opened:
        about = json.loads(opened["data"].attrs["env_args"])
    made, env = about["env_kwargs"], recorded[1]
    assert about["horizon"] == HORIZON and made["period"] == pytest.approx(0.1)
    assert made["sensors"]["width"] == 128 and made["observations"] == list(env.observation_spaces)
    assert set(made) <= set(Overrides.__annotations__)


@pytest.mark.slow
def test_episodes_that_were_cut_off_are_marked_and_left_out(mixed, tmp_path, capsys):
    file, env = mixed
    with Recording(file) as recording:
        assert [run.frames for run in recording.runs] == [6, 6, 3, 3]
        assert [run.complete for run in recording.runs] == [True, True, False, False]
        assert [run.attributes["complete"] for run in recording.runs] == [True, True, False, False]
        assert [run.attributes.get("truncated") for run in recording.runs] == [True, True, None, None]
        replayer = Replayer(recording, env=env)
        for options, count in (({}, 2), ({"incomplete": True}, 4)):
            export_robomimic(replayer, tmp_path / "out.h5", **options)
            with h5py.File(tmp_path / "out.h5") as opened:
                assert len(opened["data"]) == count and len(opened["mask/complete"]) == 2
            export_igibson(replayer, tmp_path / f"logs_{count}", **options)
            assert len(list((tmp_path / f"logs_{count}").iterdir())) == count
            assert len(metrics_of(file, 0, env, **options)) == count
        for export in (export_robomimic, export_lerobot, export_igibson):
            with pytest.raises(InputError, match="has nothing to export but 2 incomplete and 2 unsuccessful runs"):
                export(replayer, tmp_path / "none", success_only=True)
    assert metrics_of(file, 0, env, success_only=True) == []
    assert call(["demos", "metrics", str(file), "--success-only"]) == 0
    assert "nothing to measure but 2 incomplete and 2 unsuccessful runs" in capsys.readouterr().err
    assert call(["demos", "export", str(file), "--out", str(tmp_path / "none"), "--success-only"]) == 2
    # none of the incomplete ones succeeded
    assert "--include-incomplete" not in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


def test_success_only_takes_runs_that_succeeded(mixed, tmp_path):
    file, copy = mixed[0], tmp_path / "copy.h5"
    copy.write_bytes(file.read_bytes())
    with h5py.File(copy, "a") as opened:
        opened["run_000001"].attrs["success"] = True
    with Recording(copy) as recording:
        chosen = chosen_runs(recording, success_only=True)
        assert [run.name for run in chosen] == ["run_000001"]
        assert left_out(recording, chosen) == "2 incomplete and 1 unsuccessful runs"


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
@pytest.mark.parametrize("export", [export_robomimic, export_lerobot, export_igibson])
def test_an_export_is_complete_or_not_there(mixed, tmp_path, monkeypatch, export, error):
    file, env = mixed

    def broken_off(self, now, *others):
        if self.recording.runs[1] in now.values():
            raise error
        return original(self, now, *others)

    original = Replayer._by_action
    monkeypatch.setattr(Replayer, "rounds", lambda self, runs: ({run.world: run} for run in runs))
    monkeypatch.setattr(Replayer, "_by_action", broken_off)
    earlier = tmp_path / "earlier"
    if export is export_robomimic:
        earlier.write_text("what was there before")
    with Recording(file) as recording, pytest.raises(error):
        export(Replayer(recording, env=env), earlier)
    assert [f.name for f in tmp_path.iterdir()] == (["earlier"] if export is export_robomimic else [])
    if export is export_robomimic:
        assert earlier.read_text() == "what was there before"


def test_what_cannot_be_written_is_one_line(mixed, tmp_path):
    (tmp_path / "file").write_text("")
    with Recording(mixed[0]) as recording:
        replayer = Replayer(recording, env=mixed[1])
        for export in (export_robomimic, export_lerobot, export_igibson):
            with pytest.raises(InputError, match="cannot be written"):
                export(replayer, tmp_path / "file" / "out")


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [
        ("horizon", 77, "horizon was 77, and is 5 here"),
        ("grasping", "sticky", "grasping was sticky, and is mitten here"),
        ("task_hash", "0", "task_hash was 0"),
    ],
)
def test_observations_that_would_be_others_are_refused_by_state_too(mixed, tmp_path, attribute, value, words):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(mixed[0].read_bytes())
    with h5py.File(copy, "a") as opened:
        opened.attrs[attribute] = value
    with Recording(copy) as recording:
        with pytest.raises(InputError, match=words):
            Replayer(recording, env=mixed[1])
        replayer = Replayer(recording, "state", env=mixed[1])
        with pytest.raises(InputError, match=f"cannot be exported as it was recorded: {words}"):
            export_robomimic(replayer, tmp_path / "out.h5")


@pytest.mark.slow
def test_images_and_noise_are_exported_as_they_were_recorded(tmp_path):
    options = {"width": 21, "height": 15, "depth_noise_rate": 0.3, "depth_high": 4.0}
    make = functools.partial(ig2mj.make, "CookingMeat", engine="native", pool_size=4, variant=1, period=1 / 15)
    names = ("proprioception", "rgb", "depth")
    env = make(observations=names, sensors=SensorOptions(**options)).with_horizon(3)
    seen = []
    with record(env, tmp_path / "runs.h5") as played:
        state = played.reset(0)
        for _ in range(3):
            seen.append({name: np.array(rows[0]) for name, rows in state.obs.items()})
            state = played.step(state, np.full((1, env.action_space.shape[0]), 0.3, np.float32))
    assert call(["demos", "export", str(tmp_path / "runs.h5"), "--out", str(tmp_path / "out.h5")]) == 0
    with h5py.File(tmp_path / "out.h5") as opened:
        obs: Any = opened["data/demo_0/obs"]
        assert set(obs) == set(names)
        for name in names:
            assert np.array_equal(obs[name], np.stack([frame[name] for frame in seen])), name
        about = json.loads(opened["data"].attrs["env_args"])
    assert (np.asarray(seen[0]["depth"]) == 0).mean() > 0.2
    again = ig2mj.make(about["env_name"], **about["env_kwargs"]).with_horizon(about["horizon"])
    assert again.sensor_options == env.sensor_options and again.period == env.period
    assert again.observation_spaces == env.observation_spaces
    assert call(["demos", "export", str(tmp_path / "runs.h5"), "--to", "lerobot", "--out", str(tmp_path / "l")]) == 0
    info = json.loads((tmp_path / "l/meta/info.json").read_text())
    assert info["fps"] == 15 and info["features"]["observation.images.rgb"]["shape"] == [15, 21, 3]
    assert json.loads((tmp_path / "l/meta/ig2mj.json").read_text())["make"]["sensors"]["height"] == 15
    other = make(observations=names, image_size=16).with_horizon(3)
    with (
        Recording(tmp_path / "runs.h5") as recording,
        pytest.raises(InputError, match="width was 21, and is 16 here"),
    ):
        export_robomimic(Replayer(recording, env=other), tmp_path / "other.h5")
    with h5py.File(tmp_path / "runs.h5", "a") as opened:
        opened.attrs["appearance_hash"] = "another"
    with Recording(tmp_path / "runs.h5") as recording:
        with pytest.raises(InputError, match="the home's appearance differs in rgb, depth"):
            export_robomimic(Replayer(recording, env=env), tmp_path / "other.h5")
        vectors = make(observations=("proprioception",)).with_horizon(3)
        export_robomimic(Replayer(recording, env=vectors), tmp_path / "vectors.h5")
    assert not (tmp_path / "other.h5").exists()


def test_a_period_that_lerobot_cannot_hold_is_refused(mixed, tmp_path):
    file, env = mixed
    with Recording(file) as recording:
        replayer = Replayer(recording, env=env)
        replayer.env = copy.copy(env)
        replayer.env.period = 2 / 15
        with pytest.raises(InputError, match=r"has 7\.5 steps a second"):
            export_lerobot(replayer, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_lerobot_has_a_row_for_every_step_and_says_what_each_column_is(recorded):
    folder, env, seen = recorded
    with Recording(folder / "runs.h5") as recording:
        export_lerobot(Replayer(recording, env=env), folder / "lerobot")
    info = json.loads((folder / "lerobot/meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", 10, 2)
    assert info["splits"] == {"train": "0:2"} and info["total_frames"] == 2 * HORIZON
    assert info["features"]["action"]["names"] == list(env.action_names)
    assert info["features"]["observation.state"]["names"] == list(env.proprioception_names)
    assert info["features"]["observation.environment_state"]["names"] == list(env.privileged_names)
    table = pq.read_table(folder / "lerobot" / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(table.column_names) == set(info["features"])
    rows = table.to_pydict()
    assert rows["index"] == list(range(2 * HORIZON)) and rows["frame_index"] == [*range(HORIZON)] * 2
    assert rows["episode_index"] == [0] * HORIZON + [1] * HORIZON
    assert rows["next.done"] == ([False] * (HORIZON - 1) + [True]) * 2
    state = np.array(rows["observation.environment_state"], np.float32).reshape(2, HORIZON, -1)
    action = np.array(rows["action"], np.float32).reshape(2, HORIZON, -1)
    for k, (privileged, given, _) in enumerate(seen):
        assert np.array_equal(state[:, k], privileged) and np.array_equal(action[:, k], given)
    episodes = pq.read_table(folder / "lerobot/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(e["dataset_from_index"], e["dataset_to_index"]) for e in episodes] == [
        (0, HORIZON),
        (HORIZON, 2 * HORIZON),
    ]
    assert episodes[0]["tasks"] == [env.instruction()[0]] and episodes[0]["stats/action/count"] == [HORIZON]
    stats = json.loads((folder / "lerobot/meta/stats.json").read_text())
    assert np.allclose(stats["action"]["mean"], action.reshape(2 * HORIZON, -1).mean(0))
    tasks = pq.read_table(folder / "lerobot/meta/tasks.parquet")
    assert tasks.to_pydict() == {"task_index": [0], "__index_level_0__": [env.instruction()[0]]}
    with pytest.raises(InputError, match="is there already"), Recording(folder / "runs.h5") as recording:
        export_lerobot(Replayer(recording, env=env), folder / "lerobot")


def test_films_of_many_episodes_follow_each_other(tmp_path):
    videos = EpisodeVideos(lambda place: tmp_path / "{file_index}.mp4".format(**place), fps=10, codec="h264")
    shades = [40, 120, 200]
    places = [videos.add(np.full((4, 64, 96, 3), shade, np.uint8), limit=100) for shade in shades]
    videos.close()
    assert places == [({"chunk_index": 0, "file_index": 0}, start) for start in (0.0, 0.4, 0.8)]
    with av.open(str(tmp_path / "0.mp4")) as opened:
        frames = [(float(f.time), f.to_ndarray(format="rgb24")) for f in opened.decode(video=0)]  # type: ignore[arg-type]
    assert [time for time, _ in frames] == pytest.approx([k / 10 for k in range(12)])
    for k, (_, picture) in enumerate(frames):
        assert picture.shape == (64, 96, 3) and abs(picture.mean() - shades[k // 4]) < 3
    assert videos.about["video.fps"] == 10


@pytest.mark.parametrize("size", [(64, 64), (63, 65), (1, 1), (2, 3)])
@pytest.mark.parametrize("first", [1, 2, 3])
def test_films_of_episodes_of_any_length_and_images_of_any_size(tmp_path, size, first):
    videos = EpisodeVideos(lambda place: tmp_path / "{file_index}.mp4".format(**place), fps=10, codec="h264")
    shades = [40, 200]
    lengths = [first, 2]
    for shade, length in zip(shades, lengths, strict=True):
        videos.add(np.full((length, *size, 3), shade, np.uint8), limit=100)
    videos.close()
    with av.open(str(tmp_path / "0.mp4")) as opened:
        frames = [f.to_ndarray(format="rgb24") for f in opened.decode(video=0)]  # type: ignore[arg-type]
    assert [f.shape for f in frames] == [(*size, 3)] * sum(lengths)
    assert [round(f.mean() / 40) for f in frames] == [1] * first + [5] * 2
    assert (videos.about["video.height"], videos.about["video.width"]) == size


def test_igibsons_logs_are_written_and_read_back(recorded):
    folder, env, seen = recorded
    with Recording(folder / "runs.h5") as recording:
        export_igibson(Replayer(recording, env=env), folder / "igibson")
    logs = [read_igibson(folder / "igibson" / f"run_00000{k}.hdf5") for k in range(2)]
    for world, log in enumerate(logs):
        assert log.frames == HORIZON and log.satisfied is not None and log.satisfied.shape[0] == HORIZON
        assert log.metadata["atus_activity"] == "CookingMeat" and log.metadata["render_timestep"] == 0.1
        assert set(env.scene.object_names) < set(log.names.values())
        for k in range(1, HORIZON):  # a row is the world after its step
            for name, pos in seen[k][2].items():
                assert np.allclose(log.position[name][k - 1], pos[world], atol=1e-6)
        given = np.stack([action[world] for _, action, _ in seen])
        assert np.array_equal(log.actions["action/ig2mj"], given)
        assert log.actions["agent_actions/vr_robot"].shape == (HORIZON, 28)
        assert np.allclose(np.linalg.norm(log.orientation["steak_0"], axis=1), 1)
    with h5py.File(folder / "igibson/run_000000.hdf5") as opened:
        data: Any = opened
        body = next(k for k, name in logs[0].names.items() if name == "steak_0")
        raw = np.asarray(data[f"physics_data/{body}/orientation"])
        assert raw.dtype == np.float64 and np.array_equal(raw[:, [3, 0, 1, 2]], logs[0].orientation["steak_0"])
        assert (np.asarray(data["frame_data"])[:, 1:] == -1).all()


def test_foreign_and_tampered_logs_of_igibson_end_in_one_line(recorded, tmp_path):
    folder, *_ = recorded
    file, copy = folder / "igibson/run_000000.hdf5", tmp_path / "copy.hdf5"
    if not file.exists():
        test_igibsons_logs_are_written_and_read_back(recorded)

    def claimed(opened):
        del opened["physics_data/0/position"]
        opened.create_dataset("physics_data/0/position", (10**9, 3), np.float64, chunks=(100, 3))

    def short(opened):
        rows = np.asarray(opened["physics_data/0/position"])[:-1]
        del opened["physics_data/0/position"]
        opened["physics_data/0/position"] = rows

    def outside(opened):
        del opened["physics_data/0/position"]
        opened["physics_data/0/position"] = h5py.ExternalLink("/etc/passwd", "/x")

    for spoil, named in (
        (claimed, "physics_data/0/position: claims 1000000000 rows"),
        (short, "physics_data: have"),
        (outside, "physics_data/0/position: is missing"),
    ):
        copy.write_bytes(file.read_bytes())
        with h5py.File(copy, "a") as opened:
            spoil(opened)
        with pytest.raises(InputError, match=named) as refused:
            read_igibson(copy)
        assert "\n" not in str(refused.value)
    copy.write_bytes(file.read_bytes()[:3000])
    for broken in (copy, folder / "runs.h5", tmp_path / "none.hdf5"):
        with pytest.raises(InputError) as refused:
            read_igibson(broken)
        assert str(broken) in str(refused.value)
