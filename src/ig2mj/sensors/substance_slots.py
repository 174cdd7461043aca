"""Substances and fire as cameras show them: shapes behind the particles, in each world its own.

| shapes | as many as |
|---|---|
| surfaces of contents (`ig2mj.sensors.content_levels`) | containers |
| pieces of the streams that leave containers | `PIECES` for each of `streams.MOST` streams |
| puffs of steam over hot liquids | `PUFFS` for each of `STEAMING` containers |
| spots on what is covered, puddles among them | particles that the camera shows |
| tongues of flames | `TONGUES` for each of `FIRES` objects on fire |

Scenes without substances have none of the first four, and scenes without fire none of the last.

Axes: W worlds, S slots, C containers, K streams, M containers that steam, D objects that can be covered, U substances,
O objects.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate
from ig2mj.sensors.content_levels import levels, rectangles
from ig2mj.sensors.slots import FIRE, SUBSTANCE, Slots, free_slots
from ig2mj.states.model import StateModel
from ig2mj.states.substances import coat, volume
from ig2mj.states.substances.model import NUM_POINTS, SubstanceModel, of
from ig2mj.states.substances.streams import GRAVITY, LIP, MOST, SPEED
from ig2mj.states.world import ExtendedStates

PIECES = 4
"""Of a stream."""

STREAM_RADIUS, LONGER = 0.004, 1.4
"""m, and the factor by which a piece is longer than its part of the way, so that they make one shape."""

LONGEST = 1.5
"""m down which a stream that meets nothing is shown."""

SPOT_THICKNESS = 0.0015
"""m: half that of a spot."""

SPOT, SPOT_OF_VISUAL = 0.12, 0.08
"""Radius of a spot as a share of the middle size of the object's box, of substances with a volume and others."""

SPOT_LEAST, SPOT_MOST = 0.006, 0.12
"""m: radii."""

FIRES, TONGUES = 4, 14
"""Objects on fire that are shown, and tongues of each."""

FLAME_HEIGHT, FLAME_RADIUS = 0.2, 0.032
"""m to which tongues rise, and half the width of one at the bottom."""

STEAMS = 60.0
"""Degrees Celsius from which steam rises."""

STEAMING, PUFFS = 4, 5
"""Containers whose steam is shown, and puffs of each."""

STEAM_HEIGHT, STEAM_RADIUS, STEAM_ASIDE, STEAM_COLOUR = 0.18, (0.008, 0.02), 0.012, 0.92
"""m to which puffs rise, their radii below and above, m by which they are aside, and their grey: cameras show them
opaque, so that they are small and apart."""

ELLIPSOID, BOX = mujoco.mjtGeom.mjGEOM_ELLIPSOID, mujoco.mjtGeom.mjGEOM_BOX


def shape_kinds(model: StateModel, particles: int) -> tuple[mujoco.mjtGeom, ...]:
    """Of the shapes of a camera with so many particles; none where it shows no particles."""
    kinds = list[mujoco.mjtGeom]()
    if particles and model.substances is not None:
        kinds += [BOX if flat else ELLIPSOID for flat in rectangles(model)]
        kinds += [ELLIPSOID] * ((MOST * PIECES + STEAMING * PUFFS) * _has_streams(model) + particles)
    if particles and _can_burn(model):
        kinds += [ELLIPSOID] * (FIRES * TONGUES)
    return tuple(kinds)


def shapes(model: StateModel, states: ExtendedStates, view: PhysicsView, particles: int) -> Slots | None:
    """The slots of every world, in the order of `shape_kinds`; None where there are none. Pure."""
    found = list[Slots]()
    if particles and model.substances is not None:
        surface = levels(model, states, view)
        owner = jnp.broadcast_to(jnp.asarray(of(model).containers.object, jnp.int32), surface.there.shape)
        found.append(_slots(SUBSTANCE, surface.there, surface.pos, surface.axes, surface.half, surface.rgb, owner))
        if _has_streams(model):
            found.append(_streams(model, states, view, surface.pos[..., 2], surface.there))
            found.append(_steam(model, states, view))
        found.append(_spots(model, states, view, particles))
    if particles and _can_burn(model):
        found.append(_flames(states, view))
    return jax.tree.map(lambda *parts: jnp.concatenate(parts, axis=1), *found) if found else None


def spot_radii(model: StateModel) -> Float[np.ndarray, "D U"]:
    """m, of what each substance leaves on each object."""
    found = of(model)
    size = np.median(model.tables.object_bbox[found.covered], axis=-1).reshape(-1)
    share = np.array([SPOT if s.kind != "visual" else SPOT_OF_VISUAL for s in found.substances])
    return np.clip(size[:, None] * share, SPOT_LEAST, SPOT_MOST).astype(np.float32)


def _has_streams(model: StateModel) -> bool:
    return len(of(model).containers.body) > 0


def _can_burn(model: StateModel) -> bool:
    return "on_fire" in model.extras


def _colours(found: SubstanceModel) -> Float[np.ndarray, "U 3"]:
    return np.array([s.colour for s in found.substances], np.float32).reshape(-1, 3)


