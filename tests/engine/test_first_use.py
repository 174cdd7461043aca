"""First use: progress while kernels compile, and folders that keep what was compiled (issue, item 8)."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import jax
import pytest

from ig2mj.engine.compile_cache import CompileReport, cache_folder, keep_jax_programs


def test_without_a_terminal_every_tenth_module_is_told(capsys):
    report = CompileReport()
    assert [report.during(lambda: True) for _ in range(21)] == [True] * 21
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [f"compiling physics kernels {n}/80, once per machine" for n in (1, 11, 21)]


def test_more_modules_than_usual_are_told_as_they_are():
    report = CompileReport()
    report.done = 94
    assert report.text() == "compiling physics kernels 95/95, once per machine"


def test_what_goes_wrong_while_compiling_is_not_swallowed():
    report = CompileReport()

    def broken() -> bool:
        raise RuntimeError("no compiler")

    for _ in range(2):
        with pytest.raises(RuntimeError, match="no compiler"):
            report.during(broken)


def test_work_within_work_does_not_wait_for_itself():
    report = CompileReport()
    assert report.during(lambda: report.during(lambda: True))


def test_the_cache_folder_can_be_moved(monkeypatch, tmp_path):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "there"))
    assert cache_folder() == tmp_path / "there"
    monkeypatch.delenv("IG2MJ_CACHE_DIR")
    assert cache_folder().name == "ig2mj"


def test_a_folder_that_the_user_gave_jax_stands():
    """The suite's own (tests/conftest.py), where it has one."""
    given = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    if given is None:
        pytest.skip("pytest runs without its cache, so JAX was given no folder")
    assert keep_jax_programs() == pathlib.Path(given)
    assert jax.config.jax_compilation_cache_dir == given  # type: ignore[attr-defined]


def test_jax_is_given_a_folder_below_ig2mjs(tmp_path):
    code = (
        "import jax; from ig2mj.engine.compile_cache import keep_jax_programs as k;"
        "print(k()); print(jax.config.jax_compilation_cache_dir)"
    )
    for folder, lines in ((tmp_path, [str(tmp_path / "jax")] * 2), (pathlib.Path("/dev/null/x"), ["None", "None"])):
        environment = {"IG2MJ_CACHE_DIR": str(folder), "PATH": "", "JAX_PLATFORMS": "cpu"}
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
        assert done.stdout.split() == lines
