"""`supplies`: ways in which an object gets a substance in one world: from a tap, out of a container, by a spray, or, in
a container, by stirring what it is made of.

Conditions about it are those of `RECEIVED`: a container is filled with it or contains it, and anything else is covered
with it or, where it can absorb, saturated.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence

import numpy as np

from ig2mj.knowledge.substances import WATER
from ig2mj.knowledge.transitions import Transition
from ig2mj.planning.facts import Facts
from ig2mj.sampling.conditions import Condition
from ig2mj.states.substances.coat import DROP
from ig2mj.states.substances.model import of
from ig2mj.states.substances.volume import CONTAINS, FILLED

RECEIVED = ("contains", "filled", "saturated", "covered")
"""Predicates of an object and a substance that primitives make true."""


OUT = 2
"""Steps in which a loose thing is taken out of a container that is filled at a tap."""


@dataclasses.dataclass(frozen=True)
class Supply:
    """One way.

    Attributes:
      primitive: that ends it. source: tap, container, spray or stirrer. tap: where the container is filled first; "":
        it holds enough. inputs: substances that come into the container before it is stirred.
    """

    primitive: str
    source: str
    tap: str = ""
    inputs: tuple[str, ...] = ()


def litres(facts: Facts, name: str, substance: str) -> float:
    """Litres of a substance that flow out of a container, if it is turned over: none where it is frozen."""
    found, states = of(facts.domain.model), facts.states
    row = found.containers.row_of(facts.domain.index(name))
    if row is None or substance not in found.names:
        return 0.0
    column = found.names.index(substance)
    return float(np.asarray(states.volume)[0, row, column]) * (not np.asarray(states.solid)[0, row, column])


def contents(facts: Facts, name: str) -> float:
    """Litres of all that is in a container."""
    row = of(facts.domain.model).containers.row_of(facts.domain.index(name))
    return 0.0 if row is None else float(np.asarray(facts.states.volume)[0, row].sum())


def held_substances(facts: Facts, name: str) -> list[str]:
    """What flows out of a container, if it is turned over, most of it first; of anything else, nothing."""
    found = facts.domain.model.substances
    if found is None:
        return []
    amounts = {s: litres(facts, name, s) for s in found.names}
    return sorted((s for s in amounts if amounts[s] >= CONTAINS), key=lambda s: -amounts[s])


def endless(facts: Facts, name: str, substance: str) -> bool:
    """Whether a container does not become empty."""
    found = of(facts.domain.model)
    row = found.containers.row_of(facts.domain.index(name))
    return row is not None and bool(np.asarray(facts.states.stock)[0, row, found.names.index(substance)])


def required_litres(facts: Facts, condition: Condition) -> float:
    """Litres that a condition asks for."""
    name, _ = condition.arguments
    model = facts.domain.model
    if condition.predicate == "filled":
        return FILLED * facts.domain.litres(name)
    if condition.predicate == "saturated":
        return DROP * float(model.parameters.wetness_soaked[facts.domain.index(name)])
    return CONTAINS


def missing_parts(facts: Facts, name: str, recipe: Transition) -> list[str]:
    """Substances of a recipe that a container does not contain."""
    return [i for i in recipe.inputs if litres(facts, name, i) < CONTAINS]


def ingredients(facts: Facts, name: str, substance: str) -> str:
    """What a container lacks of the recipe of which it has most, in words; "": nothing."""
    lacks = [missing_parts(facts, name, recipe) for recipe in facts.domain.recipes(substance)]
    return ", ".join(min(lacks, key=len, default=["a recipe"]))


def supplies(
    facts: Facts, condition: Condition, required: Sequence[Condition] = (), within: Collection[str] = ()
) -> list[Supply]:
    """The ways, those with fewest steps first, last those in which another container is filled at a tap; none: there is
    too little of the substance.

    Args:
      condition: that is to become true. required: conditions that are to hold in the end: what they ask for in a
        container is not poured out of it. within: substances of which this one is to become a part.
    """
    domain, (name, substance) = facts.domain, condition.arguments
    container = condition.predicate in ("contains", "filled")
    need = required_litres(facts, condition)
    missing = max(need - (litres(facts, name, substance) if container else 0.0), CONTAINS)
    found = list[Supply]()
    if substance == WATER and container and name in domain.fillable:
        found += [Supply("fill", tap) for tap in domain.taps]
    if substance == WATER and condition.predicate == "saturated" and not domain.fixed(name):
        found += [Supply("soak", tap) for tap in domain.taps]
    if not container:
        found += [Supply("spray", s) for s in domain.sprays if s != name and litres(facts, s, substance) >= missing]
    others = [y for y in domain.pourable if y != name and y not in domain.sprays]
    able = [y for y in others if _spare(facts, y, substance, required) >= missing]
    found += [Supply("pour", y) for y in able]
    if substance == WATER:
        jugs = [y for y in others if y in domain.fillable and y not in able and not _asked_of(y, WATER, required)]
        found += [Supply("pour", y, tap) for y in jugs for tap in domain.taps]

    if container:
        found += _mixtures(facts, name, substance, required, {*within, substance})

    def rank(supply: Supply) -> tuple[bool, int, bool, float]:
        kept = supply.primitive == "pour" and bool(_asked_of(supply.source, substance, required))
        order = -domain.litres(supply.source) if supply.tap else _far(facts, supply.source, name)
        return bool(supply.tap), _steps(facts, name, supply), kept, order

    return sorted(found, key=rank)


def _mixtures(
    facts: Facts, name: str, substance: str, required: Sequence[Condition], within: Collection[str]
) -> list[Supply]:
    """The ways of stirring, of recipes all of whose ingredients are there or can be brought there."""
    found = list[Supply]()
    for recipe in facts.domain.recipes(substance):
        missing = missing_parts(facts, name, recipe)
        if all(i not in within and supplies(facts, part_in(name, i), required, within) for i in missing):
            found += [Supply("mix", s, inputs=tuple(missing)) for s in facts.domain.stirrers if s != name]
    return found


def part_in(name: str, substance: str) -> Condition:
    """What must hold of a container before it is stirred; what is poured into it fills a fifth of it in any case."""
    return Condition("contains", (name, substance))


def _steps(facts: Facts, name: str, supply: Supply) -> int:
    """Steps that a way takes, about."""
    if supply.primitive == "mix":
        return 1 + (supply.source not in facts.held) + 2 * len(supply.inputs)
    moved = name if supply.primitive in ("fill", "soak") else supply.source
    tap = supply.tap or (supply.source if supply.primitive in ("fill", "soak") else "")
    runs = not tap or not facts.domain.has(tap, "toggleable") or facts.holds("toggled_on", tap)
    around = {c for n in (name, moved) if n not in facts.held for c in facts.containers(n)}
    shut = sum(not facts.holds("open", c) for c in around)
    filled = moved if supply.primitive == "fill" or supply.tap else ""
    out = OUT * len(facts.things_in(filled)) if filled else 0
    return out + 1 + (moved not in facts.held) + shut + (not runs) + bool(supply.tap)


def lacking(facts: Facts, condition: Condition) -> str:
    """Why an object cannot get a substance in this world; "" where it can, or for other conditions."""
    if condition.predicate not in RECEIVED or not condition.value or supplies(facts, condition):
        return ""
    name, substance = condition.arguments
    fix = f"--substances {substance}@CONTAINER fills one at the start"
    return f"no container that can be carried holds enough {substance} for '{name}' ({fix})"


def _spare(facts: Facts, name: str, substance: str, required: Sequence[Condition]) -> float:
    """Litres that may be poured out of a container."""
    if endless(facts, name, substance):
        return np.inf
    kept = [required_litres(facts, c) for c in _asked_of(name, substance, required)]
    return litres(facts, name, substance) - max(kept, default=0.0)


def _asked_of(name: str, substance: str, required: Collection[Condition]) -> list[Condition]:
    return [c for c in required if c.value and c.predicate in RECEIVED[:2] and c.arguments == (name, substance)]


def _far(facts: Facts, one: str, other: str) -> float:
    return float(np.linalg.norm(facts.place(one) - facts.place(other)))
