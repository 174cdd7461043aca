"""`StateProgram`: a scene's states and goal as compiled functions for stepping from the host.

The functions are those of `ig2mj.states.update`, cut in two: `whole`, everything, and `heat`, temperatures and what
follows from them where nothing else can change. Calling a compiled function from the host costs a microsecond for
every array that goes in or out, as much as the work itself. So `whole` is traced first, and then takes just the arrays
on which its results depend and gives just those that it makes. What it takes is also what has to be looked at to see
whether anything can change at all (`StateProgram.view_reads`).

Axes: W worlds, O objects, S heat sources, I facts.
"""

from __future__ import annotations

import dataclasses
import weakref
from typing import ClassVar, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import SCHEMA, Array, PhysicsView, assemble, read_field
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.predicates.tracing import inputs_that_matter
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Memo, RelationPlan
from ig2mj.states.update import events, heat, queries
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.rules import Rules

T = TypeVar("T")

FIELDS = tuple(SCHEMA)

FIRST_MOVED = ("object_com", "touching", "joint_pos", "link_force")
"""Fields of the view that are looked at first: small, and among them is what changes when anything does."""

BODY_FIELDS = ("body_pos", "body_quat")


class Found(NamedTuple):
    """What `whole` gives.

    Attributes:
      leaves: of the states, at the places `StateProgram.gives`. swap: mask, pos, quat; None where nothing can be cut.
      status: the goal's fields. acts: source on object [W, O, S]. facts: of the goal [W, I].
      flags: whether the step changed nothing but temperatures, whether it asks for teleports, and whether it changed no
      temperature. memo: of relations, flat.
    """

    leaves: list[Array]
    swap: tuple[Array, Array, Array] | None
    status: tuple[Array, Array, Array] | None
    acts: Bool[Array, "W O S"]
    facts: Bool[Array, "W I"]
    flags: Bool[Array, "3"]
    memo: list[Array]


