"""Hash of what determines a task of a file: its definition, and everything of the file that the definition names.

Comments, docstrings and formatting do not count, nor do other tasks of the file. Modules that are imported from the
file's own folder count as a whole; packages that are installed do not, nor do other files that the code reads.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import pathlib
import textwrap
import types
from collections.abc import Iterator
from typing import Any


def digest_in(source: str, name: str, folder: pathlib.Path) -> str | None:
    """Of a name that a file defines; None where it does not.

    Args:
      source: of the file. folder: its own.
    """
    statements = ast.parse(source).body
    requested, seen, used = [name], set[str](), set[int]()
    while requested:
        one = requested.pop()
        if one in seen:
            continue
        seen.add(one)
        for number, statement in enumerate(statements):
            if one in _bound(statement) and number not in used:
                used.add(number)
                requested += _read(statement)
    if not used:
        return None
    hashed = hashlib.blake2b(digest_size=16)
    for number in sorted(used):
        hashed.update(_text(statements[number]).encode())
        for module in _modules(statements[number], folder):
            hashed.update(module.encode())
    return hashed.hexdigest()


def digest_of_object(thing: Any) -> str:
    """Of a class or function that no file defines at its top: its source where Python knows it, else its code."""
    try:
        text = _text(ast.parse(textwrap.dedent(inspect.getsource(thing))).body[0])
    except (OSError, TypeError, SyntaxError, IndexError):
        text = _code_text(thing)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def _text(node: ast.AST) -> str:
    for inner in ast.walk(node):
        body = getattr(inner, "body", None)
        if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Module) and body:
            first = body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and len(body) > 1:
                inner.body = body[1:]
    return ast.dump(node, include_attributes=False)


def _bound(statement: ast.stmt) -> set[str]:
    """Names that a statement of a file's top defines."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return {statement.name}
    found = set[str]()
    for node in ast.walk(statement):
        if isinstance(node, ast.Import | ast.ImportFrom):
            found |= {(alias.asname or alias.name).partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
    return found


def _read(statement: ast.stmt) -> list[str]:
    return [node.id for node in ast.walk(statement) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)]


def _modules(statement: ast.stmt, folder: pathlib.Path) -> Iterator[str]:
    """Texts of the modules of the folder that a statement imports, and of those that these import."""
    requested, seen = [statement], set[pathlib.Path]()
    while requested:
        for file in _imported(requested.pop(), folder):
            if file not in seen:
                seen.add(file)
                tree = ast.parse(file.read_text(encoding="utf-8"))
                requested.append(tree)  # pyright: ignore[reportArgumentType]
                yield _text(tree)


def _imported(node: ast.AST, folder: pathlib.Path) -> list[pathlib.Path]:
    names = list[str]()
    for inner in ast.walk(node):
        if isinstance(inner, ast.Import):
            names += [alias.name for alias in inner.names]
        elif isinstance(inner, ast.ImportFrom) and inner.module:
            names += [inner.module, *(f"{inner.module}.{alias.name}" for alias in inner.names)]
    found = list[pathlib.Path]()
    for name in names:
        path = folder.joinpath(*name.split("."))
        found += [file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()]
    return found


def _code_text(thing: Any) -> str:
    if isinstance(thing, type):
        members = {name: value for name, value in vars(thing).items() if not name.startswith("__")}
        return repr([(name, _code_text(value)) for name, value in sorted(members.items())])
    code = getattr(thing, "__code__", None)
    return _of_code(code) if isinstance(code, types.CodeType) else repr(thing)


def _of_code(code: types.CodeType) -> str:
    constants = [_of_code(c) if isinstance(c, types.CodeType) else repr(c) for c in code.co_consts]
    return repr((code.co_code.hex(), constants, code.co_names))
