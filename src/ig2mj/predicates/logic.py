"""Expressions over predicates: a tree built in Python, or read from text by `parse.parse`.

    atom("cooked", "fish_0") & ~atom("open", "fridge_0")
    ForAll("?f", "fish", atom("inside", "?f", "fridge_0"))

Groups name lists of objects; a variable begins with "?". The meaning of the quantifiers is BDDL's: `ForN` is exactly n;
`ForPairs` says that at least L objects of each group take part in some true pair, L being the smaller group's size (an
object is never paired with itself), `ForNPairs` the same with n.

`ground` replaces quantifiers by their instances, once, before anything is compiled.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

from ig2mj.files.limits import refuse_more


@dataclasses.dataclass(frozen=True)
class Expression:
    """A node of the tree. Operators: & and, | or, ~ not, >> implies."""

    def __and__(self, other: Expression) -> And:
        return And((self, other))

    def __or__(self, other: Expression) -> Or:
        return Or((self, other))

    def __invert__(self) -> Not:
        return Not(self)

    def __rshift__(self, other: Expression) -> Or:
        return implies(self, other)


@dataclasses.dataclass(frozen=True)
class Atom(Expression):
    """A predicate of named objects (or rooms, or variables)."""

    predicate: str
    arguments: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class And(Expression):
    """All hold; none given: true."""

    parts: tuple[Expression, ...]


@dataclasses.dataclass(frozen=True)
class Or(Expression):
    """At least one holds; none given: false."""

    parts: tuple[Expression, ...]


@dataclasses.dataclass(frozen=True)
class Not(Expression):
    """It does not hold."""

    part: Expression


@dataclasses.dataclass(frozen=True)
class ForAll(Expression):
    """Holds for every object of the group."""

    variable: str
    group: str
    body: Expression


@dataclasses.dataclass(frozen=True)
class Exists(Expression):
    """Holds for at least one object of the group."""

    variable: str
    group: str
    body: Expression


@dataclasses.dataclass(frozen=True)
class ForN(Expression):
    """Holds for exactly `count` objects of the group."""

    count: int
    variable: str
    group: str
    body: Expression


@dataclasses.dataclass(frozen=True)
class ForPairs(Expression):
    """As many objects of each group as the smaller one has take part in pairs for which it holds."""

    first: tuple[str, str]  # variable, group
    second: tuple[str, str]
    body: Expression


@dataclasses.dataclass(frozen=True)
class ForNPairs(Expression):
    """Holds for `count` pairs."""

    count: int
    first: tuple[str, str]
    second: tuple[str, str]
    body: Expression


@dataclasses.dataclass(frozen=True)
class Exactly(Expression):
    """Ground form of `ForN`: exactly `count` of the parts hold."""

    count: int
    parts: tuple[Expression, ...]


@dataclasses.dataclass(frozen=True)
class Pairing(Expression):
    """Ground form of `ForPairs` and `ForNPairs`: at least `count` rows and `count` columns have a part that holds.

    A None stands where an object would be paired with itself.
    """

    count: int
    rows: tuple[tuple[Expression | None, ...], ...]


def atom(predicate: str, *arguments: str) -> Atom:
    """`atom("on_top", "plate_0", "table_0")`."""
    return Atom(predicate, arguments)


def implies(condition: Expression, consequence: Expression) -> Or:
    """The condition does not hold, or the consequence does."""
    return Or((Not(condition), consequence))


def ground(expression: Expression, groups: Callable[[str], Sequence[str]]) -> Expression:
    """Replaces quantifiers by their instances.

    Args:
      expression: may hold quantifiers. A "?name" that none of them binds is the object `name`, as in BDDL.
      groups: the objects of a named group.

    Raises:
      InputError: it would have more parts than the limit `GROUNDED_PARTS` (`ig2mj.files.limits`).
    """
    count = ground_size(expression, groups)
    refuse_more("GROUNDED_PARTS", count, "its quantifiers stand for", "expression", unit=" parts")
    return _ground(expression, groups, {})


def ground_size(expression: Expression, groups: Callable[[str], Sequence[str]]) -> int:
    """How many parts `ground` would make, without making them."""
    match expression:
        case And(parts) | Or(parts) | Exactly(_, parts):
            return 1 + sum(ground_size(part, groups) for part in parts)
        case Not(part):
            return 1 + ground_size(part, groups)
        case ForAll(_, group, body) | Exists(_, group, body) | ForN(_, _, group, body):
            return 1 + len(groups(group)) * ground_size(body, groups)
        case ForPairs(first, second, body) | ForNPairs(_, first, second, body):
            return 1 + len(groups(first[1])) * len(groups(second[1])) * ground_size(body, groups)
        case Pairing(_, rows):
            return 1 + sum(ground_size(p, groups) for row in rows for p in row if p is not None)
    return 1


def _instances(
    variable: str, group: str, body: Expression, groups: Callable[[str], Sequence[str]], bound: Mapping[str, str]
) -> tuple[Expression, ...]:
    return tuple(_ground(body, groups, {**bound, variable: name}) for name in groups(group))


def _ground(e: Expression, groups: Callable[[str], Sequence[str]], bound: Mapping[str, str]) -> Expression:
    match e:
        case Atom(predicate, arguments):
            return Atom(predicate, tuple(bound.get(name, name.removeprefix("?")) for name in arguments))
        case And(parts):
            return And(tuple(_ground(p, groups, bound) for p in parts))
        case Or(parts):
            return Or(tuple(_ground(p, groups, bound) for p in parts))
        case Not(part):
            return Not(_ground(part, groups, bound))
        case ForAll(variable, group, body):
            return And(_instances(variable, group, body, groups, bound))
        case Exists(variable, group, body):
            return Or(_instances(variable, group, body, groups, bound))
        case ForN(count, variable, group, body):
            return Exactly(count, _instances(variable, group, body, groups, bound))
        case ForPairs(first, second, body):
            rows = _pairs(first, second, body, groups, bound)
            return Pairing(min(len(rows), len(groups(second[1]))), rows)
        case ForNPairs(count, first, second, body):
            return Pairing(count, _pairs(first, second, body, groups, bound))
        case Exactly(count, parts):
            return Exactly(count, tuple(_ground(p, groups, bound) for p in parts))
        case Pairing(count, rows):
            return Pairing(
                count, tuple(tuple(None if p is None else _ground(p, groups, bound) for p in row) for row in rows)
            )
    raise TypeError(f"{e!r} is not an expression")


def _pairs(
    first: tuple[str, str],
    second: tuple[str, str],
    body: Expression,
    groups: Callable[[str], Sequence[str]],
    bound: Mapping[str, str],
) -> tuple[tuple[Expression | None, ...], ...]:
    return tuple(
        tuple(
            None if a == b else _ground(body, groups, {**bound, first[0]: a, second[0]: b}) for b in groups(second[1])
        )
        for a in groups(first[1])
    )


def atoms(expression: Expression) -> list[Atom]:
    """All atoms of a ground expression, each once, in the order in which they are first met."""
    found: dict[Atom, None] = {}

    def walk(e: Expression) -> None:
        match e:
            case Atom():
                found[e] = None
            case Not(part):
                walk(part)
            case And(parts) | Or(parts) | Exactly(_, parts):
                for p in parts:
                    walk(p)
            case Pairing(_, rows):
                for p in (p for row in rows for p in row if p is not None):
                    walk(p)

    walk(expression)
    return list(found)


def text(expression: Expression) -> str:
    """The expression as `parse.parse` reads it."""
    match expression:
        case Atom(predicate, arguments):
            return f"({' '.join([predicate, *map(_quoted, arguments)])})"
        case And(parts):
            return f"({' '.join(['and', *map(text, parts)])})"
        case Or(parts):
            return f"({' '.join(['or', *map(text, parts)])})"
        case Not(part):
            return f"(not {text(part)})"
        case ForAll(variable, group, body):
            return f"(forall ({variable} - {_quoted(group)}) {text(body)})"
        case Exists(variable, group, body):
            return f"(exists ({variable} - {_quoted(group)}) {text(body)})"
        case ForN(count, variable, group, body):
            return f"(forn {count} ({variable} - {_quoted(group)}) {text(body)})"
        case ForPairs((a, g), (b, h), body):
            return f"(forpairs ({a} - {_quoted(g)}) ({b} - {_quoted(h)}) {text(body)})"
        case ForNPairs(count, (a, g), (b, h), body):
            return f"(fornpairs {count} ({a} - {_quoted(g)}) ({b} - {_quoted(h)}) {text(body)})"
        case Exactly(count, parts):
            return f"(exactly {' '.join([str(count), *map(text, parts)])})"
        case Pairing(count, rows):
            flat = " ".join("(" + " ".join("()" if p is None else text(p) for p in row) + ")" for row in rows)
            return f"(pairing {count} {flat})"
    raise TypeError(f"{expression!r} is not an expression")


def _quoted(name: str) -> str:
    plain = name and not any(c.isspace() or c in '()";' for c in name)
    return name if plain else '"' + name.replace('"', '\\"') + '"'
