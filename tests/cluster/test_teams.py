"""Processes that train together: the same gradient as one device, one end for all, and going on with another number.

Each process is a real one with one CPU device (`team_process.py`); JAX's collectives go over gloo.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from ig2mj.cluster.process_topology import ProcessTopology
from ig2mj.cluster.team import Team, _Link
from ig2mj.cluster.versions import versions
from ig2mj.errors import ClusterError

SCRIPT = Path(__file__).parent / "team_process.py"


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


@contextlib.contextmanager
def processes(task: str, out: Path, count: int):
    port, started = free_port(), []
    for rank in range(count):
        environment = {**os.environ, "JAX_PLATFORMS": "cpu", "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false"}
        if count > 1:
            address = {"JAX_COORDINATOR_ADDRESS": f"127.0.0.1:{port}"}
            environment |= {**address, "JAX_NUM_PROCESSES": str(count), "JAX_PROCESS_ID": str(rank)}
        words = [sys.executable, str(SCRIPT), task, str(out)]
        started.append(
            subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        )
    try:
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()
            process.stdout.close()
            process.stderr.close()


def results(task: str, out: Path, count: int) -> list[dict]:
    with processes(task, out, count) as started:
        said = [p.communicate(timeout=500) for p in started]
        for process, (_, error) in zip(started, said, strict=True):
            assert process.returncode == 0, error[-3000:]
        return [json.loads(answer.split("RESULT")[1]) for answer, _ in said]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_gradients_of_1_2_and_4_processes_are_the_same(tmp_path):
    """Same global batch and seed: the averaged gradient equals the single device's to 1e-5, and so do statistics."""
    (alone,) = results("gradient", tmp_path, 1)
    assert np.abs(alone["gradient"]).max() > 0.1, "there is something to compare"
    for count in (2, 4):
        every = results("gradient", tmp_path, count)
        for name in ("gradient", "weights", "mean", "var", "scale"):
            assert all(each[name] == every[0][name] for each in every), f"{name} differs between processes"
            np.testing.assert_allclose(every[0][name], alone[name], atol=1e-5, rtol=0, err_msg=f"{name}, {count}")


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("victim", [0, 1])
def test_a_process_that_dies_ends_the_others_with_one_line(tmp_path, victim):
    with processes("learn-0-long", tmp_path / "run", 2) as started:
        for process in started:
            assert any(line.strip() == "READY" for line in process.stdout)
        until = time.monotonic() + 900
        while not (tmp_path / "run" / "progress.csv").exists():  # it learns
            assert time.monotonic() < until and all(p.poll() is None for p in started)
            time.sleep(0.5)
        os.kill(started[victim].pid, signal.SIGKILL)
        began = time.monotonic()
        _, error = started[1 - victim].communicate(timeout=90)
        assert time.monotonic() - began < 60
        assert started[1 - victim].returncode != 0
        last = error.strip().splitlines()[-1]
        assert f"process {victim} (pid {started[victim].pid} on {socket.gethostname()}) died" in last, error[-2000:]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_run_goes_on_with_another_number_of_devices(tmp_path):
    """Two processes, then one, then two again: counters go on, and the global number of worlds stays."""
    out = tmp_path / "run"
    first = results("learn-12", out, 2)
    assert [r["iteration"] for r in first] == [12, 12] and first[0]["env_steps"] == first[1]["env_steps"] == 32 * 2 * 12
    (second,) = results("learn-16-resume", out, 1)
    assert second["iteration"] == 16 and second["env_steps"] == 32 * 2 * 16
    third = results("learn-20-resume", out, 2)
    assert [r["iteration"] for r in third] == [20, 20] and third[1]["env_steps"] == 32 * 2 * 20


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_first_process_samples_and_compiles_while_the_others_wait(tmp_path, monkeypatch):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    first, second = results("turns", tmp_path, 2)
    assert (first["sampled"], second["sampled"]) == (1, 0), "start states are sampled once"
    assert len(list((tmp_path / "cache" / "pools").glob("GraspingBook-*.npz"))) == 1
    assert len(first["times"]) == len(second["times"]) == 4, "compiled once"
    assert second["times"][0] >= first["times"][1], "the second begins when the first has compiled"
    assert second["times"][2] < first["times"][3] and first["times"][2] < second["times"][3], "then both step at once"


def test_a_team_of_one_waits_for_nobody():
    team = Team()
    assert team.first and team.barrier("x", 7) == 7
    with team.together(), team.turns():
        pass


def test_who_does_not_come_is_named():
    place = ProcessTopology("127.0.0.1", free_port(), 0, 3)
    with pytest.raises(ClusterError, match=r"processes 1, 2 of 3 have not come within 1.5 s"):
        Team.join(place, patience=1.5)


def test_nobody_there():
    with pytest.raises(ClusterError, match=r"process 0 cannot be reached at 127.0.0.1:\d+: Connection refused"):
        Team.join(ProcessTopology("127.0.0.1", free_port(), 1, 2), patience=0.5)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"ig2mj": "0.0.9"}, "has ig2mj 0.0.9, and process 0 has "),
        ({"Python": "3.9"}, "has Python 3.9, and process 0 has 3."),
        ({"count": 5}, "has count 5, and process 0 has 2"),
        ({"rank": 0}, "has the number of another process"),
    ],
)
def test_another_version_is_refused_on_both_sides(changes, said):
    own = {"rank": 0, "count": 2, "pid": 1, "host": "a", **versions()}
    place, team = ProcessTopology("127.0.0.1", free_port(), 0, 2), Team(0, 2)
    with socket.create_server(("127.0.0.1", 0)) as server:
        other = _Link(socket.create_connection(server.getsockname()))
        link = _Link(server.accept()[0])
    assert team._wrong(own, {**own, "rank": 1, "host": "b", **changes}) is not None
    reason = team._wrong(own, {**own, "rank": 1, "host": "b", **changes})
    assert said in reason
    team._refuse(reason, link)
    assert other.receive(5.0) == {"refused": reason}
    assert place.count == team.count
    other.close()
    link.close()
