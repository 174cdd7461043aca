"""What a traced function depends on."""

from __future__ import annotations

from jax.extend.core import Jaxpr, Literal


def inputs_that_matter(jaxpr: Jaxpr) -> list[bool]:
    """Whether any result of a traced function can depend on each input (an operation depends on all that it takes)."""
    needed = {v for v in jaxpr.outvars if not isinstance(v, Literal)}
    for equation in reversed(jaxpr.eqns):
        if any(v in needed for v in equation.outvars):
            needed.update(v for v in equation.invars if not isinstance(v, Literal))
    return [v in needed for v in jaxpr.invars]
