"""Working off in turns what a mask chooses: which places come next, and putting the answers where they belong.

Without scatters where that can be: XLA compiles each into kernels of its own, and no program with one into a single
function (`ig2mj.process.one_kernel`).

Axes: M places, N places of a turn.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array

FEW = 1 << 14
"""Comparisons up to which every place is compared with every number."""


class Worklist(NamedTuple):
    """The places where a mask is true, numbered in rising order.

    Attributes:
      mask: which places are listed. until: how many are listed up to each place, itself included.
    """

    mask: Bool[Array, "M"]
    until: Int[Array, "M"]

    @classmethod
    def of(cls, mask: Bool[Array, "M"]) -> Worklist:
        """Of a mask."""
        return cls(mask, jnp.cumsum(mask))

    def places(self, first: Int[Array, ""], count: int) -> Int[Array, "N"]:
        """The places of `count` entries from a number on; M from the end of the list on."""
        return jnp.searchsorted(self.until, first + 1 + np.arange(count)).astype(np.int32)

    def no_answers(self, count: int) -> Bool[jax.Array, "K"]:
        """What `noted` fills, where a turn answers `count` entries."""
        return jnp.zeros(self.mask.size + count, bool)

    def noted(
        self, answers: Bool[jax.Array, "K"], first: Int[Array, ""], of_turn: Bool[Array, "N"]
    ) -> Bool[jax.Array, "K"]:
        """The answers with those of the entries from a number on; what stood there before is lost."""
        return jax.lax.dynamic_update_slice(answers, jnp.asarray(of_turn), (first,))

    def in_place(self, answers: Bool[Array, "K"]) -> Bool[Array, "M"]:
        """The answers of all places; false where none is listed."""
        return self.mask & answers[jnp.maximum(self.until - 1, 0)]


def or_at(found: Bool[Array, "M"], place: Int[Array, "N"], answer: Bool[Array, "N"]) -> Bool[jax.Array, "M"]:
    """The array, true also at each place whose answer is true; places from M on count for nothing."""
    if found.size * place.size > FEW:
        return jnp.asarray(found).at[place].max(answer, mode="drop")
    return jnp.asarray(found) | jnp.any((place[:, None] == np.arange(found.size)) & answer[:, None], axis=0)
