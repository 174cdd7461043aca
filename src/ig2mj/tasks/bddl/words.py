"""An activity in English: what it starts from and what it asks for, as indented lines."""

from __future__ import annotations

from collections.abc import Sequence

from ig2mj.predicates.logic import (
    And,
    Atom,
    Exactly,
    Exists,
    Expression,
    ForAll,
    ForN,
    ForNPairs,
    ForPairs,
    Not,
    Or,
    Pairing,
)

INDENT = "  "
PHRASES = {
    "inside": "inside",
    "on_top": "on top of",
    "next_to": "next to",
    "in_contact_with": "in contact with",
    "under": "under",
    "on_floor": "on",
    "toggled_on": "switched on",
}
"""Predicates that are not said as they are written."""


def noun(name: str) -> str:
    """ "plate.n.04_1" -> "plate 1"; "?plate.n.04" and "plate.n.04" -> "plate"; names of a scene stay."""
    stem, dot, rest = name.removeprefix("?").partition(".n.")
    if not dot:
        return stem
    number = rest.partition("_")[2]
    return " ".join([*stem.replace("__", "_").split("_"), *([number] if number else [])])


def sentences(parts: Sequence[Expression], indent: str = "") -> list[str]:
    """Lines that say every one of the conditions."""
    return [line for part in parts for line in _lines(part, indent)]


def _literal(e: Expression) -> str | None:
    """A condition that one sentence says, or None."""
    negated = isinstance(e, Not)
    inner = e.part if isinstance(e, Not) else e
    if not isinstance(inner, Atom):
        return None
    what = PHRASES.get(inner.predicate, inner.predicate.replace("_", " "))
    subject, *others = (f"the {noun(a)}" if a.startswith("?") else noun(a) for a in inner.arguments)
    return " ".join([subject, "is not" if negated else "is", what, *others])


def _lines(e: Expression, indent: str) -> list[str]:
    if (sentence := _literal(e)) is not None:
        return [f"{indent}{sentence}"]
    match e:
        case Not(part):
            return _headed("it is not so that", [part], indent)
        case And(parts):
            return sentences(parts, indent)
        case Or((Not(condition), consequence)):
            return [
                *_headed("if", [condition], indent),
                *_headed("then", [consequence], indent),
            ]
        case Or(parts):
            return _headed("at least one of these:", parts, indent)
        case ForAll(variable, _, body):
            return _headed(f"for every {noun(variable)}:", [body], indent)
        case Exists(variable, _, body):
            return _headed(f"for at least one {noun(variable)}:", [body], indent)
        case ForN(count, variable, _, body):
            return _headed(f"for exactly {count} {noun(variable)}:", [body], indent)
        case ForPairs((first, _), (second, _), body):
            return _headed(f"for pairs of {noun(first)} and {noun(second)}, as many as there are:", [body], indent)
        case ForNPairs(count, (first, _), (second, _), body):
            return _headed(f"for {count} pairs of {noun(first)} and {noun(second)}:", [body], indent)
        case Exactly(count, parts):
            return _headed(f"exactly {count} of these:", parts, indent)
        case Pairing(count, rows):
            return _headed(f"{count} pairs of these:", [p for row in rows for p in row if p is not None], indent)
    raise TypeError(f"{e!r} is not an expression")


def _headed(head: str, parts: Sequence[Expression], indent: str) -> list[str]:
    """A head and one sentence in a line, or the head with the rest below it."""
    if len(parts) == 1 and (sentence := _literal(parts[0])) is not None:
        return [f"{indent}{head} {sentence}"]
    return [f"{indent}{head}", *sentences(parts, indent + INDENT)]
