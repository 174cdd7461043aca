"""`scripts/gpu_tests.py`, run on test files of its own: it goes on, says what ended, and survives what crashes."""

from __future__ import annotations

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

import pytest

CRASHES = """
import os, pytest
pytestmark = pytest.mark.gpu
def test_first(): pass
def test_it_ends_the_process(): os.abort()
def test_after_it(): pass
"""
MIXED = """
import pytest
pytestmark = pytest.mark.gpu
def test_passes(): pass
def test_fails(): assert False
def test_skipped(): pytest.skip("no reason")
@pytest.fixture
def broken(): raise RuntimeError
def test_whose_fixture_fails(broken): pass
"""
STAYS = """
import pathlib, time, pytest
pytestmark = pytest.mark.gpu
def test_short(): pass
def test_long():
    if not pathlib.Path("go").exists():
        time.sleep(60)
"""


@pytest.fixture
def place(repository, tmp_path) -> pathlib.Path:
    """A folder that looks like the repository to the script."""
    shutil.copytree(repository / "scripts", tmp_path / "scripts", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "tests").mkdir()
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = gpu: needs one\n", encoding="utf-8")
    # no processes are started to ask XLA for its options
    script = tmp_path / "scripts" / "gpu_tests.py"
    text = script.read_text(encoding="utf-8")
    assert "*known_flags(), " in text
    script.write_text(text.replace("*known_flags(), ", ""), encoding="utf-8")
    return tmp_path


def start(place: pathlib.Path, *words: str) -> subprocess.Popen:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
    command = [sys.executable, "scripts/gpu_tests.py", "--out", "out", "--jobs", "2", *words]
    return subprocess.Popen(
        command, cwd=place, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    )


def write(place: pathlib.Path, **texts: str) -> None:
    for name, text in texts.items():
        (place / "tests" / f"test_{name}.py").write_text(text, encoding="utf-8")


def outcomes(place: pathlib.Path) -> dict[str, str]:
    tests = json.loads((place / "out" / "results.json").read_text(encoding="utf-8"))["tests"]
    return {test.split("::")[1]: of_test["outcome"] for test, of_test in tests.items()}


def test_what_takes_longest_is_there(repository, monkeypatch):
    monkeypatch.syspath_prepend(repository / "scripts")
    import gpu_tests

    for part in gpu_tests.LONGEST_FIRST:
        file, *test = re.split(r"::|\[", part)
        assert file in gpu_tests.files()
        assert not test or f"def {test[0]}(" in (repository / file).read_text(encoding="utf-8"), part


@pytest.mark.slow
def test_a_crash_is_a_failure_and_the_file_goes_on(place):
    write(place, crashes=CRASHES, mixed=MIXED)
    run = start(place)
    said = run.communicate()[0]
    assert run.returncode == 1, said
    assert outcomes(place) == {
        "test_first": "passed",
        "test_it_ends_the_process": "crashed",
        "test_after_it": "passed",
        "test_passes": "passed",
        "test_fails": "failed",
        "test_skipped": "skipped",
        "test_whose_fixture_fails": "failed",
    }
    assert "FAILED tests/test_mixed.py::test_fails" in said
    write(place, mixed=MIXED)  # the same code: nothing runs again but what failed
    again = start(place, "--again", "failed", "-k", "nothing")
    said = again.communicate()[0]
    assert again.returncode == 0, said
    assert "test_fails" not in outcomes(place) and "test_passes" in outcomes(place)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_what_is_cut_leaves_what_ended_and_goes_on(place, number):
    write(place, stays=STAYS)
    run = start(place)
    until = time.monotonic() + 60
    while not (place / "out" / "results.json").exists() or not outcomes(place):
        assert time.monotonic() < until and run.poll() is None
        time.sleep(0.05)
    run.send_signal(number)
    run.communicate()
    assert run.returncode == (3 if number == signal.SIGTERM else -signal.SIGKILL)
    assert outcomes(place) == {"test_short": "passed"}
    (place / "go").touch()
    rest = start(place)
    said = rest.communicate()[0]
    assert rest.returncode == 0, said
    assert outcomes(place) == {"test_short": "passed", "test_long": "passed"}
    assert "(2 calls)" in said
