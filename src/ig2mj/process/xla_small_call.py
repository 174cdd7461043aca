"""`SmallCall`: a program for one processor core, all of whose operations are compiled into a single function.

XLA's programs for processors are lists of small kernels, handed to a pool of threads. For the states of one world, some
fifty kernels of a few hundred numbers each, handing them over takes longer than the work, and compiling fifty kernels
takes longer than compiling one. XLA:CPU compiles a computation that is called with the attribute `xla_cpu_small_call`
as one function, as it does by itself with small loops; a backend that does not know the attribute makes a plain call.
Sorts, scatters of many numbers, and operations large enough to be split between threads cannot be compiled that way: a
program with such an operation is compiled as usual when it is first called. XLA prints an error of its own when it
finds that out, so that for the first of these it is not asked.

The first agent step of CookingMeat in one world takes 5.8 s of processor time instead of 8.2, a later one 7 % less
(docs/notes/native.md).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any

from ig2mj.process.gc_pause import GC_PAUSED

Options = dict[str, int | bool | str]

ATTRIBUTES = {"inlineable": "false", "xla_cpu_small_call": "true"}

NO_LIBRARY: Options = {"xla_cpu_experimental_ynn_fusion_type": "LIBRARY_FUSION_TYPE_INDIVIDUAL_CONVOLUTION"}
"""Of a library's kernels none but convolutions, of which we have none: its calls cannot be part of a function."""

NOT_IN_ONE_FUNCTION = {"sort", "top_k"}
"""Operations of JAX that XLA hands to functions of its runtime."""

LOG = logging.getLogger("ig2mj.process")


class SmallCall:
    """A compiled function; see the module. On other backends than the processor it is JAX's own."""

    def __init__(self, function: Callable[..., Any], compiler_options: Mapping[str, int | bool | str] | None = None):
        """Compiles nothing yet.

        Args:
          function: pure, of pytrees of arrays, always of the same shapes. compiler_options: of XLA.
        """
        self._function, self._options = function, dict(compiler_options or {})
        self._call: Any = None  # made by `jax.jit`
        self.is_one = False

    def __call__(self, *arguments: Any) -> Any:
        if self._call is None:
            with GC_PAUSED:
                return self._first(arguments)
        return self._call(*arguments)[0] if self.is_one else self._call(*arguments)

    def _cache_size(self) -> int:
        """How many programs were compiled; the name that JAX's own functions have for it."""
        return 0 if self._call is None else self._call._cache_size()

    def _first(self, arguments: tuple[Any, ...]) -> Any:
        import jax

        possible = jax.default_backend() == "cpu" and any(leaf.size for leaf in jax.tree.leaves(arguments))
        for options in (NO_LIBRARY, {}) if possible else ():
            call = jax.jit(_as_one(self._function), compiler_options={**self._options, **options})
            if NOT_IN_ONE_FUNCTION & _operations(call.trace(*arguments).jaxpr.jaxpr):
                break
            try:
                made = call(*arguments)[0]
            except jax.errors.JaxRuntimeError as e:
                LOG.debug("%s is not compiled as one function: %s", self._function.__name__, e)
                if "compile option" not in str(e):
                    break
            else:
                self._call, self.is_one = call, True
                return made
        self._call = jax.jit(self._function, compiler_options=self._options)
        return self._call(*arguments)


def _as_one(function: Callable[..., Any]) -> Callable[..., tuple[Any, Any]]:
    """A function that calls the function as one; gives a number of each of its arguments, too."""
    import jax
    from jax.experimental.xla_metadata import set_xla_metadata

    def outer(*arguments: Any) -> tuple[Any, Any]:
        leaves, structure = jax.tree.flatten(arguments)
        given = [i for i, leaf in enumerate(leaves) if leaf.size]

        def inner(passed: list[Any]) -> tuple[Any, Any]:
            with set_xla_metadata(**dict.fromkeys(ATTRIBUTES)):  # calls within it are put in place as usual
                every = list(leaves)
                for i, leaf in zip(given, passed, strict=True):
                    every[i] = leaf
                # XLA ends the process where the call has an argument that turns out to be of no use.
                return function(*jax.tree.unflatten(structure, every)), _one_of_each(passed)

        with set_xla_metadata(**ATTRIBUTES):
            return jax.jit(inner)([leaves[i] for i in given])

    outer.__name__ = function.__name__
    return outer


def _operations(jaxpr: Any) -> set[str]:
    """Names of all operations of a program and of the programs in it."""
    from jax.extend.core import subjaxprs

    found = {equation.primitive.name for equation in jaxpr.eqns}
    return found.union(*map(_operations, subjaxprs(jaxpr)))


def _one_of_each(arrays: list[Any]) -> Any:
    import jax
    import jax.numpy as jnp

    plain = [jax.random.key_data(a) if jnp.issubdtype(a.dtype, jax.dtypes.prng_key) else a for a in arrays]
    return jnp.stack([jnp.ravel(a)[0].astype(jnp.float32) for a in plain])
