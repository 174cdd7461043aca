"""`IncrementalRules`: `Rules.step` without the work that cannot change anything.

It is one optimisation layer with one switch, the native engine's option `incremental`. With `incremental=False` each
control step runs MuJoCo and `Rules.step` in full. Results are the same to the bit
(`tests/worlds/test_incremental_is_the_plain_path.py`).

The core calls `IncrementalRules.of(rules, engine).step(states, view) -> Outcome` where it calls `rules.step` on other
engines, with the states and the view of each control step. Seven facts decide what runs:

- All of a step is a pure function of the states and the view. Where both are those of the last step and the last step
  changed no state, its outcome is returned.
- The first part of a step (`states.update.events`) reads no temperature. Where the view is that of the last step, which
  changed nothing but temperatures, only the second part (`states.update.heat`) runs.
- Where something has moved, two small programs take the place of the first part: `states.update.idle` says whether it
  would change anything, `states.update.sources` which heat sources act. Each is called only where a field that it reads
  has changed. While sources act on the same objects, temperatures go on as before.
- While nothing moves that contents and coats depend on, those that rested in the last step rest, and only ig2mj's own
  states are asked.
- Where the last step changed nothing but temperatures, contents of containers and coats, and ig2mj's own states are
  idle, one small program (`states.substances.flow_step`) takes the place of the first part. While nothing moves that
  these depend on, it computes several steps at a time.
- A goal is evaluated where something that it reads has changed (`ig2mj.worlds.incremental_goal`).
- The native engine marks views between which nothing but agents moved (`engine.view.but_agents`). Such a view counts as
  the same, unless the states or the goal read what differs. Fingers count as the same while all are out of reach of all
  buttons.

Updates of added states are traced (`ig2mj.states.added_checks`). Where one reads temperatures in the first part, or
changes other states in the second, every step is a whole one. Where one of the first part reads another added state of
the second, a whole step follows each change of that.

Axes: W worlds, O objects, S heat sources, K streams.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Shaped

from ig2mj.engine.base import Engine
from ig2mj.engine.native.execution import HostFunction
from ig2mj.engine.view import Array, PhysicsView, but_agents, read_field
from ig2mj.states.added_checks import AddedUpdates
from ig2mj.states.definitions import heat_source, toggled_on
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import RelationPlan
from ig2mj.states.spec import StateSpec
from ig2mj.states.substances import flow_step
from ig2mj.states.substances.flow_reads import Reach, reach
from ig2mj.states.update import can_be_idle, events, heat, heat_fields, heat_parts, idle, own_idle, queries, sources
from ig2mj.states.world import ExtendedStates, Swap, with_fields
from ig2mj.worlds.incremental_goal import AHEAD, GoalPrograms, IncrementalGoal, TemperatureSteps
from ig2mj.worlds.rules import Outcome, Rules

FINGERS = "agent.finger_pos"

FLOW_FIELDS = frozenset(flow_step.FIELDS)
"""What a step of contents and coats changes."""

SCENES = 8
"""Scenes whose programs are kept: those stepped last."""


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
        self._programs = _StatePrograms.of(rules.model, num_worlds)
        self._goal = IncrementalGoal(GoalPrograms.of(rules.goal, num_worlds))
        self._last: Outcome | None = None
        self._leaves: list[Array] = []  # of the last step's states
        self._acts: Array | None = None  # source on object [W, O, S] then; None: the next step is a whole one
        self._settled = False  # the last step changed no state
        self._ahead: TemperatureSteps | None = None  # the next steps of temperatures, of which `_ahead_over` are over
        self._ahead_over = 0
        self._view: PhysicsView | None = None
        self._fingers_away: bool | None = None  # in `_view`; None: not looked at
        self._flows = False  # the last step changed contents or coats, and else nothing but temperatures
        self._flow_ahead: FlowSteps | None = None  # steps of contents, of which `_flow_over` are over
        self._flow_over = 0
        self._stands = False  # nothing has moved since the last step

    @classmethod
    def of(cls, rules: Rules, engine: Engine) -> IncrementalRules:
        """Those of an engine's worlds, with the engine's switch."""
        return cls(rules, engine.num_worlds, getattr(engine, "incremental", True))

    def step(self, states: ExtendedStates, view: PhysicsView) -> Outcome:
        """`Rules.step`: one control step; `view` is physics after it."""
        last = self._last
        if not self._enabled or last is None or self._acts is None or states is not last.states:
            return self._whole_step(states, jax.tree.leaves(states), view)
        self._stands, before = True, self._view
        if view is not self._view and not self._is_same(view) and not self._is_idle(view):
            return self._whole_step(states, self._leaves, view)
        flowed: frozenset[str] = frozenset()
        new: dict[str, Array] = {}
        if self._flows:
            made = self._flow_step(before, view)
            if made is None:
                return self._whole_step(states, self._leaves, view)
            if self._flows:
                flowed = FLOW_FIELDS
                for name, place, leaf in zip(flow_step.FIELDS, self._programs.flow_places, made, strict=True):
                    self._leaves[place] = new[name] = leaf
                if self._settled:
                    states = with_fields(states, new)
                if not self._programs.heat_takes.isdisjoint(flowed):
                    self._settled, self._ahead = False, None
        if self._settled:
            if flowed:
                self._last = Outcome(states, None, self._goal.after_change(view, self._leaves, flowed))
                return self._last
            if self._goal.goes_on(view):
                return last
            status = self._goal.evaluate(view, self._leaves)
        else:
            if self._ahead is None or self._ahead_over == AHEAD:
                self._ahead, self._ahead_over = self._programs.heat(self._leaves, self._acts, view), 0
            ahead, k = self._ahead, self._ahead_over
            self._ahead_over += 1
            which = ahead.changed[k]
            self._settled = not which
            changed = list[str]()
            for i in which:
                name = self._programs.heat_names[i]
                changed.append(name)
                self._leaves[self._programs.heat_places[i]] = new[name] = ahead.made[i][:, k]
            states = self._programs.changed(states, new, self._leaves)
            if not self._programs.late_reads.isdisjoint(changed):
                self._acts = None  # the next step is a whole one
            if flowed:
                status = self._goal.after_change(view, self._leaves, flowed | set(changed))
            else:
                status = self._goal.after_heat(view, self._leaves, ahead, k, changed)
        self._last = Outcome(states, None, status)
        return self._last

    def _flow_step(self, before: PhysicsView | None, view: PhysicsView) -> list[Array] | None:
        """The leaves that contents and coats are after this step, and notes whether it changes any; None: it is a whole
        one. `before`: the view of the last step."""
        ahead, stands = self._flow_ahead, self._stands
        if not stands and ahead is not None and before is not None:
            stands = not flow_step.depend_on_moves(self._programs.model, before, view, ahead.streams)
        if not stands or ahead is None or self._flow_over >= ahead.steps:
            ahead = self._programs.flow(self._leaves, view, flow_step.AHEAD if stands else 1)
            self._flow_ahead, self._flow_over = ahead, 0
        k = self._flow_over
        if k >= ahead.complete:
            return None
        self._flow_over, self._flows = k + 1, bool(ahead.changes[k])
        return [steps[k] for steps in ahead.made]

    def _whole_step(self, states: ExtendedStates, leaves: list[Array], view: PhysicsView) -> Outcome:
        done = self._programs.step(leaves, view)
        self._view, self._fingers_away, self._ahead, self._leaves = view, None, None, done.leaves
        self._flows, self._flow_ahead = done.flows, None
        self._acts, self._settled = done.acts if done.quiet or done.flows else None, done.settled
        after = jax.tree.unflatten(self._programs.structure, done.leaves)
        self._last = Outcome(after, None, self._goal.evaluate(view, done.leaves))
        return self._last._replace(swap=done.swap)

    def _is_same(self, view: PhysicsView) -> bool:
        """Whether the view is that of the last step in all that the states read."""
        scene = but_agents(view)
        if scene is None or self._view is None or scene is not but_agents(self._view):
            return False
        reads = self._programs.agent_reads
        if reads and (self._programs.fingers_matter or reads != {FINGERS} or not self._are_fingers_away(view)):
            return False
        self._view = view
        return True

    def _is_idle(self, view: PhysicsView) -> bool:
        """Whether nothing but temperatures changes in this step; notes which sources act in it."""
        programs, before, own = self._programs, self._view, self._flows
        if not programs.tells_idle or before is None:
            return False
        if not own and programs.can_flow:  # what rested goes on so while nothing moves that it depends on
            own = not flow_step.depend_on_moves(programs.model, before, view, None)
        fingers, others = programs.idle_reads(self._leaves, view, own)
        same = _are_equal(view, before, others) and (not fingers or self._are_fingers_away(view))
        if not same and not programs.idle(self._leaves, view, own):
            return False
        self._stands = False
        acts = programs.acts(self._leaves, view)
        if acts is not self._acts and not np.array_equal(acts, np.asarray(self._acts)):
            self._settled, self._ahead = False, None
        self._acts, self._view = acts, view
        if not same:
            self._fingers_away = None
        return True

    def _are_fingers_away(self, view: PhysicsView) -> bool:
        """Whether no finger is anywhere near a button, neither in the last step's view nor in this one."""
        model = self._programs.model
        if self._fingers_away is None:
            assert self._view is not None
            self._fingers_away = toggled_on.all_out_of_reach(model, self._view)
        return self._fingers_away and toggled_on.all_out_of_reach(model, view)


