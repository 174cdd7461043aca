"""`StateProgram`: a scene's states and goal as compiled functions for stepping from the host.

The functions are those of `ig2mj.states.update`, cut in three: `events`, everything but temperatures; `rest`,
temperatures and the goal, which follow from them; and `heat`, some steps of the same where nothing that the goal reads
of the view changes. Each takes just the arrays on which its results depend, packed into a few vectors
(`ig2mj.worlds.lazy.packing`). What they take is also what has to be looked at to see whether anything can change at all
(`StateProgram.view_reads`).

Axes: W worlds, O objects, S heat sources, I facts.
"""

from __future__ import annotations

import dataclasses
import weakref
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import SCHEMA, Array, PhysicsView, assemble, read_fields
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.predicates.questions import COMPILED_FAST
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.relations.asked import PairByPair
from ig2mj.states.relations.plan import Memo, RelationPlan
from ig2mj.states.update import events, heat, queries
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.lazy.goal_rows import GoalRows
from ig2mj.worlds.lazy.packing import PackedFunction
from ig2mj.worlds.rules import Rules

T = TypeVar("T")

FIELDS = tuple(SCHEMA)

FIRST_MOVED = ("object_com", "touching", "joint_pos", "link_force")
"""Fields of the view that are looked at first: small, and among them is what changes when anything does."""

MANY = 24
"""Relations of a goal from which on the goal of one world is compiled fast rather than to be fast: about 8 s of
compilation are saved, and a step in which something moves that the goal names takes tenths of a millisecond more."""

AHEAD = 16
"""Steps of temperatures that one call may take at most, where nothing else is known to change: a step by itself takes a
few microseconds, a call 25, and four times that in turn with MuJoCo, which drives its code out of the caches."""

BODY_FIELDS = ("body_pos", "body_quat")


class Events(NamedTuple):
    """What `StateProgram.events` gives.

    Attributes:
      leaves: of the states, at the places `StateProgram.gives`. swap: mask, pos, quat; None where nothing can be cut.
      acts: source on object [W, O, S]. flags: whether nothing changed, and whether it asks for teleports.
      memo: of relations, flat.
    """

    leaves: list[Array]
    swap: tuple[Array, Array, Array] | None
    acts: Bool[Array, "W O S"]
    flags: Bool[Array, "2"]
    memo: list[Array]


class Rest(NamedTuple):
    """What `StateProgram.rest` gives.

    Attributes:
      leaves: of the states, at the places `StateProgram.heats`. status: the goal's fields; None without a goal.
      facts: of the goal [W, I]. same: whether no temperature has changed. memo: of the goal's relations, flat.
    """

    leaves: list[Array]
    status: tuple[Array, Array, Array] | None
    facts: Bool[Array, "W I"]
    same: Bool[Array, ""]
    memo: list[Array]


class Heat(NamedTuple):
    """What `StateProgram.heat` gives: steps of temperatures one after the other, on the host.

    Attributes:
      temperature, max_temperature: [K, W, O] after each step; of K rows only those asked for count. same: [K] whether
      the step changed neither. status: the goal's fields, [K, ...] each; None without a goal.
    """

    temperature: np.ndarray
    max_temperature: np.ndarray
    same: np.ndarray
    status: tuple[np.ndarray, np.ndarray, np.ndarray] | None


class _Traced(NamedTuple):
    """A compiled function of some of the states' leaves, fields of the view and other arrays, and which these are."""

    function: PackedFunction
    takes: list[int]
    reads: tuple[str, ...]
    others: list[int]
    structure: Any

    @classmethod
    def of(
        cls,
        step: Callable[..., Any],
        leaves: list[Array],
        view: PhysicsView,
        others: list[Array],
        options: dict[str, int | bool] | None = None,
    ) -> _Traced:
        """Of a function of all leaves, all fields and the others."""
        structures = []

        def flat(*every: Any) -> list[Any]:
            made, structure = jax.tree.flatten(step(*every))
            structures.append(structure)
            return made

        with GC_PAUSED:
            traced = jax.make_jaxpr(flat)(leaves, read_fields(view, FIELDS), others)
        function = PackedFunction(traced, step.__name__.strip("_"), options)
        first, last = len(leaves), len(leaves) + len(FIELDS)
        return cls(
            function,
            [i for i in function.takes if i < first],
            tuple(FIELDS[i - first] for i in function.takes if first <= i < last),
            [i - last for i in function.takes if i >= last],
            structures[0],
        )

    def __call__(self, leaves: list[Array], view: PhysicsView, others: list[Array]) -> Any:
        taken = [leaves[i] for i in self.takes] + read_fields(view, self.reads) + [others[i] for i in self.others]
        return jax.tree.unflatten(self.structure, self.function(taken))


