"""Substances as arguments of predicates: how they count, and what holds of objects and substances.

Dust, stain and water come first, whether they are in use or not: their predicates need no substances. Then come those
of the scene.

Axes: W worlds, O objects, A substances as arguments, U substances in use, P argument tuples.
"""

from __future__ import annotations

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.errors import UnknownNameError
from ig2mj.knowledge.substances import DUST, STAIN, WATER, substances
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

FIRST = (DUST, STAIN, WATER)

OfPairs = Callable[[StateModel, ExtendedStates], Bool[Array, "W O A"]]
"""Truth for every object and substance."""


def substance_names(model: StateModel) -> tuple[str, ...]:
    """The A axis."""
    used = () if model.substances is None else model.substances.names
    return (*FIRST, *(name for name in used if name != WATER))


def substance_index(model: StateModel, name: str) -> int:
    """Place of a substance on the A axis. Raises UnknownNameError: the scene does not use it."""
    names = substance_names(model)
    if name not in names:
        also = f"load the scene with substances=['{name}'], or --substances {name}" if name in substances() else ""
        raise UnknownNameError("substance in use", name, names, also=also)
    return names.index(name)


def in_use(model: StateModel, table: Bool[Array, "W O U"] | None, num_worlds: int) -> Bool[Array, "W O A"]:
    """A table of the substances in use with columns for those that come first; false where they are not in use.

    `table`: None where the scene uses none.
    """
    objects = model.tables.num_objects
    none = jnp.zeros((num_worlds, objects, 1), bool)
    if table is None:
        return jnp.concatenate([none] * len(FIRST), axis=-1)
    used = () if model.substances is None else model.substances.names
    columns = np.array([used.index(n) if n in used else len(used) for n in substance_names(model)])
    return jnp.concatenate([jnp.asarray(table), none], axis=-1)[..., columns]


def of_pairs(name: str, of: OfPairs, **fields) -> Predicate:
    """A predicate of an object and a substance that reads extended states only."""

    def evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
        return of(context.model, context.states)[:, arguments[:, 0], arguments[:, 1]]

    return Predicate(name=name, arguments=("object", "substance"), evaluate=evaluate, of_arguments=True, **fields)


def no_container(model: StateModel, obj: int) -> str:
    """Why an object never contains substances; "": it may, or no substances are in use."""
    found = model.substances
    if found is None or found.containers.row_of(obj) is not None:
        return ""
    return "it is no container of substances: its model has no inside"


def of_containers(model: StateModel, table: Bool[Array, "W C U"] | None, num_worlds: int) -> Bool[Array, "W O A"]:
    """A table of containers and the substances in use, for all objects and substances."""
    if table is None or model.substances is None:
        return in_use(model, None, num_worlds)
    row = np.full(model.tables.num_objects, table.shape[1])
    row[model.substances.containers.object] = np.arange(table.shape[1])
    none = jnp.zeros((num_worlds, 1, table.shape[2]), bool)
    return in_use(model, jnp.concatenate([jnp.asarray(table), none], axis=1)[:, row], num_worlds)
