"""Large constants of a program as arguments of it.

A function that JAX compiles may read arrays that are not its arguments: start states, points of surfaces, triangles
that cameras see, tens of megabytes. JAX writes them into the program, so that lowering, the key of the compilation
cache, XLA's passes (which compute with constants where they can) and reading the program again take longer, every
program holds a copy of them on the device, and other start states are another program. Here they are passed to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

LEAST = 1 << 16
"""Bytes from which a constant is an argument."""


class WithLargeConstants:
    """`jax.jit` of a function whose large constants are arguments.

    The constants are those of the first call or trace. A later one with other shapes that reads others has those in the
    program, and so have all where the first call's arguments lie on several devices. Constants of inner functions that
    are jitted themselves stay in the program, too.
    """

    def __init__(self, function: Callable[..., Any], donate_argnums: int | Sequence[int] = (), **options: Any):
        """`donate_argnums`, `options`: of `jax.jit`; arguments are given by position, and none is static."""
        import jax

        donated = (donate_argnums,) if isinstance(donate_argnums, int) else tuple(donate_argnums)
        self.plain: Any = jax.jit(function, donate_argnums=donated, **options)
        self._constants: list[Any] | None = None
        self._originals: list[Any] = []

        def program(constants: list[Any], *args: Any) -> Any:
            return self._evaluated(constants, args)

        program.__name__ = program.__qualname__ = getattr(function, "__name__", "program")
        self._program: Any = jax.jit(program, donate_argnums=tuple(k + 1 for k in donated), **options)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        if kwargs:
            return self.plain(*args, **kwargs)
        if self._constants is None:
            self._find(args)
        return self._program(self._constants, *args)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plain, name)

    def trace(self, *args: Any) -> Any:
        """As that of `jax.jit`."""
        if self._constants is None:
            self._find(args)
        return self._program.trace(self._constants, *args)

    def _find(self, args: tuple[Any, ...]) -> None:
        import jax

        constants = self.plain.trace(*args).jaxpr.consts
        self._originals = [] if _is_spread(args) else [value for value in constants if _is_large(value)]
        with jax.ensure_compile_time_eval():  # the call may be part of another program
            self._constants = [jax.numpy.asarray(value) for value in self._originals]

    def _evaluated(self, constants: list[Any], args: tuple[Any, ...]) -> Any:
        import jax
        import jax.extend.core

        traced = self.plain.trace(*args)
        passed = {id(value): constant for value, constant in zip(self._originals, constants, strict=True)}
        values = [passed.get(id(value), value) for value in traced.jaxpr.consts]
        closed = jax.extend.core.ClosedJaxpr(traced.jaxpr.jaxpr, values)
        found = jax.extend.core.jaxpr_as_fun(closed)(*jax.tree.leaves(args))
        return jax.tree.unflatten(traced.out_tree, found)


def _is_spread(args: tuple[Any, ...]) -> bool:
    """Whether arguments lie on several devices. Constants would be copied to the others in every call."""
    import jax

    shardings = [getattr(a, "sharding", None) for a in jax.tree.leaves(args)]
    return any(isinstance(s, jax.sharding.NamedSharding) and s.mesh.size > 1 for s in shardings)


def _is_large(value: Any) -> bool:
    import jax

    free = not isinstance(value, jax.Array) or not value.committed
    return getattr(value, "nbytes", 0) >= LEAST and free
