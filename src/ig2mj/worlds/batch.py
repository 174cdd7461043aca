"""`Batch`: everything of many worlds that changes, as a pytree.

Axes: W worlds, K guard flags.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Int

from ig2mj.agents.grasping import GraspState
from ig2mj.engine.view import Array, counted, length
from ig2mj.states.world import WorldState
from ig2mj.worlds.draw import Draw


@struct.dataclass
class Batch:
    """A batch of worlds, as `ig2mj.worlds.core.Core` starts, steps and resets it.

    Attributes:
      world: physics, view, states, keys, clocks.
      controllers: the state of each robot's controller; empty where there are none.
      grasps: what hands hold; None where hands hold by friction alone.
      number: global number of each world; with several devices a batch is a part of all worlds.
      seed: of all random streams, or [W], of those of each world. episode: how often each world was reset.
      flags: `guards.Flag` of each world since its reset. troubles: how often each world was flagged, per flag.
      draw: what was drawn for the episodes besides fields of the model; empty where nothing is.
    """

    world: WorldState
    controllers: tuple[Any, ...]
    grasps: GraspState | None
    number: Int[Array, "W"]
    seed: Int[Array, "*seeds"]
    episode: Int[Array, "W"]
    flags: Int[Array, "W"]
    troubles: Int[Array, "W K"]
    draw: Draw = Draw()

    def __repr__(self) -> str:
        return counted(self, worlds=length(self.number))


def select_worlds(mask: Bool[Array, "W"], new: Any, old: Any) -> Any:
    """`new` in the masked worlds, `old` elsewhere; pytrees of arrays [W, ...]. All of `new` where `old` is None."""
    if old is None:
        return new
    mask = jnp.asarray(mask)
    return jax.tree.map(lambda a, b: jnp.where(mask.reshape((-1,) + (1,) * (jnp.ndim(b) - 1)), a, b), new, old)
