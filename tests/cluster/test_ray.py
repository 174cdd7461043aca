"""Jobs on a real Ray cluster of two nodes of one processor each: the same bytes, also where a node dies."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import sys
import threading
import types

import pytest
from tiny_dataset import write_dataset

from ig2mj.cluster import ray_nodes
from ig2mj.cluster.job_runner import Where, map_jobs
from ig2mj.cluster.jobs import Job, JobSet
from ig2mj.errors import ClusterError

pytest.importorskip("ray")

HERE = pathlib.Path(__file__).parent
CONDITION = "(on_top apple_0 breakfast_table_0)"


class AuthenticationError(Exception):
    """As Ray's."""


def ig2mj(cluster, folder: pathlib.Path, *words: str) -> subprocess.CompletedProcess:
    """The command in a process of its own; the cluster's address last where it is wanted."""
    command = [sys.executable, "-m", "ig2mj", *words]
    environment = {**cluster.environment, "PYTHONPATH": os.environ.get("PYTHONPATH", "")}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=500)


def jobs(count: int, **arguments) -> JobSet:
    found = [Job(f"job_{n:03d}", {"number": n, **arguments}) for n in range(count)]
    return JobSet("job_functions:digest", "testing", found, {"file": b"shared content"})


@pytest.fixture
def joined(ray_cluster, monkeypatch):
    """This process is a driver of the cluster while the test runs."""
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("PYTHONPATH", ray_cluster.environment["PYTHONPATH"])
    return ray_cluster


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_node_that_dies_costs_nothing(joined, tmp_path):
    """The second node is killed while both work: every job comes out, with the bytes of one process."""
    import ray

    local, _ = map_jobs(jobs(30))
    ray.init(address=joined.address, namespace="ig2mj", logging_level="ERROR", log_to_driver=False)
    try:
        wait_for_nodes(ray, 2)
        expected, killed = jobs(30, seconds=0.3, note=str(tmp_path)), []

        def kill_once(done, total, text="") -> None:
            if done >= 6 and not killed:
                killed.append(done)
                threading.Thread(target=joined.kill_node).start()

        store, failed = map_jobs(expected, Where(cluster=joined.address), progress=kill_once)
        assert killed and not failed
        assert [store.get(p.name) for p in expected.jobs] == [local.get(p.name) for p in expected.jobs]
        workers = {file.name.split("-")[1] for file in tmp_path.iterdir()}
        assert len(workers) >= 2, "both nodes worked"
        wait_for_nodes(ray, 1)
    finally:
        ray.shutdown()
        joined.add_node()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_full_disk_on_one_node_fails_its_pieces_and_not_the_run(joined, tmp_path):
    """The second node writes to a full device. A job fails only where each of its three tries fell to that node."""
    import ray

    joined.kill_node()
    joined.add_node(JOBS_DISK="/dev/full")
    ray.init(address=joined.address, namespace="ig2mj", logging_level="ERROR", log_to_driver=False)
    try:
        wait_for_nodes(ray, 2)
        asked = [Job(f"job_{n:03d}", {"number": n, "note": str(tmp_path)}) for n in range(12)]
        store, failed = map_jobs(JobSet("job_functions:on_disk", "testing", asked), Where(cluster=joined.address))
        assert set(store.names()) | set(failed) == {p.name for p in asked} and len(store.names()) >= 4
        assert all(store.get(p.name) == b"%d" % p.arguments["number"] for p in asked if p.name not in failed)
        assert {reason.split(": ", 1)[1] for reason in failed.values()} <= {"[Errno 28] No space left on device"}
        assert list(tmp_path.glob("full-*")), "the full disk was met"
    finally:
        ray.shutdown()
        joined.kill_node()
        joined.add_node()