def _streams(
    model: StateModel,
    states: ExtendedStates,
    view: PhysicsView,
    level: Float[Array, "W C"],
    holds: Bool[Array, "W C"],
) -> Slots:
    """Pieces of the parabolas in which contents fall now; taps' drops are particles.

    Args:
      level: z of the surfaces of contents, m. holds: whether there are contents.
    """
    found = of(model)
    containers = found.containers
    count = len(containers.body)
    out = volume.outlets(model, states, volume.standing(model, view))
    own = out.chosen[..., :count]
    chosen = jnp.concatenate([own, jnp.zeros_like(out.chosen[..., count:])], axis=-1)
    ends = volume.streams(model, view, chosen)
    openings = containers.openings(view)
    aside = jnp.stack([jnp.sum(jnp.where(own, n[:, None], 0.0), axis=-1) for n in openings.outwards()], axis=-1)
    start, met = jnp.stack(ends.start, axis=-1), jnp.stack(ends.landed.pos, axis=-1)[..., 2]
    into = jnp.where(holds, level, openings.centre[2])
    end = jnp.sum(jnp.where(ends.landed.container, into[:, None], 0.0), axis=-1)
    depth = jnp.where(ends.landed.object >= 0, start[..., 2] - met, LONGEST)
    depth = jnp.where(jnp.any(ends.landed.container, axis=-1), start[..., 2] - end, depth)
    time = jnp.sqrt(2 * jnp.maximum(depth, 0.02) / GRAVITY)[..., None] * np.linspace(0, 1, PIECES + 1)  # [W, K, P + 1]
    flat = start[..., None, :2] + (LIP + SPEED * time)[..., None] * aside[..., None, :]
    points = jnp.concatenate([flat, (start[..., None, 2] - GRAVITY / 2 * time**2)[..., None]], axis=-1)
    way, middle = points[:, :, 1:] - points[:, :, :-1], (points[:, :, 1:] + points[:, :, :-1]) / 2
    length = jnp.maximum(jnp.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
    thin = jnp.full_like(length, STREAM_RADIUS)
    amounts = jnp.sum(jnp.where(own[..., None], (out.flow.left + out.flow.given)[:, None], 0.0), axis=2)  # [W, K, U]
    colour = amounts @ _colours(found) / jnp.maximum(jnp.sum(amounts, axis=-1, keepdims=True), 1e-12)
    worlds, streams = depth.shape
    return _slots(
        SUBSTANCE,
        there=jnp.broadcast_to(jnp.any(own, axis=-1)[..., None], (worlds, streams, PIECES)),
        pos=middle,
        rotation=along(way / length),
        size=jnp.concatenate([thin, thin, LONGER * length / 2], axis=-1),
        colour=jnp.broadcast_to(colour[:, :, None], middle.shape),
        owner=jnp.full((worlds, streams, PIECES), -1, jnp.int32),
    )


def _spots(model: StateModel, states: ExtendedStates, view: PhysicsView, count: int) -> Slots:
    """The first so many points that substances cover, object by object."""
    found = of(model)
    bits = jnp.asarray(states.coat)
    worlds, objects, substances = bits.shape
    if not objects * substances:
        return free_slots(worlds, count)
    bits = bits.reshape(worlds, -1)
    numbers = jax.lax.population_count(bits).astype(jnp.int32)
    upto = jnp.cumsum(numbers, axis=1)  # [W, D U]
    slot = np.arange(count)
    pair = jnp.sum(upto[:, None] <= slot[:, None], axis=-1)  # [W, S], of the object and substance; last: none
    there, pair = pair < bits.shape[1], jnp.minimum(pair, bits.shape[1] - 1)
    before = jnp.take_along_axis(upto - numbers, pair, axis=1)
    covers = coat.as_points(jnp.take_along_axis(bits, pair, axis=1))  # [W, S, N]
    turn = jnp.cumsum(covers, axis=-1) - 1
    point = jnp.argmax(covers & (turn == (slot - before)[..., None]), axis=-1)  # [W, S]
    row, column = pair // substances, pair % substances
    place = row * NUM_POINTS + point
    body = jnp.asarray(found.body.ravel(), jnp.int32)[place]
    turned, origin = (
        jnp.take_along_axis(jnp.asarray(a), body[..., None], axis=1) for a in (view.body_quat, view.body_pos)
    )
    radius = jnp.asarray(spot_radii(model))[row, column]
    return _slots(
        SUBSTANCE,
        there=there,
        pos=origin + quat_rotate(turned, jnp.asarray(found.pos.reshape(-1, 3))[place]),
        rotation=along(quat_rotate(turned, jnp.asarray(found.normal.reshape(-1, 3))[place])),
        size=jnp.stack([radius, radius, jnp.full_like(radius, SPOT_THICKNESS)], axis=-1),
        colour=jnp.asarray(_colours(found))[column],
        owner=jnp.asarray(found.covered, jnp.int32)[row],
    )


def _steam(model: StateModel, states: ExtendedStates, view: PhysicsView) -> Slots:
    """Puffs over the openings of the first containers with hot liquids."""
    found = of(model)
    liquid = np.array([s.kind == "liquid" for s in found.substances], bool)
    amount = jnp.sum(jnp.where(liquid, jnp.asarray(states.volume), 0.0), axis=-1)  # [W, C]
    steams = (amount >= volume.CONTAINS) & (jnp.asarray(states.temperature)[:, found.containers.object] > STEAMS)
    rank = jnp.cumsum(steams, axis=1) - 1
    first = steams[:, None] & (rank[:, None] == np.arange(STEAMING)[:, None])  # [W, M, C]
    centre = jnp.stack(found.containers.openings(view).centre, axis=-1)  # [W, C, 3]
    origin = jnp.sum(jnp.where(first[..., None], centre[:, None], 0.0), axis=2)  # [W, M, 3]
    share = (np.arange(1, PUFFS + 1) / PUFFS).astype(np.float32)
    angle = 2.4 * np.arange(PUFFS)
    place = np.stack([STEAM_ASIDE * np.cos(angle), STEAM_ASIDE * np.sin(angle), STEAM_HEIGHT * share], axis=-1)
    low, high = STEAM_RADIUS
    size = np.repeat((low + (high - low) * share)[:, None], 3, axis=-1)
    shape = (len(steams), STEAMING, PUFFS)
    return _slots(
        SUBSTANCE,
        there=jnp.broadcast_to(jnp.any(first, axis=-1)[..., None], shape),
        pos=(origin[:, :, None] + place).astype(jnp.float32),
        rotation=jnp.broadcast_to(jnp.eye(3), (*shape, 3, 3)),
        size=jnp.broadcast_to(jnp.asarray(size, jnp.float32), (*shape, 3)),
        colour=jnp.full((*shape, 3), STEAM_COLOUR, jnp.float32),
        owner=jnp.full(shape, -1, jnp.int32),
    )


def _flames(states: ExtendedStates, view: PhysicsView) -> Slots:
    """Tongues over the first objects on fire: yellow below, red above."""
    burns = jnp.asarray(states.on_fire)  # pyright: ignore[reportAttributeAccessIssue]
    worlds = len(burns)
    rank = jnp.cumsum(burns, axis=1) - 1
    first = burns[:, None] & (rank[:, None] == np.arange(FIRES)[:, None])  # [W, F, O]
    obj = jnp.argmax(first, axis=-1)
    low, high = (jnp.take_along_axis(jnp.asarray(a), obj[..., None], axis=1) for a in (view.aabb_low, view.aabb_high))
    share = (np.arange(TONGUES) / TONGUES).astype(np.float32)
    golden = 0.618 * np.arange(TONGUES)
    place = np.stack([0.1 + 0.8 * (golden % 1), 0.1 + 0.8 * ((1.7 * golden + 0.3) % 1), np.ones(TONGUES)], axis=-1)
    pos = low[:, :, None] + (high - low)[:, :, None] * place + np.array([0, 0, FLAME_HEIGHT]) * share[:, None]
    radius = FLAME_RADIUS * (1 - 0.75 * share)
    size = np.stack([radius, radius, 2 * radius], axis=-1)
    colour = np.stack([np.ones(TONGUES), 0.85 - 0.65 * share, 0.25 * (1 - share)], axis=-1)
    shape = (worlds, FIRES, TONGUES)
    return _slots(
        FIRE,
        there=jnp.broadcast_to(jnp.any(first, axis=-1)[..., None], shape),
        pos=pos.astype(jnp.float32),
        rotation=jnp.broadcast_to(jnp.eye(3), (*shape, 3, 3)),
        size=jnp.broadcast_to(jnp.asarray(size, jnp.float32), (*shape, 3)),
        colour=jnp.broadcast_to(jnp.asarray(colour, jnp.float32), (*shape, 3)),
        owner=jnp.broadcast_to(obj[..., None].astype(jnp.int32), shape),
    )


def _slots(
    kind: int,
    there: Bool[Array, "W *s"],
    pos: Float[Array, "W *s 3"],
    rotation: Float[Array, "W *s 3 3"],
    size: Float[Array, "W *s 3"],
    colour: Float[Array, "W *s 3"],
    owner: Int[Array, "W *s"],
) -> Slots:
    """Slots of shapes with one axis or several, which become one."""
    same = jnp.full(owner.shape, kind, jnp.int32)
    fields = (pos, rotation, size, colour, owner, same, jnp.zeros_like(same))
    flat = [jnp.asarray(x).reshape(len(x), -1, *x.shape[there.ndim :]) for x in fields]
    return Slots(*flat).where(there.reshape(len(there), -1))


def along(direction: Float[Array, "*b 3"]) -> Float[Array, "*b 3 3"]:
    """Rotation matrices whose third column is a unit vector."""
    direction = jnp.asarray(direction)
    aside = jnp.where(jnp.abs(direction[..., :1]) < 0.9, np.eye(3)[0], np.eye(3)[1])
    x = jnp.cross(aside, direction)
    x = x / jnp.maximum(jnp.linalg.norm(x, axis=-1, keepdims=True), 1e-9)
    return jnp.stack([x, jnp.cross(direction, x), direction], axis=-1)
