"""`StateStepper`: states and a goal stepped from the host, doing no more than the change of the world asks for.

`Rules.step` computes everything for all worlds in every step, which is right where thousands of worlds run on a device.
Worlds beside the native engine mostly lie still, and there even an operation on nothing costs microseconds. So the work
is cut up (`ig2mj.worlds.lazy.program`), with the same functions and bitwise the same results:

- the whole step, where the states are others than those of the last step, where the last step changed more than
  temperatures, or where the view differs in anything that can matter to them (`ig2mj.worlds.lazy.relevance`). Relations
  come from a memo (`ig2mj.states.relations.plan`).
- temperatures and the goal, where only what the goal itself reads of the view differs: then this step would change
  nothing else.
- temperatures and what follows from them, where that does not differ either. Then some steps are computed in one call,
  one at first and twice as many each time, and those that something overtakes are thrown away.
- nothing, where the last step did not change temperatures.

An agent that is awake makes a new view in every step. Where the engine says that nothing else moved (`but_agents`) only
its fingers and hands, base and eye are looked at, and those only where a switch is near or the goal asks for them.
Otherwise what states depend on is compared, byte by byte, field by field, without the agent's own bodies.

Axes: W worlds.
"""

from __future__ import annotations

import enum

import jax
import numpy as np

from ig2mj.engine.view import Array, PhysicsView, but_agents, read_field, read_fields
from ig2mj.predicates.compile import GoalStatus
from ig2mj.states.definitions import toggled_on
from ig2mj.states.world import ExtendedStates, Swap
from ig2mj.worlds.lazy.program import AHEAD, BODY_FIELDS, Heat, StateProgram
from ig2mj.worlds.lazy.relevance import EXACT, Relevance
from ig2mj.worlds.rules import Outcome, Rules


class News(enum.Enum):
    """What of a view can matter that was not so at the last whole step."""

    NONE = enum.auto()
    GOAL = enum.auto()  # to the goal, and not to the states
    EVENTS = enum.auto()


Differences = tuple[bool, dict[str, bytes]]
"""Whether the goal can depend on what differs, and fields that differ of those on which the states depend."""


