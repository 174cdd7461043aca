"""`SymbolicRung`: primitives as changes of states, by the samplers and setters of `ig2mj.sampling`.

It tests task plans and goals without motion: preconditions are checked, an object is placed where the sampler finds
room and everything comes to rest, and hands are names of what they hold. A held object stays where it is until it is
placed; what is in and on it goes along then.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Callable, Iterator, Sequence

import jax
import numpy as np

from ig2mj.engine.snapshot import Snapshot
from ig2mj.errors import AbilityError, StateError
from ig2mj.planning.domain import Domain, condition_of
from ig2mj.planning.facts import Facts
from ig2mj.planning.problem import start_of
from ig2mj.planning.steps import PRIMITIVES, Outcome, PlanningError, Step
from ig2mj.planning.supplies import ingredients, missing_parts
from ig2mj.predicates.logic import Atom
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.placement import Rejections
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import RowSampler
from ig2mj.sampling.substance_setters import brought, mixed
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.pool import Pool

WORK = 200
"""Units of a placement (`ig2mj.sampling.budget.Budget`)."""


@dataclasses.dataclass
class _SymbolicWorld:
    physics: Snapshot
    states: ExtendedStates
    held: list[str]
    step: Step | None = None
    count: int = 0


class SymbolicRung:
    """Primitives as changes of states, without motion, by the samplers and setters of `ig2mj.sampling`.

    Its methods: `ig2mj.planning.rung.Rung`.
    """

    name = "symbolic"

    def __init__(
        self,
        domain: Domain,
        sampler: RowSampler,
        starts: Sequence[tuple[Snapshot, ExtendedStates]],
        seed: int = 0,
        first: int = 0,
    ):
        """
        Args:
          sampler: of the scene; its world is used for all worlds in turn.
          starts: physics without, states with a world axis of 1, of each world.
          seed, first: of random streams: a stream belongs to (seed, first + world, number of the step).
        """
        self._domain, self._sampler, self._seed, self._first = domain, sampler, seed, first
        self._worlds = [_SymbolicWorld(p, jax.tree.map(np.asarray, s), []) for p, s in starts]

    @property
    def num_worlds(self) -> int:
        return len(self._worlds)

    def facts(self, world: int) -> Facts:
        own = self._worlds[world]
        self._sampler.query.load(own.physics)
        return Facts(self._domain, own.states, self._sampler.query.view, held=own.held)

    def begin(self, world: int, step: Step) -> None:
        self._worlds[world].step = self._domain.meant(step)

    def ended(self, world: int) -> str | None:
        return None

    def advance(self) -> dict[int, Outcome]:
        return {w: self._carry_out(w) for w, own in enumerate(self._worlds) if own.step is not None}

    def _carry_out(self, world: int) -> Outcome:
        own = self._worlds[world]
        step, own.step = own.step, None
        assert step is not None
        own.count += 1
        if lacking := self._lacking(step, self.facts(world), own.held):
            return Outcome("no_grasp", lacking)
        if step.primitive == "grasp":
            own.held.append(step.object)
        elif step.primitive == "release":
            own.held.remove(step.object)
        elif step.adds:
            if failure := self._make_true(world, own, step):
                return failure
            if step.primitive.startswith("place_") or step.primitive == "attach":
                own.held.remove(step.object)
        return Outcome()

    def lacking(self, world: int, step: Step) -> str:
        """What of a primitive's preconditions is false in a world, in words."""
        return self._lacking(step, self.facts(world), self._worlds[world].held)

    def state(self, world: int) -> tuple[Snapshot, ExtendedStates]:
        """Physics without, states with a world axis of 1, of a world now."""
        own = self._worlds[world]
        return own.physics, own.states

    def show(self, world: int) -> SceneQuery:
        """The sampler's world, in the state of a world."""
        self._sampler.query.load(self._worlds[world].physics)
        return self._sampler.query

    def hold(self, world: int, name: str) -> None:
        """From now on, the object counts as held."""
        self._worlds[world].held.append(name)

    def let_go(self, world: int, name: str, physics: Snapshot) -> None:
        """An object is no longer held; `physics`: of the world from now on."""
        self._worlds[world].held.remove(name)
        self.put(world, physics)

    def put(self, world: int, physics: Snapshot) -> None:
        """`physics`: of a world from now on."""
        self._worlds[world].physics = physics

    def make_true(self, world: int, step: Step, conditions: Sequence[Condition] | None = None) -> Outcome | None:
        """Changes a world so that what a step adds, or other conditions, hold; the failure, or None."""
        own = self._worlds[world]
        own.count += 1
        return self._make_true(world, own, step, conditions)

    def _lacking(self, step: Step, facts: Facts, held: Sequence[str]) -> str:
        """What of the primitive's preconditions is false, in words."""
        name, kind, last = step.object, step.primitive, step.arguments[-1]
        second = step.arguments[1] if len(step.arguments) > 1 else ""
        acting = second if kind in ("cook", "freeze") else ""  # it acts on what is shut in it
        about = second if kind in ("pour", "attach") else name
        around = facts.containers(about) if about not in held and kind not in ("navigate_to", "release") else ()
        shut = [c for c in around if c != acting and not facts.holds("open", c)]
        if kind == "grasp":
            if name in held:
                return f"a hand holds {name} already"
            if self._domain.hands_taken(held) >= self._domain.hands:
                return f"the hands are full: {', '.join(held)}"
            if self._domain.hands_taken((*held, name)) > self._domain.hands:
                return f"both hands are needed for {name}, and they hold {', '.join(held)}"
            if self._domain.fixed(name):
                return f"{name} is fixed"
        if kind in ("open", "close", "push", "spray") and self._domain.hands_taken(held) >= self._domain.hands:
            return f"the hands are full: {', '.join(held)}"
        if (kind.startswith("place_") or kind in ("release", "soak", "fill", "pour", "attach")) and name not in held:
            return f"no hand holds {name}"
        if kind in ("wipe", "scrub", "slice", "spray", "mix") and second not in held:
            return f"no hand holds {second}"
        if kind == "scrub" and not facts.holds("soaked", second):
            return f"{second} is not soaked"
        if kind in ("fill", "attach", "mix", *BRINGS) and (why := self._domain.impossible(step.adds[0])):
            return why
        if kind == "mix" and (parts := ingredients(facts, name, last)):
            return f"{name} lacks {parts} for {last}"
        if kind == "fill" and (things := facts.things_in(name)):
            return f"{', '.join(things)} {'are' if len(things) > 1 else 'is'} in {name}"
        if kind in BRINGS and not facts.holds("contains", tool := BRINGS[kind](step), last):
            return f"{tool} contains no {last}"
        if (
            kind in ("soak", "fill")
            and self._domain.has(second, "toggleable")
            and not facts.holds("toggled_on", second)
        ):
            return f"{second} is not toggled on"
        if kind == "place_inside" and self._domain.opens(second) and not facts.holds("open", second):
            return f"{second} is not open"
        if kind in ("cook", "freeze") and (why := self._not_acting(name, second, facts, held)):
            return why
        if shut:
            return f"{about} is shut in {', '.join(shut)}"
        return ""

    def _not_acting(self, name: str, source: str, facts: Facts, held: Sequence[str]) -> str:
        """Why a source of heat or cold does not act on an object."""
        rules = next(s for s in self._domain.sources if s.name == source)
        if rules.needs_switch and not facts.holds("toggled_on", source):
            return f"{source} is not toggled on"
        if rules.needs_closed and self._domain.opens(source) and facts.holds("open", source):
            return f"{source} is open"
        if rules.acts_inside:
            return "" if facts.holds("inside", name, source) else f"{name} is not inside {source}"
        return "" if name in held else f"no hand holds {name}"

    def _around(self, step: Step, facts: Facts, held: Sequence[str]) -> list[Condition]:
        """What is in or on the same thing already, which an object that is put there may push aside."""
        predicate = {"place_inside": "inside", "place_on_top": "on_top"}.get(step.primitive)
        if predicate is None:
            return []
        name, target = step.arguments
        (low, high), found = facts.box(target), []
        for other in self._domain.loose:
            middle = facts.place(other)
            if other not in (name, target, *held) and (low[:2] <= middle[:2]).all() and (middle[:2] <= high[:2]).all():
                found.append(Atom(predicate, (other, target)))
        return [condition_of(atom) for atom, holds in facts.truth(found).items() if holds]

    def _make_true(
        self, world: int, own: _SymbolicWorld, step: Step, conditions: Sequence[Condition] | None = None
    ) -> Outcome | None:
        """The failure, or None: the world is changed so that what the step adds holds."""
        if step.primitive in BRINGS and conditions is None:
            return self._bring(own, step)
        if step.primitive == "mix" and conditions is None:
            name, _, substance = step.arguments
            recipe = next(r for r in self._domain.recipes(substance) if not missing_parts(self.facts(world), name, r))
            own.states = mixed(self._domain.model, own.states, self._domain.index(name), recipe)
            return None
        rng = np.random.default_rng([self._seed, self._first + world, own.count])
        rejected: Rejections = collections.Counter()
        self._sampler.start_from(own.physics, own.states)
        try:
            facts, row = self.facts(world), None
            borne = facts.borne(step.object) if step.primitive in CARRIES else ()
            inside = tuple(atom for atom in borne if atom.predicate == "inside")
            around = self._around(step, facts, own.held)
            again = [step.object] if step.flat else ()
            required = list(step.adds if conditions is None else conditions)
            for along in dict.fromkeys((borne, inside)):  # at last without what is on it, which falls off
                also, carried = [*around, *map(condition_of, along)], [atom.arguments[0] for atom in along]
                row = row or self._sampler.sample(
                    required, rng, Budget(WORK), rejected, again=again, around=also, carried=carried
                )
        except (StateError, AbilityError) as e:
            return Outcome("not_true_after", str(e))
        if row is None:
            often = ", ".join(f"{reason} ({count})" for reason, count in rejected.most_common(2))
            return Outcome("not_true_after", often or "the sampler found nothing")
        own.physics, own.states = row.physics, row.states
        return None

    def _bring(self, own: _SymbolicWorld, step: Step) -> Outcome | None:
        """The failure, or None: what holds a substance has given as much as the step asks for."""
        model, index, tool = self._domain.model, self._domain.index, BRINGS[step.primitive](step)
        try:
            for wish in step.adds:
                name, substance = wish.arguments
                own.states = brought(model, own.states, index(tool), wish.predicate, index(name), substance)
        except StateError as e:
            return Outcome("not_true_after", str(e))
        return None


