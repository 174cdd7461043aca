"""`Swap`: teleports that slicing and transition rules ask of the engine.

Axes: W worlds, M `StateModel.swap_objects`, object indices.
"""

from __future__ import annotations

import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array


@struct.dataclass
class Swap:
    """Teleports that slicing asks of the engine: halves to where the whole was, the whole to where a half was parked;
    and those of transition rules: what they use up to where it is parked, what they make to its container.

    The moved objects come to rest (zero velocity) and wake.

    Attributes:
      mask: the object is to be moved now. pos, quat: its main body's frame, world axes, w-x-y-z; where not masked, any
        finite numbers.
    """

    mask: Bool[Array, "W M"]
    pos: Float[Array, "W M 3"]
    quat: Float[Array, "W M 4"]

    @classmethod
    def nothing(cls, num_worlds: int, count: int) -> Swap:
        """Nothing moves."""
        shape = (num_worlds, count)
        return cls(jnp.zeros(shape, bool), jnp.zeros((*shape, 3)), jnp.zeros((*shape, 4)))
