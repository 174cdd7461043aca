"""A Ray cluster of two nodes on this machine, each with one processor, started as a user would start it."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

HERE = pathlib.Path(__file__).parent


@dataclasses.dataclass
class RayCluster:
    """Attributes: address: of the head. environment: of its processes. second: the process of the second node."""

    address: str
    environment: dict[str, str]
    second: subprocess.Popen | None = None

    def add_node(self, **variables: str) -> None:
        """A second node. `variables`: of its environment, beside those of the first."""
        self.second = node({**self.environment, **variables}, "--address", self.address)

    def wait_for_nodes(self, count: int) -> None:
        """Until so many nodes are alive, as a process of its own sees it."""
        code = f"import ray, time; ray.init(address={self.address!r}, log_to_driver=False, logging_level='ERROR')\n"
        code += f"while sum(n['Alive'] for n in ray.nodes()) != {count}: time.sleep(0.5)"
        subprocess.run([sys.executable, "-c", code], env=self.environment, capture_output=True, check=True, timeout=180)

    def kill_node(self) -> None:
        """Kills the second node: the process that was started, and those that it started, which are its session."""
        assert self.second is not None
        os.killpg(self.second.pid, signal.SIGKILL)
        self.second.wait()


def free_port() -> int:
    """Below the ports that Ray gives its workers."""
    for port in range(6400, 9900, 7):
        with socket.socket() as tried:
            try:
                tried.bind(("", port))
            except OSError:
                continue
            return port
    raise AssertionError("no free port")


def node(environment: dict[str, str], *words: str) -> subprocess.Popen:
    """A node in a session of its own."""
    command = [sys.executable, "-m", "ray.scripts.scripts", "start", *words, "--num-cpus", "1", "--num-gpus", "0"]
    command += ["--object-store-memory", "100000000", "--disable-usage-stats", "--block"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen(command, env=environment, start_new_session=True, **quiet)


@pytest.fixture(scope="module")
def ray_cluster(tmp_path_factory) -> Iterator[RayCluster]:
    pytest.importorskip("ray")
    port, folder = free_port(), tmp_path_factory.mktemp("ray")
    environment = {
        **os.environ,
        "JAX_PLATFORMS": "cpu",
        "PYTHONPATH": os.pathsep.join([str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")]),
        "RAY_USAGE_STATS_ENABLED": "0",
        "RAY_AUTH_MODE": "disabled",  # whether there is a token on this machine or not
        "RAY_TMPDIR": str(folder) if len(str(folder)) < 40 else "/tmp/ray",  # its sockets' names may not be long
    }
    head = node(environment, "--head", "--port", str(port), "--include-dashboard", "false")
    cluster = RayCluster(f"127.0.0.1:{port}", environment)
    try:
        wait_for(lambda: answers(port), 120)
        cluster.add_node()
        yield cluster
    finally:
        for started in (cluster.second, head):
            if started is not None:
                if started.poll() is None:
                    os.killpg(started.pid, signal.SIGTERM)
                try:
                    started.wait(20)
                except subprocess.TimeoutExpired:
                    os.killpg(started.pid, signal.SIGKILL)
                    started.wait()


def answers(port: int) -> bool:
    with socket.socket() as tried:
        return tried.connect_ex(("127.0.0.1", port)) == 0


def wait_for(what, seconds: float) -> None:
    until = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < until, "not within the time"
        time.sleep(0.2)