CARRIES = tuple(name for name in PRIMITIVES if name.startswith("place_"))
"""Primitives by which an object comes elsewhere, with what is in and on it."""

BRINGS: dict[str, Callable[[Step], str]] = {
    "pour": lambda step: step.arguments[0],
    "spray": lambda step: step.arguments[1],
}
"""Primitives that bring a substance somewhere -> what holds it."""


def symbolic_episodes(
    domain: Domain, scene: Scene, pool: Pool | None, numbers: Sequence[int], seed: int = 0
) -> Iterator[tuple[int, SymbolicRung]]:
    """Rungs of one world each, one after another, with the number of each episode.

    Args:
      scene: without robots. pool: start states; an episode without a row of its own is left out. None: the scene at
        rest. numbers: of the episodes. seed: see `SymbolicRung`.
    """
    sampler = make_sampler(scene)
    own = sampler.start
    for number in numbers:
        if pool is None or number < pool.size:
            yield number, SymbolicRung(domain, sampler, [own if pool is None else start_of(pool, number)], seed, number)


def start_facts(domain: Domain, scene: Scene, pool: Pool | None, row: int) -> Facts:
    """What holds in a start state. Raises PlanningError: there are fewer."""
    if pool is not None and row >= pool.size:
        raise PlanningError(f"start state {row} was asked for, and only {pool.size} could be sampled")
    (_, rung), *_ = symbolic_episodes(domain, scene, pool, [row])
    return rung.facts(0)
