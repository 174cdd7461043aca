"""From the shell: an expert is recorded, cloned, judged and played; what does not fit is refused in one line."""

from __future__ import annotations

import json

import pytest

from ig2mj.cli import call
from ig2mj.cli.train import _devices
from ig2mj.errors import Ig2mjError

POOL = ["--pool-size", "4"]


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_recorded_expert_is_cloned_and_judged(tmp_path, capsys):
    demos, run = tmp_path / "meat.h5", tmp_path / "run"
    assert call(["demos", "collect", "CookingMeat", "--out", str(demos), "--episodes", "8", *POOL]) == 0
    train = ["train", "CookingMeat", "--algo", "bc", "--demos", str(demos), "--out", str(run)]
    assert call([*train, "--set", "num_updates=1500", "batch_size=128", "actor_layers=64,64"]) == 0
    assert call([*train[:-1], str(tmp_path / "other"), "--obs", "rgbd"]) == 2
    assert "holds no images" in capsys.readouterr().err
    assert call(["demos", "replay", str(demos), "--check"]) == 0 and "all the same" in capsys.readouterr().out
    episodes = ["--episodes", "4", *POOL, "--split", "train", "--json"]
    assert call(["evaluate", str(run), "--worlds", "4", *episodes]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["env"] == "CookingMeat" and found["episodes"] == 4
    assert found["success_low"] <= found["success_rate"] <= found["success_high"]
    assert found["start_seconds"] > 0.0 and found["steps_per_second"] > 0.0
    assert found["success_rate"] >= 0.75
    assert call(["rollout", "CookingMeat", "--agent", str(run / "policy.npz"), "--worlds", "4", *episodes]) == 0
    played = json.loads(capsys.readouterr().out)
    assert played["success_rate"] >= 0.75 and set(played) <= set(found), "evaluate has the keys of rollout"
    assert call(["evaluate", str(run), "--worlds", "1", "--episodes", "5", *POOL, "--robot", "fetch"]) == 2
    assert "there are 4 start states, so some are played and counted again" in (refused := capsys.readouterr().err)
    assert "was made for robot = humanoid; you asked for fetch" in refused


def test_wrong_options_name_what_is_near(tmp_path, capsys):
    for arguments, told in (
        (["train", "CookingMeat", "--algo", "sax"], "near matches: sac"),
        (["train", "CookingMeat", "--obs", "rgb"], "near matches: rgbd"),
        (["train", "CookingMeat", "--set", "utd_ration=3"], "utd_ratio"),
        (["train", "CookingMeat", "--algo", "bc"], "needs --demos"),
        (["train", "CookingMeat", "--algo", "bc", "--expert"], "expert=true is for sac"),
        (
            ["train", "CookingMeat", "--algo", "ppo", "--begin-with", "CookingMeat"],
            "--init-from is for --algo dagger and sac",
        ),
        (["train", "CookingMeat", "--algo", "dagger", "--init-from", "CookingMeet"], "near matches: CookingMeat"),
        (["train", "CookingMeat", "--set", "programs=3"], "programs=3"),
        (["train", "CookingMeat", "--minutes", "nan"], "--minutes nan"),
        (["train", "CookingMeat", "--until", "7"], "--stop-at-success 7.0: a share"),
        (["train", "CookingMeat", "--pixels", "0"], "image_size is at least 1"),
        (["evaluate", "CookingMeet"], "no policy is named"),
        (["train", "GraspingBook", "--set", "augment_starts=-1"], "augment_starts is at least 0"),
        (["train"], "no environment"),
        (["train", "--config", "no/such.toml"], "there is no such file"),
        (["train", "GraspingBook", "--out", __file__], "is a file"),
        (["train", "GraspingBook", "--devices", "4"], "--devices 4: this run can have 1"),
        (["evaluate", "no/such.npz"], "there is no such file"),
        (["evaluate", str(tmp_path)], "holds no policy.npz"),
        (["evaluate", "CookingMeat", "--worlds", "-2"], "--worlds -2"),
        (["evaluate", "CookingMeat", "--out", "no/such.json"], "folder no does not exist"),
        (["rollout", "CookingMeat", "--agent", "expart"], "near matches: expert"),
        (["rollout", "CookingMeat", "--pool-size", "-1"], "pool_size = -1: a whole number of at least 1"),
        (["rollout", "CookingMeat", "--video", "a.doc"], "not a video format"),
        (["rollout", "CookingMeat", "--record", "no/such.h5"], "folder no does not exist"),
        (["rollout", "CookingMeat", "--record", str(tmp_path)], "is a folder"),
        (["rollout", "CookingMeat", "--format", "igibson"], "needs --record FILE"),
        (["demos", "collect", "CookingMeat", "--out", "a.h5", "--noise", "nan"], "--noise nan"),
        (["demos", "collect", "CookingMeat", "--out", "a.h5", "--disturbed", "4"], "--disturbed 4.0"),
        (["demos", "collect", "CookingMeat", "--out", str(tmp_path)], "is a folder"),
        (
            ["demos", "collect", "CookingMeat", "--out", str(tmp_path / "a.h5"), "--engine", "natve", *POOL],
            "error: no eng",
        ),
    ):
        assert call(arguments) == 2, arguments
        assert told in capsys.readouterr().err, arguments


def test_a_training_that_does_not_fit_ends_in_one_line(tmp_path, capsys, monkeypatch):
    from ig2mj.learn import train as loop

    def full(*arguments, **named):
        raise RuntimeError("RESOURCE_EXHAUSTED: Out of memory while trying to allocate 17179869184 bytes.")

    monkeypatch.setattr(loop, "train", full)
    arguments = ["train", "PointNavigation", "--worlds", "8", "--pool-size", "4", "--out", str(tmp_path / "run")]
    assert call([*arguments, "--set", "engine=native"]) == 2
    (line,) = [text for text in capsys.readouterr().err.splitlines() if "memory" in text]
    assert "8 worlds" in line and "--worlds 4" in line


def test_processes_join_before_jax_looks_for_devices(monkeypatch, capsys):
    """`jax.distributed` cannot be initialized once there is a backend."""
    import jax

    from ig2mj.cluster.team import Team

    asked = []

    def join(topology):
        raise Ig2mjError(f"joined after {len(asked)} questions")

    monkeypatch.setattr(jax, "default_backend", lambda: asked.append(1) or "cpu")
    monkeypatch.setattr(Team, "join", join)
    assert call(["train", "CookingMeat", "--config", "CookingMeat"]) == 2
    assert "joined after 0 questions" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_training_leaves_reports_checkpoints_a_policy_and_films(tmp_path, capsys):
    """A film of a held-out episode while it trains, and one at its end; a second run with the folder is refused."""
    pytest.importorskip("imageio_ffmpeg", reason="makes the films")
    run = tmp_path / "run"
    settings = ["--worlds", "2", *POOL, "--engine", "native", "--out", str(run), "--set", "updates=1", "batch=32"]
    assert call(["train", "GraspingBook", "--minutes", "0.2", "--videos", "0.1", *settings]) == 0
    assert capsys.readouterr().out.strip() == str(run / "policy.npz")
    films = sorted((run / "videos").glob("*.mp4"))
    logs = "\n".join(log.read_text()[-500:] for log in (run / "videos").glob("*.log"))
    assert films and all(film.stat().st_size > 2000 and film.with_suffix(".npz").exists() for film in films), logs
    assert (run / "progress.csv").exists() and list(run.glob("events.out.tfevents.*"))
    assert [f.name for f in (run / "checkpoints").iterdir()]
    assert call(["train", "GraspingBook", "--minutes", "0.2", *settings]) == 2
    assert "holds a run already: --resume continues it" in capsys.readouterr().err


def test_all_devices_are_none_to_share_where_there_is_one():
    """A single device is trained on as without `--devices`, also by the native engine."""
    assert _devices("all", 1) == _devices("1", 1) == []
    with pytest.raises(Ig2mjError, match="--devices 2: this run can have 1"):
        _devices("2", 1)
