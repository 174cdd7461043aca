"""What a training says on the terminal and writes to its folder."""

from __future__ import annotations

import math
import struct
import subprocess
import sys

import pytest

from ig2mj.learn.log import Log

ROW = {"seconds": 12.0, "env_steps": 64000, "steps_per_second": 5000.0, "updates_per_second": 40.0}
SHARES = {"learner_share": 0.25, "simulator_share": 0.75}


def test_before_an_episode_has_ended_losses_are_shown(capsys):
    log = Log(None, minutes=10.0)
    log.row({**ROW, **SHARES, "return": None, "success": None, "actor_loss": 0.5, "critic_loss": 1.25, "copied": 0.1})
    line = capsys.readouterr().err
    assert "12.0 of 600 s" in line and "actor_loss 0.5  critic_loss 1.25" in line
    assert " -" not in line and "copied" not in line


def test_after_an_episode_return_and_success_are_shown(capsys):
    Log(None).row({**ROW, **SHARES, "return": 1.5, "success": 0.5, "actor_loss": 0.5})
    line = capsys.readouterr().err
    assert "return 1.500  success 50.0%" in line and "actor_loss" not in line


def test_cloning_says_how_many_updates_and_which_losses(capsys):
    Log(None, minutes=1.0).row({**ROW, "env_steps": 1200, "steps_per_second": None, "success": None, "actor_loss": 0.5})
    line = capsys.readouterr().err
    assert "12.0 of 60 s  1,200 updates  actor_loss 0.5" in line and "steps/s" not in line


def test_a_row_is_a_point_of_each_curve_of_tensorboard(tmp_path):
    event_pb2 = pytest.importorskip("tensorboardX.proto.event_pb2")
    log = Log(tmp_path, quiet=True)
    log.row({**ROW, **SHARES, "return": None, "success/birch": 0.5, "env_steps": 3_000_000_000})
    log.row({**ROW, "actor_loss": math.inf, "critic_loss": -1})
    log.close()
    (file,) = tmp_path.glob("events.out.tfevents.*")
    content, points = file.read_bytes(), {}
    while content:
        (length,) = struct.unpack_from("<Q", content)
        event = event_pb2.Event.FromString(content[12 : 12 + length])
        points |= {(v.tag, event.step): v.simple_value for v in event.summary.value}
        content = content[16 + length :]
    assert points["success/birch", 3_000_000_000] == 0.5 and points["steps_per_second", 64000] == 5000.0
    assert points["actor_loss", 64000] == math.inf and points["critic_loss", 64000] == -1
    assert not {"env_steps", "return"} & {tag for tag, _ in points}


def test_without_the_library_a_line_says_so_and_rows_are_kept(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    log = Log(tmp_path, quiet=True)
    for _ in range(2):
        log.row(ROW)
    log.close()
    assert capsys.readouterr().err.count("no TensorBoard file") == 1
    assert len((tmp_path / "progress.csv").read_text().splitlines()) == 3


def test_a_start_does_not_wait_for_the_library_of_curves(tmp_path):
    """It imports PyTorch where that is installed: 10 s of a start."""
    code = (
        "import sys; from ig2mj.learn.log import Log; Log(sys.argv[1]); "
        "print([m for m in ('tensorboardX', 'tensorboard', 'torch', 'google.protobuf') if m in sys.modules])"
    )
    said = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
