"""Placements that cannot be true together, though each of them can be.

An object cannot be in two rooms, nor in or on two pieces of furniture that stand apart, and objects cannot be in or on
each other in a circle.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping

import numpy as np

from ig2mj.planning.facts import Facts
from ig2mj.predicates.logic import Atom

BORNE = ("inside", "on_top")
"""Predicates whose second argument bears the first, or holds it."""


def incompatible(facts: Facts, reading: Mapping[Atom, bool]) -> Collection[Atom]:
    """Atoms of a reading that exclude each other; none: there are none.

    Args:
      reading: atoms and the truth that each is to have.
    """
    true = [a for a, required in reading.items() if required]
    borne = [a for a in true if a.predicate in BORNE]
    rooms = [a for a in true if a.predicate == "on_floor" and a.arguments[1] in facts.domain.model.tables.room_names]
    for group, apart in ((rooms, _two_rooms), (borne, _stand_apart)):
        by_object: dict[str, list[Atom]] = {}
        for atom in group:
            by_object.setdefault(atom.arguments[0], []).append(atom)
        for atoms in by_object.values():
            for one, other in itertools.combinations(atoms, 2):
                if apart(facts, one, other):
                    return one, other
    return _circle(borne)


def _two_rooms(facts: Facts, one: Atom, other: Atom) -> bool:
    return one.arguments[1] != other.arguments[1]


def _stand_apart(facts: Facts, one: Atom, other: Atom) -> bool:
    """Whether the second arguments are fixed, and farther from each other than the object is long."""
    name, first, second = one.arguments[0], one.arguments[1], other.arguments[1]
    if first == second or not (facts.domain.fixed(first) and facts.domain.fixed(second)):
        return False
    (low, high), (other_low, other_high) = facts.box(first), facts.box(second)
    gap = np.maximum(0.0, np.maximum(low - other_high, other_low - high))
    return float(np.linalg.norm(gap)) > facts.domain.length(name)


def _circle(borne: Collection[Atom]) -> Collection[Atom]:
    """Atoms by which objects are in or on each other in a circle."""
    import networkx  # 90 ms that importing ig2mj.Simulation does not spend

    by_edge = {(a.arguments[0], a.arguments[1]): a for a in borne}
    graph = networkx.DiGraph(list(by_edge))
    try:
        return tuple(by_edge[a, b] for a, b, *_ in networkx.find_cycle(graph))
    except networkx.NetworkXNoCycle:
        return ()
