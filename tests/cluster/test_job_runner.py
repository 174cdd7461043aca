"""Jobs on this machine: the same results in any order, retries, reasons, journals."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
import time

import pytest

from ig2mj.cluster.job_runner import Where, _Counter, map_jobs, stream_jobs
from ig2mj.cluster.jobs import Job, JobSet
from ig2mj.cluster.journal import Journal
from ig2mj.cluster.versions import difference, versions
from ig2mj.errors import ClusterError, EngineError, InputError

HERE = pathlib.Path(__file__).parent


@pytest.fixture(autouse=True)
def functions_are_found(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("PYTHONPATH", str(HERE))
    yield
    sys.modules.pop("job_functions", None)


def work(count: int = 5, function: str = "digest", shared: dict[str, bytes] | None = None, **arguments) -> JobSet:
    jobs = [Job(f"job_{n}", {"number": n, **arguments}) for n in range(count)]
    return JobSet(f"job_functions:{function}", "testing", jobs, shared or {})


def everything(work: JobSet, where: Where = Where(), **options) -> tuple[list[bytes | None], dict[str, str]]:  # noqa: B008
    store, failed = map_jobs(work, where, **options)
    return [None if p.name in failed else store.get(p.name) for p in work.jobs], failed


def test_the_same_results_here_and_on_two_processes():
    expected = work(shared={"file": b"content"})
    here, failed = everything(expected)
    assert not failed and len(set(here)) == 5
    assert everything(expected, Where(jobs=2)) == (here, {})


@pytest.mark.parametrize(
    ("how", "tries", "reason"),
    [
        ("bug", 3, "ValueError: a bug of two lines"),
        ("disk", 3, "OSError: [Errno 28] No space left on device: '/data/x'"),
        ("input", 1, "the object is broken"),
    ],
)
def test_what_fails_is_told_with_its_reason_while_the_others_finish(tmp_path, how, tries, reason):
    results, failed = everything(work(function="failing", how=how, folder=str(tmp_path)))
    assert results == [b"0", b"1", None, b"3", b"4"]
    assert failed == {"job_2": reason}
    assert len(list(tmp_path.glob("try-*"))) == tries, "the user's mistakes are not tried again"


def test_a_second_try_helps(tmp_path):
    results, failed = everything(work(function="failing", how="once", folder=str(tmp_path)))
    assert results[2] == b"at last" and not failed


def test_a_process_that_dies_costs_its_piece_alone(tmp_path):
    results, failed = everything(work(function="failing", how="death", folder=str(tmp_path)), Where(jobs=2))
    assert results == [b"0", b"1", None, b"3", b"4"]
    assert failed == {"job_2": "the process that ran it died"}
    assert len(list(tmp_path.glob("try-*"))) == 3


def test_jobs_are_drawn_from_an_iterator_as_results_arrive():
    seen: list[str] = []

    def until_three():
        for n in range(100):
            if len(seen) == 3:
                return
            yield Job(f"job_{n}", {"number": n})

    counts: list[tuple] = []
    for result in stream_jobs(JobSet("job_functions:digest", "", until_three()), progress=lambda *c: counts.append(c)):
        seen.append(result.name)
    assert seen == ["job_0", "job_1", "job_2"]
    assert counts[-1] == (3, None, "0 running"), "how many there will be is not known"


def test_what_would_fail_everywhere_ends_the_run(tmp_path):
    with pytest.raises(EngineError, match="the scene does not come to rest"):
        everything(work(function="failing", how="all", folder=str(tmp_path)))


def test_progress_counts_jobs_and_predicts_the_remaining_time(tmp_path, monkeypatch):
    seen: list[tuple] = []
    everything(work(function="failing", how="input", folder=str(tmp_path)), progress=lambda *now: seen.append(now))
    assert seen[0] == (0, 5, "1 running")
    assert seen[-1] == (5, 5, "1 failed, 0 running, nearly done")
    clock = iter([0.0, 3725.0])
    monkeypatch.setattr("time.monotonic", lambda: next(clock))
    counter = _Counter(total=9, before=0)
    counter.done, counter.failed = 3, 1
    assert counter.text(running=2) == "1 failed, 2 running, 1:17:36 left", "five of nine, at the pace of the first four"


class Killed(Exception):
    """Stands for a kill of the driver."""


def test_a_killed_run_goes_on_where_it_stopped(tmp_path):
    out, expected, count = tmp_path / "pool.npz", work(note=str(tmp_path)), []

    def die_after_three(done, total, text="") -> None:
        if done == 3:
            raise Killed

    with pytest.raises(Killed), Journal(out, {"rows": 5}) as journal:
        map_jobs(expected, Where(), journal, die_after_three)
    with (tmp_path / "pool.npz.jobs" / "done.jsonl").open("a") as lines:
        lines.write('{"name": "job_4", "sha2')  # half a line, as a kill leaves it
    with pytest.raises(InputError, match=r"an earlier run was interrupted \(--resume continues it"):
        Journal(out, {"rows": 5})
    with pytest.raises(InputError, match="the interrupted run had rows = 5; this one has 6"):
        Journal(out, {"rows": 6}, resume=True)
    before = set(tmp_path.glob("*-*"))
    with Journal(out, {"rows": 5}, resume=True) as journal:
        count, failed = everything(expected, store=journal)
        journal.finish()
    assert count == everything(work())[0] and not failed
    assert len(set(tmp_path.glob("*-*")) | before) == 5 and len(before) == 3, "finished jobs were not done again"
    assert not (tmp_path / "pool.npz.jobs").exists()


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_command_that_was_killed_goes_on_to_the_same_bytes(tmp_path):
    """SIGKILL of `ig2mj sample`, then `--resume`: rows that were finished are not sampled again."""
    words = ["sample", "small_home", "(on_top apple_0 breakfast_table_0)", "--count", "12", "--out"]
    command = [sys.executable, "-m", "ig2mj", *words]
    done, deadline = tmp_path / "killed.npz.jobs" / "done.jsonl", time.monotonic() + 300
    where = {"cwd": tmp_path, "env": {**os.environ, "JAX_PLATFORMS": "cpu"}}
    with subprocess.Popen([*command, "killed.npz"], **where, stderr=subprocess.DEVNULL) as driver:
        while not done.exists() or len(done.read_text().splitlines()) < 3:
            assert driver.poll() is None and time.monotonic() < deadline
            time.sleep(0.01)
        driver.kill()
    finished = len(done.read_text().splitlines())
    assert not (tmp_path / "killed.npz").exists() and finished < 12
    refused = subprocess.run([*command, "killed.npz"], **where, capture_output=True, text=True)
    assert refused.returncode == 2 and "--resume continues it" in refused.stderr
    for file, more in (("killed.npz", ["--resume"]), ("whole.npz", [])):
        subprocess.run([*command, file, *more], **where, check=True, capture_output=True)
    assert (tmp_path / "killed.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert not done.parent.exists()


def test_a_result_that_is_damaged_is_made_again(tmp_path):
    out, expected = tmp_path / "pool.npz", work()
    with Journal(out, {}) as journal:
        first, _ = everything(expected, store=journal)
    (tmp_path / "pool.npz.jobs" / "job_1.bin").write_bytes(b"half")
    with Journal(out, {}, resume=True) as journal:
        assert "job_1" not in journal.names() and len(journal.names()) == 4
        assert everything(expected, store=journal)[0] == first


def test_a_run_that_finished_nothing_is_begun_anew(tmp_path):
    """Whether it failed, as for want of a cluster, or was killed."""
    with pytest.raises(ClusterError), Journal(tmp_path / "a.npz", {"rows": 1}):
        raise ClusterError("there is no answer")
    assert not list(tmp_path.iterdir())
    Journal(tmp_path / "a.npz", {"rows": 1})._unlock()  # as a kill leaves it
    with Journal(tmp_path / "a.npz", {"rows": 2}) as journal:
        assert not journal.names()


def test_two_runs_with_one_output_the_second_refuses(tmp_path):
    with (
        Journal(tmp_path / "a.npz", {}),
        pytest.raises(ClusterError, match=r"a.npz: process \d+ on .* is writing there; wait for it"),
    ):
        Journal(tmp_path / "a.npz", {}, resume=True)


def test_results_can_be_delivered_at_once(tmp_path):
    placed: dict[str, bytes] = {}

    def journal(resume: bool = False) -> Journal:
        return Journal(tmp_path, {}, resume, placed.__setitem__, lambda name: name in placed)

    with journal() as first:
        map_jobs(work(), Where(), first)
    assert len(placed) == 5 and json.loads((tmp_path / ".jobs" / "request.json").read_text()) == {}
    placed.pop("job_3")
    with journal(resume=True) as second:
        assert len(second.names()) == 4, "what has gone since is made again"


def test_versions_are_compared_by_name():
    own = versions()
    assert difference(own, dict(own)) is None
    assert difference(own, {**own, "numpy": "1.0"}) == f"numpy 1.0, not {own['numpy']} as here"
    assert difference(own, {**own, "ig2mj": "0.0.9"}).startswith("ig2mj 0.0.9, not 0.")