class StateProgram:
    """The jitted functions of a scene's rules; may serve any number of steppers.

    Attributes:
      heat: one step of temperatures, jitted. heats: places of what it makes among the states' leaves.
      gives: places of the leaves that a whole step makes; the others it hands through. view_reads: fields of the view
      that a whole step depends on; goal_reads: those of the goal itself. All three are known from the first step on.
      rows: bodies whose poses matter.
    """

    _of_rules: ClassVar[weakref.WeakKeyDictionary] = weakref.WeakKeyDictionary()  # Rules -> {worlds: StateProgram}

    def __init__(self, model: StateModel, goal: CompiledExpression | None = None, num_worlds: int = 1):
        """Compiles nothing yet: that happens at the first step.

        Args:
          goal: evaluated at the end of every step.
        """
        self.model, self.goal, self.num_worlds = model, goal, num_worlds
        self.plan = RelationPlan.build(model, [*queries(model), *(goal.queries if goal else [])])
        template = initial_states(model, num_worlds)
        self._template = template
        named, self.structure = jax.tree_util.tree_flatten_with_path(template)
        self._paths = [tuple(key.name for key in path) for path, _ in named]
        self.heats = [self._paths.index((name,)) for name in ("temperature", "max_temperature")]
        self._empty_memo, self._memo_structure = jax.tree.flatten(self.plan.empty_memo(num_worlds))
        self.heat = jax.jit(self._heat_step)
        self.view_reads: tuple[str, ...] = ()
        self.goal_reads: frozenset[str] = frozenset()
        self.gives: list[int] = []
        self._takes: list[int] = []
        self._whole = None
        self.rows = _object_bodies(model)

    @classmethod
    def of(cls, rules: Rules, num_worlds: int) -> StateProgram:
        """The program of these rules; asked again, the same object, so that it is compiled once."""
        made = cls._of_rules.setdefault(rules, {})
        if num_worlds not in made:
            made[num_worlds] = cls(rules.model, rules.goal, num_worlds)
        return made[num_worlds]

    def empty_memo(self) -> list[Array]:
        """A memo that knows nothing yet, flat."""
        return self._empty_memo

    def whole(self, leaves: list[Array], view: PhysicsView, memo: list[Array]) -> Found:
        """One step of everything.

        Args:
          leaves: all leaves of the states. memo: the last step's.
        """
        if self._whole is None:
            self._trace(leaves, view, memo)
            assert self._whole is not None
        taken = [leaves[i] for i in self._takes]
        return Found(*self._whole(taken, [read_field(view, name) for name in self.view_reads], memo))

    def with_leaves(self, states: ExtendedStates, places: list[int], leaves: list[Array]) -> ExtendedStates:
        """A copy of the states in which the leaves at some places are others.

        `dataclasses.replace` and unflattening run the constructors of frozen dataclasses, which take longer than a step
        of temperatures.
        """
        new = _copied(states)
        fields, copied = new.__dict__, set()
        for place, leaf in zip(places, leaves, strict=True):
            name, *inner = self._paths[place]
            if inner:
                if name not in copied:
                    copied.add(name)
                    fields[name] = _copied(fields[name])
                fields[name].__dict__[inner[0]] = leaf
            else:
                fields[name] = leaf
        return new

    def _trace(self, leaves: list[Array], view: PhysicsView, memo: list[Array]) -> None:
        fields = [read_field(view, name) for name in FIELDS]
        matters = inputs_that_matter(jax.make_jaxpr(self._whole_step)(leaves, fields, memo).jaxpr)
        read = [name for name, used in zip(FIELDS, matters[len(leaves) :], strict=False) if used]
        takes = [i for i in range(len(leaves)) if matters[i]]
        reads = sorted(read, key=lambda name: (name not in FIRST_MOVED, FIELDS.index(name)))
        blank_leaves: list[Array] = [np.zeros(leaf.shape, leaf.dtype) for leaf in leaves]
        blank_fields: dict[str, Array] = {n: np.zeros(f.shape, f.dtype) for n, f in zip(FIELDS, fields, strict=True)}

        def whole(taken: list[Array], seen: list[Array], memo: list[Array]) -> tuple:
            every = list(blank_leaves)
            for place, leaf in zip(takes, taken, strict=True):
                every[place] = leaf
            named = {**blank_fields, **dict(zip(reads, seen, strict=True))}
            return self._whole_step(every, [named[name] for name in FIELDS], memo)

        self._takes, self.view_reads = takes, tuple(reads)
        self.goal_reads = self._reads_of_goal(leaves, fields, memo)
        self._whole = jax.jit(whole)

    def _reads_of_goal(self, leaves: list[Array], fields: list[Array], memo: list[Array]) -> frozenset[str]:
        """Fields of the view on which the goal depends, but through what the step makes of the states."""
        if self.goal is None:
            return frozenset()
        if self.goal.queries:
            return frozenset(FIELDS)
        goal = self.goal

        def facts(leaves: list[Array], fields: list[Array], memo: list[Array]) -> Array:
            view = assemble(dict(zip(FIELDS, fields, strict=True)))
            relations, _ = self.plan.evaluate_changed(view, jax.tree.unflatten(self._memo_structure, memo))
            return goal.literals.facts(goal.context(jax.tree.unflatten(self.structure, leaves), view, relations))

        matters = inputs_that_matter(jax.make_jaxpr(facts)(leaves, fields, memo).jaxpr)
        return frozenset(name for name, used in zip(FIELDS, matters[len(leaves) :], strict=False) if used)

    def _whole_step(self, leaves: list[Array], fields: list[Array], memo: list[Array]) -> tuple:
        """`Found` as a plain tuple; notes which leaves of the states it makes."""
        states: ExtendedStates = jax.tree.unflatten(self.structure, leaves)
        view = assemble(dict(zip(FIELDS, fields, strict=True)))
        before: Memo = jax.tree.unflatten(self._memo_structure, memo)
        relations, after_memo = self.plan.evaluate_changed(view, before)
        after, swap, acts = events(self.model, states, view, relations)
        same = [jnp.all(a == b) for a, b in zip(leaves, jax.tree.leaves(after), strict=True) if a is not b]
        new = heat(self.model, after, acts, view.touching)
        facts, status = jnp.zeros((view.object_com.shape[0], 0), bool), None
        if self.goal is not None:
            facts = self.goal.literals.facts(self.goal.context(new, view, relations))
            status = _status_fields(self.goal.status_of(facts, new))
        cold = jnp.all(new.temperature == after.temperature) & jnp.all(new.max_temperature == after.max_temperature)
        flags = jnp.stack([jnp.all(jnp.array(same)), jnp.any(swap.mask), cold])
        made = jax.tree.leaves(new)
        self.gives = [i for i, (a, b) in enumerate(zip(leaves, made, strict=True)) if a is not b]
        cuts = (swap.mask, swap.pos, swap.quat) if swap.mask.shape[1] else None
        return [made[i] for i in self.gives], cuts, status, acts, facts, flags, jax.tree.leaves(after_memo)

    def _heat_step(
        self,
        temperature: Float[Array, "W O"],
        max_temperature: Float[Array, "W O"],
        sliced: Bool[Array, "W O"],
        acts: Bool[Array, "W O S"],
        facts: Bool[Array, "W I"],
    ) -> tuple[Float[Array, "W O"], Float[Array, "W O"], tuple[Array, Array, Array] | None]:
        states = dataclasses.replace(
            self._template, temperature=temperature, max_temperature=max_temperature, sliced=sliced
        )
        nothing = jnp.zeros((sliced.shape[0], sliced.shape[1], sliced.shape[1]), bool)
        new = heat(self.model, states, acts, nothing)
        status = None
        if self.goal is not None:
            status = _status_fields(self.goal.status_of(self.goal.literals.update_heat(facts, new), new))
        return new.temperature, new.max_temperature, status


def _copied(node: T) -> T:
    new = object.__new__(type(node))
    new.__dict__.update(node.__dict__)
    return new


def _status_fields(status: GoalStatus) -> tuple[Array, Array, Array]:
    return status.holds, status.fraction, status.literals


def _object_bodies(model: StateModel) -> slice | np.ndarray:
    """Bodies that states can depend on: those of objects, and those that carry pieces; not agents' own."""
    tables = model.tables
    bodies = np.union1d(np.flatnonzero(tables.body_object >= 0), tables.piece_body).astype(int)
    if len(bodies) and bodies[-1] - bodies[0] + 1 == len(bodies):
        return slice(int(bodies[0]), int(bodies[-1]) + 1)
    return bodies
