"""Expressions compiled against a scene: one jitted function from the state of all worlds to truth.

    goal = compile_expression(model, "(and (cooked fish_0) (on_top plate_0 table_0))")
    goal(world)            Bool[W]
    goal.fraction(world)   Float[W], 1 exactly where the goal holds
    print(goal.explain(world))

`goal.status(states, view, relations)` is the pure function underneath, for use inside larger jitted ones;
`goal.queries` are the relations it needs.

Axes: W worlds, L literals.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import jax
import numpy as np
from flax import struct
from jax.core import Tracer
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import StaleStateError, UnknownNameError
from ig2mj.knowledge import categories_of
from ig2mj.predicates import logic
from ig2mj.predicates.base import Context
from ig2mj.predicates.evaluate import Truth, fraction, holds
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.literals import Literals
from ig2mj.predicates.logic import Atom, Expression
from ig2mj.predicates.parse import parse
from ig2mj.process import entry_point
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query, RelationPlan
from ig2mj.states.relations.relations import Relations
from ig2mj.states.world import ExtendedStates, WorldState

Groups = Mapping[str, Sequence[str]]


@struct.dataclass
class GoalStatus:
    """Truth and progress of an expression in every world.

    Attributes:
      holds: it is true. fraction: share of its literals that have the required truth (`evaluate.fraction`).
      literals: truth of every literal, in the order of `CompiledExpression.atoms`.
    """

    holds: Bool[Array, "W"]
    fraction: Float[Array, "W"]
    literals: Bool[Array, "W L"]

    @classmethod
    def empty(cls, num_worlds: int) -> GoalStatus:
        """The status where there is no goal: no literals, and nothing that could ever be reached."""
        return cls(np.zeros(num_worlds, bool), np.zeros(num_worlds, np.float32), np.zeros((num_worlds, 0), bool))


@entry_point
@dataclasses.dataclass(frozen=True, eq=False)
class CompiledExpression:
    """An expression of a scene; made by `compile_expression`.

    Attributes:
      model: constants. source: the expression as given. ground: without quantifiers. literals: resolved.
      questions: what answers for a single world, one program per predicate; None: every number of worlds has its own
      fused program.
    """

    model: StateModel
    source: Expression
    ground: Expression
    literals: Literals
    questions: HostQueries | None = None

    @functools.cached_property
    def atoms(self) -> tuple[Atom, ...]:
        """The literals' atoms: the L axis."""
        return tuple(x.atom for x in self.literals.literals)

    @functools.cached_property
    def queries(self) -> list[Query]:
        """Relations that `status` needs."""
        return self.literals.queries()

    @functools.cached_property
    def plan(self) -> RelationPlan:
        """Those relations, planned for this expression alone."""
        return RelationPlan.build(self.model, self.queries)

    def status(self, states: ExtendedStates, view: PhysicsView, relations: Relations | None = None) -> GoalStatus:
        """Truth, fraction and literals in all worlds. Pure."""
        with GC_PAUSED:
            return self.status_of(self.literals.facts(self.context(states, view, relations)), states)

    def context(self, states: ExtendedStates, view: PhysicsView, relations: Relations | None = None) -> Context:
        """What the literals read; relations are computed where they are not given."""
        return Context(self.model, states, view, self.plan.evaluate(view) if relations is None else relations)

    def status_of(self, facts: Bool[Array, "W I"], states: ExtendedStates) -> GoalStatus:
        """The status that follows from `Literals.facts`."""
        values = self.literals.combine(facts, states.sliced)
        truth = Truth(values, {a: i for i, a in enumerate(self.atoms)})
        return GoalStatus(holds=holds(self.ground, truth), fraction=fraction(self.ground, truth), literals=values)

    def __call__(self, world: WorldState) -> Bool[Array, "W"]:
        """Whether the expression holds, in every world. Raises StaleStateError: the worlds' arrays were donated."""
        return self._status_now(world).holds

    def fraction(self, world: WorldState) -> Float[Array, "W"]:
        """Share of literals that are as the expression wants them: 1 exactly where it holds (`evaluate.fraction`)."""
        return self._status_now(world).fraction

    def literals_of(self, world: WorldState) -> Bool[Array, "W L"]:
        """Truth of every literal (`atoms`), in every world."""
        return self._status_now(world).literals

    def _status_now(self, world: WorldState) -> GoalStatus:
        states, view = _kept(world.states), world.view
        if self.questions is None or len(states.sliced) != 1 or isinstance(states.sliced, Tracer):
            return self._jitted(states, view)
        return self.status_of(self.questions.facts(self.literals, states, view), states)

    def explain(self, world: WorldState, index: int = 0) -> str:
        """What is still missing in one world, as readable text."""
        from ig2mj.predicates.explain import explain

        return explain(self, _kept(world.states), world.view, index)

    @functools.cached_property
    def _jitted(self):
        return jax.jit(lambda states, view: self.status(states, view))


def _kept(states: ExtendedStates) -> ExtendedStates:
    """The same states. Raises StaleStateError where their arrays were donated to a program."""
    sliced = states.sliced
    if isinstance(sliced, jax.Array) and not isinstance(sliced, Tracer) and sliced.is_deleted():
        raise StaleStateError
    return states


@entry_point
def compile_expression(
    model: StateModel,
    expression: Expression | str,
    groups: Groups | None = None,
    strict: bool = False,
    questions: HostQueries | None = None,
) -> CompiledExpression:
    """Resolves an expression against a scene.

    Args:
      model: constants of the scene's states.
      expression: a tree, or text for `parse.parse`.
      groups: lists of objects by name, for quantifiers. Without an entry, a group is the objects of the category, or of
        the synset, of that name; halves of sliceable objects are not listed, their whole stands for them.
      strict: an object that lacks the ability is an error instead of False.
      questions: see `CompiledExpression`.

    Raises:
      UnknownNameError, ArityError, AbilityError: see `Literals.build`. ExpressionError: the text is not an expression.
    """
    source = parse(expression) if isinstance(expression, str) else expression
    grounded = logic.ground(source, lambda name: group_members(model, name, groups or {}))
    return CompiledExpression(model, source, grounded, Literals.build(model, logic.atoms(grounded), strict), questions)


def group_members(model: StateModel, name: str, groups: Groups) -> list[str]:
    """Objects of a named group (see `compile_expression`). Raises UnknownNameError."""
    if name in groups:
        return list(groups[name])
    tables = model.tables
    expected = {name} if name in tables.object_categories else _categories(name)
    rows = zip(tables.object_names, tables.object_categories, tables.object_part_of, strict=True)
    found = [n for n, category, whole in rows if category in expected and whole < 0]
    if not found:
        raise UnknownNameError("group of objects", name, {*groups, *tables.object_categories})
    return found


def _categories(synset: str) -> set[str]:
    try:
        return set(categories_of(synset))
    except UnknownNameError:
        return set()
