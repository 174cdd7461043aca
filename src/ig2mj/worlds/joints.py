"""`JointSwitch`: the equality constraints by which objects are attached, switched as the states say.

Axes: W worlds, N pairs that can be attached, E equality constraints.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.base import Engine, Write
from ig2mj.engine.model_fields import ModelFields
from ig2mj.engine.view import Array
from ig2mj.scene.extras import joint_name
from ig2mj.scene.scene import Scene
from ig2mj.states.definitions.attached import Joints
from ig2mj.states.world import ExtendedStates


class JointSwitch:
    """Constants of a scene in which objects can be attached."""

    def __init__(self, scene: Scene, joints: Joints):
        names = scene.object_names
        self._model = scene.model
        pairs = zip(joints.child, joints.parent, strict=True)
        self._equality = np.array([scene.model.equality(joint_name(names[a], names[b])).id for a, b in pairs], int)

    @classmethod
    def of(cls, engine: Engine, joints: Joints | None) -> JointSwitch | None:
        """That of an engine's scene; None: nothing in it can be attached."""
        return None if joints is None else cls(engine.scene, joints)

    def changed(self, before: ExtendedStates, after: ExtendedStates) -> Bool[Array, "W"]:
        """Worlds in which something else is attached than before."""
        if after.attached is before.attached and after.joint_place is before.joint_place:
            return np.zeros(len(before.attached), bool)
        moved = jnp.any(jnp.asarray(after.joint_place) != before.joint_place, axis=-1) & jnp.asarray(after.attached)
        return jnp.any((jnp.asarray(after.attached) != before.attached) | moved, axis=-1)

    def none_held(self, num_worlds: int) -> Write:
        """The constraints as they were compiled, in which nothing is held or attached."""
        active = jnp.tile(jnp.asarray(self._model.eq_active0, bool), (num_worlds, 1))
        data = jnp.tile(jnp.asarray(self._model.eq_data[:, :12], jnp.float32), (num_worlds, 1, 1))
        return Write(eq_active=active, model_fields=ModelFields(eq_data=data))

    def joined(self, write: Write, states: ExtendedStates) -> Write:
        """A write of constraints in which what the states say is attached."""
        assert write.eq_active is not None and write.model_fields is not None
        active = jnp.asarray(write.eq_active).at[:, self._equality].set(jnp.asarray(states.attached))
        data = jnp.asarray(write.model_fields.eq_data).at[:, self._equality, :10].set(jnp.asarray(states.joint_place))
        return dataclasses.replace(write, eq_active=active, model_fields=ModelFields(eq_data=data))
