"""Building blocks of robots' controllers: pure, batched functions. Geometry and limits are constants while tracing.

Axes: W worlds, n numbers, J joints.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array, PhysicsView


def scale_command(
    command: Float[Array, "W n"],
    low: Float[np.ndarray, "n"],
    high: Float[np.ndarray, "n"],
    out_low: Float[np.ndarray, "n"],
    out_high: Float[np.ndarray, "n"],
) -> Float[Array, "W n"]:
    """Clips a command to its limits and maps them linearly onto those of the output."""
    command = jnp.clip(jnp.asarray(command, jnp.float32), low, high)
    gain = np.abs(out_high - out_low) / np.abs(high - low)
    return (command - (low + high) / 2) * gain + (out_low + out_high) / 2


def differential_drive(
    command: Float[Array, "W 2"], radius: float, axle: float, max_wheel: float
) -> Float[Array, "W 2"]:
    """Angular velocities of the left and the right wheel, rad/s, clipped to `max_wheel`.

    Args:
      command: m/s forwards, rad/s to the left.
      radius: of the wheels, m. axle: distance between the wheels, m. max_wheel: limit of a wheel, rad/s.
    """
    forward, turn = command[:, 0], command[:, 1] * (axle / 2)
    wheels = jnp.stack([forward - turn, forward + turn], axis=1) / radius
    return jnp.clip(wheels, -max_wheel, max_wheel)


def drive_limits(radius: float, axle: float, max_wheel: float) -> Float[np.ndarray, "2"]:
    """The largest commands of a differential drive, m/s and rad/s."""
    speed = max_wheel * radius
    return np.array([speed, 2 * speed / axle])


def wheel_odometry(wheels: Float[Array, "W 2"], radius: float, axle: float) -> Float[Array, "W 2"]:
    """Speed forwards (m/s) and to the left (rad/s) of a base, from the speeds of its left and right wheel (rad/s)."""
    left, right = wheels[:, 0], wheels[:, 1]
    return jnp.stack([(left + right) / 2 * radius, (right - left) * (radius / axle)], axis=1)


def compiled_eye(view: PhysicsView, agent: int) -> tuple[Float[Array, "W 3"], Float[Array, "W 4"]]:
    """Pose of an agent's camera that moves with its joints alone, as the view has it: world frame, m and w-x-y-z."""
    return jnp.asarray(view.agent.eye_pos)[:, agent], jnp.asarray(view.agent.eye_quat)[:, agent]


def discrete_drive(radius: float, axle: float, max_wheel: float) -> Float[np.ndarray, "5 2"]:
    """iGibson's five discrete actions of two wheels as commands (m/s, rad/s): forwards, backwards, right, left, stay.

    Half the wheels' speed to move, 0.5 rad/s of each wheel to turn, as in iGibson's turtlebot.py, which does not name
    directions; a positive second number turns to the left.
    """
    move, turn = 0.5 * max_wheel * radius, 2 * 0.5 * radius / axle
    return np.array([[move, 0], [-move, 0], [0, turn], [0, -turn], [0, 0]])


def two_finger_grip(command: Float[Array, "W 1"], low: float, high: float) -> Float[Array, "W 2"]:
    """Targets of both fingers, m: open (`high`) for commands from 0 on, else closed (`low`); iGibson's binary mode."""
    return jnp.repeat(jnp.where(command >= 0, high, low), 2, axis=1)


def sines_and_cosines(angles: Float[Array, "W J"]) -> Float[Array, "W 2*J"]:
    """First all sines, then all cosines."""
    return jnp.concatenate([jnp.sin(angles), jnp.cos(angles)], axis=1)
