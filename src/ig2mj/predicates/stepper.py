"""`StateStepper`: states and a goal stepped from the host, doing no more than the change of the world asks for.

`ig2mj.states.update` computes everything for all worlds in every step, which is right where thousands of worlds run on
a device. One world beside the native engine mostly lies still, and there even an operation on nothing costs
microseconds. So the work is cut up, with the same functions and bitwise the same results:

- the whole step, where the view or the states are others than those of the last step, or the last step changed more
  than temperatures. Relations come from a memo (`ig2mj.states.relations`).
- temperatures and what follows from them, where the view and the states are the very objects of the last step, and
  that step changed nothing else: then neither would this one.
- nothing, where that step did not change temperatures either.

Arrays that a step hands through are not given to XLA as results at all, which would copy them.

Axes: W worlds, O objects, S heat sources, I facts.
"""

from __future__ import annotations

import dataclasses
import os
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.predicates.compile import CompiledExpression, Verdict
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.relations import Memo, RelationPlan
from ig2mj.states.update import events, heat, queries
from ig2mj.states.world import ExtendedStates, Swap


def run_inline() -> None:
    """Makes JAX run small CPU programs in the calling thread, for the rest of the process.

    By default it hands them to another thread, which costs more than a step of the states takes. Has an effect only
    before JAX is first used; does nothing where the user has decided (JAX_CPU_ENABLE_ASYNC_DISPATCH).
    """
    if "JAX_CPU_ENABLE_ASYNC_DISPATCH" not in os.environ:
        jax.config.update("jax_cpu_enable_async_dispatch", False)


LOOK_EVERY = 30
"""Steps of temperatures between two looks whether they still change; a look costs microseconds."""


class Step(NamedTuple):
    """What a step gives: states, the teleports that slicing asks for (None: none), and the goal's verdict."""

    states: ExtendedStates
    swap: Swap | None
    verdict: Verdict | None


@struct.dataclass
class _Kept:
    """What the next step may go on with.

    Attributes:
      acts: source on object. facts: of the goal. flags: whether the step changed nothing but temperatures, whether it
      asks for teleports, and whether it changed no temperature. memo: of relations.
    """

    acts: Bool[Array, "W O S"]
    facts: Bool[Array, "W I"]
    flags: Bool[Array, "3"]
    memo: Memo


class StateProgram:
    """The two jitted functions of a scene; may serve any number of `StateStepper`s."""

    def __init__(self, model: StateModel, goal: CompiledExpression | None = None, num_worlds: int = 1):
        """Compiles nothing yet: that happens at the first step.

        Args:
          goal: evaluated at the end of every step.
        """
        self.model, self.goal, self.num_worlds = model, goal, num_worlds
        self.plan = RelationPlan.build(model, [*queries(model), *(goal.queries if goal else [])])
        self._template = initial_states(model, num_worlds)
        self.whole = jax.jit(self._whole_step)
        self.heat = jax.jit(self._heat_step)
        self.changed: list[int] = []  # leaves of the states that a whole step gives; known once it was traced

    def _whole_step(
        self, states: ExtendedStates, view: PhysicsView, memo: Memo
    ) -> tuple[list[Array], Swap | None, Verdict | None, _Kept]:
        relations, memo = self.plan.evaluate_changed(view, memo)
        after, swap, acts = events(self.model, states, view, relations)
        before = jax.tree.leaves(states)
        same = [jnp.all(a == b) for a, b in zip(before, jax.tree.leaves(after), strict=True) if a is not b]
        new = heat(self.model, after, acts, view.touching)
        facts = jnp.zeros((view.object_com.shape[0], 0), bool)
        if self.goal is not None:
            facts = self.goal.literals.facts(self.goal.context(new, view, relations))
        cuts = swap.mask.shape[1] > 0
        cold = jnp.all(new.temperature == after.temperature) & jnp.all(new.max_temperature == after.max_temperature)
        flags = jnp.stack([jnp.all(jnp.array(same)), jnp.any(swap.mask), cold])
        verdict = self.goal.verdict_of(facts, new) if self.goal else None
        leaves = jax.tree.leaves(new)
        self.changed = [i for i, (a, b) in enumerate(zip(before, leaves, strict=True)) if a is not b]
        found = [leaves[i] for i in self.changed]
        return found, swap if cuts else None, verdict, _Kept(acts=acts, facts=facts, flags=flags, memo=memo)

    def _heat_step(
        self,
        temperature: Float[Array, "W O"],
        max_temperature: Float[Array, "W O"],
        sliced: Bool[Array, "W O"],
        acts: Bool[Array, "W O S"],
        facts: Bool[Array, "W I"],
    ) -> tuple[Float[Array, "W O"], Float[Array, "W O"], Verdict | None]:
        states = dataclasses.replace(
            self._template, temperature=temperature, max_temperature=max_temperature, sliced=sliced
        )
        nothing = jnp.zeros((sliced.shape[0], sliced.shape[1], sliced.shape[1]), bool)
        new = heat(self.model, states, acts, nothing)
        verdict = None
        if self.goal is not None:
            verdict = self.goal.verdict_of(self.goal.literals.update_heat(facts, new), new)
        return new.temperature, new.max_temperature, verdict


class StateStepper:
    """Steps states beside an engine that hands out the same view while nothing moves (the native one)."""

    def __init__(self, program: StateProgram):
        """Begins with an empty memo."""
        self.program = program
        self._memo = program.plan.empty_memo(program.num_worlds)
        self._view: PhysicsView | None = None
        self._states: ExtendedStates | None = None
        self._kept: _Kept | None = None
        self._verdict: Verdict | None = None
        self._settled = False
        self._heat_steps = 0

    def step(self, states: ExtendedStates, view: PhysicsView) -> Step:
        """One control step: `view` is physics after it."""
        if view is self._view and states is self._states and self._kept is not None:
            if not self._settled:
                self._heat(states, self._kept)
            assert self._states is not None
            return Step(self._states, None, self._verdict)
        return self._everything(states, view)

    def _heat(self, states: ExtendedStates, kept: _Kept) -> None:
        warm, hottest, self._verdict = self.program.heat(
            states.temperature, states.max_temperature, states.sliced, kept.acts, kept.facts
        )
        if self._heat_steps % LOOK_EVERY == 0:
            before, after = jax.device_get(((states.temperature, states.max_temperature), (warm, hottest)))
            self._settled = all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
        self._heat_steps += 1
        self._states = dataclasses.replace(states, temperature=warm, max_temperature=hottest)

    def _everything(self, states: ExtendedStates, view: PhysicsView) -> Step:
        found, swap, verdict, kept = self.program.whole(states, view, self._memo)
        leaves, structure = jax.tree.flatten(states)
        for place, leaf in zip(self.program.changed, found, strict=True):
            leaves[place] = leaf
        new = jax.tree.unflatten(structure, leaves)
        quiet, swapped, self._settled = np.asarray(kept.flags).tolist()
        self._memo, self._view, self._states, self._verdict = kept.memo, view, new, verdict
        self._heat_steps = 0
        self._kept = kept if quiet and not self.program.model.options.contact_heat_rate else None
        return Step(new, swap if swapped else None, verdict)
