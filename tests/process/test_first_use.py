"""First use: progress while kernels compile, and folders that keep what was compiled."""

from __future__ import annotations

import ast
import io
import os
import pathlib
import subprocess
import sys
import time

import jax
import jax.monitoring
import pytest

import ig2mj
from ig2mj.process import cache_folder, prepare_jax, waiting
from ig2mj.process.compilation import PROGRAMS, kernels_text, xla_text
from ig2mj.process.waiting import Waiting


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def impatient(monkeypatch) -> Waiting:
    """A line after 0.05 s, and another every 0.2 s."""
    for name, seconds in (("PATIENCE", 0.05), ("EVERY", 0.2), ("REDRAW", 0.02), ("PAUSE", 0.1)):
        monkeypatch.setattr(waiting, name, seconds)
    return Waiting()


def until(condition) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_long_work_is_told_on_stderr_again_and_again(impatient, monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with impatient.during(lambda: "working"):
        until(lambda: sys.stderr.getvalue().count("\n") >= 3)  # type: ignore[attr-defined]
    lines = sys.stderr.getvalue().splitlines()  # type: ignore[attr-defined]
    assert lines[:3] == ["working (0 s)"] * 3


def test_short_work_is_not_told(impatient, monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setattr(waiting, "PATIENCE", 60.0)
    with impatient.during(lambda: "working"):
        time.sleep(0.05)
    assert sys.stderr.getvalue() == ""  # type: ignore[attr-defined]


def test_many_short_works_in_a_row_are_one_wait(impatient, monkeypatch):
    """80 modules of a second each: the first is told once patience is over, the others now and then."""
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setattr(waiting, "PAUSE", 60.0)
    for number in range(40):
        with impatient.during(lambda n=number: kernels_text(n + 1), in_row=True):
            time.sleep(0.02)
    lines = sys.stderr.getvalue().splitlines()  # type: ignore[attr-defined]
    assert 2 <= len(lines) < 20 and not lines[0].startswith(kernels_text(1))


def test_many_short_works_that_are_no_row_are_not_told(impatient, monkeypatch):
    """Little programs that XLA compiles one after the other, as code outside `jit` makes them."""
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setattr(waiting, "PATIENCE", 2.0)
    deadline = time.monotonic() + 2.5
    while time.monotonic() < deadline:
        with impatient.during(lambda: "working"):
            time.sleep(0.01)
    assert sys.stderr.getvalue() == ""  # type: ignore[attr-defined]


def test_in_a_terminal_the_line_goes_when_the_work_is_done(impatient, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with impatient.during(lambda: "working"):
        until(lambda: sys.stderr.getvalue().count("\r") >= 2)  # type: ignore[attr-defined]
    text = sys.stderr.getvalue()  # type: ignore[attr-defined]
    assert text.startswith("\rworking (0 s)\x1b[K\rworking") and text.endswith("\r\x1b[K") and "\n" not in text


def test_what_goes_wrong_is_not_swallowed_and_ends_the_wait(impatient):
    for _ in range(2):
        with pytest.raises(RuntimeError, match="no compiler"), impatient.during(lambda: "working"):
            raise RuntimeError("no compiler")
    assert not impatient._works


def test_a_closed_stderr_harms_nobody(impatient, monkeypatch):
    closed = io.StringIO()
    monkeypatch.setattr(closed, "isatty", lambda: False)
    closed.close()
    monkeypatch.setattr(sys, "stderr", closed)
    with impatient.during(lambda: "working"):
        until(lambda: impatient._told > float("-inf"))


def test_work_within_work_does_not_wait_for_itself(impatient):
    with impatient.during(lambda: "outer"), impatient.during(lambda: "inner"):
        assert [work.text() for work in impatient._works] == ["outer", "inner"]


def test_more_modules_than_usual_are_told_as_they_are():
    assert kernels_text(3) == "compiling physics kernels 3/80, once per machine"
    assert kernels_text(95) == "compiling physics kernels 95/95, once per machine"


def test_what_xla_compiles_is_told(monkeypatch):
    """By JAX's own monitoring; the compiled function is a new one, so it is in no cache."""
    prepare_jax()
    begun = []

    class Told(Waiting):
        def begin(self, text, in_row=False):
            begun.append(text())
            return super().begin(text, in_row)

    told = Told()
    monkeypatch.setattr("ig2mj.process.compilation.WAITING", told)

    def some_step(x):
        return x + 1

    jax.jit(some_step)(1.0)
    assert xla_text("jit(some_step)") in begun and not told._works


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
    assert prepare_jax() == pathlib.Path(given)
    assert jax.config.jax_compilation_cache_dir == given  # type: ignore[attr-defined]


def test_jax_is_given_a_folder_below_ig2mjs(tmp_path):
    code = (
        "import jax; from ig2mj.process import prepare_jax as k;print(k()); print(jax.config.jax_compilation_cache_dir)"
    )
    for folder, lines in ((tmp_path, [str(tmp_path / "jax")] * 2), (pathlib.Path("/dev/null/x"), ["None", "None"])):
        environment = {"IG2MJ_CACHE_DIR": str(folder), "PATH": "", "JAX_PLATFORMS": "cpu"}
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
        assert done.stdout.split() == lines


def test_programs_are_named_by_what_they_do():
    assert xla_text("jit(rules_fn)").startswith("compiling the rules of states, once per machine")
    assert xla_text("jit(_start_all)").startswith("compiling the start of physics in all worlds,")
    assert xla_text("jit(some_step)").startswith("compiling a program (some_step),")
    assert xla_text("jit(<lambda>)").startswith("compiling a program, ")


def compiled_functions() -> set[str]:
    """Names of the functions that the package hands to a compiler."""
    compilers, found = {"jit", "compile", "program", "Compiled", "HostFunction", "PackedFunction"}, set()
    for file in pathlib.Path(ig2mj.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and node.args and _name(node.func) in compilers:
                found.add(_name(node.args[0]).strip("_"))
    return found


def _name(node: ast.expr) -> str:
    return getattr(node, "attr", getattr(node, "id", ""))


@pytest.mark.slow
def test_every_program_of_the_table_is_compiled_somewhere():
    assert set(PROGRAMS) <= compiled_functions(), sorted(set(PROGRAMS) - compiled_functions())


FIRST_STEPS = """
import sys
import jax
import numpy as np
import ig2mj
from ig2mj.envs.experts import expert_of
from ig2mj.process.compilation import XLA_EVENT, xla_text
took = {}
def heard(event, seconds, **about):
    if event == XLA_EVENT:
        name = str(about.get("fun_name", ""))
        took[name] = max(seconds, took.get(name, 0.0))
jax.monitoring.register_event_duration_secs_listener(heard)
def longest():
    print(xla_text(max(took, key=lambda name: took[name])))
    took.clear()
world = ig2mj.Simulation(sys.argv[1])
world.set_state("temperature", "apple", 80.0)
world.step(count=2)
world.predicate("cooked", "apple")
longest()
env = ig2mj.make("GraspingBook", "humanoid", 2, "native", pool_size=2)
state = env.reset(0)
longest()
state = env.step_autoreset(state, np.zeros((2, *env.action_space.shape), np.float32))
longest()
expert_of(env)(state)
longest()
"""


@pytest.mark.slow
def test_what_a_user_waits_for_is_named(tiny_home_folder, tmp_path):
    """With nothing cached: the program that compiles longest in the first steps of a world, in the first reset and step
    of an environment, and in the first action of its expert says what it is for."""
    command = [sys.executable, "-c", FIRST_STEPS, str(tiny_home_folder)]
    environment = {**os.environ, "IG2MJ_CACHE_DIR": str(tmp_path), "JAX_PLATFORMS": "cpu"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    said = [line.partition(",")[0].removeprefix("compiling ") for line in done.stdout.splitlines()]
    assert len(said) == 4 and set(said) <= set(PROGRAMS.values()), done.stdout + done.stderr
    assert said[1] == "observations after a reset" and said[3] == "an expert"


def test_a_line_is_cut_to_one_row_of_the_terminal_so_that_it_can_be_overwritten(monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    assert waiting._cut("x" * 29) == "x" * 29
    assert waiting._cut("compiling a program with a long name (2 s)") == "compiling a program with a..."
