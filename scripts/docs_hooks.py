"""MkDocs hook: fills the parts of docs/reference that are generated from the code.

A page has a marker where a part goes:

    <!-- generated: commands -->            every command of `ig2mj` with its options, from `--help`
    <!-- generated: struct ObjectEntry -->  the fields of a structure of `ig2mj.scene.manifest`
"""

from __future__ import annotations

import ast
import contextlib
import html
import importlib
import inspect
import io
import os
import re
from collections.abc import Iterator
from typing import Any
from unittest import mock

from ig2mj import cli
from ig2mj.scene import manifest

MARKER = re.compile(r"^<!-- generated: (\w+)(?: (\w+))? -->$", re.MULTILINE)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """MkDocs' event: the page with its markers replaced."""
    return MARKER.sub(lambda match: commands() if match[1] == "commands" else struct(match[2]), markdown)


def commands() -> str:
    """A section for every command, in the order of `ig2mj --help`, and one for each of its sub-commands."""
    parts = list[str]()
    for name, summary in cli.COMMANDS.items():
        parts.append(f"## {name}\n\n{_sentence(summary)}\n")
        module = importlib.import_module(f"ig2mj.cli.{name.replace('-', '_')}")
        subcommands = getattr(module, "SUBCOMMANDS", None)
        if subcommands is None:
            parts.append(_command([name]))
            continue
        for sub in subcommands:
            parts += [f"### {name} {sub}\n", _command([name, sub])]
    return "\n".join(parts)


def struct(name: str) -> str:
    """A table of the fields of a structure: name, type, default, and the comment behind it."""
    source = inspect.getsource(getattr(manifest, name))
    lines = source.splitlines()
    (definition,) = ast.parse(source).body
    assert isinstance(definition, ast.ClassDef)
    rows = ["| field | type | default | meaning |", "|---|---|---|---|"]
    for node in definition.body:
        if not isinstance(node, ast.AnnAssign):
            continue
        remark = lines[node.lineno - 1].partition("#")[2].strip()
        default = f"`{ast.unparse(node.value)}`" if node.value is not None else "required"
        default = re.sub(r"`msgspec\.field\(.*\)`", "empty", default)
        rows.append(f"| `{ast.unparse(node.target)}` | {_code(ast.unparse(node.annotation))} | {default} | {remark} |")
    if all(row.endswith("|  |") for row in rows[2:]):  # no field has a remark
        rows = [row.rsplit("|", 2)[0] + "|" for row in rows]
    return "\n".join(rows)


def _command(words: list[str]) -> str:
    """Usage, description and options of one command, as its `--help` prints them."""
    lines = _help([*words, "--help"]).splitlines()
    text, rows = list[str](), list[tuple[str, str]]()
    for line in lines:
        if line.startswith("usage:"):
            text.append(f"```text\n{line.removeprefix('usage: ')}\n```\n")
        elif not line.startswith(("╭", "│", "╰")) and (line.strip() or text[-1]):
            text.append(line.strip())
    for left, right in _entries(lines):
        if left != "-h, --help":
            rows.append((_code(left), right.replace("|", "\\|")))
    table = ["", "| argument | meaning |", "|---|---|", *(f"| {a} | {b} |" for a, b in rows)] if rows else []
    return "\n".join([*text, *table, ""])


def _entries(lines: list[str]) -> Iterator[tuple[str, str]]:
    """(argument, meaning) of every entry in the boxes of a help text."""
    left, right = "", list[str]()
    for line in lines:
        if not line.startswith("│"):
            continue
        content = line[2:-1].rstrip()
        if content.startswith(" ") or not content:
            right.append(content.strip())
            continue
        if left:
            yield left, " ".join(right).strip()
        left, _, rest = content.partition("  ")
        right = [rest.strip()]
    if left:
        yield left, " ".join(right).strip()


def _help(arguments: list[str]) -> str:
    """What `ig2mj ARGUMENTS` prints on a terminal of 100 columns."""
    shown = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")  # tyro draws boxes where they can be encoded
    with mock.patch.dict(os.environ, {"COLUMNS": "100", "NO_COLOR": "1"}), contextlib.redirect_stdout(shown):
        status = cli.call(arguments)
        shown.flush()
    text = shown.buffer.getvalue().decode()  # pyright: ignore[reportAttributeAccessIssue]
    assert status == 0, (arguments, text)
    return text


def _code(text: str) -> str:
    """As code in a cell of a table, which a bar would end."""
    return f"<code>{html.escape(text).replace('|', '&#124;')}</code>" if "|" in text else f"`{text}`"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."