class StateProgram:
    """The jitted functions of a scene's rules; may serve any number of steppers.

    Attributes:
      heats: places of temperatures among the states' leaves.
      gives: places of the leaves that `events` makes; the others it hands through. event_reads, goal_reads: fields of
      the view on which events depend, and the goal itself; view_reads: both; agent_reads, scene_reads: those of agents,
      and the others. All are known from the first step on.
      rows: bodies whose poses matter. goal_rows: what of its fields the goal can depend on.
    """

    _of_rules: ClassVar[weakref.WeakKeyDictionary] = weakref.WeakKeyDictionary()  # Rules -> {worlds: StateProgram}

    def __init__(self, model: StateModel, goal: CompiledExpression | None = None, num_worlds: int = 1):
        """Compiles nothing yet: that happens at the first step.

        Args:
          goal: evaluated at the end of every step.
        """
        self.model, self.goal, self.num_worlds = model, goal, num_worlds
        self.plan = RelationPlan.build(model, queries(model))
        asked = goal.queries if goal is not None else []
        self._many = num_worlds == 1 and len(set(asked)) > MANY and jax.default_backend() == "cpu"
        self.goal_plan = (PairByPair if self._many else RelationPlan).build(model, asked)
        template = initial_states(model, num_worlds)
        self._template = template
        named, self.structure = jax.tree_util.tree_flatten_with_path(template)
        self._paths = [tuple(key.name for key in path) for path, _ in named]
        self.heats = [self._paths.index((name,)) for name in ("temperature", "max_temperature")]
        self._empty_memo, self._memo_structure = jax.tree.flatten(self.plan.empty_memo(num_worlds))
        self._empty_goal_memo, self._goal_memo_structure = jax.tree.flatten(self.goal_plan.empty_memo(num_worlds))
        self.view_reads = self.scene_reads = self.agent_reads = tuple[str, ...]()
        self.event_reads: frozenset[str] = frozenset()
        self.goal_reads: frozenset[str] = frozenset()
        self.gives: list[int] = []
        self._events: _Traced | None = None
        self._rest: _Traced | None = None
        self._heat: _Traced | None = None
        self._facts: _Traced | None = None
        self.rows, self.goal_rows = _object_bodies(model), GoalRows(model, goal)

    @classmethod
    def of(cls, rules: Rules, num_worlds: int) -> StateProgram:
        """The program of these rules; asked again, the same object, so that it is compiled once."""
        made = cls._of_rules.setdefault(rules, {})
        if num_worlds not in made:
            made[num_worlds] = cls(rules.model, rules.goal, num_worlds)
        return made[num_worlds]

    def empty_memos(self) -> tuple[list[Array], list[Array]]:
        """Memos of `events` and of `rest` that know nothing yet, flat."""
        return self._empty_memo, self._empty_goal_memo

    def events(self, leaves: list[Array], view: PhysicsView, memo: list[Array]) -> Events:
        """One step of everything but temperatures and the goal.

        Args:
          leaves: all leaves of the states. memo: the last step's.
        """
        if self._events is None:
            self._events = _Traced.of(self._events_step, leaves, view, memo)
            self.event_reads = frozenset(self._events.reads)
        return Events(*self._events(leaves, view, memo))

    def lasting_facts(self, leaves: list[Array], view: PhysicsView) -> Bool[Array, "W I"]:
        """Facts of the goal that follow from the states, but from no temperature; a program of its own, so that
        `events` is the same program whatever the goal is."""
        if self._facts is None:
            self._facts = _Traced.of(self._facts_step, leaves, view, [])
        return self._facts(leaves, view, [])

    def rest(
        self,
        leaves: list[Array],
        acts: Bool[Array, "W O S"],
        facts: Bool[Array, "W I"],
        view: PhysicsView,
        memo: list[Array],
    ) -> Rest:
        """One step of temperatures, and the goal after it.

        Args:
          leaves: all leaves of the states, those of `events` among them. acts: of `events`. facts: `lasting_facts`; or
            those of the last call, where none of the states has changed since that they follow from. memo: the last
            call's.
        """
        others = [acts, facts, *memo]
        if self._rest is None:
            options = COMPILED_FAST if self._many else None
            self._rest = _Traced.of(self._rest_step, leaves, view, others, options)
            self.goal_reads = frozenset(self._rest.reads)
            every = self.event_reads | self.goal_reads
            self.view_reads = tuple(sorted(every, key=lambda name: (name not in FIRST_MOVED, FIELDS.index(name))))
            self.scene_reads = tuple(name for name in self.view_reads if not name.startswith("agent."))
            self.agent_reads = tuple(name for name in self.view_reads if name.startswith("agent."))
        return Rest(*self._rest(leaves, view, others))

    def heat(self, leaves: list[Array], acts: Array, facts: Array, view: PhysicsView, count: int) -> Heat:
        """The next `count` steps (at most `AHEAD`) of temperatures and of the goal, in which nothing else changes."""
        others: list[Array] = [acts, facts, np.array(count, np.int32)]
        if self._heat is None:
            self._heat = _Traced.of(self._heat_steps, leaves, view, others)
        return Heat(*self._heat(leaves, view, others))

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

    def _events_step(self, leaves: list[Array], fields: list[Array], memo: list[Array]) -> tuple:
        """`Events` as a plain tuple; notes which leaves of the states it makes."""
        states: ExtendedStates = jax.tree.unflatten(self.structure, leaves)
        view = assemble(dict(zip(FIELDS, fields, strict=True)))
        before: Memo = jax.tree.unflatten(self._memo_structure, memo)
        relations, after_memo = self.plan.evaluate_changed(view, before)
        after, swap, acts = events(self.model, states, view, relations)
        made = jax.tree.leaves(after)
        self.gives = [i for i, (a, b) in enumerate(zip(leaves, made, strict=True)) if a is not b]
        same = [jnp.all(leaves[i] == made[i]) for i in self.gives]
        flags = jnp.stack([jnp.all(jnp.array(same)), jnp.any(swap.mask)])
        cuts = (swap.mask, swap.pos, swap.quat) if swap.mask.shape[1] else None
        return [made[i] for i in self.gives], cuts, acts, flags, jax.tree.leaves(after_memo)

    def _facts_step(self, leaves: list[Array], fields: list[Array], others: list[Array]) -> Array:
        states: ExtendedStates = jax.tree.unflatten(self.structure, leaves)
        if self.goal is None:
            return jnp.zeros((self.num_worlds, 0), bool)
        return self.goal.literals.lasting_facts(states)

    def _rest_step(self, leaves: list[Array], fields: list[Array], others: list[Array]) -> tuple:
        """`Rest` as a plain tuple."""
        acts, facts, *memo = others
        states: ExtendedStates = jax.tree.unflatten(self.structure, leaves)
        view = assemble(dict(zip(FIELDS, fields, strict=True)))
        new = heat(self.model, states, acts, view.touching)
        status, after_memo = None, ()
        if self.goal is not None:
            before: Memo = jax.tree.unflatten(self._goal_memo_structure, memo)
            relations, after_memo = self.goal_plan.evaluate_changed(view, before)
            facts = self.goal.literals.facts(self.goal.context(new, view, relations), lasting=facts)
            status = _status_fields(self.goal.status_of(facts, new))
        pairs = ((states.temperature, new.temperature), (states.max_temperature, new.max_temperature))
        same = jnp.all(jnp.stack([jnp.all(a == b) for a, b in pairs]))
        return [new.temperature, new.max_temperature], status, facts, same, jax.tree.leaves(after_memo)

    def _heat_steps(self, leaves: list[Array], fields: list[Array], others: list[Array]) -> tuple:
        """`Heat` as a plain tuple."""
        states: ExtendedStates = jax.tree.unflatten(self.structure, leaves)
        acts, facts, count = others
        sliced = states.sliced
        nothing = jnp.zeros((sliced.shape[0], sliced.shape[1], sliced.shape[1]), bool)

        def step(before: tuple[Array, Array]) -> tuple:
            now = dataclasses.replace(self._template, temperature=before[0], max_temperature=before[1], sliced=sliced)
            new = heat(self.model, now, acts, nothing)
            same = jnp.all(before[0] == new.temperature) & jnp.all(before[1] == new.max_temperature)
            status = None
            if self.goal is not None:
                status = _status_fields(self.goal.status_of(self.goal.literals.update_heat(facts, new), new))
            return new.temperature, new.max_temperature, same, status

        def turn(k: Int[Array, ""], carried: tuple) -> tuple:
            now, rows = carried
            made = step(now)
            return made[:2], jax.tree.map(lambda row, value: row.at[k].set(value), rows, made)

        start = jnp.asarray(states.temperature), jnp.asarray(states.max_temperature)
        shapes = jax.eval_shape(step, start)
        rows = jax.tree.map(lambda leaf: jnp.zeros((AHEAD, *leaf.shape), leaf.dtype), shapes)
        return jax.lax.fori_loop(0, count, turn, (start, rows))[1]


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
