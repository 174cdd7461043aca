"""What a traced function depends on."""

from __future__ import annotations

import jax
from jax.extend.core import Jaxpr, Literal

from ig2mj.predicates.base import OfStates
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel


def inputs_that_matter(jaxpr: Jaxpr) -> list[bool]:
    """Whether any result of a traced function can depend on each input (an operation depends on all that it takes)."""
    needed = {v for v in jaxpr.outvars if not isinstance(v, Literal)}
    for equation in reversed(jaxpr.eqns):
        if any(v in needed for v in equation.outvars):
            needed.update(v for v in equation.invars if not isinstance(v, Literal))
    return [v in needed for v in jaxpr.invars]


def reads_of_states(of_states: OfStates, model: StateModel) -> set[str]:
    """Paths of the states' arrays, such as "temperature" or "dust.alive", on which a function of them depends."""
    template = initial_states(model, 1)
    paths = [".".join(key.name for key in path) for path, _ in jax.tree_util.tree_flatten_with_path(template)[0]]
    matters = inputs_that_matter(jax.make_jaxpr(lambda states: of_states(model, states))(template).jaxpr)
    return {path for path, used in zip(paths, matters, strict=True) if used}
