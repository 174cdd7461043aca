"""`StateStepper`: states and a goal stepped from the host, doing no more than the change of the world asks for.

`Rules.step` computes everything for all worlds in every step, which is right where thousands of worlds run on a device.
Worlds beside the native engine mostly lie still, and there even an operation on nothing costs microseconds. So the work
is cut up (`ig2mj.worlds.lazy.program`), with the same functions and bitwise the same results:

- the whole step, where the states are others than those of the last step, where the last step changed more than
  temperatures, or where the view differs in anything that a step depends on. Relations come from a memo
  (`ig2mj.states.relations.plan`).
- temperatures and what follows from them, where neither is so, or where what differs cannot matter
  (`ig2mj.worlds.lazy.relevance`): then this step would change nothing else either.
- nothing, where the last step did not change temperatures.

An agent that is awake makes a new view in every step. What states depend on is therefore compared, byte by byte, field
by field: not the agent's own bodies, and its fingers only near a button, its base and eye only where the goal asks
for them.

Axes: W worlds.
"""

from __future__ import annotations

import jax
import numpy as np

from ig2mj.engine.view import Array, PhysicsView, read_field
from ig2mj.predicates.compile import GoalStatus
from ig2mj.states.definitions import toggled_on
from ig2mj.states.world import ExtendedStates, Swap
from ig2mj.worlds.lazy.program import BODY_FIELDS, Found, StateProgram
from ig2mj.worlds.lazy.relevance import Relevance
from ig2mj.worlds.rules import Outcome, Rules

LOOK_EVERY = 30
"""Steps of temperatures between two looks whether they still change; a look costs microseconds."""


class StateStepper:
    """Steps states beside an engine that hands out the same arrays while nothing moves (the native one)."""

    def __init__(self, program: StateProgram):
        """Begins with an empty memo."""
        self.program = program
        self._no_status = GoalStatus.empty(program.num_worlds)
        self._memo = program.empty_memo()
        self._view: PhysicsView | None = None
        self._step: Outcome | None = None
        self._leaves: list[Array] = []
        self._kept: Found | None = None
        self._settled = False
        self._heat_steps = 0
        self._seen: list[Array] = []  # fields read, as last seen; and their bytes at the last whole step, once needed
        self._bytes: list[bytes | None] = []
        self._fingers_away = False
        self._relevance: Relevance | None = None

    @classmethod
    def of(cls, rules: Rules, num_worlds: int) -> StateStepper:
        """A stepper of its own over the compiled functions that the rules keep for everyone."""
        return cls(StateProgram.of(rules, num_worlds))

    def step(self, states: ExtendedStates, view: PhysicsView) -> Outcome:
        """`Rules.step`: one control step; `view` is physics after it."""
        last = self._step
        if last is None or states is not last.states:
            return self._everything(states, jax.tree.leaves(states), view)
        if self._kept is None or (view is not self._view and not self._says_the_same(view)):
            return self._everything(states, self._leaves, view)
        return last if self._settled else self._heat(last, self._kept)

    def _says_the_same(self, view: PhysicsView) -> bool:
        """Whether the view has all that a step depends on as it was at the last whole step."""
        rows, changed, relevance = self.program.rows, [], self._relevance
        assert relevance is not None, "there was a whole step"
        for k, name in enumerate(self.program.view_reads):
            now = read_field(view, name)
            seen = self._seen[k]
            if now is seen:
                continue
            if name == "agent.finger_pos" and self._fingers_away and self._away(view):
                continue
            if not isinstance(now, np.ndarray) or not isinstance(seen, np.ndarray):
                return False  # on a device: to fetch it would take as long as the step
            chosen = rows if name in BODY_FIELDS else slice(None)
            before = self._bytes[k]
            if before is None:
                before = self._bytes[k] = seen[:, chosen].tobytes()
            if now[:, chosen].tobytes() != before:
                if name in relevance.exact:
                    return False
                changed.append(name)
            else:
                self._seen[k] = now
        if changed and not relevance.same(view, changed):
            return False
        self._view = view
        return True

    def _away(self, view: PhysicsView) -> bool:
        return isinstance(view.agent.finger_pos, np.ndarray) and toggled_on.all_out_of_reach(self.program.model, view)

    def _heat(self, last: Outcome, kept: Found) -> Outcome:
        states = last.states
        warm, hottest, status = self.program.heat(
            states.temperature, states.max_temperature, states.sliced, kept.acts, kept.facts
        )
        if self._heat_steps % LOOK_EVERY == 0:
            before, after = jax.device_get(((states.temperature, states.max_temperature), (warm, hottest)))
            self._settled = all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
        self._heat_steps += 1
        states = self.program.with_leaves(states, self.program.heats, [warm, hottest])
        self._put(self.program.heats, [warm, hottest])
        self._step = Outcome(states, None, self._status(status))
        return self._step

    def _everything(self, states: ExtendedStates, leaves: list[Array], view: PhysicsView) -> Outcome:
        program = self.program
        found = program.whole(leaves, view, self._memo)
        self._leaves = leaves
        self._put(program.gives, found.leaves)
        new = program.with_leaves(states, program.gives, found.leaves)
        quiet, swapped, self._settled = np.asarray(found.flags).tolist()
        self._memo, self._view, self._heat_steps = found.memo, view, 0
        self._step = Outcome(new, None, self._status(found.status))
        self._kept = None
        if quiet and not program.model.options.contact_heat_rate:
            self._kept = found
            if self._relevance is None:
                self._relevance = Relevance(program.model, program.goal_reads)
            self._relevance.begin(new, view, program.view_reads)
            self._seen = [read_field(view, name) for name in program.view_reads]
            self._bytes = [None] * len(self._seen)
            self._fingers_away = "agent.finger_pos" in program.view_reads and self._away(view)
        return self._step._replace(swap=Swap(*found.swap)) if swapped and found.swap else self._step

    def _status(self, fields: tuple[Array, Array, Array] | None) -> GoalStatus:
        return self._no_status if fields is None else GoalStatus(*fields)

    def _put(self, places: list[int], leaves: list[Array]) -> None:
        for place, leaf in zip(places, leaves, strict=True):
            self._leaves[place] = leaf
