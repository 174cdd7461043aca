"""Copies of an engine's physics: `SavedPhysics`, all of it in arrays (more than a `Snapshot`, which starts worlds), and
copies of pytrees on the device.

Axis: W worlds.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Int

from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array, PhysicsView, counted, length


@struct.dataclass
class SavedPhysics:
    """Physics of W worlds as `Engine.saved` gives it and `Engine.restored` takes it, in NumPy arrays.

    Attributes:
      snapshot: of all worlds, with the world axis.
      view: of the engine at the same instant; forces of the last control step are nowhere else.
      overflow, wrong_controls: see `ig2mj.engine.health`; since each world was loaded.
      lost: (native engine) the world is not finite and is not stepped.
    """

    snapshot: Snapshot
    view: PhysicsView
    overflow: Int[Array, "W"]
    wrong_controls: Bool[Array, "W"]
    lost: Bool[Array, "W"]

    def __repr__(self) -> str:
        return counted(self, worlds=length(self.overflow))


@jax.jit
def copied(tree: Any) -> Any:
    """A pytree of copies of all arrays, each on its device, made in one program."""
    return jax.tree.map(jnp.copy, tree)
