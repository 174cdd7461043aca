"""Commands on a real Ray cluster of two nodes: the bytes of one process, although a node is killed while it works."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
import time

import pytest

pytest.importorskip("ray")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1500)]

TASK, STARTS = "GraspingBook", ("--pool-size", "4")


def command(cluster, folder: pathlib.Path, *words: str) -> subprocess.Popen:
    environment = {**cluster.environment, "PYTHONPATH": os.environ.get("PYTHONPATH", "")}
    return subprocess.Popen(
        [sys.executable, "-m", "ig2mj", *words],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def done(process: subprocess.Popen) -> str:
    """What a command that must succeed printed."""
    said, error = process.communicate(timeout=900)
    assert process.returncode == 0, error[-3000:]
    return said


def at_work(session: int) -> bool:
    """Whether a process of this session does a job: Ray gives it the task's name."""
    for entry in pathlib.Path("/proc").iterdir():
        try:
            own = entry.name.isdigit() and os.getsid(int(entry.name)) == session
            if own and (entry / "cmdline").read_bytes().startswith(b"ray::_task"):
                return True
        except OSError:  # it has just ended
            continue
    return False


def with_a_death(cluster, folder: pathlib.Path, *words: str) -> str:
    """Runs a command on the cluster, whose second node is killed as soon as it does a job of it."""
    assert cluster.second is not None
    process = command(cluster, folder, *words, "--cluster", cluster.address)
    try:
        until = time.monotonic() + 600
        while not at_work(cluster.second.pid):
            assert process.poll() is None, process.communicate()[1][-3000:]
            assert time.monotonic() < until, "the second node was given nothing to do"
            time.sleep(0.05)
        time.sleep(1.0)  # in the middle of it
        assert process.poll() is None, "the work was over before a node could die"
        cluster.kill_node()
        return done(process)
    finally:
        process.kill()
        process.communicate()
        if cluster.second.poll() is None:
            cluster.kill_node()
        cluster.add_node()
        cluster.wait_for_nodes(2)


@pytest.fixture(scope="module")
def policy(tmp_path_factory) -> pathlib.Path:
    """A policy that was never trained, so that its episodes are long."""
    import jax

    import ig2mj
    from ig2mj.envs.registry import VECTORS
    from ig2mj.learn.algorithms import config_of, make_algorithm
    from ig2mj.learn.perception import Perception
    from ig2mj.learn.policies import Policy, depends_on

    env = ig2mj.make(TASK, worlds=1, engine="native", observations=VECTORS, pool_size=4, split="held_out")
    perception = Perception(env.observation_spaces, "state")
    sac = make_algorithm(config_of("sac", small=True), perception, env)
    file = tmp_path_factory.mktemp("policy") / "policy.npz"
    Policy.of(sac, sac.init(jax.random.PRNGKey(0)), depends_on(env, perception), {"seed": 0}).save(file)
    return file


@pytest.fixture
def both_nodes(ray_cluster):
    ray_cluster.wait_for_nodes(2)
    return ray_cluster


def test_disturbed_states_are_the_same(both_nodes, tmp_path):
    words = ("sample", "willow", "--disturb", "--count", "40", "--out")
    with_a_death(both_nodes, tmp_path, *words, "there.npz")
    done(command(both_nodes, tmp_path, *words, "here.npz", "--jobs", "1"))
    assert (tmp_path / "here.npz").read_bytes() == (tmp_path / "there.npz").read_bytes()


def test_demonstrations_are_the_same(both_nodes, tmp_path):
    words = ("demos", "collect", TASK, "--episodes", "70", "--worlds", "4", *STARTS, "--out")
    with_a_death(both_nodes, tmp_path, *words, "there.h5")
    done(command(both_nodes, tmp_path, *words, "here.h5", "--jobs", "1"))
    assert (tmp_path / "here.h5").read_bytes() == (tmp_path / "there.h5").read_bytes()
    assert not list(tmp_path.glob("*.jobs")), "the journals went"


def test_replays_are_the_same(both_nodes, tmp_path):
    played = ("rollout", TASK, "--agent", "expert", "--worlds", "2", "--episodes", "10", *STARTS, "--record", "a.h5")
    done(command(both_nodes, tmp_path, *played))
    words = ("demos", "replay", "a.h5", "--check", "--sensors", "proprioception,privileged_state", "--out")
    there = with_a_death(both_nodes, tmp_path, *words, "there.h5")
    here = done(command(both_nodes, tmp_path, *words, "here.h5"))
    assert here == there and "all the same" in here
    assert (tmp_path / "here.h5").read_bytes() == (tmp_path / "there.h5").read_bytes()


def test_evaluations_are_the_same(both_nodes, tmp_path, policy):
    words = ("evaluate", str(policy), "--episodes", "12", "--worlds", "2", *STARTS, "--out")
    with_a_death(both_nodes, tmp_path, *words, "there.json")
    done(command(both_nodes, tmp_path, *words, "here.json", "--jobs", "1"))
    assert (tmp_path / "here.json").read_bytes() == (tmp_path / "there.json").read_bytes()
