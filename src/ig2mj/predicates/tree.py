"""An expression as a tree of parts with their truth and the reason for it, for panels."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from ig2mj.engine.view import PhysicsView
from ig2mj.predicates import logic
from ig2mj.predicates.explain import pairs_found, reason_of, truth_in, value_of
from ig2mj.predicates.logic import And, Atom, Exactly, Expression, Not, Or, Pairing
from ig2mj.states.world import ExtendedStates

if TYPE_CHECKING:
    from ig2mj.predicates.compile import CompiledExpression


@dataclasses.dataclass(frozen=True)
class GoalPart:
    """A part of an expression in one world.

    Attributes:
      text: the literal, or what its parts have to do ("all of", "one of"). literal: it has no parts.
      holds: its truth. expected: the truth that would make the whole hold. why: numbers behind a literal that does not
      have it, else "". parts: of which it consists.
    """

    text: str
    holds: bool
    expected: bool
    literal: bool = False
    why: str = ""
    parts: tuple[GoalPart, ...] = ()

    @property
    def fine(self) -> bool:
        """The part has the required truth."""
        return self.holds == self.expected


def tree(compiled: CompiledExpression, states: ExtendedStates, view: PhysicsView, world: int = 0) -> GoalPart:
    """The expression in one world, without quantifiers: they are written out for the scene's objects."""
    context, table = truth_in(compiled, states, view, world)
    reason = reason_of(compiled, context)

    def part(e: Expression, expected: bool) -> GoalPart:
        holds = value_of(e, table)
        match e:
            case Atom():
                why = reason(e) if holds != expected else ""
                return GoalPart(logic.text(e), holds, expected, True, why)
            case Not(Atom() as inner):
                inside = part(inner, not expected)
                return GoalPart(f"not {inside.text}", holds, expected, True, inside.why)
            case Not(inner):
                return GoalPart("not", holds, expected, parts=(part(inner, not expected),))
            case And(parts) | Or(parts):
                name = "all of" if isinstance(e, And) else "one of"
                return GoalPart(name, holds, expected, parts=tuple(part(p, expected) for p in parts))
            case Exactly(count, parts):
                found = sum(value_of(p, table) for p in parts)
                name = f"exactly {count} of {len(parts)}, now {found}"
                return GoalPart(name, holds, expected, parts=tuple(part(p, found <= count) for p in parts))
            case Pairing(count, rows):
                inner = tuple(part(p, expected) for row in rows for p in row if p is not None)
                return GoalPart(f"{count} pairs, now {min(pairs_found(rows, table))}", holds, expected, parts=inner)
        raise TypeError(f"{e!r} is not a ground expression")

    return part(compiled.ground, True)
