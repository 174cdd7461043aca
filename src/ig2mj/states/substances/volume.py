"""Volumes: litres of each substance in each container; what flows out, where it goes, and what it does there.

What a container holds above its capacity as it stands flows out (`Containers.holds`), in the ratio of its contents;
what is frozen stays. Sources and taps give without becoming empty. Containers and objects with a drain swallow. The sum
over containers, plus `lost`, minus `drawn`, stays the same to rounding.

Axes: W worlds, C containers, U substances, E = C + T outlets (T taps), K streams, D objects that can be covered, N = 20
points, O objects.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep, Saved, StateSpec, nothing_inherited
from ig2mj.states.substances import coat
from ig2mj.states.substances.model import of
from ig2mj.states.substances.streams import MOST, Landed, falling_from, land

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates

OUTFLOW_TIME = 0.3
"""s in which what is too much falls to 1/e."""

LEAST_OUTFLOW = 1e-4
"""Litres that leave in a step at least, while there is too much: a stream ends."""

TAP_RATE = 0.1
"""l/s of a tap: 6 litres a minute, an ordinary tap."""

SOURCE_RATE = 0.05
"""l/s of a container that is a source, while its opening points down."""

DRAIN_RATE = 0.3
"""l/s of a drain."""

FILLED = 0.2
"""Share of a container's litres above which it is filled (OmniGibson's filled.py)."""

CONTAINS = 1e-4
"""Litres from which a container contains a substance: OmniGibson asks for one particle (contains.py), and a particle of
water of its size is 0.06 ml."""


def contains(model: StateModel, volume: Float[Array, "W C U"]) -> Bool[Array, "W C U"]:
    """Whether each container contains each substance."""
    return volume >= CONTAINS


def filled(model: StateModel, volume: Float[Array, "W C U"]) -> Bool[Array, "W C U"]:
    """Whether each container is filled with each substance."""
    return volume > FILLED * of(model).containers.litres[:, None]


def outflow(
    model: StateModel,
    volume: Float[Array, "W C U"],
    stock: Bool[Array, "W C U"],
    solid: Bool[Array, "W C U"],
    view: PhysicsView,
) -> tuple[Float[Array, "W C U"], Float[Array, "W C U"]]:
    """Litres that leave each container in this step, and those that its sources give besides."""
    containers, dt = of(model).containers, model.options.timestep
    free = jnp.where(solid, 0.0, volume)
    available = jnp.sum(free, axis=-1)
    excess = jnp.sum(volume, axis=-1) - containers.holds(view)
    wanted = jnp.maximum(excess * (dt / OUTFLOW_TIME), jnp.minimum(excess, LEAST_OUTFLOW))
    leaving = jnp.clip(wanted, 0.0, available)
    share = free / jnp.maximum(available, 1e-12)[..., None]
    left = jnp.minimum(share * leaving[..., None], volume)
    down = containers.openings(view).normal[..., 2] < 0.0
    return left, (stock & ~solid & down[..., None]) * np.float32(SOURCE_RATE * dt)


def taps(model: StateModel, toggled_on: Bool[Array, "W O"]) -> Float[Array, "W T U"]:
    """Litres that each tap gives in this step."""
    found, sources = of(model), model.parameters.water_object
    worlds = toggled_on.shape[0]
    if found.water < 0 or not len(sources):
        return jnp.zeros((worlds, 0, len(found.substances)))
    on = jnp.where(model.parameters.has("toggleable")[sources], toggled_on[:, sources], True)
    amount = np.where(np.arange(len(found.substances)) == found.water, TAP_RATE * model.options.timestep, 0.0)
    return on[..., None] * amount.astype(np.float32)


def drained(model: StateModel, volume: Float[Array, "W C U"]) -> Float[Array, "W C U"]:
    """Litres that leave each container through its drain in this step."""
    drains = of(model).containers.drains
    if not drains.any():
        return jnp.zeros_like(volume)
    total = jnp.sum(volume, axis=-1)
    leaving = jnp.minimum(total, DRAIN_RATE * model.options.timestep) * drains
    return jnp.minimum(volume / jnp.maximum(total, 1e-12)[..., None] * leaving[..., None], volume)


class Streams(NamedTuple):
    """Which outlets had streams in a step, and where these ended."""

    chosen: Bool[Array, "W K E"]
    landed: Landed


def update(step: EventStep) -> EventStep:
    """One control step of all volumes."""
    return flow(step)[0]


def flow(
    step: EventStep, before: Streams | None = None, same: Bool[Array, ""] | bool = False
) -> tuple[EventStep, Streams | None]:
    """One control step of all volumes, and its streams; None where the scene has no outlets.

    Args:
      before: those of another step. same: nothing has moved since that step, so that the streams of the same outlets
        end where they did.
    """
    model, states, view = step.model, step.states, step.view
    found = of(model)
    containers = found.containers
    if not has_outlets(model):
        return step, None
    gone = drained(model, states.volume)
    volume = states.volume - gone
    left, given = outflow(model, volume, states.stock, states.solid, view)
    from_taps = taps(model, states.toggled_on)
    amounts = jnp.concatenate([left + given, from_taps], axis=1)  # [W, E, U]
    flowing = jnp.any(amounts > 0, axis=-1)
    turn = jnp.cumsum(flowing, axis=1) - 1
    chosen = flowing[:, None] & (turn[:, None] == np.arange(MOST)[:, None])  # [W, K, E]
    flows = jnp.any(chosen, axis=1)[..., None]
    count = len(containers.body)
    left, given, from_taps = (jnp.where(flows[:, a:b], x, 0.0) for a, b, x in
                              ((0, count, left), (0, count, given), (count, None, from_taps)))  # fmt: skip
    amounts = jnp.sum(jnp.where(chosen[..., None], amounts[:, None], 0.0), axis=2)  # [W, K, U]
    landed = _landed(model, chosen, view, before, same)
    into = jnp.sum(jnp.where(landed.container[..., None], amounts[:, :, None], 0.0), axis=1)
    outside = jnp.where(jnp.any(landed.container, axis=-1)[..., None], 0.0, amounts)
    states = dataclasses.replace(
        states,
        volume=jnp.maximum(volume - left, 0.0) + into,
        lost=states.lost + jnp.sum(gone, axis=1) + jnp.sum(outside, axis=1),
        drawn=states.drawn + jnp.sum(given, axis=1) + jnp.sum(from_taps, axis=1),
    )
    by_taps = jnp.any(chosen[:, :, count:], axis=-1)  # their drops soak (`ig2mj.states.definitions.water`)
    step = dataclasses.replace(step, states=coat.spilled(model, states, outside, landed, by_taps, view))
    return step, Streams(chosen, landed)


def has_outlets(model: StateModel) -> bool:
    """Whether something can flow in a scene."""
    return bool(len(of(model).containers.body) or len(model.parameters.water_object))


def no_streams(model: StateModel, worlds: int) -> Streams:
    """Streams of a step in which nothing flows. NumPy arrays."""
    containers, outlets = len(of(model).containers.body), len(of(model).containers.body) + len(_tap_links(model))
    return Streams(
        np.zeros((worlds, MOST, outlets), bool),
        Landed(
            np.zeros((worlds, MOST, containers), bool),
            np.full((worlds, MOST), -1, np.int32),
            np.zeros((worlds, MOST, 3), np.float32),
        ),
    )


def _landed(
    model: StateModel,
    chosen: Bool[Array, "W K E"],
    view: PhysicsView,
    before: Streams | None,
    same: Bool[Array, ""] | bool,
) -> Landed:
    """Where the streams of the chosen outlets end."""
    containers = of(model).containers

    def follow() -> Landed:
        start, aside = _beginnings(model, view)
        falling = falling_from(
            jnp.any(chosen, axis=-1),
            jnp.sum(jnp.where(chosen[..., None], start[:, None], 0.0), axis=2),
            jnp.sum(jnp.where(chosen[..., None], aside[:, None], 0.0), axis=2),
            chosen[:, :, : len(containers.body)],
            _origins(model, chosen),
            containers.openings(view),
            view,
        )
        return land(model.tables, containers, falling)

    if before is None:
        return follow()
    known = same & jnp.all(before.chosen == chosen)
    return jax.lax.cond(known, lambda: jax.tree.map(jnp.asarray, before.landed), follow)


def _beginnings(model: StateModel, view: PhysicsView) -> tuple[Float[Array, "W E 3"], Float[Array, "W E 2"]]:
    """Where streams of each outlet begin (m, world), and the unit vector outwards (0 of a tap)."""
    openings = of(model).containers.openings(view)
    low, out = openings.lowest(), openings.outwards()
    tap = jnp.asarray(view.link_pos)[:, _tap_links(model)]
    return jnp.concatenate([low, tap], axis=1), jnp.concatenate([out, jnp.zeros(tap[..., :2].shape)], axis=1)


def _tap_links(model: StateModel) -> np.ndarray:
    return model.parameters.water_link if of(model).water >= 0 else np.zeros(0, int)


def _origins(model: StateModel, chosen: Bool[Array, "W K E"]) -> Int[Array, "W K"]:
    """The object that each stream comes from; -1 of a tap, since its own basin takes it."""
    owner = np.concatenate([of(model).containers.object, np.full(len(_tap_links(model)), -1)])
    return jnp.max(jnp.where(chosen, owner, -1), axis=2, initial=-1)


def idle(step: EventStep) -> Bool[Array, ""]:
    """Nothing flows, and nothing drains."""
    model, states = step.model, step.states
    left, given = outflow(model, states.volume, states.stock, states.solid, step.view)
    moving = jnp.any(left > 0) | jnp.any(given > 0) | jnp.any(drained(model, states.volume) > 0)
    return ~moving & ~jnp.any(taps(model, states.toggled_on) > 0)


def set_volume(
    model: StateModel, states: ExtendedStates, obj: int, name: str, litres: float | Float[np.ndarray, "W"]
) -> ExtendedStates:
    """The states with so much of a substance in a container, in every world; NumPy arrays stay that."""
    found = of(model)
    row = found.containers.row_of(obj)
    assert row is not None and name in found.names
    own = (np.arange(len(found.containers.object)) == row)[:, None] & (
        np.arange(len(found.names)) == found.names.index(name)
    )
    xp: Any = np if isinstance(states.volume, np.ndarray) else jnp
    value = xp.asarray(litres, np.float32).reshape(-1, 1, 1)
    return dataclasses.replace(states, volume=xp.where(own, value, states.volume).astype(np.float32))


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    found = of(model)
    containers, substances = len(found.containers.object), len(found.substances)
    return {
        "volume": np.zeros((1, containers, substances), np.float32),
        "stock": np.zeros((1, containers, substances), bool),
        "lost": np.zeros((1, substances), np.float32),
        "drawn": np.zeros((1, substances), np.float32),
    }


def _from_manifest(saved: Saved) -> None:
    """From "volume", {substance: litres}, and "stock", a list of substances."""
    found = of(saved.model)
    row = found.containers.row_of(saved.obj)
    if row is None:
        return
    for name, litres in saved.values.get("volume", {}).items():
        if name in found.names:
            saved.states.volume[0, row, found.names.index(name)] = litres
    for name in saved.values.get("stock", ()):
        if name in found.names:
            saved.states.stock[0, row, found.names.index(name)] = True


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> float:
    row = of(model).containers.row_of(obj)
    return 0.0 if row is None else float(np.asarray(states.volume)[world, row].sum())


SPEC = StateSpec(
    name="volume",
    get=_get,
    abilities=None,
    of_substances=True,
    unit="l",
    fields={
        "volume": Float[Array, "W C U"],
        "stock": Bool[Array, "W C U"],
        "lost": Float[Array, "W U"],
        "drawn": Float[Array, "W U"],
    },
    initial=_initial,
    update=update,
    idle=idle,
    inherit=nothing_inherited,  # what can be cut holds nothing
    from_manifest=_from_manifest,
)
