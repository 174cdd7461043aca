"""A command for each GPU: which GPUs there are, what each process is told, and how they end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from ig2mj.cluster import process_per_gpu
from ig2mj.cluster.process_per_gpu import run_on_each_gpu, visible_gpus
from ig2mj.cluster.process_topology import find_topology

TELL = """
import os, pathlib, sys
rank = os.environ["JAX_PROCESS_ID"]
pathlib.Path(sys.argv[1], rank).write_text("\\n".join(f"{k}={v}" for k, v in os.environ.items() if "\\n" not in v))
sys.exit(int(sys.argv[2]) if rank == "1" else 0)
"""

PARENT = """
import os, sys
from ig2mj.cluster.process_per_gpu import run_on_each_gpu
sleeps = "import os, signal, sys, time; signal.signal(signal.SIGTERM, lambda *_: sys.exit(7)); os.write(1, b'up\\\\n')"
sys.exit(run_on_each_gpu(["0", "1"], [sys.executable, "-c", sleeps + "; time.sleep(60)"], os.environ))
"""


@pytest.mark.parametrize(
    ("environ", "found"),
    [
        ({"CUDA_VISIBLE_DEVICES": "3,1"}, ["3", "1"]),
        ({"CUDA_VISIBLE_DEVICES": ""}, []),
        ({"CUDA_VISIBLE_DEVICES": "-1"}, []),
        ({"CUDA_VISIBLE_DEVICES": "0,1", "JAX_PLATFORMS": "cpu"}, []),
        ({"CUDA_VISIBLE_DEVICES": "0,1", "JAX_PLATFORMS": "cuda,cpu"}, ["0", "1"]),
    ],
)
def test_gpus_are_those_that_variables_leave(environ, found):
    assert visible_gpus(environ) == found


def test_without_nvidias_program_there_are_no_gpus(monkeypatch):
    monkeypatch.setattr(process_per_gpu.subprocess, "run", lambda *_, **__: (_ for _ in ()).throw(FileNotFoundError()))
    assert visible_gpus({}) == []


@pytest.mark.parametrize("status", [0, 5])
def test_each_process_has_a_gpu_and_a_rank_of_one_run(tmp_path, status):
    command = [sys.executable, "-c", TELL, str(tmp_path), str(status)]
    assert run_on_each_gpu(["4", "2"], command, os.environ) == status
    told = [dict(line.split("=", 1) for line in (tmp_path / rank).read_text().splitlines()) for rank in "01"]
    assert [one["CUDA_VISIBLE_DEVICES"] for one in told] == ["4", "2"]
    topologies = [find_topology(one) for one in told]
    assert [t.rank for t in topologies if t] == [0, 1] and {(t.count, t.port) for t in topologies if t} == {
        (2, topologies[0].port)
    }


def test_a_signal_goes_to_all_processes():
    with subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        assert [parent.stdout.readline().strip() for _ in range(2)] == ["up", "up"]
        began = time.monotonic()
        parent.send_signal(signal.SIGTERM)
        assert parent.wait(20) == 7 and time.monotonic() - began < 20
