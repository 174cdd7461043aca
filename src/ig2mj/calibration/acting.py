"""A robot that acts at random over its whole range of actions: how `ig2mj calibrate --robot` disturbs a scene.

Pure JAX. Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Float, Int, UInt

from ig2mj.agents.base import Controller, ControllerState, Robot
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.scene.scene import Scene
from ig2mj.worlds.random_streams import step_keys

ACTION_STEPS = 3
"""Control steps of an action."""

HOLD = 5
"""Actions after which another one is drawn: robots that change their mind ten times a second get nowhere."""


@struct.dataclass
class Acting:
    """What the robot of each world does.

    Attributes:
      ctrl: controls of the model. action: the one that holds. state: the controller's.
    """

    ctrl: Float[Array, "W nu"]
    action: Float[Array, "W n"]
    state: ControllerState


def robot_of(scene: Scene, period: float) -> Controller | None:
    """The controller of a scene's first agent, whose actuators are all there are; None where it is not a robot.
    `period`: seconds of an action."""
    if not scene.agents or not isinstance(scene.agents[0], Robot):
        return None
    return scene.agents[0].controller(scene.tables, 0, period)


def start_acting(controller: Controller, worlds: int, actuators: int) -> Acting:
    """Robots at their start."""
    state = controller.initial(worlds)
    return Acting(jnp.zeros((worlds, actuators)), jnp.zeros((worlds, controller.action_size)), state)


def act_at_random(
    controller: Controller,
    acting: Acting,
    view: PhysicsView,
    key: UInt[Array, "W 2"],
    step: Int[Array, "W"],
    share: float = 1.0,
    action_steps: int = ACTION_STEPS,
) -> Acting:
    """Controls for the next control step.

    Args:
      key: of each world's round. step: control steps since its start, the same in all worlds.
      share: of the range of actions that is drawn from.
      action_steps: control steps after which the robot acts, at the controller's period.
    """
    low, high = share * jnp.asarray(controller.action_low), share * jnp.asarray(controller.action_high)
    keys = step_keys(key, step)
    drawn = jax.vmap(lambda k: jax.random.uniform(k, low.shape, minval=low, maxval=high))(keys)
    action = jnp.where((step % (ACTION_STEPS * HOLD) == 0)[:, None], drawn, acting.action)

    def another() -> Acting:
        ctrl, state = controller.control(action, view, acting.state)
        return Acting(jnp.asarray(ctrl, acting.ctrl.dtype), action, state)

    return jax.lax.cond(step[0] % action_steps == 0, another, lambda: dataclasses.replace(acting, action=action))
