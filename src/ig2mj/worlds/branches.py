"""Work that is only done where some world asks for it, as a branch of a compiled program or of Python; and forks of
batches."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
from jaxtyping import Bool

from ig2mj.engine.base import Engine
from ig2mj.engine.saved import copied
from ig2mj.engine.view import Array
from ig2mj.worlds.batch import Batch


def cond_any(mask: Bool[Array, "W"], act: Callable[..., Any], *operands: Any) -> Any:
    """What `act` makes of the operands where some world is masked; else the operands. In compiled programs."""
    return jax.lax.cond(mask.any(), act, lambda *same: same, *operands)


def call(mask: Bool[Array, "W"], act: Callable[..., Any], *operands: Any) -> Any:
    """`cond_any` for the native engine, where nothing is asked for unless a world is chosen."""
    return act(*operands)


def forked(engine: Engine, batch: Batch) -> Batch:
    """An independent copy of a batch of the engine."""
    if engine.pure:
        return copied(batch)
    world = dataclasses.replace(batch.world, physics=engine.fork(batch.world.physics))
    return dataclasses.replace(batch, world=world)  # its arrays, and those of the view, never change
