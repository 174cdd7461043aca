"""Branches of programs that change states."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array

Fields = TypeVar("Fields")


def changed_where(predicate: Bool[Array, ""], change: Callable[[Fields], Fields], fields: Fields) -> Fields:
    """`change(fields)` where `predicate` holds, else `fields`: a pytree of arrays.

    It is a loop of at most one step. A loop of XLA works on arrays in place; a branch that changes nothing copies all
    of them, which takes a GPU longer than the rest of a step in which nothing is to be done.

    Args:
      change: reads the arrays from its argument.
    """

    def once(now: tuple[Array, Fields]) -> tuple[Array, Fields]:
        return jnp.array(False), change(now[1])

    return jax.lax.while_loop(lambda now: now[0], once, (jnp.asarray(predicate), fields))[1]
