"""What a frozen dataclass holds is given to its constructor: nobody edits its attributes behind its back."""

from __future__ import annotations

import ast
import contextlib
from pathlib import Path

import pytest

from ig2mj.planning.moves import PrimitiveFailed

CONSTRUCTORS = {"engine/view.py": "over", "engine/base.py": "__copy__", "states/world.py": "with_fields"}
"""The functions that set attributes of an object that they have just made, by file."""


def _edits(source: str, setter: str = "") -> list[str]:
    """Uses of `__dict__`, and outside of `setter` and `__post_init__`, in which a dataclass brings its own fields into
    form, writes through `vars` and calls of `object.__setattr__`."""
    tree = ast.parse(source)
    functions = [f for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) and f.name in (setter, "__post_init__")]
    allowed = [n for f in functions for n in ast.walk(f)]
    found = []
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr="__dict__"):
                found.append(f"line {node.lineno}: __dict__")
            case ast.Attribute(value=ast.Name(id="object"), attr="__setattr__") if node not in allowed:
                found.append(f"line {node.lineno}: object.__setattr__")
            case (
                ast.Attribute(value=ast.Call(func=ast.Name(id="vars")), attr="update" | "pop" | "setdefault")
                | ast.Subscript(value=ast.Call(func=ast.Name(id="vars")), ctx=ast.Store() | ast.Del())
            ) if node not in allowed:
                found.append(f"line {node.lineno}: vars")
    return found


def test_no_module_edits_attributes_behind_a_class(repository: Path):
    found = {}
    for folder in ("src/ig2mj", "converters", "homes"):
        for path in sorted((repository / folder).rglob("*.py")):
            name = path.relative_to(repository / folder).as_posix()
            edits = _edits(path.read_text(), CONSTRUCTORS.get(name, "") if folder == "src/ig2mj" else "")
            found |= {f"{folder}/{name}": edits} if edits else {}
    assert not found


@pytest.mark.parametrize(
    "source",
    [
        "view.__dict__['pos'] = 1",
        "fields = view.__dict__",
        "vars(view)['pos'] = 1",
        "del vars(view)['pos']",
        "vars(view).update(pos=1)",
        "object.__setattr__(view, 'pos', 1)",
    ],
)
def test_each_way_to_edit_is_found(source):
    assert _edits(source)


def test_reading_is_no_edit():
    assert not _edits("names = list(vars(view))\nview = dataclasses.replace(view, pos=1)\nsetattr(view, 'pos', 1)")


def _frozen_exceptions(source: str) -> list[str]:
    """Frozen dataclasses that are exceptions: a context manager that one passes through sets its `__traceback__`,
    which raises FrozenInstanceError in its place."""
    return [
        node.name
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ClassDef)
        and any("frozen=True" in ast.unparse(decorator) for decorator in node.decorator_list)
        and any(ast.unparse(base).endswith(("Error", "Exception")) for base in node.bases)
    ]


def test_no_exception_is_frozen(repository: Path):
    folders = ("src", "converters", "homes", "benchmarks", "tests")
    paths = [path for folder in folders for path in sorted((repository / folder).rglob("*.py"))]
    assert not {path.name: found for path in paths if (found := _frozen_exceptions(path.read_text()))}
    assert _frozen_exceptions("@dataclasses.dataclass(frozen=True)\nclass A(Exception): ...") == ["A"]


def test_a_failure_passes_through_a_context_manager():
    @contextlib.contextmanager
    def block():
        yield

    with pytest.raises(PrimitiveFailed, match="no_path"), block():
        raise PrimitiveFailed("no_path", "a wall")
