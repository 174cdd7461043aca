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


def events(folder):
    """Events of the folder's only file, whose checksums are compared: read by another library."""
    event_pb2 = pytest.importorskip("tensorboardX.proto.event_pb2")
    from tensorboardX.record_writer import masked_crc32c

    (file,) = folder.glob("events.out.tfevents.*")
    content, found = file.read_bytes(), []
    while content:
        (length,) = struct.unpack_from("<Q", content)
        body, sums = content[12 : 12 + length], (content[8:12], content[12 + length : 16 + length])
        assert [int.from_bytes(s, "little") for s in sums] == [masked_crc32c(content[:8]), masked_crc32c(body)]
        found.append(event_pb2.Event.FromString(body))
        content = content[16 + length :]
    return found


def test_a_row_is_a_point_of_each_curve_of_tensorboard(tmp_path):
    log = Log(tmp_path, quiet=True)
    log.row({**ROW, **SHARES, "return": None, "success/birch": 0.5, "env_steps": 3_000_000_000})
    log.row({**ROW, "actor_loss": math.inf, "critic_loss": -1, "reward/ü": 1e-3})
    first, *rows = events(tmp_path)
    assert first.file_version == "brain.Event:2" and first.wall_time > 1.7e9
    assert [row.step for row in rows] == [3_000_000_000, 64000]
    points = [{v.tag: v.simple_value for v in row.summary.value} for row in rows]
    assert points[0] == {k: v for k, v in {**ROW, **SHARES, "success/birch": 0.5}.items() if k != "env_steps"}
    assert points[1]["actor_loss"] == math.inf and points[1]["critic_loss"] == -1
    assert points[1]["reward/ü"] == pytest.approx(1e-3)


def test_a_log_needs_no_other_library(tmp_path):
    """Those that write TensorBoard's files import PyTorch where it is installed: 10 s of a start."""
    code = (
        "import sys; from ig2mj.learn.log import Log; Log(sys.argv[1]); "
        "print([m for m in ('tensorboardX', 'tensorboard', 'torch', 'google.protobuf') if m in sys.modules])"
    )
    said = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
