"""A floating hand that goes about pushing loose objects: the disturbance of benchmarks and of `ig2mj calibrate`.

Every second each world's hand chooses an object near it and moves through that object's place. Pure JAX.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int, UInt

from ig2mj.engine.view import Array
from ig2mj.worlds.random_streams import step_keys

SPEED = 0.5
"""m/s at which the hand's target moves."""

HEIGHT = 0.12
"""Metres of the palm over the object's centre: the fingers, which point down, sweep the object and not the table."""

REACH = 1.0
"""Metres of noise on the distance by which objects are chosen: nearer ones are likelier."""

STEPS_PER_OBJECT = 30
"""Control steps until the next object is chosen."""


def push_controls(
    object_com: Float[Array, "W O 3"],
    ctrl: Float[Array, "W nu"],
    home: Float[np.ndarray, "3"],
    loose: Int[np.ndarray, "M"],
    key: UInt[Array, "W 2"],
    step: Int[Array, "W"],
    seconds: float,
) -> Float[Array, "W nu"]:
    """Controls of the next control step.

    Args:
      object_com: where everything is (`PhysicsView.object_com`), m.
      ctrl: controls of the last step; the first three are the hand's x, y and z from `home` (see `add_floating_hand`).
      home: world position of the hand at zero controls, m.
      loose: objects to push.
      key, step: random keys of the worlds' episodes, and their control steps.
      seconds: length of a control step.
    """
    keys = step_keys(key, step // STEPS_PER_OBJECT)
    noise = jax.vmap(lambda k: jax.random.uniform(k, (len(loose),), maxval=REACH))(keys)
    place = jnp.asarray(object_com)[:, loose]
    distance = jnp.linalg.norm(place - (jnp.asarray(ctrl)[:, None, :3] + home), axis=-1)
    chosen = jnp.argmin(jnp.where(jnp.isfinite(distance), distance, jnp.inf) + noise, axis=1)
    target = jnp.take_along_axis(place, chosen[:, None, None], axis=1)[:, 0] + np.array([0.0, 0.0, HEIGHT]) - home
    stride = SPEED * seconds
    moved = ctrl[:, :3] + jnp.clip(target - ctrl[:, :3], -stride, stride)
    return jnp.asarray(ctrl).at[:, :3].set(jnp.where(jnp.isfinite(moved), moved, ctrl[:, :3]))
