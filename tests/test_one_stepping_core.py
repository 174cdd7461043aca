"""One stepping core: nothing above `engine` asks which engine it has (docs/design/architecture.md)."""

from __future__ import annotations

import ast
import inspect
import pathlib
import textwrap

import pytest

import ig2mj
from ig2mj.envs.environment import Environment
from ig2mj.worlds.core import Core

SRC = pathlib.Path(ig2mj.__file__).parent

#: Questions that are asked of an engine outside of `engine`, and why.
ALLOWED = {
    "envs/environment.py: .pure": "`Environment.pure` tells callers whether a step may be part of their program",
}

ENGINES = {"NativeEngine", "MjxEngine", "WarpEngine", "JaxEngine"}


def questions(tree: ast.AST) -> set[str]:
    """What code asks about an engine: its class, its name, or whether its physics can be traced."""
    found = set()
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in ("isinstance", "issubclass")
        ):
            found |= ENGINES & {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
        if isinstance(node, ast.Attribute) and node.attr == "pure" and _last(node.value) in ("engine", "_engine"):
            found.add(".pure")
        if isinstance(node, ast.Compare):
            for side in (node.left, *node.comparators):
                if isinstance(side, ast.Attribute) and side.attr == "name" and "engine" in _last(side.value):
                    found.add(".name")
                if isinstance(side, ast.Attribute) and side.attr == "num_worlds" and "engine" in _last(side.value):
                    found.add(".num_worlds")
    return found


def _last(node: ast.AST) -> str:
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


@pytest.mark.parametrize(
    "code, asked",
    [
        ("isinstance(self.engine, NativeEngine)", {"NativeEngine"}),
        ("x = 1 if core.engine.pure else 2", {".pure"}),
        ("if engine.name == 'warp': pass", {".name"}),
        ("done = engine.num_worlds == 1", {".num_worlds"}),
        ("engine.compile(f); env.num_worlds == 1; f'{engine.name}'", set()),
    ],
)
def test_a_question_about_an_engine_is_found(code, asked):
    assert questions(ast.parse(code)) == asked


def test_nothing_above_engine_asks_which_engine_it_has():
    asked = set()
    for file in sorted(SRC.rglob("*.py")):
        name = file.relative_to(SRC).as_posix()
        if not name.startswith("engine/"):
            asked |= {f"{name}: {question}" for question in questions(ast.parse(file.read_text(encoding="utf-8")))}
    one_world = {"simulation/simulation.py: .num_worlds"}  # refuses an engine of several worlds
    assert asked - one_world == set(ALLOWED)


CORE = ["core", "controls", "hands", "hand_resets", "agent_cameras", "starts", "guards", "rules", "worlds"]


@pytest.mark.parametrize("file", [*(f"worlds/{name}" for name in CORE), "envs/environment", "sensors/suite"])
def test_the_core_leaves_it_to_the_engine_how_functions_run(file):
    """No `jax.jit`, no branch or loop of a compiled program: `Engine.compile`, `program`, `when_any` and `repeat`."""
    tree = ast.parse((SRC / f"{file}.py").read_text(encoding="utf-8"))
    used = {ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    assert not used & {"jax.jit", "jax.lax.cond", "jax.lax.scan", "jax.lax.fori_loop"}


@pytest.mark.parametrize("kind", [Core, Environment])
def test_functions_of_the_stepping_core_have_few_arguments(kind):
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind)))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name != "__init__":
            assert len(node.args.args) - 1 <= 7, f"{kind.__name__}.{node.name}"
