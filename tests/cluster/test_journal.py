"""A torn or damaged line of a journal costs the job that it is of, and nothing else."""

from __future__ import annotations

import pytest

from ig2mj.cluster.journal import DONE, Journal
from ig2mj.errors import InputError

REQUEST = {"command": "sample", "versions": {"numpy": "2"}}
RESULTS = {f"row/{k}": f"job {k}".encode() for k in range(4)}


@pytest.fixture
def interrupted(tmp_path):
    """The output of a run that was interrupted after four jobs."""
    with Journal(tmp_path / "out.npz", REQUEST) as journal:
        for name, result in RESULTS.items():
            journal.put(name, result)
    return tmp_path / "out.npz"


@pytest.mark.parametrize(
    "torn",
    [b"", b'{"name": "row/1", "sha', b"\xff\xfe\0", b"[]", b"null", b'{"name": [], "sha256": 3}', b"[" * 5000, b"7"],
)
def test_a_torn_line_costs_its_job(interrupted, torn):
    file = interrupted.with_name("out.npz.jobs") / DONE
    lines = file.read_bytes().splitlines()
    lines[1] = torn
    file.write_bytes(b"\n".join(lines) + b"\n")
    with Journal(interrupted, REQUEST, resume=True) as journal:
        assert set(journal.names()) == set(RESULTS) - {"row/1"}
        assert all(journal.get(name) == RESULTS[name] for name in journal.names())


def test_a_last_line_without_an_end_does_not_cost_the_next_one(interrupted):
    file = interrupted.with_name("out.npz.jobs") / DONE
    file.write_bytes(file.read_bytes()[:-20])
    with Journal(interrupted, REQUEST, resume=True) as journal:
        assert set(journal.names()) == set(RESULTS) - {"row/3"}
        journal.put("row/3", RESULTS["row/3"])
    with Journal(interrupted, REQUEST, resume=True) as journal:
        assert set(journal.names()) == set(RESULTS)


def test_a_line_with_a_path_reads_nothing_outside(interrupted, tmp_path):
    (tmp_path / "secret.bin").write_bytes(b"secret")
    file = interrupted.with_name("out.npz.jobs") / DONE
    sha = "2bb80d537b1da3e38bd30361aa855686bde0eacd7162fef6a25fe97bf527a25b"
    with file.open("a") as lines:
        lines.write(f'{{"name": "../secret", "sha256": "{sha}"}}\n')
    with Journal(interrupted, REQUEST, resume=True) as journal:
        assert set(journal.names()) == set(RESULTS)


@pytest.mark.parametrize("text", ["", "[]", "null", '"a"', "[" * 5000])
def test_a_broken_request_is_named(interrupted, text):
    file = interrupted.with_name("out.npz.jobs") / "request.json"
    file.write_text(text)
    with pytest.raises(InputError, match=r"request\.json: (is|holds)"):
        Journal(interrupted, REQUEST, resume=True)


def test_an_interrupted_run_of_0_1_0_is_refused_by_name_and_left_alone(tmp_path):
    old = tmp_path / "out.npz.pieces"
    old.mkdir()
    (old / DONE).write_text("{}\n")
    with pytest.raises(InputError, match=r"run of ig2mj 0\.1\.0 is there \(finish it with ig2mj 0\.1\.0"):
        Journal(tmp_path / "out.npz", {}, resume=True)
    assert (old / DONE).exists() and not (tmp_path / "out.npz.jobs").exists()
