"""`expert_of`: the expert of an environment, a scripted one or the planner.

    expert = expert_of(env)
    state = env.step(state, expert(state))

A scripted expert is pure: it may be part of a compiled program, and asked in any state (`ig2mj.tasks.experts`). The
planner (`ig2mj.envs.planned_expert`) has a memory, and is shown every state in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import jax
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment
from ig2mj.envs.planned_expert import PlannedExpert, is_planned
from ig2mj.errors import UnknownNameError
from ig2mj.process import entry_point
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.experts import Expert
from ig2mj.tasks.experts.sight import Belief
from ig2mj.tasks.model_choices import VariedObjective
from ig2mj.tasks.task import Task


def has_script(env: Environment) -> bool:
    """Whether a scripted expert does an environment's task."""
    return isinstance(env.task, Task) and env.task.expert is not None


def make_expert(env: Environment) -> Expert:
    """The expert of an environment's task and robot, not compiled: from view and states to actions. Raises as
    `expert_of`."""
    rules = env.core.rules
    if not isinstance(env.task, Task) or env.task.expert is None or rules is None:
        names = [name for name, task in ACTIVITIES.items() if task.expert is not None]
        raise UnknownNameError("task with an expert", env.task.name, names)
    objective = getattr(env.objective, "base", env.objective)
    if isinstance(objective, VariedObjective):
        return VariedExpert(objective, env.robot, env.scene, rules.model, env.grasping)
    return Expert(env.task, env.robot, env.scene, rules.model, env.grasping)


class VariedExpert(Expert):
    """The expert of a task whose objects vary: in each world that of the models in use."""

    def __init__(self, objective: VariedObjective, robot: str, scene: Scene, model: StateModel, grasping: str):
        """As `Expert`."""
        super().__init__(objective.tasks[0], robot, scene, model, grasping)
        self._objective = objective
        self._experts = [Expert(task, robot, scene, model, grasping) for task in objective.tasks]

    def __call__(self, view: Any, states: Any, beliefs: Mapping[str, Belief] | None = None) -> Float[Array, "W n"]:
        """See `Expert`; beliefs are about the objects by the names of their parts."""
        swaps, actions = self._objective.swaps, []
        for expert, names in zip(self._experts, swaps.names, strict=True):
            taken: dict[str, str] = dict(zip(swaps.roles, names, strict=True))
            own: dict[str, Belief] = {taken.get(name, name): belief for name, belief in (beliefs or {}).items()}
            actions.append(expert(view, states, own))
        return self._objective.pick(view, actions)


@entry_point
def expert_of(env: Environment) -> Callable[..., Float[Array, "W n"]]:
    """What acts in all worlds of an environment, compiled: from a state, and where it takes objects to be, as
    `ig2mj.tasks.experts.Expert` does, to actions. Of an activity of BEHAVIOR, and of a goal in a home, it is the
    planner (`PlannedExpert`), on the host.

    Raises:
      UnknownNameError: the task has no expert. EngineError: the robot lacks hands that tasks move. PlanningError:
      motion of the robot cannot be planned.
    """
    if not has_script(env) and is_planned(env):
        return PlannedExpert(env)
    expert = make_expert(env)

    def expert_fn(view: Any, states: Any, beliefs: Any) -> Any:
        return expert(view, states, beliefs)

    acts = jax.jit(expert_fn)
    return lambda state, beliefs=None: acts(state.batch.world.view, state.batch.world.states, beliefs)
