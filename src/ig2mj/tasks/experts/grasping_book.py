"""Grasping Book: take the notebook from above and lift it."""

from __future__ import annotations

import jax.numpy as jnp

from ig2mj.tasks.experts.motion import Wish, where, wish
from ig2mj.tasks.experts.reaching import take
from ig2mj.tasks.experts.sight import Sight


def plan(see: Sight) -> list[Wish]:
    """One hand: to the notebook, and up."""
    (book,) = see.objects
    up = jnp.zeros_like(see.hand_pos()).at[:, 2].set(0.1)
    return [where(see.holds(book), wish(up, close=True), take(see, book))]
