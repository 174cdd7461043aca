"""`ig2mj warm-up` leaves a cache with which the next process starts without compiling."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys

import pytest


def _warm_up(folder: pathlib.Path, *more: str) -> dict:
    command = [sys.executable, "-m", "ig2mj", "warm-up", "small_home", "--worlds", "2", "--out", str(folder), "--json"]
    environment = os.environ | {"JAX_PLATFORMS": "cpu"}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    done = subprocess.run([*command, *more], capture_output=True, text=True, env=environment, timeout=600, check=True)
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_the_second_process_finds_everything_compiled(tmp_path):
    cold, warm = _warm_up(tmp_path / "cache"), _warm_up(tmp_path / "cache")
    assert cold["megabytes"] == warm["megabytes"] > 0
    assert sum(1 for file in (tmp_path / "cache" / "jax").iterdir() if file.is_file()) > 3
    steps = ("start", "first step")
    assert sum(warm["seconds"][k] for k in steps) < 0.6 * sum(cold["seconds"][k] for k in steps)


def test_a_home_takes_no_robot_and_no_grasping(capsys):
    from ig2mj.cli import call

    for architecture in ((), ("--arch", "90")):
        assert call(["warm-up", "small_home", "--robot", "fetch", *architecture]) == 2
        assert "belong to environments" in capsys.readouterr().err
    assert call(["warm-up", "small_home", "--grasping", "physical"]) == 2
    assert "belong to environments" in capsys.readouterr().err
    assert call(["warm-up", "ig2mj/CookingMeet-v0"]) == 2
    assert "near matches: CookingMeat" in capsys.readouterr().err
    assert call(["warm-up", "CookingMeat", "--grasping", "firm", "--worlds", "1"]) == 2
    assert "firm" in capsys.readouterr().err
    assert call(["warm-up", "small_home", "--homes", "train"]) == 2
    assert "belong to environments" in capsys.readouterr().err
    assert call(["warm-up", "CookingMeat", "--arch", "90", "--randomize", "light"]) == 2
    assert "near matches: lights" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_to_is_refused_before_anything_is_made(tmp_path, capsys, monkeypatch):
    from ig2mj.cli import call
    from ig2mj.process.compilation import CACHE_VARIABLE

    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    (tmp_path / "file").write_text("")
    assert call(["warm-up", "CookingMeat", "--worlds", "1", "--out", str(tmp_path / "file" / "cache")]) == 2
    assert "cannot be the folder of the cache" in capsys.readouterr().err
    assert os.environ[CACHE_VARIABLE] == str(tmp_path)