def wait_for_nodes(ray, count: int) -> None:
    import time

    until = time.monotonic() + 120
    while sum(node["Alive"] for node in ray.nodes()) != count:
        assert time.monotonic() < until
        time.sleep(0.5)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_pool_has_the_same_bytes_on_one_process_and_on_two_nodes(ray_cluster, tmp_path):
    words = ("sample", "small_home", CONDITION, "--count", "4", "--out")
    here = ig2mj(ray_cluster, tmp_path, *words, "here.npz", "--jobs", "1")
    there = ig2mj(ray_cluster, tmp_path, *words, "there.npz", "--cluster", ray_cluster.address)
    assert here.returncode == there.returncode == 0, here.stderr + there.stderr
    assert (tmp_path / "here.npz").read_bytes() == (tmp_path / "there.npz").read_bytes()
    assert sorted(f.name for f in tmp_path.iterdir()) == ["here.npz", "there.npz"], "the journals went"


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_dataset_has_the_same_bytes_and_what_is_broken_is_listed(ray_cluster, tmp_path):
    root = write_dataset(tmp_path / "dataset")
    broken = next(iter(sorted(root.glob("objects/*/*/*.urdf"))))
    broken.write_text("<robot")
    words = ("convert", "dataset", str(root), "--no-cache", "--no-report", "--out")
    here = ig2mj(ray_cluster, tmp_path, *words, "here", "--jobs", "1")
    there = ig2mj(ray_cluster, tmp_path, *words, "there", "--cluster", ray_cluster.address)
    name = broken.parent.relative_to(root).as_posix()
    for done in (here, there):
        assert done.returncode == 1, done.stderr
        assert f"  {name}: " in done.stderr and "--resume tries them again" in done.stderr
    shutil.rmtree(tmp_path / "here" / ".jobs")
    shutil.rmtree(tmp_path / "there" / ".jobs")
    files = [
        {f.relative_to(top): f.read_bytes() for f in top.rglob("*") if f.is_file()}
        for top in (tmp_path / "here", tmp_path / "there")
    ]
    assert files[0] == files[1] and sum(f.name == "manifest.json" for f in files[0]) > 3


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_node_without_the_files_or_with_another_version_is_told_before_any_work(joined, tmp_path, monkeypatch):
    import ray

    note = tmp_path / "note"
    note.mkdir()
    expected = jobs(3, note=str(note))
    ray.init(address=joined.address, namespace="ig2mj", logging_level="ERROR", log_to_driver=False)
    try:
        wait_for_nodes(ray, 2)
        file = tmp_path / "scene.xml"
        file.write_text("here")
        other = JobSet(expected.function, "", expected.jobs, check=("job_functions:node_files", {"path": str(file)}))
        monkeypatch.setattr(ray_nodes, "digest_seen", lambda check: "what this machine has")
        with pytest.raises(ClusterError, match=r"node .* has other files than this machine"):
            run(other, Where(cluster=joined.address))
        gone = JobSet(expected.function, "", expected.jobs, check=("job_functions:node_files", {"path": "/no/such"}))
        with pytest.raises(ClusterError, match=r"node .*: .*No such file or directory: '/no/such'"):
            run(gone, Where(cluster=joined.address))
        monkeypatch.undo()
        monkeypatch.setattr(ray_nodes, "versions", lambda: {"ig2mj": "9.9 (abc)"})
        with pytest.raises(ClusterError, match=r"node .* has ig2mj .*, not 9.9"):
            map_jobs(expected, Where(cluster=joined.address))
        assert not list(note.iterdir()), "no job was begun"
    finally:
        ray.shutdown()


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("127.0.0.1:9", "--cluster 127.0.0.1:9: there is no answer .Connection refused"),
        ("nonsense", "an address is HOST:PORT"),
        ("host:port", "an address is HOST:PORT"),
    ],
)
def test_an_address_where_nobody_is(address, said):
    with pytest.raises(ClusterError, match=said):
        map_jobs(jobs(1), Where(cluster=address))


@pytest.mark.parametrize("error", [ConnectionError("Failed to connect"), AuthenticationError("no token")])
def test_a_cluster_that_asks_for_a_token_says_how_it_is_given(monkeypatch, error):
    monkeypatch.setattr(ray_nodes, "check_address", lambda address: None)

    def init(**_):
        raise error

    fake = types.SimpleNamespace(init=init, exceptions=types.SimpleNamespace(AuthenticationError=AuthenticationError))
    with pytest.raises(ClusterError, match=r"--cluster 10\.0\.0\.1:6379: .*RAY_AUTH_MODE=token"):
        ray_nodes._connect(fake, "10.0.0.1:6379")


def test_a_cluster_that_has_ended_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    (tmp_path / "ray").mkdir()
    (tmp_path / "ray" / "ray_current_cluster").write_text("127.0.0.1:9\n")
    with pytest.raises(ClusterError, match="--cluster auto: there is no answer at 127"):
        map_jobs(jobs(1), Where(cluster="auto"))


def test_commands_ask_for_the_cluster_before_they_do_anything(tmp_path, monkeypatch, capsys):
    from ig2mj.cli import call

    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    for words in (
        ["sample", "small_home", CONDITION, "--out", str(tmp_path / "a.npz")],
        ["demos", "collect", "GraspingBook", "--out", str(tmp_path / "a.h5")],
    ):
        assert call([*words, "--cluster", "127.0.0.1:9"]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "127.0.0.1:9: there is no answer" in error, words
    assert not list(tmp_path.iterdir()), "nothing was made"
