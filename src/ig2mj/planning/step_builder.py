"""`StepBuilder`: the steps that make the literals of a reading true in one world, with what they need first.

What shuts an object in is opened, a tap runs before a tool is soaked or a container filled, what holds a substance is
taken before it is poured, a tool is soaked before it scrubs, a knife is taken before it cuts, hands that are full put
something down. Steps that failed choose another tool, tap, container or support.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from ig2mj.planning.domain import SYMMETRIC, HeatSource
from ig2mj.planning.facts import Facts
from ig2mj.planning.step_order import GIVE_UP, LATER, ordered
from ig2mj.planning.steps import PLACE, Step
from ig2mj.planning.supplies import RECEIVED, Supply, part_in, supplies
from ig2mj.sampling.conditions import Condition

SUPPLIES = ("fill", "soak", "pour", "spray", "mix")
"""Primitives that bring a substance into or onto an object."""

FLAT = 1.2
"""Height of an object's box, as a share of its thickness, up to which it lies flat."""

CLEARED = 2
"""Failures of bringing a container out onto the floor after which it is left where it is."""


class StepBuilder:
    """Collects steps over a light symbolic state, which the steps change as they are added."""

    def __init__(
        self,
        facts: Facts,
        required: Sequence[Condition],
        missing: Sequence[Condition],
        failed: Mapping[Condition, int],
        begun: Condition | None = None,
        stuck: Collection[Condition] = (),
        failed_steps: Mapping[str, int] | None = None,
    ):
        """
        Args:
          required, missing, failed, begun, stuck, failed_steps: see `TaskPlan`, `TaskPlanner.plan`.
        """
        self._facts, self._domain, self._failed = facts, facts.domain, failed
        self._failed_steps = failed_steps or {}
        self._required, self._begun = required, begun
        self.steps: list[Step] = []
        self._held = list(facts.held)
        self._open: dict[str, bool] = {}
        self._on: dict[str, bool] = {}
        self._wet: set[str] = set()
        self._inside: dict[str, tuple[str, ...]] = {}
        for condition in ordered(missing, failed, self._held, self._tool, self._domain, begun, stuck, self._ajar):
            self._serves = condition
            self._make(condition)
        for condition in required:  # what the steps themselves made false
            self._serves = condition
            if condition.predicate == "open" and condition.arguments[0] in self._open:
                self._set_open(condition.arguments[0], condition.value)
            if condition.predicate == "toggled_on" and condition.arguments[0] in self._on:
                self._switch(condition.arguments[0], condition.value)

    def _add(self, primitive: str, *arguments: str, also: tuple[Condition, ...] = (), flat: bool = False) -> None:
        self.steps.append(Step(primitive, arguments, also, self._serves, flat))

    def _make(self, c: Condition) -> None:
        name = c.arguments[0]
        if c.predicate in PLACE:
            self._move(c)
        elif c.predicate == "open":
            self._set_open(name, c.value)
        elif c.predicate == "toggled_on":
            self._switch(name, c.value)
        elif c.predicate == "soaked":
            for part in self._parts(name, c):
                self._soak(part)
        elif c.predicate in RECEIVED:
            self._supply(c)
        elif c.predicate == "attached":
            self._attach(*c.arguments)
        elif c.predicate == "cooked":
            for part in self._parts(name, c):
                self._cook(part)
        elif c.predicate == "frozen":
            for part in self._parts(name, c):
                self._freeze(part)
        elif c.predicate == "sliced":
            knife = self._tool(c)
            self._reach(name)
            self._take(knife)
            self._add("slice", name, knife)
        else:
            tool = self._tool(c)
            for part in self._parts(name, c):
                self._reach(part)
            if c.predicate == "stained" and not self._soaked(tool):
                self._soak(tool)
            self._take(tool)
            for part in self._parts(name, c):
                self._add("scrub" if c.predicate == "stained" else "wipe", part, tool)

    def _parts(self, name: str, c: Condition) -> tuple[str, ...]:
        """The object of a condition, or of its halves, where it has been cut, those of which it is false."""
        if not self._facts.sliced(name):
            return (name,)
        own = {h: tuple(h if a == name else a for a in c.arguments) for h in self._domain.halves(name)}
        return tuple(h for h, arguments in own.items() if self._facts.holds(c.predicate, *arguments) != c.value)

    def _tool(self, c: Condition) -> str:
        """What cleans or cuts: one in a hand first, then a soaked one for stains, one that needs no switch, one that is
        not shut in; after failures the next."""
        knife = c.predicate == "sliced"
        tools = [t for t in (self._domain.knives if knife else self._domain.tools) if t != c.arguments[0]]
        if c.predicate == "stained":
            tools = [t for t in tools if self._domain.has(t, "soakable") or self._facts.holds("soaked", t)]
        named = {a for w in self._required for a in w.arguments}

        uses = {"sliced": "slice", "stained": "scrub", "dusty": "wipe"}[c.predicate]
        taps = self._domain.taps if c.predicate == "stained" else ()

        def rank(tool: str) -> tuple:
            return (
                self._failures(("grasp", tool), *(("soak", tool, tap) for tap in taps))
                + self._failures((uses, c.arguments[0], tool)) // 2,
                tool not in self._held,
                c.predicate == "stained" and not self._soaked(tool),
                self._domain.has(tool, "toggleable"),
                bool(self._shut_in(tool)),
                tool not in named,
                tools.index(tool),
            )

        return min(tools, key=rank)

    def _ajar(self, name: str) -> float:
        """Share of its range to which a door between rooms is open; 0 of anything else."""
        return self._facts.open_share(name) if self._domain.is_door(name) else 0.0

    def _failures(self, *steps: tuple[str, ...]) -> int:
        """How often steps have failed, each given by its primitive and arguments."""
        return sum(self._failed_steps.get(" ".join(step), 0) for step in steps)

    def _soaked(self, name: str) -> bool:
        return name in self._wet or self._facts.holds("soaked", name)

    def _is_open(self, name: str) -> bool:
        return self._open[name] if name in self._open else self._facts.holds("open", name)

    def _is_on(self, name: str) -> bool:
        return self._on[name] if name in self._on else self._facts.holds("toggled_on", name)

    def _shut_in(self, name: str) -> list[str]:
        """Closed containers around an object."""
        if name in self._held:
            return []
        around = self._inside[name] if name in self._inside else self._facts.containers(name)
        return [c for c in around if self._domain.opens(c) and not self._is_open(c)]

    def _reach(self, name: str) -> None:
        """Opens what shuts an object in."""
        for container in self._shut_in(name):
            self._set_open(container, True)

    def _set_open(self, name: str, value: bool) -> None:
        if self._is_open(name) == value:
            return
        self._free_hand()
        self._add("open" if value else "close", name)
        self._open[name] = value

    def _switch(self, name: str, value: bool, keep: str = "") -> None:
        if self._is_on(name) == value or not self._domain.has(name, "toggleable"):
            return
        self._reach(name)
        if name not in self._held:
            self._free_hand(keep)
        if name not in self._held or self._domain.hands == 1:
            self._free_hand()  # of a robot with one hand, which takes what it keeps, or switches, again
        self._add("toggle_on" if value else "toggle_off", name)
        self._on[name] = value

    def _free_hand(self, keep: str = "", hands: int = 1) -> None:
        """Puts down what is held longest, where fewer hands are free: what must not be on the floor, onto a support."""
        while self._domain.hands_taken(self._held) + hands > self._domain.hands:
            name = next((n for n in self._held if n != keep), "")
            if not name:
                return
            if (c := self._barred_floor(name)) is not None:
                serves, self._serves = self._serves, c
                self._away(name, c)
                self._serves = serves
                continue
            self._add("release", name)
            self._held.remove(name)

    def _barred_floor(self, name: str) -> Condition | None:
        """The condition of the reading that an object is not on the floor, which is true as long as a hand holds it;
        None: there is none, or it cannot be put elsewhere."""
        own = (w for w in self._required if (w.predicate, w.arguments[0], w.value) == ("on_floor", name, False))
        return next((w for w in own if self._domain.supports and self._failed.get(w, 0) < GIVE_UP), None)

    def _take(self, name: str) -> None:
        if name in self._held:
            return
        self._reach(name)
        if self._failures(("grasp", name)):
            self._clear_out(self._loose_container(name))
        self._free_hand(hands=self._domain.hands_for(name))
        self._add("grasp", name)
        self._held.append(name)
        self._inside[name] = ()

    def _loose_container(self, name: str) -> str:
        """What can be carried and an object is inside of; "" for nothing."""
        middle = self._facts.place(name)
        for other in self._domain.loose:
            low, high = self._facts.box(other)
            around = (low <= middle).all() and (middle <= high).all()
            if other != name and around and self._facts.holds("inside", name, other):
                return other
        return ""

    def _clear_out(self, container: str) -> None:
        """Puts a container that can be carried, or is held, onto open floor, where hands reach into it from all sides,
        if it is not on the floor yet; where this has failed, what is held onto the nearest support."""
        if not container or self._domain.fixed(container):
            return
        room = self._facts.room(container)
        if not self._domain.graspable(container) or self._facts.holds("on_floor", container, room):
            return
        if self._failures(("grasp", container), ("place_on_floor", container, room)) >= CLEARED:
            self._set_down(container)
            return
        self._take(container)
        self._put("place_on_floor", container, room)

    def _put(self, primitive: str, name: str, where: str, also: tuple[Condition, ...] = (), flat: bool = False) -> None:
        self._add(primitive, name, where, also=also, flat=flat)
        if name in self._held:
            self._held.remove(name)
        if primitive == "place_inside":
            self._inside[name] = (where, *(self._inside.get(where) or ()))

    def _soak(self, name: str) -> None:
        self._hold_below_tap("soak", name)
        self._wet.add(name)

    def _supply(self, c: Condition) -> None:
        """Brings a substance into or onto an object, once where several conditions ask for it."""
        name, substance = c.arguments
        for step in self.steps:
            if step.primitive in SUPPLIES and any(a.arguments == c.arguments for a in (*step.adds, step.serves) if a):
                return
        found = supplies(self._facts, c, self._required)

        def failures(s: Supply) -> int:
            if s.primitive in ("fill", "soak"):
                return self._failures((s.primitive, name, s.source), ("toggle_on", s.source))
            about = (s.source, name, substance) if s.primitive == "pour" else (name, s.source, substance)
            return self._failures(("grasp", s.source), (s.primitive, *about), ("fill", s.source, s.tap))

        if not found:
            return
        fewest = min(map(failures, found))
        chosen = next(s for s in found if failures(s) == fewest)
        if chosen.primitive in ("fill", "soak"):
            self._hold_below_tap(chosen.primitive, name)
            return
        if chosen.tap:
            self._hold_below_tap("fill", chosen.source)
        for part in chosen.inputs:
            self._supply(part_in(name, part))
        self._reach(name)
        self._set_down(name)
        self._take(chosen.source)
        if chosen.primitive == "pour":
            self._add("pour", chosen.source, name, substance, also=(c,))
        elif chosen.primitive == "mix":
            self._add("mix", name, chosen.source, substance, also=(c,))
        else:
            self._free_hand(chosen.source)
            self._add("spray", name, chosen.source, substance, also=(c,))

    def _attach(self, name: str, other: str) -> None:
        self._reach(other)
        self._set_down(other)
        self._take(name)
        self._add("attach", name, other)
        self._held.remove(name)

    def _set_down(self, name: str) -> None:
        """Puts what is held onto the nearest support, where something is done to it."""
        if name in self._held:
            near = min(self._domain.supports, key=self._far_from(name), default="")
            self._put(*(("place_on_top", name, near) if near else ("place_on_floor", name, self._facts.room(name))))

    def _far_from(self, name: str) -> Callable[[str], float]:
        return lambda other: float(np.linalg.norm(self._facts.place(other) - self._facts.place(name)))

    def _empty(self, name: str) -> None:
        """Takes loose things out of a container, and puts them onto the nearest support."""
        for thing in self._facts.things_in(name):
            if not self._domain.graspable(thing) or self._failures(("grasp", thing)) >= CLEARED:
                continue
            self._take(thing)
            self._set_down(thing)

    def _hold_below_tap(self, primitive: str, name: str) -> None:
        if primitive == "fill":
            self._empty(name)
        taps = self._domain.taps
        far = {t: float(np.linalg.norm(self._facts.place(t) - self._facts.place(name))) for t in taps}
        tap = min(taps, key=lambda t: (self._failures(("toggle_on", t), (primitive, name, t)), far[t]))
        self._switch(tap, True, keep=name)
        self._take(name)
        self._add(primitive, name, tap)

    def _cook(self, name: str) -> None:
        source = self._source("cook", name, self._domain.heaters(name))
        was_on = self._is_on(source.name) if source.needs_switch else True
        if source.acts_inside:
            self._put_in(name, source.name, source.needs_closed)
        if source.needs_switch:
            self._switch(source.name, True)
        if not source.acts_inside:
            self._take(name)
        self._add("cook", name, source.name)
        if not was_on:
            self._switch(source.name, False)

    def _freeze(self, name: str) -> None:
        source = self._source("freeze", name, self._domain.coolers(name))
        self._put_in(name, source.name, source.needs_closed)
        if source.needs_switch:
            self._switch(source.name, True)
        self._add("freeze", name, source.name)

    def _source(self, primitive: str, name: str, sources: Sequence[HeatSource]) -> HeatSource:
        """The source of heat or cold with which fewest steps have failed."""

        def failures(source: HeatSource) -> int:
            own = [(p, source.name) for p in ("open", "close", "toggle_on")]
            return self._failures(*own, ("place_inside", name, source.name), (primitive, name, source.name))

        return min(sources, key=failures)

    def _put_in(self, name: str, container: str, close: bool) -> None:
        """Puts an object into a container and shuts it."""
        if not self._facts.holds("inside", name, container) or name in self._held:
            self._reach(name)
            if self._domain.opens(container):
                self._set_open(container, True)
            self._take(name)
            self._put("place_inside", name, container)
        if close and self._domain.opens(container):
            self._set_open(container, False)

    def _move(self, c: Condition) -> None:
        """Makes a placement true, or false. Conditions on the same object are made true together."""
        mover = self._domain.mover(c)
        if c.value and c.predicate in SYMMETRIC and (count := self._failed.get(c, 0)):
            other = next((a for a in c.arguments if a != mover and not self._domain.fixed(a)), "")
            if other and count >= LATER and self._placed_otherwise(other, c):
                if c != self._begun or other in self._held:
                    self._elsewhere(other, c)
            elif other and count % 2:
                mover = other
        for name in self._parts(mover, c):
            if not c.value:
                if not self._moved(name):
                    self._away(name, c)
                continue
            rules = self._rules(mover, name, c)
            rule = rules[0]
            if any(s.primitive == PLACE[rule.predicate] and s.arguments == rule.arguments for s in self.steps):
                continue
            target = rule.arguments[1]
            self._reach(name)
            if rule.predicate == "inside" and self._domain.opens(target):
                self._set_open(target, True)
            elif rule.predicate != "on_floor" and rule.predicate != "on_top":
                self._reach(target)
            if rule.predicate == "in_contact_with":
                self._free_hand()
                self._put("push", name, target, rules[1:])
                continue
            if rule.predicate == "inside" and self._had_no_place("place_inside", target):
                self._clear_out(target)
            if rule.predicate == "on_top":
                self._lay_flat(target, c)
            crowding = self._crowding(rule, c)
            if crowding is not None:
                self._take(crowding.arguments[0])
            self._take(name)
            self._put(PLACE[rule.predicate], name, target, rules[1:])
            if crowding is not None:
                self._serves = crowding
                self._put(PLACE[crowding.predicate], crowding.arguments[0], target)
                self._serves = c

    def _placed_otherwise(self, name: str, c: Condition) -> list[Condition]:
        """Conditions of the reading on where an object is, but for one."""
        return [w for w in self._required if w.value and w.predicate in PLACE and w.arguments[0] == name and w != c]

    def _elsewhere(self, name: str, c: Condition, flat: bool = False) -> None:
        """Places the partner of a relation in another spot where all else holds of it: there may be no room next to
        the present one."""
        own = sorted(self._placed_otherwise(name, c), key=lambda w: list(PLACE).index(w.predicate))
        target = own[0].arguments[1]
        self._reach(target)
        self._take(name)
        self._put(PLACE[own[0].predicate], name, target, tuple(own[1:]), flat)

    def _lay_flat(self, name: str, c: Condition) -> None:
        """Lays what is to bear something on its flattest side, if it can be carried, does not lie so, and something
        has not stayed on it: where it is to be, or on the nearest support."""
        low, high = self._facts.box(name)
        if not self._domain.graspable(name) or high[2] - low[2] < FLAT * self._domain.thickness(name):
            return
        own = any(s.primitive in PLACE.values() and s.arguments[0] == name for s in self.steps)
        if own or not self._had_no_place("place_on_top", name):
            return
        if self._placed_otherwise(name, c):
            self._elsewhere(name, c, flat=True)
        elif near := min(self._domain.supports, key=self._far_from(name), default=""):
            self._take(name)
            self._put("place_on_top", name, near, flat=True)

    def _had_no_place(self, primitive: str, where: str) -> bool:
        """Whether something could not be placed somewhere."""
        return any(s.startswith(f"{primitive} ") and s.endswith(f" {where}") for s in self._failed_steps)

    def _crowding(self, rule: Condition, c: Condition) -> Condition | None:
        """After failures of a placement, one of the things that are there already: it is taken out first and put back
        last, so that the room is divided in another way. Needs two hands."""
        count = self._failed.get(c, 0)
        if c == self._begun or count < LATER or self._domain.hands < 2 or rule.predicate not in ("inside", "on_top"):
            return None
        if not self._failures((PLACE[rule.predicate], *rule.arguments)):  # it was not room that was lacking
            return None
        there = [
            w
            for w in self._required
            if (w.predicate, w.arguments[1:], w.value) == (rule.predicate, rule.arguments[1:], True)
            and w.arguments[0] != rule.arguments[0]
            and w.arguments[0] not in self._held
            and not self._domain.fixed(w.arguments[0])
            and self._true(w)
        ]
        return there[count % len(there)] if there else None

    def _rules(self, mover: str, name: str, c: Condition) -> tuple[Condition, ...]:
        """The conditions that the reading puts on an object, the rule first; `name` stands for the one that moves.

        Of relations to objects that are still to be moved nothing is asked yet.
        """
        moved = {s.arguments[0] for s in self.steps if s.primitive in PLACE.values()}
        later = {
            w.arguments[0] for w in self._required if w.value and w.predicate in PLACE and not self._true(w)
        } - moved
        found = [c] if c.arguments[0] == mover else [dataclasses.replace(c, arguments=(mover, c.arguments[0]))]
        for w in self._required:
            if w.predicate in PLACE and w.value and w.arguments[0] == mover and w != c and w.arguments[1] not in later:
                found.append(w)
        ordered = sorted(found, key=lambda w: list(PLACE).index(w.predicate))
        return tuple(dataclasses.replace(w, arguments=(name, *w.arguments[1:])) for w in ordered)

    def _true(self, c: Condition) -> bool:
        return self._facts.holds(c.predicate, *c.arguments) == c.value

    def _moved(self, name: str) -> bool:
        """Whether the plan places the object anyway, or will."""
        placed = any(s.primitive in PLACE.values() and s.arguments[0] == name for s in self.steps)
        return placed or any(
            w.predicate in PLACE and w.value and w.arguments[0] == name and not self._true(w) for w in self._required
        )

    def _away(self, name: str, c: Condition) -> None:
        """Takes an object away from where it must not be."""
        self._reach(name)
        self._take(name)
        gone, count = dataclasses.replace(c, arguments=(name, *c.arguments[1:])), self._failed.get(c, 0)
        supports = [s for s in self._domain.supports if s != c.arguments[1]]
        if supports and (c.predicate == "on_floor" or count % 2):
            near = sorted(supports, key=lambda s: float(np.linalg.norm(self._facts.place(s) - self._facts.place(name))))
            self._put("place_on_top", name, near[count // 2 % len(near)], (gone,))
        else:
            self._put("place_on_floor", name, self._facts.room(name), (gone,))
