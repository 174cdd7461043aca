"""Reads expressions from text in BDDL's form.

    (and (cooked fish_0) (on_top plate_0 table_0))
    (forall (?f - fish) (or (inside ?f fridge_0) (frozen ?f)))
    (exists (?t - table) (forn 2 (?p - plate) (on_top ?p ?t)))
    (forpairs (?c - candle) (?t - table) (on_top ?c ?t))    (fornpairs 2 (?c - candle) (?t - table) (on_top ?c ?t))

Words: and, or, not, imply (or implies), forall, exists, forn, forpairs, fornpairs; anything else is a predicate. A
count may stand in brackets, as in BDDL. Names with blanks or brackets stand in double quotes. A semicolon starts a
comment.
"""

from __future__ import annotations

import re
from typing import TypeAlias

from ig2mj.errors import InputError
from ig2mj.predicates import logic
from ig2mj.predicates.logic import Expression

_TOKEN = re.compile(r'\s+|;[^\n]*|(?P<token>[()]|"(?:\\.|[^"\\])*"|[^\s()";]+)')

MAX_DEPTH = 100
"""Nesting that no sensible goal reaches; deeper text is refused instead of overflowing the stack."""

Tree: TypeAlias = str | list


class ExpressionError(InputError):
    """Text that is not an expression."""


def parse(source: str, name: str = "expression") -> Expression:
    """The expression that a text states.

    Args:
      source: one expression.
      name: of the file or argument it comes from, for errors.

    Raises:
      ExpressionError: unbalanced brackets, a word with the wrong parts, or something after the end.
    """
    tokens = _tokens(source, name)
    if not tokens:
        raise ExpressionError(name, "is empty", fix="write for instance (cooked fish_0)")
    tree, rest = _tree(tokens, 0, name, 0)
    if rest != len(tokens):
        raise ExpressionError(
            name, "has text after its end", element=f"'{tokens[rest]}'", fix="join parts with (and ...)"
        )
    return _expression(tree, name)


def _tokens(source: str, name: str) -> list[str]:
    found, at = [], 0
    while at < len(source):
        match = _TOKEN.match(source, at)
        if match is None:
            raise ExpressionError(name, "has a quote that does not end", element=source[at : at + 20])
        if match["token"]:
            found.append(match["token"])
        at = match.end()
    return found


def _tree(tokens: list[str], at: int, name: str, depth: int) -> tuple[Tree, int]:
    if depth > MAX_DEPTH:
        raise ExpressionError(name, f"is nested deeper than {MAX_DEPTH}")
    if at >= len(tokens):
        raise ExpressionError(name, "ends too early", fix="close every bracket")
    if tokens[at] == ")":
        raise ExpressionError(name, "closes a bracket that was not opened")
    if tokens[at] != "(":
        return tokens[at], at + 1
    parts: list = []
    at += 1
    while at < len(tokens) and tokens[at] != ")":
        part, at = _tree(tokens, at, name, depth + 1)
        parts.append(part)
    if at >= len(tokens):
        raise ExpressionError(name, "ends too early", fix="close every bracket")
    return parts, at + 1


def _expression(tree: Tree, name: str) -> Expression:
    if isinstance(tree, str) or not tree or not isinstance(tree[0], str):
        raise ExpressionError(name, "expected (word ...)", element=_show(tree))
    word, parts = tree[0].lower(), tree[1:]

    def wants(count: int, form: str) -> None:
        if len(parts) != count:
            raise ExpressionError(name, f"'{word}' has {len(parts)} parts", element=_show(tree), fix=f"write {form}")

    match word:
        case "and":
            return logic.And(tuple(_expression(p, name) for p in parts))
        case "or":
            return logic.Or(tuple(_expression(p, name) for p in parts))
        case "not":
            wants(1, "(not X)")
            return logic.Not(_expression(parts[0], name))
        case "imply" | "implies":
            wants(2, "(imply X Y)")
            return logic.implies(_expression(parts[0], name), _expression(parts[1], name))
        case "forall" | "exists":
            wants(2, f"({word} (?x - GROUP) X)")
            quantifier = logic.ForAll if word == "forall" else logic.Exists
            return quantifier(*_binding(parts[0], name), _expression(parts[1], name))
        case "forn":
            wants(3, "(forn N (?x - GROUP) X)")
            return logic.ForN(_count(parts[0], name), *_binding(parts[1], name), _expression(parts[2], name))
        case "forpairs":
            wants(3, "(forpairs (?x - GROUP) (?y - GROUP) X)")
            return logic.ForPairs(_binding(parts[0], name), _binding(parts[1], name), _expression(parts[2], name))
        case "fornpairs":
            wants(4, "(fornpairs N (?x - GROUP) (?y - GROUP) X)")
            count, first, second = _count(parts[0], name), _binding(parts[1], name), _binding(parts[2], name)
            return logic.ForNPairs(count, first, second, _expression(parts[3], name))
    names = [p for p in parts if isinstance(p, str)]
    if len(names) < len(parts):
        raise ExpressionError(
            name, f"'{word}' is not a word of the language, so its parts are names", element=_show(tree)
        )
    return logic.Atom(tree[0], tuple(_unquoted(p) for p in names))


def _binding(tree: Tree, name: str) -> tuple[str, str]:
    match tree:
        case [str(variable), "-", str(group)] if variable.startswith("?"):
            return variable, _unquoted(group)
    raise ExpressionError(name, "expected (?x - GROUP)", element=_show(tree))


def _count(tree: Tree, name: str) -> int:
    word = tree[0] if isinstance(tree, list) and len(tree) == 1 else tree
    if not isinstance(word, str) or not word.isdecimal():
        raise ExpressionError(name, "expected a whole number", element=_show(tree))
    return int(word)


def _unquoted(token: str) -> str:
    return re.sub(r"\\(.)", r"\1", token[1:-1]) if token.startswith('"') else token


def _show(tree: Tree) -> str:
    return tree if isinstance(tree, str) else "(" + " ".join(_show(p) for p in tree) + ")"
