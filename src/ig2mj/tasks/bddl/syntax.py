"""BDDL's brackets: text to a tree whose every word knows its line, so that errors can name line and word."""

from __future__ import annotations

import dataclasses
import re
from typing import TypeAlias

from ig2mj.errors import InputError

_TOKEN = re.compile(r"[()]|[^\s();]+|;[^\n]*|\n")

MAX_DEPTH = 100
"""Nesting that no activity reaches; deeper text is refused instead of overflowing the stack."""


class BddlError(InputError):
    """Text that is not a BDDL, or names what it does not declare; says the line and the word."""


@dataclasses.dataclass(frozen=True)
class Word:
    """One word, in lower case as BDDL compares them, and its line, from 1."""

    text: str
    line: int


@dataclasses.dataclass(frozen=True)
class SyntaxGroup:
    """What stands between two brackets; `line`: of the opening one."""

    parts: tuple[Tree, ...]
    line: int


Tree: TypeAlias = Word | SyntaxGroup


def error(file: str, at: Tree, problem: str, fix: str = "") -> BddlError:
    """The error that names a place: its line, and its word (of a group: the first)."""
    first = at
    while isinstance(first, SyntaxGroup) and first.parts:
        first = first.parts[0]
    word = first.text if isinstance(first, Word) else "()"
    shown = word if at is first else f"({word}"
    return BddlError(file, problem, element=f"line {at.line}: '{shown}'", fix=fix)


def read_tree(text: str, file: str) -> SyntaxGroup:
    """The one group that the text is. Comments run from a semicolon to the end of the line.

    Raises:
      BddlError: brackets that do not match, something next to the group, or no group at all.
    """
    line = 1
    found: list[Tree] = []
    open_groups: list[tuple[Word, list[Tree]]] = []
    for token in _TOKEN.findall(text):
        if token == "\n":
            line += 1
            continue
        if token.startswith(";"):
            continue
        word = Word(token.lower(), line)
        parts = open_groups[-1][1] if open_groups else found
        if found and not open_groups:
            raise error(file, word, "is after the end", "remove it, or the bracket that closes too early")
        if token == "(":
            if len(open_groups) == MAX_DEPTH:
                raise error(file, word, f"is nested deeper than {MAX_DEPTH}")
            open_groups.append((word, []))
        elif token == ")":
            if not open_groups:
                raise error(file, word, "closes a bracket that was not opened")
            opening, inner = open_groups.pop()
            (open_groups[-1][1] if open_groups else found).append(SyntaxGroup(tuple(inner), opening.line))
        elif not open_groups:
            raise error(file, word, "is outside of brackets", "a definition begins with (define")
        else:
            parts.append(word)
    if open_groups:
        raise error(file, open_groups[-1][0], "is never closed", "add a ')'")
    if not found:
        raise BddlError(file, "is empty", fix="a definition begins with (define")
    assert isinstance(found[0], SyntaxGroup)
    return found[0]
