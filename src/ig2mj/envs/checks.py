"""Checks of states and actions, on the host."""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from ig2mj.engine.base import check_pure
from ig2mj.engine.view import Array
from ig2mj.envs.state import EnvState
from ig2mj.errors import ActionError

if TYPE_CHECKING:
    from ig2mj.envs.environment import Environment


def checked_state(state: EnvState) -> EnvState:
    """The state itself. Raises ActionError: it is no `EnvState`."""
    if not isinstance(state, EnvState):
        given = type(state).__name__
        raise ActionError(f"an environment takes the state that reset or the last step returned, not {given}")
    return state


def checked_action(env: Environment, action: Array) -> Float[Array, "W n"]:
    """The action in single precision.

    Raises:
      ActionError: it is traced on the native engine, has another shape, is not of numbers, or is NumPy's and has some
        that are not finite.
    """
    if isinstance(action, Tracer):
        outside = "the native engine steps outside of compiled programs: call step without jit, vmap or scan"
        check_pure(env.core.engine, ActionError(outside))
    requested = (env.num_worlds, *env.action_space.shape)
    if np.shape(action) != requested:
        raise ActionError(f"an action of {env.task.name} has shape {requested}, not {np.shape(action)}")
    if not isinstance(action, jax.Array):
        action = np.asarray(action)
    if not (jnp.issubdtype(action.dtype, jnp.floating) or jnp.issubdtype(action.dtype, jnp.integer)):
        raise ActionError(f"an action is of real numbers, not of {action.dtype}")
    if isinstance(action, np.ndarray) and not (fine := np.isfinite(action)).all():
        world, number = np.argwhere(~fine)[0]
        name = env.action_names[number]
        raise ActionError(f"{name} of the action of world {world} is not finite: {action[world, number]}")
    return (action.clip(-1.0, 1.0) if isinstance(action, np.ndarray) else action).astype(np.float32)
