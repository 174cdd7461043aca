"""`TracedExecution`: how functions run next to an MJX engine, whose physics is a pytree that JAX can trace."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.base import Physics, Write
from ig2mj.engine.saved import copied
from ig2mj.engine.view import OF_CONSTRAINTS, Array, PhysicsView, read_field, replace_fields
from ig2mj.process.gc_pause import Compiled


class TracedExecution:
    """Part of `MjxEngine`: see `ig2mj.engine.base.Engine`, "How functions run"."""

    num_worlds: int

    def compile(self, function: Callable[..., Any], shortcut: Callable[..., Any] | None = None) -> Callable[..., Any]:
        """See `Engine.compile`: `jax.jit`. Nothing looks at values, so that there are no shortcuts."""
        return jax.jit(function)

    def program(
        self, function: Callable[..., Any], check: Callable[[Any], None] | None = None, **options: Any
    ) -> Callable[..., Any]:
        """See `Engine.program`: one compiled program."""
        return Compiled(function, check, **options)

    def when_any(self, mask: Bool[Array, "W"], act: Callable[..., Any], *operands: Any, cheap: bool = False) -> Any:
        """See `Engine.when_any`: a branch of the program."""
        if cheap:
            return act(*operands)
        return jax.lax.cond(mask.any(), act, lambda *same: _unpacked(same), *operands)

    def repeat(self, body: Callable[[Any], tuple[Any, Any]], carry: Any, length: int) -> tuple[Any, Any]:
        """See `Engine.repeat`: a loop of the program. Written out, a program would call a physics step `length` times
        as often, and MJX keeps a CUDA graph of each call."""
        structures = []

        def turn(carry: Any, _: None) -> tuple[Any, list[Array]]:
            carry, result = body(carry)
            leaves, structure = jax.tree.flatten(result)  # a result has a world axis first, what is stacked has not
            structures.append(structure)
            return carry, leaves

        carry, each = jax.lax.scan(turn, carry, None, length)
        return carry, jax.tree.unflatten(structures[0], [values[-1] for values in each])

    def constants(self, tree: Any) -> Any:
        """See `Engine.constants`: on the device, in single precision."""
        with jax.ensure_compile_time_eval():  # may be asked for first while a step is traced
            return jax.device_put(jax.tree.map(_single_precision, tree))

    def kept(self, tree: Any) -> Any:
        """See `Engine.kept`: fetched to the host, since a step may consume the arrays that it is given."""
        return jax.tree.map(np.array, tree)

    def kept_row(self, tree: Any, world: int) -> tuple[Any, int]:
        """See `Engine.kept_row`: that world alone is fetched."""
        return jax.tree.map(lambda a: np.asarray(a[world : world + 1]), tree), 0

    def copied(self, tree: Any) -> Any:
        """See `Engine.copied`: each array on its device."""
        return copied(tree)

    def with_eyes(self, view: PhysicsView, poses: Callable[[], tuple[Array, Array]]) -> PhysicsView:
        """See `Engine.with_eyes`."""
        pos, quat = poses()
        return replace_fields(view, {"agent.eye_pos": pos, "agent.eye_quat": quat})

    def write_with_view(
        self,
        physics: Physics,
        write: Write,
        before: PhysicsView,
        worlds: Bool[Array, "W"] | None = None,
    ) -> tuple[Physics, PhysicsView]:
        """See `Engine.write_with_view`."""
        engine: Any = self
        physics = engine.write(physics, write)
        now = engine.view(physics)  # what is not read of it is never computed
        if write.moves_nothing:
            return physics, replace_fields(before, {name: read_field(now, name) for name in OF_CONSTRAINTS})
        if worlds is None or self.num_worlds == 1:
            return physics, now
        chosen = jnp.asarray(worlds)
        return physics, jax.tree.map(
            lambda new, old: jnp.where(chosen.reshape((-1,) + (1,) * (old.ndim - 1)), new, old), now, before
        )


def _unpacked(operands: tuple[Any, ...]) -> Any:
    one, *more = operands
    return operands if more else one


def _single_precision(array: Array) -> np.ndarray:
    values = np.asarray(array)
    return values.astype(np.float32) if values.dtype == np.float64 else values
