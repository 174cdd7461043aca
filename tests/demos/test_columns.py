"""Rows of arrays are written once however many frames have them, and every frame gets its own back."""

from __future__ import annotations

import json

import h5py
import jax.numpy as jnp
import numpy as np
import pytest
from hostile_readers import recordings

from ig2mj.demos.reader import Recording
from ig2mj.demos.replay_jobs import TOLD, join_replays
from ig2mj.demos.writer import FLUSH, RunWriter
from ig2mj.engine.native.recorded import Cut
from ig2mj.errors import InputError

ABOUT = {name: "" for name in ("mujoco", "scene", "scene_hash", "model_hash")}
OWN = {"vector": Cut(0, 0, 3), "matrix": Cut(0, 3, 7, (2, 2)), "nothing": Cut(0, 7, 7), "flag": Cut(1)}


@pytest.mark.parametrize("worlds", [(0,), (1, 2)])
def test_every_frame_of_every_run_comes_back(tmp_path, worlds):
    rng, expected, last = np.random.default_rng(0), {}, {}
    still = np.zeros((3, 2000))  # large: remembered, not copied
    frame = {"own": {w: np.zeros(7) for w in worlds}, "flag": np.array([True]), "few": jnp.zeros((3, 2), jnp.float32)}

    def arrays():
        own = [[frame["own"][w].copy(), frame["flag"]] for w in worlds]
        return own, [frame["few"], still]

    def note(w, action):
        values = (frame["own"][w].copy(), np.asarray(frame["few"])[w], still[w], action)
        expected[last[w]].append(values)

    count = 0
    with RunWriter(tmp_path / "x.h5", ABOUT, OWN, ["few", "still"], ["action"], worlds) as writer:
        for step in range(2 * FLUSH + 50):
            begun = [w for w in worlds if step == 0 or rng.random() < 0.02]
            if step:
                for w in worlds:
                    if rng.random() < 0.7:
                        frame["own"][w][rng.integers(7)] = rng.integers(3)
                if rng.random() < 0.3:
                    frame["few"] = frame["few"].at[rng.integers(3), 0].set(float(rng.integers(3)))
                if rng.random() < 0.01:
                    still = still + 1.0
                action = rng.standard_normal((3, 4)).astype(np.float32)
                writer.add(*arrays(), [action])
                for w in worlds:
                    note(w, action[w])
            for w in begun:
                frame["own"][w][:] = 0.0
            if begun:
                writer.begin({w: {"row": step} for w in begun}, *arrays())
            for w in begun:
                last[w], count = count, count + 1
                expected[last[w]] = []
                note(w, None)
    with Recording(tmp_path / "x.h5") as recording:
        assert len(recording.runs) == count
        assert len(recording.arrays["frames/still"]) < 20 and len(recording.arrays["frames/nothing"]) == 1
        for number, run in enumerate(recording.runs):
            assert run.frames == len(expected[number])
            got = {name: run.all_rows(f"frames/{name}") for name in run.names}
            for k, (own, few, large, _) in enumerate(expected[number]):
                assert np.array_equal(got["vector"][k], own[:3]) and np.array_equal(got["matrix"][k].ravel(), own[3:])
                assert np.array_equal(got["few"][k], few) and np.array_equal(got["still"][k], large)
                assert got["flag"][k] and got["nothing"][k].shape == (0,)
            actions = [action for *_, action in expected[number]][1:]
            if actions:
                assert np.array_equal(run.all_rows("steps/action"), np.stack(actions))


def test_runs_that_begin_alike_share_their_rows(tmp_path):
    start, other = np.arange(5.0), np.ones(5)
    with RunWriter(tmp_path / "x.h5", ABOUT, {"a": Cut(0)}, [], ["action"]) as writer:
        for _ in range(30):
            writer.begin({0: {}}, [[start.copy()]], [])
            writer.add([[other * np.random.default_rng(0).random()]], [], [np.zeros((1, 1))])
    with h5py.File(tmp_path / "x.h5") as opened:
        assert len(opened["frames/a"]) < 32 + 1  # pyright: ignore[reportArgumentType]


def test_short_episodes_take_little_room(tmp_path):
    """Every run has an index of its own, which is what 80 arrays of 30 frames each would pay for."""
    rng = np.random.default_rng(0)
    cuts = {f"a{k}": Cut(0, 5 * k, 5 * k + 5) for k in range(80)}
    with RunWriter(tmp_path / "x.h5", ABOUT, cuts, [], ["action"]) as writer:
        for _ in range(100):
            writer.begin({0: {}}, [[np.zeros(400)]], [])
            for _ in range(30):
                row = np.zeros(400)
                row[:20] = rng.random(20)
                writer.add([[row]], [], [np.zeros((1, 1))])
    size = (tmp_path / "x.h5").stat().st_size
    assert size / 3100 < 1.5 * 20 * 8 + 150


def test_pieces_of_a_replay_are_joined_only_from_their_own_content(tmp_path):
    def piece(run, **told):
        with h5py.File(tmp_path / "piece.h5", "w") as out:
            out[f"{run}/vector"] = np.zeros((4, 3), np.float32)
            out.attrs[TOLD] = json.dumps({"runs": 1, "frames": 4, "differences": ["d"], "warnings": [], **told})
        return (tmp_path / "piece.h5").read_bytes()

    first, second = piece("run_000000"), piece("run_000001")
    found = join_replays([first, second], tmp_path / "whole.h5")
    assert found == {"runs": 2, "frames": 8, "differences": ["d", "d"], "warnings": []}
    with h5py.File(tmp_path / "whole.h5") as whole:
        assert list(whole) == ["run_000000", "run_000001"]
    with pytest.raises(InputError, match="Expected `int`, got `str`"):
        join_replays([piece("run_000000", frames="many")], None)
    piece("run_000000")
    with h5py.File(tmp_path / "piece.h5", "a") as out:
        out["run_000000/more"] = h5py.ExternalLink("secret.h5", "/a")
    with pytest.raises(InputError, match="run_000000/more: is missing, or no array of this file"):
        join_replays([(tmp_path / "piece.h5").read_bytes()], tmp_path / "whole.h5")


def test_a_recording_does_not_name_a_file_as_its_task(tmp_path):
    recordings(tmp_path)
    with h5py.File(tmp_path / "runs.h5", "a") as out:
        out.attrs["task"] = "activity/own.bddl"
    with pytest.raises(InputError, match=r"attribute task: 'activity/own\.bddl' is the path of a file"):
        Recording(tmp_path / "runs.h5")
