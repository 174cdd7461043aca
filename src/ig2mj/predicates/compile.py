"""Expressions compiled against a scene: one jitted function from the state of all worlds to truth.

    goal = compile_expression(model, "(and (cooked fish_0) (on_top plate_0 table_0))")
    goal(world)            Bool[W]
    goal.fraction(world)   Float[W], 1 exactly where the goal holds
    print(goal.explain(world))

`goal.verdict(states, view, relations)` is the pure function underneath, for use inside larger jitted ones;
`goal.queries` are the relations it needs.

Axes: W worlds, L literals.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import UnknownNameError
from ig2mj.knowledge import categories_of
from ig2mj.predicates import logic
from ig2mj.predicates.base import Context
from ig2mj.predicates.literals import Literals
from ig2mj.predicates.logic import And, Atom, Exactly, Expression, Not, Or, Pairing
from ig2mj.predicates.parse import parse
from ig2mj.states.model import StateModel
from ig2mj.states.relations import Query, RelationPlan, Relations
from ig2mj.states.world import ExtendedStates, WorldState

Groups = Mapping[str, Sequence[str]]


@struct.dataclass
class Verdict:
    """What an expression says of every world.

    Attributes:
      holds: it is true. fraction: of its literals that are as they should be (see `CompiledExpression.fraction`).
      literals: truth of every literal, in the order of `CompiledExpression.atoms`.
    """

    holds: Bool[Array, "W"]
    fraction: Float[Array, "W"]
    literals: Bool[Array, "W L"]


@dataclasses.dataclass(frozen=True, eq=False)
class CompiledExpression:
    """An expression of a scene; made by `compile_expression`.

    Attributes:
      model: constants. source: the expression as given. ground: without quantifiers. literals: resolved.
    """

    model: StateModel
    source: Expression
    ground: Expression
    literals: Literals

    @functools.cached_property
    def atoms(self) -> tuple[Atom, ...]:
        """The literals' atoms: the L axis."""
        return tuple(x.atom for x in self.literals.literals)

    @functools.cached_property
    def queries(self) -> list[Query]:
        """Relations that `verdict` needs."""
        return self.literals.queries()

    @functools.cached_property
    def plan(self) -> RelationPlan:
        """Those relations, planned for this expression alone."""
        return RelationPlan.build(self.model, self.queries)

    def verdict(self, states: ExtendedStates, view: PhysicsView, relations: Relations | None = None) -> Verdict:
        """Truth, fraction and literals in all worlds. Pure."""
        if relations is None:
            relations = self.plan.evaluate(view)
        truth = self.literals.evaluate(Context(self.model, states, view, relations))
        column = {a: truth[:, i] for i, a in enumerate(self.atoms)}
        worlds = truth.shape[0]
        score, _ = _score(self.ground, column, True, worlds)
        return Verdict(holds=_holds(self.ground, column, worlds), fraction=score, literals=truth)

    def __call__(self, world: WorldState) -> Bool[Array, "W"]:
        """Whether the expression holds, in every world."""
        return self._jitted(world.states, world.view).holds

    def fraction(self, world: WorldState) -> Float[Array, "W"]:
        """Share of literals that are as the expression wants them: 1 exactly where it holds.

        A conjunction counts the literals of its parts. Of a disjunction, and of what exists, the part that is nearest
        to holding counts; exactly n and pairs count the n nearest, less what is too much.
        """
        return self._jitted(world.states, world.view).fraction

    def explain(self, world: WorldState, index: int = 0) -> str:
        """What is still missing in one world, as text to read."""
        from ig2mj.predicates.explain import explain

        return explain(self, world.states, world.view, index)

    @functools.cached_property
    def _jitted(self):
        return jax.jit(lambda states, view: self.verdict(states, view))


def compile_expression(
    model: StateModel, expression: Expression | str, groups: Groups | None = None, strict: bool = False
) -> CompiledExpression:
    """Resolves an expression against a scene.

    Args:
      model: constants of the scene's states.
      expression: a tree, or text for `parse.parse`.
      groups: lists of objects by name, for quantifiers. Without an entry, a group is the objects of the category, or of
        the synset, of that name; halves of sliceable objects are not listed, their whole stands for them.
      strict: an object that lacks the ability is an error instead of False.

    Raises:
      UnknownNameError, ArityError, AbilityError: see `Literals.build`. ExpressionError: the text is no expression.
    """
    source = parse(expression) if isinstance(expression, str) else expression
    grounded = logic.ground(source, lambda name: group_members(model, name, groups or {}))
    return CompiledExpression(model, source, grounded, Literals.build(model, logic.atoms(grounded), strict))


