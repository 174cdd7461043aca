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
from jaxtyping import Bool, Float, UInt32

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.frames import Numbers, numbers, some, sums, total
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep, Saved, StateSpec, nothing_inherited
from ig2mj.states.substances import coat
from ig2mj.states.substances.model import of
from ig2mj.states.substances.streams import MOST, Falling, Landed, land

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


class Standing(NamedTuple):
    """How containers stand: litres that stay in each, and whether its opening points down."""

    holds: Float[Array, "W C"]
    down: Bool[Array, "W C"]


def standing(model: StateModel, view: PhysicsView) -> Standing:
    """How containers stand in a view."""
    containers = of(model).containers
    return Standing(containers.holds(view), containers.frames(view).turned(numbers(containers.normal))[2] < 0.0)


def outflow(model: StateModel, states: ExtendedStates, volume: Float[Array, "W C U"], stand: Standing) -> Outflow:
    """What leaves each container in this step.

    Args:
      volume: what is in it, litres.
    """
    dt = model.options.timestep
    free = jnp.where(states.solid, 0.0, volume)
    available = total(free)
    excess = total(volume) - stand.holds
    wanted = jnp.maximum(excess * (dt / OUTFLOW_TIME), jnp.minimum(excess, LEAST_OUTFLOW))
    leaving = jnp.clip(wanted, 0.0, available)
    share = free / jnp.maximum(available, 1e-12)[..., None]
    left = jnp.minimum(share * leaving[..., None], volume)
    return Outflow(left, (states.stock & ~states.solid & stand.down[..., None]) * np.float32(SOURCE_RATE * dt))


class Outflow(NamedTuple):
    """Litres that leave each container in a step, and those that its sources give besides."""

    left: Float[Array, "W C U"]
    given: Float[Array, "W C U"]


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
    litres = total(volume)
    leaving = jnp.minimum(litres, DRAIN_RATE * model.options.timestep) * drains
    return jnp.minimum(volume / jnp.maximum(litres, 1e-12)[..., None] * leaving[..., None], volume)


class Outlets(NamedTuple):
    """What flows in a step, before it is known where to.

    Attributes:
      volume: of containers after they drained. gone: what drains took. flow: of containers, and from_taps: of taps, all
        of them. chosen: outlet of each stream.
    """

    volume: Float[Array, "W C U"]
    gone: Float[Array, "W C U"]
    flow: Outflow
    from_taps: Float[Array, "W T U"]
    chosen: Bool[Array, "W K E"]


class Streams(NamedTuple):
    """Where the streams of chosen outlets begin (m, world frame), where they end, and which points of the objects that
    they meet they cover."""

    start: Numbers
    landed: Landed
    points: UInt32[Array, "W K"]


def update(step: EventStep) -> EventStep:
    """One control step of all volumes."""
    if not has_outlets(step.model):
        return step
    out = outlets(step.model, step.states, standing(step.model, step.view))
    return poured(step, out, streams(step.model, step.view, out.chosen))


def outlets(model: StateModel, states: ExtendedStates, stand: Standing) -> Outlets:
    """What flows in a step that begins with these states."""
    gone = drained(model, states.volume)
    volume = states.volume - gone
    flow, from_taps = outflow(model, states, volume, stand), taps(model, states.toggled_on)
    flowing = jnp.concatenate([total(flow.left + flow.given) > 0, total(from_taps) > 0], axis=1)  # [W, E]
    before = np.tri(flowing.shape[1], k=-1, dtype=bool)
    turn = jnp.sum(flowing[:, None] & before, axis=-1)
    chosen = flowing[:, None] & (turn[:, None] == np.arange(MOST)[:, None])
    return Outlets(volume, gone, flow, from_taps, chosen)


def poured(step: EventStep, out: Outlets, ends: Streams) -> EventStep:
    """The step after contents flowed where their streams end. `ends`: of the chosen outlets."""
    model, states = step.model, step.states
    count = len(of(model).containers.body)
    flows = some(out.chosen, axis=1)[..., None]
    left, given = (jnp.where(flows[:, :count], x, 0.0) for x in out.flow)
    from_taps = jnp.where(flows[:, count:], out.from_taps, 0.0)
    of_containers = jnp.where(out.chosen[:, :, :count, None], (left + given)[:, None], 0.0)
    of_taps = jnp.where(out.chosen[:, :, count:, None], from_taps[:, None], 0.0)
    amounts = jnp.sum(of_containers, axis=2) + total(of_taps, axis=2)  # [W, K, U]
    into = total(jnp.where(ends.landed.container[..., None], amounts[:, :, None], 0.0), axis=1)
    outside = jnp.where(jnp.any(ends.landed.container, axis=-1)[..., None], 0.0, amounts)
    states = dataclasses.replace(
        states,
        volume=jnp.maximum(out.volume - left, 0.0) + into,
        lost=states.lost + jnp.sum(out.gone, axis=1) + total(outside, axis=1),
        drawn=states.drawn + jnp.sum(given, axis=1) + total(from_taps, axis=1),
    )
    by_taps = some(out.chosen[:, :, count:])  # their drops soak (`ig2mj.states.definitions.water`)
    states = coat.spilled(model, states, outside, ends.landed.object, ends.points, by_taps)
    return dataclasses.replace(step, states=states)


def has_outlets(model: StateModel) -> bool:
    """Whether something can flow in a scene."""
    return bool(len(of(model).containers.body) or len(model.parameters.water_object))


def streams(model: StateModel, view: PhysicsView, chosen: Bool[Array, "W K E"]) -> Streams:
    """Where the streams of the chosen outlets end."""
    containers = of(model).containers
    worlds, most = chosen.shape[:2]

    def follow() -> Streams:
        openings, taps = containers.openings(view), numbers(jnp.asarray(view.link_pos)[:, _tap_links(model)])
        straight = jnp.zeros(taps[0].shape)
        begins = [jnp.concatenate(x, axis=1) for x in zip(openings.lowest(), taps, strict=True)]
        outwards = [jnp.concatenate([n, straight], axis=1) for n in openings.outwards()]
        owner = np.concatenate([containers.object, np.full(len(_tap_links(model)), -1)])  # a tap's own basin takes it
        found = sums(
            [jnp.where(chosen, x[:, None], 0.0) for x in (*begins, *outwards)]
            + [jnp.where(chosen, x, 0).astype(jnp.int32) for x in (1, 1 + owner)],
            axis=2,
        )
        start, aside, active, origin = list(found[:3]), list(found[3:5]), found[5] > 0, found[6] - 1
        falling = Falling(active, start, aside, chosen[:, :, : len(containers.body)], origin)
        landed = land(model.tables, containers, falling, view)
        return Streams(start, landed, coat.points_near(model, landed, view))

    def none() -> Streams:
        container = jnp.zeros((worlds, most, len(containers.body)), bool)
        nothing = jnp.full((worlds, most), -1, jnp.int32)
        nowhere = [jnp.zeros((worlds, most))] * 3
        return Streams(nowhere, Landed(container, nothing, nowhere), jnp.zeros((worlds, most), jnp.uint32))

    return jax.lax.cond(jnp.any(chosen), follow, none)


def _tap_links(model: StateModel) -> np.ndarray:
    return model.parameters.water_link if of(model).water >= 0 else np.zeros(0, int)


def idle(step: EventStep) -> Bool[Array, ""]:
    """Nothing flows, and nothing drains."""
    model, states = step.model, step.states
    flow = outflow(model, states, states.volume, standing(model, step.view))
    moving = jnp.any(flow.left + flow.given + drained(model, states.volume) > 0)
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
