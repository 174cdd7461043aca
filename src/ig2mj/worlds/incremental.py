"""`IncrementalRules`: `Rules.step` without the work that cannot change anything.

It is one optimisation layer with one switch, the native engine's option `incremental`. With `incremental=False` each
control step runs MuJoCo and `Rules.step` in full. Results are the same to the bit
(`tests/worlds/test_incremental_is_the_plain_path.py`).

The core calls `IncrementalRules.of(rules, engine).step(states, view) -> Outcome` where it calls `rules.step` on other
engines, with the states and the view of each control step. Three facts decide what runs:

- All of a step is a pure function of the states and the view. Where both are those of the last step and the last step
  changed no state, its outcome is returned.
- The first part of a step (`states.update.events`) reads no temperature. Where the view is that of the last whole step,
  which changed nothing but temperatures, only the second part (`states.update.heat`) runs, and the goal where it
  depends on what that changed.
- The native engine marks views between which nothing but agents moved (`engine.view.but_agents`). Such a view counts as
  the same, unless the states or the goal read what differs. Fingers count as the same while all are out of reach of all
  buttons.

Updates of plug-ins' states are traced (`ig2mj.states.added_checks`). Where one reads temperatures in the first part, or
changes other states in the second, every step is a whole one.

Axes: W worlds, O objects, S heat sources, L literals.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.base import Engine
from ig2mj.engine.native.execution import HostFunction
from ig2mj.engine.view import Array, PhysicsView, but_agents
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.registry import find
from ig2mj.states.added_checks import AddedUpdates
from ig2mj.states.definitions import toggled_on
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import RelationPlan
from ig2mj.states.update import events, heat, heat_fields, queries
from ig2mj.states.world import ExtendedStates, Swap
from ig2mj.worlds.rules import Outcome, Rules

FINGERS = "agent.finger_pos"

MANY = 24
"""Relations of a goal from which on one world asks the host's questions."""

AHEAD = 16
"""Steps of temperatures that one call computes: a call takes 40 us, and what it computes hardly counts. Steps that
something overtakes are discarded."""

SCENES = 8
"""Scenes, and goals, whose programs are kept: those stepped last."""


def rules_step(rules: Rules, engine: Engine) -> Callable[[ExtendedStates, PhysicsView], Outcome]:
    """What steps the rules next to an engine: incrementally where its views tell what changed, else `Rules.step`."""
    return IncrementalRules.of(rules, engine).step if engine.tracks_changes else rules.step


class IncrementalRules:
    """The rules of one batch of worlds, with what is known of its last step."""

    def __init__(self, rules: Rules, num_worlds: int, enabled: bool = True):
        """Compiles nothing: that happens at the first step. Rules of the same states share programs.

        Args:
          enabled: the switch; False: each step is a whole one.
        """
        self._enabled = enabled and not AddedUpdates.of(rules.model).whole
        self._programs, self._goal = _StatePrograms.of(rules.model, num_worlds), _Goal.of(rules.goal, num_worlds)
        self._last: Outcome | None = None
        self._acts: Array | None = None  # of the last whole step; None: the next step is a whole one
        self._settled = False  # the last step changed no state
        self._ahead: Iterator[_Heat] = iter(())  # the next steps of temperatures
        self._view: PhysicsView | None = None
        self._fingers_away: bool | None = None  # in `_view`; None: not looked at

    @classmethod
    def of(cls, rules: Rules, engine: Engine) -> IncrementalRules:
        """Those of an engine's worlds, with the engine's switch."""
        return cls(rules, engine.num_worlds, getattr(engine, "incremental", True))

    def step(self, states: ExtendedStates, view: PhysicsView) -> Outcome:
        """`Rules.step`: one control step; `view` is physics after it."""
        last = self._last
        if (
            not self._enabled
            or last is None
            or self._acts is None
            or states is not last.states
            or not self._is_same(view)
        ):
            return self._whole_step(states, view)
        if self._settled:
            return last
        after = next(self._ahead, None)
        if after is None:
            self._ahead = self._programs.heat(states, self._acts, view)
            after = next(self._ahead)
        fields, changed = after
        states, self._settled = states.replace(**fields), not changed
        status = last.status if self._goal.heat_reads.isdisjoint(changed) else self._goal(view, states)
        self._last = Outcome(states, None, status)
        return self._last

    def _whole_step(self, states: ExtendedStates, view: PhysicsView) -> Outcome:
        done = self._programs.step(states, view)
        self._view, self._fingers_away, self._ahead = view, None, iter(())
        self._acts, self._settled = done.acts if done.quiet else None, done.settled
        self._last = Outcome(done.states, None, self._goal(view, done.states))
        return self._last._replace(swap=done.swap)

    def _is_same(self, view: PhysicsView) -> bool:
        """Whether the view is that of the last step in all that a step reads."""
        if view is self._view:
            return True
        scene = but_agents(view)
        if scene is None or self._view is None or scene is not but_agents(self._view):
            return False
        if self._goal.reads_agents or not self._programs.agent_reads <= {FINGERS}:
            return False
        if self._programs.agent_reads:
            model = self._programs.model
            if self._programs.fingers_matter:
                return False
            if self._fingers_away is None:
                self._fingers_away = toggled_on.all_out_of_reach(model, self._view)
            if not self._fingers_away or not toggled_on.all_out_of_reach(model, view):
                return False
        self._view = view
        return True


