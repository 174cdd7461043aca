"""Extended states at the start of an episode: plain ones, and those a manifest gives (`ObjectEntry.state`)."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.scene.manifest import Manifest
from ig2mj.states import particles
from ig2mj.states.definitions import max_temperature, temperature, water, wetness
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

FIELDS = {
    "temperature": "temperature",
    "max_temperature": "max_temperature",
    "wetness": "wetness",
    "toggled": "toggled",
    "toggled_steps": "press_count",
    "sliced": "sliced",
}
"""Keys of a manifest's `state` that are one number per object, and the fields they go to."""


def initial_states(model: StateModel, num_worlds: int) -> ExtendedStates:
    """Everything at room temperature, dry, clean, switched off, whole."""
    p = model.parameters
    return _plain(num_worlds, model.tables.num_objects, len(p.water_object), len(p.dust_rows), len(p.stain_rows))


@functools.partial(jax.jit, static_argnums=(0, 1, 2, 3, 4))
def _plain(num_worlds: int, objects: int, sources: int, dust_rows: int, stain_rows: int) -> ExtendedStates:
    """One program instead of one per array."""
    shape = (num_worlds, objects)
    return ExtendedStates(
        temperature=temperature.initial(*shape),
        max_temperature=max_temperature.initial(*shape),
        wetness=wetness.initial(*shape),
        toggled=jnp.zeros(shape, bool),
        press_count=jnp.zeros(shape, jnp.int32),
        sliced=jnp.zeros(shape, bool),
        water=water.no_drops(num_worlds, sources),
        dust=particles.no_particles(num_worlds, dust_rows),
        stain=particles.no_particles(num_worlds, stain_rows),
    )


def states_of_manifest(
    model: StateModel, manifest: Manifest, bodies: Mapping[str, int], num_worlds: int = 1
) -> ExtendedStates:
    """The states that a converted scene starts with, the same in every world.

    The manifest's keys are those of `ig2mj_converters.reading.cached_states`: `FIELDS`; "dust" and "stain", lists of
    null or {"body", "pos", "quat"} whose z axis is the normal; "water", {"steps_since_drop", "drops"}, with
    entries that are null or a position.
    Particles count as placed where they are there; values of objects without the ability are left out.

    Args:
      bodies: MuJoCo ids of body names.
    """
    # Filled in on the host, one world, then repeated.
    states = jax.tree.map(lambda leaf: np.array(leaf), initial_states(model, 1))
    p = model.parameters
    for o, entry in enumerate(manifest.objects):
        for key, field in FIELDS.items():
            if key in entry.state:
                getattr(states, field)[0, o] = entry.state[key]
        for key, rows in (("dust", p.dust_rows), ("stain", p.stain_rows)):
            for row in np.flatnonzero(rows == o):
                _fill(getattr(states, key), int(row), entry.state.get(key, ()), bodies)
        for source in np.flatnonzero(p.water_object == o):
            _fill_water(states.water, int(source), entry.state.get("water", {}))
    return jax.device_put(jax.tree.map(lambda leaf: np.repeat(leaf, num_worlds, axis=0), states))


def _fill(
    rows: particles.Particles, row: int, entries: Sequence[Mapping[str, Any] | None], bodies: Mapping[str, int]
) -> None:
    """Writes saved particles into one row, in place."""
    for n, entry in enumerate(entries[: particles.NUM_PARTICLES]):
        if entry is not None and entry["body"] in bodies:
            rows.alive[0, row, n] = rows.placed[0, row, n] = True
            rows.body[0, row, n] = bodies[entry["body"]]
            rows.pos[0, row, n] = entry["pos"]
            rows.normal[0, row, n] = _z_axis(np.asarray(entry["quat"], float))


def _fill_water(drops: water.WaterDrops, source: int, saved: Mapping[str, Any]) -> None:
    """Writes saved drops of one source, in place; they start at rest."""
    for n, pos in enumerate(saved.get("drops", ())[: water.NUM_DROPS]):
        if pos is not None:
            drops.active[0, source, n] = True
            drops.pos[0, source, n] = pos
    if saved.get("steps_since_drop") is not None:
        drops.waited[0, source] = saved["steps_since_drop"]


def _z_axis(quat: Float[np.ndarray, "4"]) -> Float[np.ndarray, "3"]:
    w, x, y, z = quat / np.linalg.norm(quat)
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
