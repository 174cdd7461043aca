"""Whether conditions hold in a sampler's world."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ig2mj.engine.view import PhysicsView
from ig2mj.predicates.compile import compile_expression
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.logic import And
from ig2mj.sampling.conditions import Condition
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates, WorldState


class Truths:
    """The truth of a fixed list of conditions."""

    def __init__(self, model: StateModel, conditions: Sequence[Condition]):
        """Compiles them. Raises what `compile_expression` raises."""
        self._goal = compile_expression(
            model, And(tuple(c.atom for c in conditions)), strict=True, questions=HostQueries.of(model)
        )
        place = {atom: i for i, atom in enumerate(self._goal.atoms)}
        self._place = {c: place[c.atom] for c in conditions}

    def hold(self, conditions: Sequence[Condition], states: ExtendedStates, view: PhysicsView) -> bool:
        """Whether all of some of the conditions hold."""
        nothing = np.zeros(1, np.int32)
        world = WorldState(
            None, view, states, key=np.zeros((1, 2), np.uint32), step=nothing, time=np.zeros(1, np.float32)
        )
        literals = np.asarray(self._goal.literals_of(world))[0]
        return all(bool(literals[self._place[c]]) == c.value for c in conditions)
