"""States of plug-ins in files, also where file and scene have different ones.

A file names the fields of plug-ins' states, and where each comes from. Fields that the file lacks start as in a new
world. Fields that the scene lacks cannot be used: the plug-in is not there.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.errors import InputError, PluginError
from ig2mj.states.added import STATES, extra_states, substance_states
from ig2mj.states.world import ExtendedStates, added_fields
from ig2mj.worlds.archive import name_of

KEY = "plugin_states"
"""Of a file's header: names of fields, and what they come from."""


def plugin_header(states: ExtendedStates | None) -> dict[str, dict[str, str]]:
    """Entry of a file's header; empty where there are no states of plug-ins."""
    fields = [] if states is None else added_fields(states)
    sources = STATES.sources()
    by_field = {field: sources[name] for name, spec in STATES.added().items() for field in spec.fields}
    by_field |= {field: "substances of its scene" for spec in substance_states() for field in spec.fields}
    by_field |= {field: f"with:{spec.extra} of its scene" for spec in extra_states() for field in spec.fields}
    return {KEY: {field: by_field.get(field, "this program") for field in fields}} if fields else {}


def foreign_fields(header: Mapping[str, Any], states: ExtendedStates | None) -> dict[str, str]:
    """Fields of a file that these states lack, and where they come from."""
    named, own = header.get(KEY), set() if states is None else set(added_fields(states))
    if not isinstance(named, Mapping):
        return {}
    return {str(field)[:80]: str(source)[:80] for field, source in named.items() if field not in own}


def refuse_foreign(header: Mapping[str, Any], states: ExtendedStates | None, file: str | os.PathLike) -> None:
    """Raises InputError: the file has states of plug-ins that these states lack."""
    for field, source in foreign_fields(header, states).items():
        fix = f"it is from {source}; install or register it before the scene is made"
        raise InputError(file, f"holds the state '{field}', which is not registered here", fix=fix)


def plugin_defaults(initial: ExtendedStates | None, num_worlds: int, prefix: str = "states.") -> dict[str, np.ndarray]:
    """Arrays that a file may lack, by path: fields of plug-ins' states as worlds begin with them."""
    if initial is None or not (fields := added_fields(initial)):
        return {}
    tree = {name: getattr(initial, name) for name in fields}
    paths = jax.tree_util.tree_leaves_with_path(tree)
    return {prefix + name_of(keys): np.repeat(np.asarray(leaf)[:1], num_worlds, axis=0) for keys, leaf in paths}


def completed(states: ExtendedStates, initial: ExtendedStates) -> ExtendedStates:
    """States with the fields of `initial`, which is of one world.

    Raises:
      PluginError: they have a field that `initial` lacks.
    """
    if type(states) is type(initial):
        return states
    own = added_fields(initial)
    if lacking := [field for field in added_fields(states) if field not in own]:
        raise PluginError(f"there is a state '{lacking[0]}' that the scene's states lack: load the scene again")
    count = states.temperature.shape[0]

    def rows(leaf: Any) -> Any:
        numbers = np if isinstance(states.temperature, np.ndarray) else jnp
        return numbers.broadcast_to(numbers.asarray(leaf)[:1], (count, *leaf.shape[1:]))

    values = {name: getattr(states, name) for name in states.__dataclass_fields__}
    for name in own:
        if name not in values:
            values[name] = jax.tree.map(rows, getattr(initial, name))
    return type(initial)(**values)
