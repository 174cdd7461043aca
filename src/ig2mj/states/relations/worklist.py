"""`Worklist`: computes the entries of a mask chunk by chunk, and puts the results in their places.

Without scatters where that can be: XLA compiles each into kernels of its own, and no program with one into a single
function (`ig2mj.process.xla_small_call`).

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
    """The places where a mask is true, numbered in rising order, and worked off some at a time.

    Attributes:
      mask: which places are listed. until: how many are listed up to each place, itself included.
      count: N. listed: the places and then M, N times or more; None: each turn searches for its own.
    """

    mask: Bool[Array, "M"]
    until: Int[Array, "M"]
    count: int
    listed: Int[Array, "L"] | None

    @classmethod
    def of(cls, mask: Bool[Array, "M"], count: int, search: bool | None = None) -> Worklist:
        """Of a mask.

        Args:
          count: places of a turn. search: whether each turn searches for its places; None: on processors, where a list
            is a scatter and the search a few instructions, while on a GPU each turn would wait for a loop of its own.
        """
        listed, size = None, mask.size
        if not (jax.default_backend() == "cpu" if search is None else search):
            listed = jnp.nonzero(mask, size=size + count, fill_value=size)[0]
        return cls(mask, jnp.cumsum(mask), count, listed)

    def places(self, first: Int[Array, ""]) -> Int[Array, "N"]:
        """The places of a turn's entries, from a number on; M from the end of the list on."""
        if self.listed is not None:
            return jax.lax.dynamic_slice(jnp.asarray(self.listed), (first,), (self.count,))
        return jnp.searchsorted(self.until, first + 1 + np.arange(self.count)).astype(np.int32)

    def no_answers(self) -> Bool[jax.Array, "K"]:
        """What `noted` fills."""
        return jnp.zeros(self.mask.size + self.count, bool)

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