def _are_equal(one: PhysicsView, other: PhysicsView, names: Iterable[str]) -> bool:
    """Whether fields of two views are the same; what is on a device is not compared."""
    for name in names:
        a, b = read_field(one, name), read_field(other, name)
        if a is not b and not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and a.tobytes() == b.tobytes()):
            return False
    return True


class FlowSteps(NamedTuple):
    """Steps of contents and coats, as long as nothing moves.

    Attributes:
      made: leaves of the states that these are, after each step. steps: how many were asked for. complete: how many are
        those of a whole step. changes: whether each changes something. streams: where these are.
    """

    made: list[Shaped[Array, "N W ..."]]
    steps: int
    complete: int
    changes: list[int]
    streams: Reach


class _Step(NamedTuple):
    """What a whole step of the states gives.

    Attributes:
      leaves: of the states after it. swap: teleports that slicing asks for; None where there are none. acts: source on
      object [W, O, S]. quiet: nothing but temperatures has changed. flows: contents or coats have, too, and nothing
      else. settled: nothing has changed, but contents and coats where these flow.
    """

    leaves: list[Array]
    swap: Swap | None
    acts: Array
    quiet: bool
    flows: bool
    settled: bool


class _StatePrograms:
    """The compiled steps of a scene's states. They return only the arrays that a step can change.

    Attributes:
      structure: of the states, as a pytree. heat_places, heat_names: of the leaves that the second part changes, their
        places among the states' and the names of their fields. flow_places: places of
        `flow_step.FIELDS`. fingers_matter: also where they are out of reach of buttons. tells_idle: `idle` is of use.
        late_reads: fields that the second part changes and the first reads. can_flow: there are steps of contents alone
        (`flow_step.possible`).
    """

    def __init__(self, model: StateModel, num_worlds: int):
        self.model, self._plan = model, RelationPlan.build(model, queries(model))
        named, self.structure = jax.tree_util.tree_flatten_with_path(initial_states(model, num_worlds))
        names = [path[0].name for path, _ in named]
        self.heat_places = [
            place for place, name in enumerate(names) if name in heat_fields(model) and named[place][1].size
        ]
        self.heat_names = [names[place] for place in self.heat_places]
        self._are_arrays = all(len(named[place][0]) == 1 for place in self.heat_places)
        self.fingers_matter = FINGERS in AddedUpdates.of(model).reads
        added = AddedUpdates.of(model)
        self.late_reads = added.late
        self.tells_idle = can_be_idle(model) and not added.heat_reads_view and not self.fingers_matter
        self._step, self._heat = HostFunction(self._rules_fn), HostFunction(self._heat_fn)
        self._idle, self._acts = HostFunction(self._idle_fn), HostFunction(self._acts_fn)
        self._own_idle, self._flow = HostFunction(self._own_idle_fn), HostFunction(self._flow_fn)
        self.flow_places = [names.index(name) for name in flow_step.FIELDS] if set(names) >= FLOW_FIELDS else []
        self._names, self.can_flow = names, flow_step.possible(model)
        self._with_count = jax.tree.structure((0, [0] * len(names), 0))
        self._none_act = np.zeros((num_worlds, model.tables.num_objects, len(model.parameters.heat_object)), bool)
        self._of_view_and_states = jax.tree.structure((0, [0] * len(names)))
        self._with_acts = jax.tree.structure((0, [0] * len(names), 0))
        self._idle_reads: dict[bool, tuple[bool, list[str]]] = {}  # known once they were traced
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

    def step(self, leaves: list[Array], view: PhysicsView) -> _Step:
        """The whole of `states.update.update`."""
        made, swap, acts, flags = self._step.flat([view, *leaves], self._of_view_and_states)
        leaves = list(leaves)
        for place, leaf in zip(self._changed, made, strict=True):
            leaves[place] = leaf
        quiet, flows, settled, swapped = flags.tolist()
        flows = flows and not quiet and self.can_flow
        return _Step(leaves, Swap(*swap) if swapped else None, acts, quiet, flows, settled and (quiet or flows))

    def idle_reads(self, leaves: list[Array], view: PhysicsView, own: bool) -> tuple[bool, list[str]]:
        """Whether the answer of `idle` depends on fingers, and on which other fields of the view."""
        if own not in self._idle_reads:
            function = self._own_idle if own else self._idle
            reads = function.traced([view, *leaves], self._of_view_and_states)
            self._idle_reads[own] = FINGERS in reads, sorted(reads - {FINGERS})
        return self._idle_reads[own]

    def idle(self, leaves: list[Array], view: PhysicsView, own: bool) -> bool:
        """Whether the first part of `update` changes nothing. `own`: of ig2mj's own states."""
        function = self._own_idle if own else self._idle
        return bool(function.flat([view, *leaves], self._of_view_and_states))

    def flow(self, leaves: list[Array], view: PhysicsView, steps: int) -> FlowSteps:
        """The next steps of contents and coats."""
        made, flags, starts = self._flow.flat([view, *leaves, np.int32(steps)], self._with_count)
        count, *changes = flags.tolist()
        return FlowSteps(made, steps, count, changes, reach(np.asarray(starts)))

    def changed(self, states: ExtendedStates, fields: dict[str, Array], leaves: list[Array]) -> ExtendedStates:
        """The states with new values of some fields. `leaves`: all of them."""
        return with_fields(states, fields) if self._are_arrays else jax.tree.unflatten(self.structure, leaves)

    @functools.cached_property
    def heat_takes(self) -> frozenset[str]:
        """Fields of states on which temperatures depend; known after the first call of `heat`."""
        return frozenset(self._names[i - 1] for i in self._heat.takes if 1 <= i <= len(self._names))

    def acts(self, leaves: list[Array], view: PhysicsView) -> Bool[np.ndarray, "W O S"]:
        """Which source acts on what."""
        if heat_source.all_out_of_reach(self.model, view):
            return self._none_act
        return self._acts.flat([view, *leaves], self._of_view_and_states)

    def heat(self, leaves: list[Array], acts: Array, view: PhysicsView) -> TemperatureSteps:
        """The second part of `update` in each of the next steps."""
        made, same = self._heat.flat([view, *leaves, acts], self._with_acts)
        return TemperatureSteps(made, [_not_in(tuple(row)) for row in same.tolist()])

    def _rules_fn(self, view: PhysicsView, before: list[Array]) -> tuple[Any, ...]:
        states = jax.tree.unflatten(self.structure, before)
        after, swap, acts = events(self.model, states, view, self._plan.evaluate(view))
        new = heat(self.model, after, acts, view)
        quiet, same = _are_same(states, after), _are_same(after, new)
        flows = _are_same(states, after, FLOW_FIELDS) & ~jnp.any(swap.mask)
        made = jax.tree.leaves(new)
        self._changed = [i for i, leaf in enumerate(made) if leaf is not before[i]]
        flags = jnp.stack([quiet, flows, same, jnp.any(swap.mask)])
        return [made[i] for i in self._changed], (swap.mask, swap.pos, swap.quat), acts, flags

    def _idle_fn(self, view: PhysicsView, leaves: list[Array]) -> Array:
        return idle(self.model, jax.tree.unflatten(self.structure, leaves), view, self._plan.evaluate(view))

    def _own_idle_fn(self, view: PhysicsView, leaves: list[Array]) -> Array:
        return own_idle(self.model, jax.tree.unflatten(self.structure, leaves), view, self._plan.evaluate(view))

    def _flow_fn(self, view: PhysicsView, leaves: list[Array], steps: Array) -> tuple[list[Array], Array, Array]:
        states = jax.tree.unflatten(self.structure, leaves)
        done = flow_step.flowed(self.model, states, view, self._plan.evaluate(view), jnp.asarray(steps))
        flags = jnp.concatenate([done.count[None], done.changes.astype(jnp.int32)])
        return list(done.made), flags, done.starts

    def _acts_fn(self, view: PhysicsView, leaves: list[Array]) -> Array:
        return sources(self.model, jax.tree.unflatten(self.structure, leaves), view, self._plan.evaluate(view))

    def _heat_fn(self, view: PhysicsView, leaves: list[Array], acts: Array) -> tuple[list[Any], Array]:
        changing, follow = heat_parts(self.model)
        late = {name for spec in follow for name in spec.fields}
        is_late = [name in late for name in self.heat_names]
        first = [place for place, last in zip(self.heat_places, is_late, strict=True) if not last]
        then = [place for place, last in zip(self.heat_places, is_late, strict=True) if last]

        def updated(values: list[Array], places: list[int], specs: Sequence[StateSpec], of: list[int]) -> list[Array]:
            every = list(leaves)
            for place, leaf in zip(places, values, strict=True):
                every[place] = leaf
            new = jax.tree.leaves(heat(self.model, jax.tree.unflatten(self.structure, every), acts, view, specs))
            return [new[place] for place in of]

        def step(before: list[Array], _: None) -> tuple[list[Array], list[Array]]:
            after = updated(before, first, changing, first)
            return after, after

        def changes(made: Array, place: int) -> Bool[Array, "N"]:
            before = jnp.concatenate([jnp.asarray(leaves[place])[None], made[:-1]])
            return jnp.any(made != before, axis=tuple(range(1, made.ndim)))

        start: list[Array] = [jnp.asarray(leaves[place]) for place in first]
        made = jax.lax.scan(step, start, None, AHEAD)[1]
        if then:  # of all steps at once
            made = [*made, *jax.vmap(lambda values: updated(values, first, follow, then))(made)]
        of_place = dict(zip((*first, *then), made, strict=True))
        found = [of_place[place] for place in self.heat_places]
        same = ~jnp.stack([changes(steps, place) for steps, place in zip(found, self.heat_places, strict=True)], axis=1)
        return [jnp.moveaxis(steps, 0, 1) for steps in found], same


def _are_same(one: ExtendedStates, other: ExtendedStates, but: Iterable[str] = ()) -> Bool[Array, ""]:
    """Whether all numbers of two states are equal, `but` those of some fields; arrays that are one object are not
    compared."""
    leaves = zip(jax.tree_util.tree_leaves_with_path(one), jax.tree.leaves(other), strict=True)
    compared = [(a, b) for (path, a), b in leaves if a is not b and path[0].name not in but]
    return jnp.all(jnp.array([True, *(jnp.all(a == b) for a, b in compared)]))


@functools.lru_cache(maxsize=256)
def _not_in(flags: tuple[bool, ...]) -> tuple[int, ...]:
    """Places of flags that are not set."""
    return tuple(i for i, flag in enumerate(flags) if not flag)


def _is_of_agents(field: str) -> bool:
    return field.startswith("agent.")
