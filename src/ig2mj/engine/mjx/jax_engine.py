"""The JAX engine: MJX `impl='jax'`. Differentiable, for small scenes only.

It keeps a contact slot for every pair of geoms, so time and memory grow with the square of their number (design
section 2, fact 1), and nothing sleeps in it.
"""

from __future__ import annotations

import jax.numpy as jnp
import mujoco
from jaxtyping import Bool, Float, Int
from mujoco import mjx

from ig2mj.engine.mjx.contacts import Contacts, jax_contacts
from ig2mj.engine.mjx.engine import MjxEngine
from ig2mj.engine.native.sleep import FULLY_AWAKE
from ig2mj.engine.view import Array


class JaxEngine(MjxEngine):
    """MJX-JAX behind the `Engine` protocol. Sleep states of snapshots are ignored: everything is awake."""

    name = "jax"
    unrolled = False  # a step's program is large: compile it once

    def _host_model(self, model: mujoco.MjModel) -> mujoco.MjModel:
        own = super()._host_model(model)
        own.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        return own

    def _put_model(self, model: mujoco.MjModel) -> mjx.Model:
        return mjx.put_model(model, impl="jax")

    def _put_data(self, model: mujoco.MjModel, data: mujoco.MjData) -> mjx.Data:
        return mjx.put_data(model, data, impl="jax")

    def _contacts(self, data: mjx.Data) -> Contacts:
        return jax_contacts(data)

    def _efc_force(self, data: mjx.Data) -> Float[Array, "W N"]:
        return data._impl.efc_force

    def _tree_asleep(self, data: mjx.Data) -> Int[Array, "W T"]:
        return jnp.full((data.qpos.shape[0], self.host_model.ntree), FULLY_AWAKE, jnp.int32)

    def _with_sleep(self, data: mjx.Data, asleep: Int[Array, "W T"], awake: Bool[Array, "W T"]) -> mjx.Data:
        return data

    def _overflow(self, data: mjx.Data) -> Int[Array, "W"]:
        return jnp.zeros(data.qpos.shape[0], jnp.int32)
