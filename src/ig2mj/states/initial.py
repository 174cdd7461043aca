"""Extended states at the start of an episode: plain ones, and those a manifest gives (`ObjectEntry.state`)."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.scene.manifest import Manifest
from ig2mj.states.model import StateModel
from ig2mj.states.registry import SPECS
from ig2mj.states.spec import Saved
from ig2mj.states.world import ExtendedStates


def initial_states(model: StateModel, num_worlds: int) -> ExtendedStates:
    """Everything at room temperature, dry, clean, switched off, whole."""
    states = jax.device_put(_one_world(model))
    return states if num_worlds == 1 else _repeated(states, num_worlds)


def _one_world(model: StateModel) -> ExtendedStates:
    """NumPy arrays."""
    values: dict[str, Any] = {}
    for spec in SPECS:
        if spec.initial is not None:
            found = spec.initial(model)
            if set(found) != set(spec.fields):
                raise ValueError(f"state '{spec.name}' has fields {sorted(spec.fields)} but starts {sorted(found)}")
            values.update(found)
    return ExtendedStates(**values)


@functools.partial(jax.jit, static_argnums=1)
def _repeated(states: ExtendedStates, num_worlds: int) -> ExtendedStates:
    """One program instead of one per array."""
    return jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (num_worlds, *leaf.shape[1:])), states)


def states_of_manifest(
    model: StateModel, manifest: Manifest, bodies: Mapping[str, int], num_worlds: int = 1
) -> ExtendedStates:
    """The states that a converted scene starts with, the same in every world.

    The manifest's keys are those of `ig2mj_converters.reading.cached_states`; each state's `from_manifest` reads its
    own. Values of objects without the ability are left out.

    Args:
      bodies: MuJoCo ids of body names.
    """
    # Filled in on the host, one world, then repeated.
    states = _one_world(model)
    for obj, entry in enumerate(manifest.objects):
        for spec in SPECS:
            if spec.from_manifest is not None:
                spec.from_manifest(Saved(model, states, obj, entry.state, bodies))
    return jax.device_put(jax.tree.map(lambda leaf: np.repeat(leaf, num_worlds, axis=0), states))
