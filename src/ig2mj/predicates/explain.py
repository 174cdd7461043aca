"""Why an expression does not hold, as text: the tree with what is missing, and the numbers behind it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import jax
import numpy as np

from ig2mj.engine.view import PhysicsView
from ig2mj.predicates import logic
from ig2mj.predicates.base import Context
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.logic import And, Atom, Exactly, Expression, Not, Or, Pairing
from ig2mj.states.world import ExtendedStates

if TYPE_CHECKING:
    from ig2mj.predicates.compile import CompiledExpression


def truth_in(
    compiled: CompiledExpression, states: ExtendedStates, view: PhysicsView, world: int
) -> tuple[Context, dict[Atom, bool]]:
    """The context of one world, and the truth of the expression's atoms in it."""
    states, view = jax.tree.map(lambda leaf: np.asarray(leaf)[world : world + 1], (states, view))
    questions = compiled.questions or HostQueries.of(compiled.model)
    context = Context(compiled.model, states, view, questions.relations(states, view))
    truth = np.asarray(compiled.literals.combine(questions.facts(compiled.literals, states, view), states.sliced))[0]
    table = dict(zip(compiled.atoms, truth.tolist(), strict=True))
    return context, table


def explain(compiled: CompiledExpression, states: ExtendedStates, view: PhysicsView, world: int = 0) -> str:
    """Readable text about one world: one line when the expression holds, else what is missing."""
    context, table = truth_in(compiled, states, view, world)
    if value_of(compiled.ground, table):
        return f"{logic.text(compiled.source)} holds."
    lines = [f"{logic.text(compiled.source)} does not hold. Missing:"]
    _missing(compiled.ground, table, True, reason_of(compiled, context), lines, "  ")
    return "\n".join(lines)


def reason_of(compiled: CompiledExpression, context: Context) -> Callable[[Atom], str]:
    """What gives the numbers behind a literal of an expression, in the first world of a context; "" where there are
    none."""
    literals, states = {x.atom: x for x in compiled.literals.literals}, context.states

    def reason(atom: Atom) -> str:
        literal = literals[atom]
        if not literal.able:
            return f"'{atom.arguments[0]}' is not {literal.predicate.ability}"
        if any(compiled.model.parameters.halves_of(o) and states.sliced[0, o] for o in literal.arguments):
            return "judged by its halves"
        return literal.predicate.why(context, literal.arguments, 0) if literal.predicate.why else ""

    return reason


def value_of(e: Expression, table: dict[Atom, bool]) -> bool:
    """Truth of a ground expression, from that of its atoms."""
    match e:
        case Atom():
            return table[e]
        case Not(part):
            return not value_of(part, table)
        case And(parts):
            return all(value_of(p, table) for p in parts)
        case Or(parts):
            return any(value_of(p, table) for p in parts)
        case Exactly(count, parts):
            return sum(value_of(p, table) for p in parts) == count
        case Pairing(count, rows):
            rows_found, columns_found = pairs_found(rows, table)
            return min(rows_found, columns_found) >= count
    raise TypeError(f"{e!r} is not a ground expression")


def pairs_found(rows, table: dict[Atom, bool]) -> tuple[int, int]:
    """Of a pairing: how many of its rows, and of its columns, have one that holds."""
    grid = [[p is not None and value_of(p, table) for p in row] for row in rows]
    return sum(any(row) for row in grid), sum(any(column) for column in zip(*grid, strict=True))


def _missing(e: Expression, table: dict[Atom, bool], expected: bool, reason, lines: list[str], indent: str) -> None:
    """Adds lines about `e`, whose truth is not the desired one."""
    if value_of(e, table) == expected:
        return
    match e:
        case Atom():
            why = reason(e)
            lines.append(f"{indent}{'' if expected else 'not '}{logic.text(e)}" + (f": {why}" if why else ""))
        case Not(part):
            _missing(part, table, not expected, reason, lines, indent)
        case And(parts) | Or(parts):
            every = isinstance(e, And) == expected
            if not every and len(parts) > 1:
                lines.append(f"{indent}one of:")
                indent += "  "
            if not parts:
                lines.append(f"{indent}nothing can make an empty alternative true")
            for p in parts:
                _missing(p, table, expected, reason, lines, indent)
        case Exactly(count, parts):
            found = sum(value_of(p, table) for p in parts)
            lines.append(f"{indent}{'' if expected else 'not '}exactly {count} of {len(parts)} (now {found}):")
            for p in parts:
                _missing(p, table, found < count, reason, lines, indent + "  ")
        case Pairing(count, rows):
            found = min(pairs_found(rows, table))
            lines.append(f"{indent}{'' if expected else 'not '}{count} pairs (now {found}):")
            for p in (p for row in rows for p in row if p is not None):
                _missing(p, table, expected, reason, lines, indent + "  ")