_Heat = tuple[dict[str, Array], list[str]]
"""A step of temperatures: fields of the states after it, and the names of those that it changed."""


class _Step(NamedTuple):
    """What a whole step of the states gives.

    Attributes:
      states: after it. swap: teleports that slicing asks for; None where there are none. acts: source on object
        [W, O, S]. quiet: nothing but temperatures has changed. settled: nothing has.
    """

    states: ExtendedStates
    swap: Swap | None
    acts: Array
    quiet: bool
    settled: bool


class _StatePrograms:
    """The compiled steps of a scene's states. They return only the arrays that a step can change."""

    def __init__(self, model: StateModel, num_worlds: int):
        self.model, self._plan = model, RelationPlan.build(model, queries(model))
        self._heat_fields = heat_fields(model)
        self.fingers_matter = FINGERS in AddedUpdates.of(model).reads  # also where they are out of reach of buttons
        self._step, self._heat = HostFunction(self._rules_fn), HostFunction(self._heat_fn)
        self._changed: list[int] = []  # leaves of the states that a step can change; known once it was traced

    @staticmethod
    @functools.lru_cache(maxsize=SCENES)
    def of(model: StateModel, num_worlds: int) -> _StatePrograms:
        """Those of a scene; asked again, the same object."""
        return _StatePrograms(model, num_worlds)

    @functools.cached_property
    def agent_reads(self) -> frozenset[str]:
        """Fields of agents that a step reads; known after the first step."""
        return frozenset(filter(_is_of_agents, self._step.reads | self._heat.reads))

    def step(self, states: ExtendedStates, view: PhysicsView) -> _Step:
        """The whole of `states.update.update`."""
        made, swap, acts, flags = self._step(view, states)
        leaves, structure = jax.tree.flatten(states)
        for place, leaf in zip(self._changed, made, strict=True):
            leaves[place] = leaf
        quiet, settled, swapped = np.asarray(flags).tolist()
        return _Step(jax.tree.unflatten(structure, leaves), Swap(*swap) if swapped else None, acts, quiet, settled)

    def heat(self, states: ExtendedStates, acts: Array, view: PhysicsView) -> Iterator[_Heat]:
        """The second part of `update` in each of the next steps, as long as nothing else changes: its fields of the
        states, and the names of those that it changed."""
        made, same = self._heat(view, states, acts)
        for k, kept in enumerate(same.tolist()):
            changed = [name for name, is_same in zip(self._heat_fields, kept, strict=True) if not is_same]
            yield {name: _row(steps, k) for name, steps in zip(self._heat_fields, made, strict=True)}, changed

    def _rules_fn(self, view: PhysicsView, states: ExtendedStates) -> tuple[Any, ...]:
        after, swap, acts = events(self.model, states, view, self._plan.evaluate(view))
        new = heat(self.model, after, acts, view)
        quiet, same = _are_same(states, after), _are_same(after, new)
        before, made = jax.tree.leaves(states), jax.tree.leaves(new)
        self._changed = [i for i, leaf in enumerate(made) if leaf is not before[i]]
        flags = jnp.stack([quiet, quiet & same, jnp.any(swap.mask)])
        return [made[i] for i in self._changed], (swap.mask, swap.pos, swap.quat), acts, flags

    def _heat_fn(self, view: PhysicsView, states: ExtendedStates, acts: Array) -> tuple[list[Any], Array]:
        names = self._heat_fields

        def step(before: list[Any], _: None) -> tuple[list[Any], tuple[list[Any], Array]]:
            now = states.replace(**dict(zip(names, before, strict=True)))
            new = heat(self.model, now, acts, view)
            after = [getattr(new, name) for name in names]
            same = jnp.stack([_are_same(a, b) for a, b in zip(before, after, strict=True)])
            return after, (after, same)

        start = [jax.tree.map(jnp.asarray, getattr(states, name)) for name in names]
        return jax.lax.scan(step, start, None, AHEAD)[1]


