"""From the shell: an expert is recorded, cloned, judged and played; what does not fit is refused in one line."""

from __future__ import annotations

import json

import pytest

from ig2mj.cli import call

POOL = ["--pool-size", "4"]


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_recorded_expert_is_cloned_and_judged(tmp_path, capsys):
    demos, run = tmp_path / "meat.h5", tmp_path / "run"
    assert call(["demos", "collect", "CookingMeat", "--out", str(demos), "--episodes", "8", *POOL]) == 0
    train = ["train", "CookingMeat", "--algo", "bc", "--demos", str(demos), "--out", str(run)]
    assert call([*train, "--set", "steps=1500", "batch=128", "actor=64,64"]) == 0
    capsys.readouterr()
    episodes = ["--episodes", "4", *POOL, "--split", "train", "--json"]
    assert call(["evaluate", str(run), "--worlds", "4", *episodes]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["env"] == "CookingMeat" and found["episodes"] == 4
    assert found["success_low"] <= found["success_rate"] <= found["success_high"]
    assert found["success_rate"] >= 0.75
    assert call(["rollout", "CookingMeat", "--agent", str(run / "policy.npz"), "--worlds", "4", *episodes]) == 0
    assert json.loads(capsys.readouterr().out)["success_rate"] >= 0.75
    assert call(["evaluate", str(run), "--worlds", "1", "--episodes", "1", *POOL, "--robot", "fetch"]) == 2
    assert 'is for robot = "humanoid", and here it is "fetch"' in capsys.readouterr().err


def test_wrong_options_name_what_is_near(capsys):
    for arguments, told in (
        (["train", "CookingMeat", "--algo", "sax"], "near matches: sac"),
        (["train", "CookingMeat", "--obs", "rgb"], "near matches: rgbd"),
        (["train", "CookingMeat", "--set", "updatez=3"], "updates"),
        (["train", "CookingMeat", "--algo", "bc"], "needs --demos"),
        (["evaluate", "CookingMeet"], "no policy is named"),
        (["evaluate", "no/such.npz"], "there is no such file"),
        (["rollout", "CookingMeat", "--agent", "expart"], "near matches: expert"),
    ):
        assert call(arguments) == 2, arguments
        assert told in capsys.readouterr().err, arguments


def test_a_training_that_does_not_fit_ends_in_one_line(tmp_path, capsys, monkeypatch):
    from ig2mj.learn import train as loop

    def full(*arguments, **named):
        raise RuntimeError("RESOURCE_EXHAUSTED: Out of memory while trying to allocate 17179869184 bytes.")

    monkeypatch.setattr(loop, "train", full)
    arguments = ["train", "PointNavigation", "--worlds", "8", "--pool-size", "4", "--out", str(tmp_path / "run")]
    assert call([*arguments, "--engine", "native"]) == 2
    (line,) = [text for text in capsys.readouterr().err.splitlines() if "memory" in text]
    assert "8 worlds" in line and "--worlds 4" in line