def group_members(model: StateModel, name: str, groups: Groups) -> list[str]:
    """Objects of a named group (see `compile_expression`). Raises UnknownNameError."""
    if name in groups:
        return list(groups[name])
    tables = model.tables
    wanted = {name} if name in tables.object_categories else _categories(name)
    rows = zip(tables.object_names, tables.object_categories, tables.object_part_of, strict=True)
    found = [n for n, category, whole in rows if category in wanted and whole < 0]
    if not found:
        raise UnknownNameError("group of objects", name, {*groups, *tables.object_categories})
    return found


def _categories(synset: str) -> set[str]:
    try:
        return set(categories_of(synset))
    except UnknownNameError:
        return set()


def _holds(e: Expression, column: Mapping[Atom, Bool[Array, "W"]], worlds: int) -> Bool[Array, "W"]:
    def stacked(parts: Sequence[Expression]) -> Bool[Array, "N W"]:
        none = jnp.zeros((0, worlds), bool)
        return jnp.stack([_holds(p, column, worlds) for p in parts]) if parts else none

    match e:
        case Atom():
            return column[e]
        case Not(part):
            return ~_holds(part, column, worlds)
        case And(parts):
            return jnp.all(stacked(parts), axis=0)
        case Or(parts):
            return jnp.any(stacked(parts), axis=0)
        case Exactly(count, parts):
            return jnp.sum(stacked(parts), axis=0) == count
        case Pairing(count, rows):
            return _pairs_found(_grid(rows, lambda p: _holds(p, column, worlds), worlds), count)
    raise TypeError(f"{e!r} is no ground expression")


def _grid(rows, value, worlds: int) -> Bool[Array, "M N W"]:
    """Values of the parts of a `Pairing`; an object paired with itself has 0."""
    cells = [[jnp.zeros(worlds) if p is None else jnp.asarray(value(p)) for p in row] for row in rows]
    if not cells or not cells[0]:
        return jnp.zeros((len(cells), 0, worlds))
    return jnp.stack([jnp.stack(row) for row in cells])


def _pairs_found(grid: Array, count: int) -> Bool[Array, "W"]:
    """BDDL's test: at least `count` rows and `count` columns have a true cell."""
    true = grid > 0.5
    return (jnp.sum(jnp.any(true, axis=1), axis=0) >= count) & (jnp.sum(jnp.any(true, axis=0), axis=0) >= count)


def _score(
    e: Expression, column: Mapping[Atom, Bool[Array, "W"]], wanted: bool, worlds: int
) -> tuple[Float[Array, "W"], float]:
    """How far an expression is from being `wanted`, 0 to 1, and how many literals that counts for."""
    ones = jnp.ones(worlds)

    def scores(parts: Sequence[Expression], value: bool) -> list[tuple[Float[Array, "W"], float]]:
        return [_score(p, column, value, worlds) for p in parts]

    match e:
        case Atom():
            return (column[e] == wanted).astype(jnp.float32), 1.0
        case Not(part):
            return _score(part, column, not wanted, worlds)
        case And(parts) | Or(parts):
            found = scores(parts, wanted)
            if isinstance(e, And) == wanted:
                total = sum(n for _, n in found)
                return (sum(n * s for s, n in found) / total, total) if found else (ones, 0.0)
            return (
                (jnp.max(jnp.stack([s for s, _ in found]), axis=0), max(n for _, n in found))
                if found
                else (
                    0 * ones,
                    1.0,
                )
            )
        case Exactly(count, parts):
            holds = _holds(e, column, worlds) == wanted
            near = jnp.stack([s for s, _ in scores(parts, True)]) if parts else jnp.zeros((0, worlds))
            best = jnp.sum(jnp.sort(near, axis=0)[::-1][:count], axis=0)
            extra = jnp.maximum(jnp.sum(near >= 1.0, axis=0) - count, 0)
            share = (best - extra) / max(count, len(parts), 1)
            return _whole_or_less(holds, share if wanted else 0 * ones), float(max(count, 1))
        case Pairing(count, rows):
            holds = _holds(e, column, worlds) == wanted
            grid = _grid(rows, lambda p: _score(p, column, True, worlds)[0], worlds)
            sides = [
                jnp.sum(jnp.sort(jnp.max(grid, axis=a, initial=0.0), axis=0)[::-1][:count], axis=0) for a in (0, 1)
            ]
            share = jnp.minimum(*sides) / max(count, 1)
            return _whole_or_less(holds, share if wanted else 0 * ones), float(max(count, 1))
    raise TypeError(f"{e!r} is no ground expression")


def _whole_or_less(holds: Bool[Array, "W"], share: Float[Array, "W"]) -> Float[Array, "W"]:
    """1 exactly where it holds."""
    return jnp.where(holds, 1.0, jnp.clip(share, 0.0, LESS_THAN_ONE))


LESS_THAN_ONE = 0.99
"""The most that a quantifier that does not hold scores."""
