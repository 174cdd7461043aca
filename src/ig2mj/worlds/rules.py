"""`Rules`: all of a control step that is not physics. Extended states, what slicing moves, and the goal.

    rules = Rules.of_scene(scene).with_goal("(cooked fish_0)")
    states, swap, status = rules.step(states, view)

Axis: W worlds.
"""

from __future__ import annotations

import functools
import weakref
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp

from ig2mj.engine.base import Write
from ig2mj.engine.view import PhysicsView
from ig2mj.predicates.compile import CompiledExpression, GoalStatus, compile_expression
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.logic import Expression
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.scene.scene import Scene
from ig2mj.states.added import added_states
from ig2mj.states.added_checks import AddedUpdates
from ig2mj.states.initial import initial_states, states_of_manifest
from ig2mj.states.model import DEFAULTS, StateModel
from ig2mj.states.options import StateOptions
from ig2mj.states.relations.plan import RelationPlan
from ig2mj.states.update import queries, update
from ig2mj.states.world import ExtendedStates, Swap

States = Any
"""`ExtendedStates`; None where only physics is stepped."""


KEPT_EXPRESSIONS = 256
"""Compiled expressions that a scene's rules keep: those asked for last."""


class Outcome(NamedTuple):
    """What the rules make of a control step: states, teleports that slicing asks for (None: none), the goal."""

    states: States
    swap: Swap | None
    status: GoalStatus


class Rules:
    """How the states of a scene go on, and what they start from. Constants only; any number of cores may share them.

    Attributes:
      model: constants of the states. initial: states of one world at its start. goal: None where there is none.
    """

    _of_scenes: ClassVar[weakref.WeakKeyDictionary] = weakref.WeakKeyDictionary()  # Scene -> {(options, added): Rules}

    def __init__(
        self, model: StateModel, goal: CompiledExpression | None = None, initial: ExtendedStates | None = None
    ):
        """Binds a goal to the states.

        Args:
          goal: evaluated at the end of every step.
          initial: of one world; None: everything at room temperature, dry, clean, switched off and whole.

        Raises:
          PluginError: a state of a plug-in is at fault (`AddedUpdates.of`).
        """
        self.model, self.goal = model, goal
        AddedUpdates.of(model)
        self.initial = initial if initial is not None else initial_states(model, 1)
        self._compiled: dict[tuple[Expression | str, bool], CompiledExpression] = {}

    @classmethod
    def of_scene(cls, scene: Scene, options: StateOptions = DEFAULTS) -> Rules:
        """The rules of a scene that starts with its manifest's states; asked again, the same object."""
        made = cls._of_scenes.setdefault(scene, {})
        key = options, tuple(map(id, added_states()))  # a model keeps its states, so that no id is used again
        if key not in made:
            model = StateModel.of_manifest(scene.tables, scene.manifest, options)
            bodies = {scene.model.body(b).name: b for b in range(scene.model.nbody)}
            made[key] = cls(model, initial=states_of_manifest(model, scene.manifest, bodies))
        return made[key]

    def with_goal(self, goal: CompiledExpression | Expression | str | None) -> Rules:
        """The same rules with a goal. Raises what `compile_expression` raises."""
        if goal is None:
            return self
        compiled = goal if isinstance(goal, CompiledExpression) else self.compiled(goal)
        return Rules(self.model, compiled, self.initial)

    def compiled(self, expression: Expression | str, strict: bool = False) -> CompiledExpression:
        """An expression compiled for this scene; asked again soon, the same object. Raises as `compile_expression`.

        Of a single world it is answered by programs that all expressions share (`ig2mj.predicates.host_queries`).
        """
        key = (expression, strict)
        found = self._compiled.pop(key, None)
        if found is None:
            found = compile_expression(self.model, expression, strict=strict, questions=HostQueries.of(self.model))
        self._compiled[key] = found  # the one used last stands last
        if len(self._compiled) > KEPT_EXPRESSIONS:
            del self._compiled[next(iter(self._compiled))]
        return found

    @functools.cached_property
    def plan(self) -> RelationPlan:
        """The relations between objects that a step needs."""
        return RelationPlan.build(self.model, [*queries(self.model), *(self.goal.queries if self.goal else [])])

    def step(self, states: ExtendedStates, view: PhysicsView) -> Outcome:
        """One control step of all worlds; `view` is physics after it. Pure."""
        with GC_PAUSED:
            relations = self.plan.evaluate(view)
            states, swap = update(self.model, states, view, relations)
            if self.goal is not None:
                status = self.goal.status(states, view, relations)
            else:
                status = GoalStatus.empty(view.object_com.shape[0])
        return Outcome(states, swap if len(self.model.swap_objects) else None, status)

    def teleports(self, swap: Swap, view: PhysicsView) -> Write:
        """What slicing asks of the engine. `view`: of the present physics."""
        objects = self.model.swap_objects
        pos, quat = jnp.asarray(view.object_pos), jnp.asarray(view.object_quat)
        mask = jnp.zeros(pos.shape[:2], bool)
        return Write(
            object_mask=mask.at[:, objects].set(swap.mask),
            object_pos=pos.at[:, objects].set(swap.pos),
            object_quat=quat.at[:, objects].set(swap.quat),
        )
