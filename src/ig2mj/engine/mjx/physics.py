"""Physics of a batch on MJX as a pytree, and how it comes from and goes to snapshots and MuJoCo's structures."""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from jax.core import Tracer
from jaxtyping import Bool, Float, Int
from mujoco import mjx

from ig2mj.engine.contact_filter import BitLayers
from ig2mj.engine.model_fields import ModelFields, given
from ig2mj.engine.native.sleep import restore_sleep
from ig2mj.engine.snapshot import AXIS, Snapshot
from ig2mj.engine.view import Array, length
from ig2mj.errors import EngineError, StaleStateError
from ig2mj.scene.tables import SceneTables

STATE_FIELDS = tuple(name for name in AXIS if name not in ("eq_data", "tree_asleep"))
"""Fields of MJX data that are state, and that a `Snapshot` has by the same name; besides them the time."""


@struct.dataclass
class MjxPhysics:
    """Physics of a batch.

    Attributes:
      data: MJX data; arrays begin with the world axis, but for Warp's contact list.
      fields: fields of the model that are each world's own, eq_data always.
      ignored: contacts of hands with objects dropped.
      touching: of units, as of the last step. link_force, finger_force: newtons, of the last control step.
      overflow: or of MJX-Warp's overflow flags since the world was loaded (`ig2mj.worlds.guards`).
      wrong_controls: some control had to be clipped since then.
    """

    data: Any
    fields: ModelFields
    ignored: Bool[Array, "W H O"]
    touching: Bool[Array, "W U U"]
    link_force: Float[Array, "W L O"]
    finger_force: Float[Array, "W F Y"]
    overflow: Int[Array, "W"]
    wrong_controls: Bool[Array, "W"]

    def is_stale(self) -> bool:
        """Its arrays were donated to a program; false while tracing."""
        qpos = self.data.qpos
        return isinstance(qpos, jax.Array) and not isinstance(qpos, Tracer) and qpos.is_deleted()

    def __repr__(self) -> str:
        return f"MjxPhysics({length(self.wrong_controls)} worlds{', stale' * self.is_stale()})"

    def __copy__(self) -> MjxPhysics:
        return dataclasses.replace(self)

    def __reduce_ex__(self, protocol: Any) -> Any:
        if self.data.impl is mjx.Impl.WARP:
            raise EngineError(
                "a state of the warp engine can neither be pickled nor deep-copied: take a copy with env.fork(state), "
                "or a file with env.save(state, file)"
            )
        return super().__reduce_ex__(protocol)


def fresh(physics: MjxPhysics) -> MjxPhysics:
    """The same physics. Raises StaleStateError where its arrays were donated to a program; nothing while tracing."""
    if physics.is_stale():
        raise StaleStateError
    return physics


def all_units(snapshot: Snapshot) -> Bool[Array, "*W U U"]:
    """Touching of all units from a snapshot's two parts; agents' with agents' is not kept."""
    objects, agents = jnp.asarray(snapshot.scene.touching), jnp.asarray(snapshot.agents.touching)
    count = agents.shape[-2]
    if not count:
        return objects
    corner = jnp.zeros((*agents.shape[:-1], count), bool)
    rows = jnp.concatenate([objects, agents.swapaxes(-1, -2)], -1)
    return jnp.concatenate([rows, jnp.concatenate([agents, corner], -1)], -2)


def mujoco_of(row: Snapshot, model: mujoco.MjModel, tables: SceneTables) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A snapshot without the world axis in MuJoCo's own structures; `model` is copied."""
    model = copy.copy(model)
    for name, array in {"eq_data": row.eq_data, **given(row.model_fields)}.items():
        getattr(model, name)[:] = array
    masks = BitLayers(model, tables).masks(np.asarray(row.agents.ignored_contacts))
    if masks is not None:
        model.geom_contype[:], model.geom_conaffinity[:] = masks
    data = mujoco.MjData(model)
    data.time = float(row.time)
    for name in STATE_FIELDS:
        getattr(data, name)[:] = row.whole(name)
    mujoco.mj_forward(model, data)  # of all bodies: nothing sleeps in new data
    restore_sleep(model, data, np.asarray(row.tree_asleep))
    return model, data


def own_device() -> Any:
    """Where models and data are put: MJX itself takes the first device of all processes, which may be another one's."""
    return jax.local_devices()[0]


def uncommitted(tree: Any) -> Any:
    """The same arrays without the device that MJX commits them to.

    A program's outputs are committed as soon as one of its inputs is, and JAX compiles again for arguments that are: a
    loop whose carry begins with arrays of the caller's own would compile its program twice.
    """
    return jax.tree.map(lambda a: jax.device_put(np.asarray(a)) if isinstance(a, jax.Array) else a, tree)
