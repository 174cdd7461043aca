"""`Swap`: teleports that slicing asks of the engine.

Axes: W worlds, M `StateModel.swap_objects`, object indices.
"""

from __future__ import annotations

from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array


@struct.dataclass
class Swap:
    """Teleports that slicing asks of the engine: halves to where the whole was, the whole to where a half was parked.

    The moved objects come to rest (zero velocity) and wake.

    Attributes:
      mask: the object is to be moved now. pos, quat: its main body's frame, world axes, w-x-y-z; where not masked, any
        finite numbers.
    """

    mask: Bool[Array, "W M"]
    pos: Float[Array, "W M 3"]
    quat: Float[Array, "W M 4"]
