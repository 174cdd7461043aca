"""The conditions of a bound activity as expressions over the scene, compiled: truth, progress, explanation."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

from ig2mj.predicates import And, CompiledExpression, Expression, compile_expression
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.logic import Atom
from ig2mj.states.model import StateModel
from ig2mj.tasks.bddl.binding import Binding
from ig2mj.tasks.bddl.synsets import AGENT, FLOOR
from ig2mj.tasks.bddl.vocabulary import names_in, rewrite


@dataclasses.dataclass(frozen=True)
class BoundConditions:
    """An activity's conditions over the scene's objects; groups of quantifiers are synsets (`groups`).

    Attributes:
      init: of the start. Conditions of agents that are not in the scene are not among them.
      goal: all must hold. groups: synset -> objects of the scene.
      left_out: conditions of the start about absent agents, over the activity's names.
    """

    init: tuple[Expression, ...]
    goal: tuple[Expression, ...]
    groups: Mapping[str, Sequence[str]]
    left_out: tuple[Expression, ...] = ()

    def compile_goal(self, model: StateModel) -> CompiledExpression:
        """The goal: truth, fraction of progress, `explain`. Raises UnknownNameError: the scene lacks an addition."""
        return compile_expression(model, And(self.goal), self.groups, questions=HostQueries.of(model))

    def compile_init(self, model: StateModel) -> CompiledExpression:
        """The conditions of the start, likewise."""
        return compile_expression(model, And(self.init), self.groups, questions=HostQueries.of(model))


def conditions(binding: Binding) -> BoundConditions:
    """The activity's conditions, with the scene's names in place of the activity's.

    The floor of a room is the room where something is on it, else the home's floor.
    """
    names = {**binding.objects, **binding.agents}
    synset = binding.activity.synset_of()
    absent = set(binding.activity.objects.get(AGENT, ())) - set(binding.agents)

    def bound(a: Atom, variables: Mapping[str, str]) -> Atom:
        arguments = [names.get(x, x) for x in a.arguments]
        if a.predicate == "on_floor" and synset.get(a.arguments[1]) == FLOOR:
            arguments[1] = binding.rooms.get(a.arguments[1], arguments[1])
        return Atom(a.predicate, tuple(arguments))

    kept = [c for c in binding.activity.init if not absent & names_in(c)]
    groups = {s: [names[n] for n in found if n in names] for s, found in binding.activity.objects.items()}
    return BoundConditions(
        init=tuple(rewrite(c, bound) for c in kept),
        goal=tuple(rewrite(c, bound) for c in binding.activity.goal),
        groups=groups,
        left_out=tuple(c for c in binding.activity.init if absent & names_in(c)),
    )