def _row(tree: Any, k: int) -> Any:
    """One step of a field, which is an array or a pytree of arrays."""
    return tree[k] if isinstance(tree, np.ndarray | jax.Array) else jax.tree.map(lambda leaf: leaf[k], tree)


def _are_same(one: Any, other: Any) -> Bool[Array, ""]:
    """Whether all numbers of two pytrees are equal; arrays that are one object are not compared."""
    leaves = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return jnp.all(jnp.array([True, *(jnp.all(a == b) for a, b in leaves if a is not b)]))


def _is_of_agents(field: str) -> bool:
    return field.startswith("agent.")


class _Goal:
    """The status of a goal, compiled.

    One world with a goal of many relations asks the host's questions, whose programs the goals of a scene share: a
    program of the goal's own would take seconds to compile.
    """

    def __init__(self, goal: CompiledExpression | None, num_worlds: int):
        self._goal, self._none = goal, GoalStatus.empty(num_worlds)
        self._questions: HostQueries | None = None
        if goal is not None and num_worlds == 1 and len(set(goal.queries)) > MANY:
            self._questions = HostQueries.of(goal.model)
        self._status = HostFunction(self._status_fn)

    @staticmethod
    @functools.lru_cache(maxsize=SCENES)
    def of(goal: CompiledExpression | None, num_worlds: int) -> _Goal:
        """That of a goal; asked again, the same object."""
        return _Goal(goal, num_worlds)

    def __call__(self, view: PhysicsView, states: ExtendedStates) -> GoalStatus:
        if self._goal is None:
            return self._none
        if self._questions is not None:
            return self._goal.status_of(self._questions.facts(self._goal.literals, states, view), states)
        return GoalStatus(*self._status(view, states))

    @functools.cached_property
    def reads_agents(self) -> bool:
        """Whether it depends on agents; known after the first call."""
        if self._questions is None or self._goal is None:
            return any(map(_is_of_agents, self._status.reads))
        reads = (self._questions.reads(find(name)) for name in self._goal.literals.instances)
        return any(name.startswith("view.agent.") for names in reads for name in names)

    @functools.cached_property
    def heat_reads(self) -> frozenset[str]:
        """Fields that `heat` changes on which it depends; known after the first call."""
        if self._goal is None:
            return frozenset()
        if self._questions is not None:
            reads = (self._questions.reads(find(name)) for name in self._goal.literals.instances)
            read = {name.split(".")[1] for names in reads for name in names if name.startswith("states.")}
            return frozenset(heat_fields(self._goal.model)).intersection(read)
        paths, _ = jax.tree_util.tree_flatten_with_path(initial_states(self._goal.model, 1))
        names = [path[0].name for path, _ in paths]  # leaf 0 of the arguments is the view
        return frozenset(names[leaf - 1] for leaf in self._status.takes).intersection(heat_fields(self._goal.model))

    def _status_fn(self, view: PhysicsView, states: ExtendedStates) -> tuple[Array, Array, Array]:
        assert self._goal is not None
        status = self._goal.status(states, view)
        return status.holds, status.fraction, status.literals
