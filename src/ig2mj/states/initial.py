"""Extended states at the start of an episode: plain ones, and those a manifest gives (`ObjectEntry.state`)."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.scene.manifest import Manifest
from ig2mj.states.model import StateModel
from ig2mj.states.registry import SPECS
from ig2mj.states.spec import Saved
from ig2mj.states.world import ExtendedStates, states_class

NUMBERS = ("temperature", "max_temperature", "wetness", "toggled_on", "sliced")
"""Keys of a manifest that are one number per object, and the fields of the same names."""

PARTICLES = ("dust", "stain")
"""Keys of a manifest that are lists of particles, and the fields of the same names."""


def initial_states(model: StateModel, num_worlds: int) -> ExtendedStates:
    """Everything at room temperature, dry, clean, switched off, whole."""
    states = jax.device_put(_one_world(model))
    return states if num_worlds == 1 else _repeated(states, num_worlds)


def _one_world(model: StateModel) -> ExtendedStates:
    """NumPy arrays."""
    values: dict[str, Any] = {}
    for spec in (*SPECS, *model.added):
        if spec.initial is not None:
            found = spec.initial(model)
            if set(found) != set(spec.fields):
                raise ValueError(f"state '{spec.name}' has fields {sorted(spec.fields)} but starts {sorted(found)}")
            values.update(found)
    return states_class(model.added)(**values)


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
        for spec in (*SPECS, *model.added):
            if spec.from_manifest is not None:
                spec.from_manifest(Saved(model, states, obj, entry.state, bodies))
    return jax.device_put(jax.tree.map(lambda leaf: np.repeat(leaf, num_worlds, axis=0), states))


def manifest_states(
    model: StateModel, states: ExtendedStates, bodies: Sequence[str]
) -> list[dict[str, float | bool | list[dict[str, Any] | None]]]:
    """What a manifest says of each object that starts with these states of one world: the inverse of
    `states_of_manifest`, without water on its way. Values that every object starts with are left out.

    Args:
      bodies: names of MuJoCo's bodies, by id.
    """
    plain = _one_world(model)
    found: list[dict[str, Any]] = [{} for _ in range(model.tables.num_objects)]
    for name in NUMBERS:
        values, usual = (np.asarray(getattr(of, name))[0] for of in (states, plain))
        for obj in np.flatnonzero(values != usual):
            found[obj][name] = values[obj].item()
    for name in PARTICLES:
        rows = jax.tree.map(np.asarray, getattr(states, name))
        for row, obj in enumerate(getattr(model.parameters, f"{name}_rows")):
            if rows.placed[0, row].any():
                found[obj][name] = [_particle(rows, row, n, bodies) for n in range(rows.placed.shape[2])]
    return found


def _particle(rows: Any, row: int, n: int, bodies: Sequence[str]) -> dict[str, Any] | None:
    """A particle in its body's frame, w-x-y-z; None: it is not there."""
    if not rows.alive[0, row, n]:
        return None
    normal = np.asarray(rows.normal[0, row, n], float)
    quat = np.array([1 + normal[2], -normal[1], normal[0], 0.0])  # turns the z axis to the normal
    quat = quat / np.linalg.norm(quat) if normal[2] > -1 + 1e-6 else np.array([0.0, 1.0, 0.0, 0.0])
    pos = [round(float(v), 6) for v in rows.pos[0, row, n]]
    return {"body": bodies[int(rows.body[0, row, n])], "pos": pos, "quat": [round(float(v), 6) for v in quat]}