class StateStepper:
    """Steps states beside an engine that hands out the same arrays while nothing moves (the native one)."""

    def __init__(self, program: StateProgram):
        """Begins with empty memos."""
        self.program = program
        self._no_status = GoalStatus.empty(program.num_worlds)
        self._memo, self._goal_memo = program.empty_memos()
        self._view: PhysicsView | None = None
        self._step: Outcome | None = None
        self._leaves: list[Array] = []
        self._acts: Array | None = None  # which source acts on what; None where there must be a whole step next
        self._whole_facts = self._facts = np.zeros((program.num_worlds, 0), bool)  # of the last whole step; now
        self._whole_status: GoalStatus | None = None  # of `_whole_facts` and the temperatures as they are now
        self._settled = False
        self._ahead: Heat | None = None  # steps computed before they are due, how many, and how many of them are over
        self._ahead_count, self._ahead_over = 0, 0
        self._seen: dict[str, Array] = {}  # fields read, as last seen; their bytes at the last whole step, once needed
        self._bytes: dict[str, bytes] = {}
        self._scene: object | None = None  # what stands for the last view but for its agents
        self._of_scene: Differences = False, {}
        self._fingers_away = False
        self._relevance: Relevance | None = None
        self._without_effect: dict[str, bytes] = {}  # the changed fields of the last view that did not matter

    @classmethod
    def of(cls, rules: Rules, num_worlds: int) -> StateStepper:
        """A stepper of its own over the compiled functions that the rules keep for everyone."""
        return cls(StateProgram.of(rules, num_worlds))

    def step(self, states: ExtendedStates, view: PhysicsView) -> Outcome:
        """`Rules.step`: one control step; `view` is physics after it."""
        last = self._step
        if last is None or states is not last.states:
            return self._everything(states, jax.tree.leaves(states), view)
        if self._acts is None:
            return self._everything(states, self._leaves, view)
        if view is not self._view and not self._nothing_read_moved(view):
            news = self._news(view)
            if news is News.EVENTS:
                return self._everything(states, self._leaves, view)
            self._view = view
            if news is News.GOAL:
                return self._temperatures_and_goal(last.states, self._acts, view)
            if self._facts is not self._whole_facts:  # all is again as it was then
                self._facts = self._whole_facts
                if self._settled and self._whole_status is not None:
                    self._step = Outcome(last.states, None, self._whole_status)
                    return self._step
                return self._heat(last, self._acts, view)
        return last if self._settled else self._heat(last, self._acts, view)

    def _news(self, view: PhysicsView) -> News:
        """What differs from the last whole step, of all that a step depends on."""
        program, relevance, scene = self.program, self._relevance, but_agents(view)
        assert relevance is not None, "there was a whole step"
        if scene is None or scene is not self._scene:
            found = self._differences(view, program.scene_reads)
            if found is None:
                return News.EVENTS
            self._scene, self._of_scene = scene, found
        to_goal, changed = self._of_scene
        if program.agent_reads:
            found = self._differences(view, program.agent_reads)
            if found is None:
                return News.EVENTS
            to_goal, changed = to_goal or found[0], changed | found[1]
        if changed and changed != self._without_effect:
            if not relevance.same(view, changed):
                return News.EVENTS
            self._without_effect = changed
        return News.GOAL if to_goal else News.NONE

    def _nothing_read_moved(self, view: PhysicsView) -> bool:
        """Whether only agents moved since the last view, of which nothing is read."""
        return not self.program.agent_reads and self._scene is not None and but_agents(view) is self._scene

    def _differences(self, view: PhysicsView, names: tuple[str, ...]) -> Differences | None:
        """What of these fields is not as it was at the last whole step; None where a whole step must follow."""
        program, changed, to_goal = self.program, dict[str, bytes](), False
        for name in names:
            now, seen = read_field(view, name), self._seen[name]
            if now is seen:
                continue
            if name == "agent.finger_pos" and self._fingers_away and self._away(view):
                continue
            if not isinstance(now, np.ndarray) or not isinstance(seen, np.ndarray):
                return None  # on a device: to fetch it would take as long as the step
            chosen = program.rows if name in BODY_FIELDS else slice(None)
            before = self._bytes.get(name)
            if before is None:
                before = self._bytes[name] = seen[:, chosen].tobytes()
            data = now[:, chosen].tobytes()
            if data == before:
                self._seen[name] = now
                continue
            if name in program.goal_reads and not to_goal:
                to_goal = not program.goal_rows.same(name, now, seen)
            if name in program.event_reads:
                if name in EXACT:
                    return None
                changed[name] = data
        return to_goal, changed

    def _away(self, view: PhysicsView) -> bool:
        return isinstance(view.agent.finger_pos, np.ndarray) and toggled_on.all_out_of_reach(self.program.model, view)

    def _heat(self, last: Outcome, acts: Array, view: PhysicsView) -> Outcome:
        program, states = self.program, last.states
        if self._ahead is None or self._ahead_over == self._ahead_count:
            self._ahead_count = min(AHEAD, 1 if self._ahead is None else 2 * self._ahead_count)
            self._ahead, self._ahead_over = program.heat(self._leaves, acts, self._facts, view, self._ahead_count), 0
        ahead, k = self._ahead, self._ahead_over
        self._ahead_over += 1
        self._settled = bool(ahead.same[k])
        made: list[Array] = [ahead.temperature[k], ahead.max_temperature[k]]
        states = program.with_leaves(states, program.heats, made)
        self._put(program.heats, made)
        status = None if ahead.status is None else tuple(field[k] for field in ahead.status)
        self._step = Outcome(states, None, self._status(status))
        self._whole_status = self._step.status
        return self._step

    def _temperatures_and_goal(self, states: ExtendedStates, acts: Array, view: PhysicsView) -> Outcome:
        program = self.program
        rest = program.rest(self._leaves, acts, self._facts, view, self._goal_memo)
        self._goal_memo, self._facts, self._ahead = rest.memo, rest.facts, None
        if not self._settled:
            self._whole_status = None
            states = program.with_leaves(states, program.heats, rest.leaves)
            self._put(program.heats, rest.leaves)
        self._step = Outcome(states, None, self._status(rest.status))
        return self._step

    def _everything(self, states: ExtendedStates, leaves: list[Array], view: PhysicsView) -> Outcome:
        program = self.program
        events = program.events(leaves, view, self._memo)
        self._leaves, self._memo = leaves, events.memo
        self._put(program.gives, events.leaves)
        facts = program.lasting_facts(leaves, view)
        rest = program.rest(leaves, events.acts, facts, view, self._goal_memo)
        self._put(program.heats, rest.leaves)
        self._goal_memo, self._whole_facts = rest.memo, rest.facts
        self._facts = self._whole_facts
        self._whole_status = self._status(rest.status)
        new = program.with_leaves(states, [*program.gives, *program.heats], [*events.leaves, *rest.leaves])
        quiet, swapped = np.asarray(events.flags).tolist()
        self._view, self._ahead = view, None
        self._step = Outcome(new, None, self._whole_status)
        self._acts = None
        if quiet and not program.model.options.contact_heat_rate:
            self._acts, self._settled = events.acts, bool(np.asarray(rest.same))
            if self._relevance is None:
                self._relevance = Relevance(program.model)
            self._relevance.begin(new, view, program.event_reads)
            self._without_effect = {}
            self._seen = dict(zip(program.view_reads, read_fields(view, program.view_reads), strict=True))
            self._bytes, self._scene, self._of_scene = {}, but_agents(view), (False, {})
            fingers = "agent.finger_pos" in program.view_reads and "agent.finger_pos" not in program.goal_reads
            self._fingers_away = fingers and self._away(view)
        return self._step._replace(swap=Swap(*events.swap)) if swapped and events.swap else self._step

    def _status(self, fields: tuple[Array, Array, Array] | None) -> GoalStatus:
        return self._no_status if fields is None else GoalStatus(*fields)

    def _put(self, places: list[int], leaves: list[Array]) -> None:
        for place, leaf in zip(places, leaves, strict=True):
            self._leaves[place] = leaf
