"""The JAX engine: MJX `impl='jax'`. Differentiable, for small scenes only.

It keeps a contact slot for every pair of geoms, so time and memory grow with the square of their number, and
nothing sleeps in it.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import mujoco
from jaxtyping import Bool, Float, Int
from mujoco import mjx
from mujoco.mjx._src import collision_driver

from ig2mj.engine.contact_filter import DROPPED_DISTANCE, geom_hands
from ig2mj.engine.mjx.contacts import Contacts, jax_contacts
from ig2mj.engine.mjx.engine import MjxEngine
from ig2mj.engine.mjx.physics import own_device
from ig2mj.engine.native.sleep import FULLY_AWAKE
from ig2mj.engine.view import Array
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.process import entry_point


@entry_point
class JaxEngine(MjxEngine):
    """MJX-JAX behind the `Engine` protocol. Sleep states of snapshots are ignored: everything is awake."""

    name = "jax"
    unrolled = False  # a step's program is large: compile it once

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Does nothing: a program allocates its own memory."""

    def pending_reset_program(self) -> None:
        """See `Engine.pending_reset_program`."""

    def _host_model(self, model: mujoco.MjModel) -> mujoco.MjModel:
        own = super()._host_model(model)
        own.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        return own

    def _put_model(self, model: mujoco.MjModel) -> mjx.Model:
        return mjx.put_model(model, own_device(), impl="jax")

    def _put_data(self, model: mujoco.MjModel, data: mujoco.MjData) -> mjx.Data:
        return mjx.put_data(model, data, own_device(), impl="jax")

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

    def _act(self, act: Any, model: mjx.Model, data: mjx.Data, ignored: Bool[Array, "H O"] | None) -> mjx.Data:
        if ignored is None:
            return act(model, data)
        hand, thing = geom_hands(self.host_model, self.tables), self.tables.geom_object
        with _ignoring(jnp.asarray(hand), jnp.asarray(thing), ignored):
            return act(model, data)


class _Pairs(NamedTuple):
    """`Write.ignored_contacts` of the world that is being traced, and hand and object of each geom."""

    geom_hand: Int[Array, "G"]
    geom_object: Int[Array, "G"]
    ignored: Bool[Array, "H O"]


_here = threading.local()
_collision = ScopedReplacement()


@contextlib.contextmanager
def _ignoring(geom_hand: Array, geom_object: Array, ignored: Array) -> Iterator[None]:
    """What this thread traces of MJX's collision inside the block drops the ignored contacts."""
    _here.pairs = _Pairs(geom_hand, geom_object, ignored)
    try:
        with _collision.entered():
            yield
    finally:
        _here.pairs = None


def _without_ignored(model: mjx.Model, data: mjx.Data) -> mjx.Data:
    data = _collision.original(collision_driver, "collision")(model, data)
    pairs: _Pairs = _here.pairs
    contact = data._impl.contact
    geom = jnp.maximum(jnp.asarray(contact.geom), 0)
    hand, thing = pairs.geom_hand[geom], pairs.geom_object[geom]
    dropped = jnp.zeros(contact.dist.shape, bool)
    for side in (0, 1):
        own, other = hand[:, side], thing[:, 1 - side]
        dropped |= (own >= 0) & (other >= 0) & pairs.ignored[jnp.maximum(own, 0), jnp.maximum(other, 0)]
    return data.tree_replace({"_impl.contact.dist": jnp.where(dropped, DROPPED_DISTANCE, contact.dist)})


_collision.add({(collision_driver, "collision"): _without_ignored})
