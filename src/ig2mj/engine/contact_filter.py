"""Contacts of chosen (hand, object) pairs dropped: what engines share.

A held object is welded to the hand that surrounds it; its contacts with the palm and the fingers would fight the weld.
`Write.ignored_contacts` drops them, exactly: each engine takes them out between finding contacts and making constraints
of them. Where nothing is ignored, nothing is done.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.errors import EngineError
from ig2mj.scene.tables import SceneTables

DROPPED_DISTANCE = 1000.0
"""Metres: the distance written into a dropped contact of MJX, so that it gives neither force nor touch."""

MOST_BITS = 31
"""Of an integer of MuJoCo's that stays positive."""


def geom_hands(model: mujoco.MjModel, tables: SceneTables) -> Int[np.ndarray, "G"]:
    """Hand that each geom is part of, -1 none."""
    return tables.body_hand[model.geom_bodyid]


class BitLayers:
    """The contact filter of C MuJoCo: bits of `geom_contype` and `geom_conaffinity`, which it looks at for each pair.

    The scene's own bits are repeated in layers: every geom has the lowest; a hand that ignores something is in a layer
    of its own instead, where all geoms are but those of the objects that it ignores. All such hands also share one more
    layer, in which they meet each other. So exactly the ignored pairs have no bit in common any more.
    """

    def __init__(self, model: mujoco.MjModel, tables: SceneTables):
        self._contype, self._conaffinity = np.array(model.geom_contype), np.array(model.geom_conaffinity)
        self._hand, self._object = geom_hands(model, tables), tables.geom_object
        self._width = int(np.bitwise_or.reduce(self._contype | self._conaffinity, initial=1)).bit_length()

    @property
    def full(self) -> str:
        """Why not even one hand can ignore contacts; "" where one can."""
        if self._width * 3 <= MOST_BITS:
            return ""
        return f"geoms of the scene use {self._width} bits of contype and conaffinity, which leaves none for layers"

    def masks(self, ignored: Bool[np.ndarray, "H O"]) -> tuple[np.ndarray, np.ndarray] | None:
        """`geom_contype` and `geom_conaffinity` [G]; None: the model's own.

        Raises:
          EngineError: the scene uses too many bits for so many hands.
        """
        hands = np.flatnonzero(ignored.any(1))
        if not len(hands):
            return None
        if self._width * (len(hands) + 2) > MOST_BITS:
            raise EngineError(
                f"{len(hands)} hands cannot ignore contacts where geoms use {self._width} bits of contype and "
                f"conaffinity: there is room for {MOST_BITS // self._width - 2}"
            )
        layers = np.ones(len(self._hand), np.int64)  # bit k: the geom is in layer k
        together = 1 << (len(hands) + 1)
        for k, hand in enumerate(hands):
            layer = 1 << (k + 1)
            own = self._hand == hand
            left_out = ignored[hand][self._object] & (self._object >= 0)
            others = ~own & ~left_out & ~np.isin(self._hand, hands)
            layers[others] |= layer
            layers[own] = layer | together
        contype, conaffinity = np.zeros_like(layers), np.zeros_like(layers)
        for k in range(len(hands) + 2):
            inside = (layers >> k) & 1
            contype |= inside * (self._contype << (k * self._width))
            conaffinity |= inside * (self._conaffinity << (k * self._width))
        return contype.astype(np.int32), conaffinity.astype(np.int32)
