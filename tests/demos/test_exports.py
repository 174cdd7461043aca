"""Recordings in the formats of other projects: what is in them is what happened."""

from __future__ import annotations

import json
from typing import Any

import av
import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

from ig2mj.demos import Recording, Replayer, record
from ig2mj.demos.films import EpisodeFilms
from ig2mj.demos.igibson import export_igibson, read_igibson
from ig2mj.demos.lerobot import export_lerobot
from ig2mj.demos.robomimic import export_robomimic
from ig2mj.envs.experts import expert_of
from ig2mj.errors import InputError

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


def test_lerobot_has_a_row_for_every_step_and_says_what_each_column_is(recorded):
    folder, env, seen = recorded
    with Recording(folder / "runs.h5") as recording:
        export_lerobot(Replayer(recording, env=env), folder / "lerobot")
    info = json.loads((folder / "lerobot/meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", 10, 2)
    assert info["splits"] == {"train": "0:2"} and info["total_frames"] == 2 * HORIZON
    assert info["features"]["action"]["names"] == list(env.action_names)
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
    assert episodes[0]["tasks"] == [env.task.summary] and episodes[0]["stats/action/count"] == [HORIZON]
    stats = json.loads((folder / "lerobot/meta/stats.json").read_text())
    assert np.allclose(stats["action"]["mean"], action.reshape(2 * HORIZON, -1).mean(0))
    tasks = pq.read_table(folder / "lerobot/meta/tasks.parquet")
    assert tasks.to_pydict() == {"task_index": [0], "__index_level_0__": [env.task.summary]}
    with pytest.raises(InputError, match="is there already"), Recording(folder / "runs.h5") as recording:
        export_lerobot(Replayer(recording, env=env), folder / "lerobot")


def test_films_of_many_episodes_follow_each_other(tmp_path):
    films = EpisodeFilms(lambda place: tmp_path / "{file_index}.mp4".format(**place), fps=10, codec="h264")
    shades = [40, 120, 200]
    places = [films.add(np.full((4, 64, 96, 3), shade, np.uint8), limit=100) for shade in shades]
    films.close()
    assert places == [({"chunk_index": 0, "file_index": 0}, start) for start in (0.0, 0.4, 0.8)]
    with av.open(str(tmp_path / "0.mp4")) as opened:
        frames = [(float(f.time), f.to_ndarray(format="rgb24")) for f in opened.decode(video=0)]  # type: ignore[arg-type]
    assert [time for time, _ in frames] == pytest.approx([k / 10 for k in range(12)])
    for k, (_, picture) in enumerate(frames):
        assert picture.shape == (64, 96, 3) and abs(picture.mean() - shades[k // 4]) < 3
    assert films.about["video.fps"] == 10


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
        (claimed, "physics_data/0/position: claims 1000000000 frames"),
        (short, "physics_data: have"),
        (outside, "physics_data/0/position: is not a table"),
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
