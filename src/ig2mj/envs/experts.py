"""`expert_of`: the scripted expert of an environment.

    expert = expert_of(env)
    state = env.step(state, expert(state))

Pure: it may be part of a compiled program, and asked in any state (`ig2mj.tasks.experts`).
"""

from __future__ import annotations

from collections.abc import Callable

import jax
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import EngineError
from ig2mj.tasks.experts import Expert
from ig2mj.tasks.task import Task


def expert_of(env: Environment) -> Callable[[EnvState], Float[Array, "W n"]]:
    """What acts in all worlds of an environment, compiled.

    Raises:
      UnknownNameError: the task has no expert.
    """
    rules, task = env.core.rules, env.task
    if rules is None or not isinstance(task, Task):
        raise EngineError(f"{task.name} has no scripted expert")
    acts = jax.jit(Expert(task, env.robot, env.scene, rules.model, closing=env.grasping != "mitten"))
    return lambda state: acts(state.batch.world.view, state.batch.world.states)
