"""`OfView`: a function of the view, compiled so that it takes just the fields on which its results depend.

Beside the native engine many fields of the view are only made when they are read, and every array that goes into a
compiled function costs a microsecond.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from ig2mj.engine.view import SCHEMA, PhysicsView, assemble, read_field
from ig2mj.predicates.tracing import inputs_that_matter


class OfView:
    """A pure function whose first argument is the view; the others are pytrees. Traced at its first call."""

    def __init__(self, function: Callable[..., Any]):
        self._function = function
        self._programs: dict[Any, tuple[tuple[str, ...], Any]] = {}  # by structure of the other arguments

    def __call__(self, view: PhysicsView, *others: Any) -> Any:
        structure = jax.tree.structure(others)
        found = self._programs.get(structure)
        if found is None:
            found = self._programs[structure] = self._trace(view, others)
        reads, program = found
        return program([read_field(view, name) for name in reads], *others)

    def _cache_size(self) -> int:
        """How many programs were compiled; the name that JAX's own functions have for it."""
        return sum(program._cache_size() for _, program in self._programs.values())

    def _trace(self, view: PhysicsView, others: tuple[Any, ...]) -> tuple[tuple[str, ...], Any]:
        fields = [read_field(view, name) for name in SCHEMA]
        shapes = {n: jax.ShapeDtypeStruct(f.shape, f.dtype) for n, f in zip(SCHEMA, fields, strict=True)}

        def whole(fields: list[Any], *others: Any) -> Any:
            return self._function(assemble(dict(zip(SCHEMA, fields, strict=True))), *others)

        matters = inputs_that_matter(jax.make_jaxpr(whole)(list(shapes.values()), *others).jaxpr)
        reads = tuple(name for name, used in zip(SCHEMA, matters, strict=False) if used)

        def program(fields: list[Any], *others: Any) -> Any:
            blank = {name: np.zeros(s.shape, s.dtype) for name, s in shapes.items() if name not in reads}
            return self._function(assemble({**blank, **dict(zip(reads, fields, strict=True))}), *others)

        return reads, jax.jit(program)
