"""Conditions to be sampled together: what must hold, of which objects, and in which order it is made true.

A condition is an atom or its negation. A category in place of an object's name means any one object of it, the same
one in all conditions of a row (`plate` here and there is one plate; `plate#2` is another one).
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from ig2mj.errors import StateError, UnknownNameError
from ig2mj.predicates.logic import And, Atom, Expression, Not
from ig2mj.predicates.parse import parse
from ig2mj.predicates.registry import find
from ig2mj.sampling.rules import PLACEMENTS
from ig2mj.scene.tables import SceneTables

MUTUAL = frozenset(("next_to", "in_contact_with"))
"""Placements that either object can be moved for."""

_NUMBERED = re.compile(r"(?P<category>.+)#(?P<number>\d+)")


@dataclasses.dataclass(frozen=True)
class Condition:
    """What must hold: an atom of objects' names, or that it does not."""

    predicate: str
    arguments: tuple[str, ...]
    value: bool = True

    @property
    def atom(self) -> Atom:
        """As an expression, without the negation."""
        return Atom(self.predicate, self.arguments)

    @property
    def expression(self) -> Expression:
        """As an expression."""
        return self.atom if self.value else Not(self.atom)

    @property
    def objects(self) -> tuple[str, ...]:
        """Its arguments without substances."""
        roles = find(self.predicate).arguments
        if len(roles) != len(self.arguments):  # an error that is reported where it is resolved
            return self.arguments
        return tuple(a for a, role in zip(self.arguments, roles, strict=True) if role != "substance")

    @property
    def is_placement(self) -> bool:
        """It says where an object is."""
        return self.predicate in PLACEMENTS

    @property
    def is_mutual(self) -> bool:
        """Placing either of its two objects can make it true."""
        return self.value and self.predicate in MUTUAL

    def other_than(self, name: str) -> str:
        """The argument of a placement that is not the given object."""
        first, second = self.arguments
        return second if first == name else first

    def __str__(self) -> str:
        text = f"({' '.join((self.predicate, *self.arguments))})"
        return text if self.value else f"(not {text})"


def read_conditions(sources: Iterable[str | Expression]) -> list[Condition]:
    """Conditions from expressions: atoms, their negations, and conjunctions of these.

    Raises:
      ExpressionError: a text is not an expression. StateError: it is none of these forms.
      UnknownNameError: no such predicate.
    """
    found: list[Condition] = []
    for source in sources:
        found += _conditions(parse(source) if isinstance(source, str) else source, True)
    return found


def _conditions(expression: Expression, value: bool) -> list[Condition]:
    if isinstance(expression, Atom):
        return [Condition(find(expression.predicate).name, expression.arguments, value)]
    if isinstance(expression, Not):
        return _conditions(expression.part, not value)
    if isinstance(expression, And) and value:
        return [c for part in expression.parts for c in _conditions(part, True)]
    raise StateError("only predicates, their negations and conjunctions of them can be sampled, not other expressions")


def bind(conditions: Sequence[Condition], tables: SceneTables, rng: np.random.Generator) -> list[Condition]:
    """The conditions with every category replaced by an object of it, drawn at random; no object stands for two.

    Raises:
      UnknownNameError: neither an object, nor a room, nor a category of the scene. StateError: too few objects of it.
    """
    bound: dict[str, str] = {}
    wholes = [
        (name, category)
        for name, category, whole in zip(
            tables.object_names, tables.object_categories, tables.object_part_of, strict=True
        )
        if whole < 0
    ]
    used = {a for c in conditions for a in c.arguments if a in tables.object_names}
    for name in dict.fromkeys(a for c in conditions for a in c.objects):
        if name in bound or name in tables.object_names or name in tables.room_names or name in tables.agent_names:
            continue
        match = _NUMBERED.fullmatch(name)
        category = match["category"] if match else name
        members = [n for n, c in wholes if c == category]
        if not members:
            known = [*tables.object_names, *tables.room_names, *dict.fromkeys(tables.object_categories)]
            raise UnknownNameError("object, room or category", name, known)
        free = [n for n in members if n not in used]
        if not free:
            raise StateError(f"the scene has too few objects of category '{category}' for '{name}'")
        bound[name] = free[int(rng.integers(len(free)))]
        used.add(bound[name])

    def with_objects(c: Condition) -> tuple[str, ...]:
        return tuple(bound.get(a, a) if a in c.objects else a for a in c.arguments)

    return [dataclasses.replace(c, arguments=with_objects(c)) for c in conditions]


@dataclasses.dataclass(frozen=True)
class SamplingPlan:
    """The order of work.

    Attributes:
      joints: conditions about open, done first: what is in a drawer is put there when it stands as it shall.
      placements: (object, conditions on where it is), supports before what they bear; the first condition is the rule
        that proposes places, a floor only where nothing says more. Conditions of two objects that either can be moved
        for are with the one that is placed later.
      states: all others; cuts come last.
    """

    joints: tuple[Condition, ...]
    placements: tuple[tuple[str, tuple[Condition, ...]], ...]
    states: tuple[Condition, ...]


def order(
    conditions: Sequence[Condition], fixed: Collection[str] = (), rank: Mapping[str, float] | None = None
) -> SamplingPlan:
    """Orders conditions by what depends on what.

    Args:
      fixed: objects that cannot be placed. rank: of objects that do not depend on each other, the lowest is placed
        first; None: by their names.

    Raises:
      StateError: objects are to be placed on each other in a circle.
    """
    import networkx

    graph = networkx.DiGraph()
    placed = [c for c in conditions if c.is_placement]
    for condition in placed:
        if not _is_about_second(condition, fixed):
            graph.add_node(condition.arguments[0])
        if condition.value and len(condition.arguments) > 1 and not condition.is_mutual:
            graph.add_edge(condition.arguments[1], condition.arguments[0])
    for condition in placed:
        if condition.is_mutual:
            first, second = condition.arguments
            turned = _is_about_second(condition, fixed)
            turned |= graph.has_node(second) and graph.has_node(first) and networkx.has_path(graph, first, second)
            graph.add_edge(*((first, second) if turned else (second, first)))
    ranks = rank or {}
    try:
        names = list(networkx.lexicographical_topological_sort(graph, key=lambda n: (ranks.get(n, 0.0), n)))
    except networkx.NetworkXUnfeasible:
        circle = " -> ".join(a for a, _ in networkx.find_cycle(graph))
        raise StateError(f"objects cannot be placed on each other in a circle: {circle}") from None
    turn = {name: n for n, name in enumerate(names)}
    where: dict[str, list[Condition]] = {}
    for condition in placed:
        first, *rest = condition.arguments
        last = rest[0] if condition.is_mutual and turn[rest[0]] > turn[first] else first
        where.setdefault(last, []).append(condition)
    placements = tuple(
        (n, tuple(sorted(where[n], key=lambda c: (not c.value, c.predicate == "on_floor"))))
        for n in names
        if n in where
    )
    rest = [c for c in conditions if not c.is_placement]
    return SamplingPlan(
        joints=tuple(c for c in rest if c.predicate == "open"),
        placements=placements,
        states=tuple(sorted((c for c in rest if c.predicate != "open"), key=lambda c: c.predicate == "sliced")),
    )


def _is_about_second(condition: Condition, fixed: Collection[str]) -> bool:
    """Whether only the second object of a mutual condition can be moved."""
    return condition.is_mutual and condition.arguments[0] in fixed and condition.arguments[1] not in fixed
