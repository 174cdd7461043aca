"""Water: sources release drops, which fall; sinks and soakable objects absorb them (paper tables A.2 to A.4).

A drop is a point that falls straight down with a radius, not a body: under gravity alone, held against the collision
pieces of all objects on the way it falls during the step, so that none is skipped at speed. What it touches first
decides: a soakable object absorbs it (wetness.py), a sink or the source's own object takes it back, on anything else
it rests until that goes away. Drops that fall out of the house come back to the source.

Rules in force (docs/design/rules.md#water): the paper's droplets are absorbed, and sinks (`water_sink`
links) take drops; in iGibson's code a soaked object leaves the drop where it is, and only the source's own object takes
drops back.

iGibson's drops are balls: they roll off a towel into the basin, which is how a tap over a towel keeps running there.
Ours do not roll. Instead, when all drops of a source are out, the one that has lain longest makes room for the next: a
source never runs dry because of what lies under it. One whose drops are all still falling waits, as in iGibson.

Axes: W worlds, C sources, N = 10 drops of each, O objects.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate_inverse
from ig2mj.geometry.targets import RayTargets, fall_contact
from ig2mj.scene.tables import LinkKind
from ig2mj.states.model import StateModel
from ig2mj.states.relations.worklist import Worklist
from ig2mj.states.spec import EventStep, Saved, StateSpec, nothing_inherited

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates

NUM_DROPS = 10
"""Drops of one source (iGibson's particles.py)."""

DROP_RADIUS = 0.01
"""Metres (iGibson's object_states)."""

DROP_PERIOD = 0.1
"""Seconds that a source waits, at least, between two drops (iGibson's water_source.py)."""

SPAWN_BELOW = 0.05
"""Metres below the source's link at which a drop appears (iGibson's water_source.py)."""

TOUCHING = 0.003
"""Metres. A drop this near a surface touches it, as any two bodies (measured in PyBullet)."""

GRAVITY = 9.8
"""m/s^2 (iGibson's object_states)."""

LOST_BELOW = 10.0
"""Metres below its source at which a drop has left the house."""

OLDEST = 2**30
"""Updates at which a drop's age stands still: a year."""

SINK_REACH = 0.1
"""Metres around a sink link that is a point, not a box: drops this near are taken."""

WORLDS_AT_ONCE = 256
"""Worlds whose drops are moved together: of a larger batch only those in which any is out."""


class Poses(NamedTuple):
    """What of the view drops fall on: poses of bodies and of annotated links, m, world frame."""

    body_pos: Float[Array, "W B 3"]
    body_quat: Float[Array, "W B 4"]
    link_pos: Float[Array, "W L 3"]
    link_quat: Float[Array, "W L 4"]


@struct.dataclass
class WaterDrops:
    """The drops of all sources.

    Attributes:
      active: on the way or at rest, not in the source. pos: centre, world frame. speed: downwards, m/s. age: updates
      since the drop left its source. waited: updates since the last drop, counted up to the period. running: the source
      was on at the last update (the next drop depends on it, one step late, as in iGibson).
    """

    active: Bool[Array, "W C N"]
    pos: Float[Array, "W C N 3"]
    speed: Float[Array, "W C N"]
    age: Int[Array, "W C N"]
    waited: Int[Array, "W C"]
    running: Bool[Array, "W C"]


def no_drops(num_worlds: int, num_sources: int) -> WaterDrops:
    """All taps off and full; the first drop comes as soon as one runs. NumPy arrays."""
    shape = (num_worlds, num_sources, NUM_DROPS)
    return WaterDrops(
        active=np.zeros(shape, bool),
        pos=np.zeros((*shape, 3), np.float32),
        speed=np.zeros(shape, np.float32),
        age=np.zeros(shape, np.int32),
        waited=np.full(shape[:2], np.iinfo(np.int16).max, np.int32),
        running=np.zeros(shape[:2], bool),
    )


def update(
    model: StateModel, water: WaterDrops, view: PhysicsView, toggled_on: Bool[Array, "W O"]
) -> tuple[WaterDrops, Int[Array, "W O"]]:
    """One control step of all drops.

    Returns:
      The drops, and how many touched each soakable object: those it absorbs (paper), or that lie on it (iGibson).
    """
    parameters = model.parameters
    num_worlds = toggled_on.shape[0]
    if len(parameters.water_object) == 0:
        return water, jnp.zeros((num_worlds, model.tables.num_objects), jnp.int32)

    emitting, waited = _emission(model, water)
    poses = Poses(*(jnp.asarray(getattr(view, name)) for name in Poses._fields))
    if num_worlds <= WORLDS_AT_ONCE:
        moved, contacts = jax.lax.cond(
            jnp.any(water.active),
            lambda: _fall(model, water, poses),
            lambda: (water, jnp.zeros((num_worlds, model.tables.num_objects), jnp.int32)),
        )
    else:
        moved, contacts = _fall_in_turns(model, water, poses)
    tap = jnp.asarray(view.link_pos)[:, parameters.water_link] - np.array([0.0, 0.0, SPAWN_BELOW], np.float32)
    updated = WaterDrops(
        active=moved.active | emitting,
        pos=jnp.where(emitting[..., None], tap[:, :, None], moved.pos),
        speed=jnp.where(emitting, 0.0, moved.speed),
        age=jnp.where(emitting | ~moved.active, 0, jnp.minimum(moved.age, OLDEST - 1) + 1),
        waited=waited,
        running=_switched_on(model, toggled_on),
    )
    return updated, contacts


def _switched_on(model: StateModel, toggled_on: Bool[Array, "W O"]) -> Bool[Array, "W C"]:
    sources = model.parameters.water_object
    return jnp.where(model.parameters.has("toggleable")[sources], toggled_on[:, sources], True)


def _emission(model: StateModel, water: WaterDrops) -> tuple[Bool[Array, "W C N"], Int[Array, "W C"]]:
    """Which drop each source lets go now, and its count, which stands still while it is off or has none to give."""
    period = math.ceil(DROP_PERIOD / model.options.timestep - 1e-9)
    lying = water.active & (water.speed == 0) & (water.age > 0)
    turn = jnp.where(
        lying, water.age, jnp.where(water.active, -1, OLDEST + 1)
    )  # the first in the source, or the oldest
    able = water.running & jnp.any(turn >= 0, axis=-1)
    due = able & (water.waited >= period)
    next_drop = jnp.argmax(turn, axis=-1)
    emitting = due[..., None] & (np.arange(NUM_DROPS) == next_drop[..., None])
    return emitting, jnp.where(due, 0, jnp.where(able, jnp.minimum(water.waited + 1, period), water.waited))


def _fall_in_turns(model: StateModel, water: WaterDrops, poses: Poses) -> tuple[WaterDrops, Int[Array, "W O"]]:
    """`_fall` of those worlds in which a drop is out, `WORLDS_AT_ONCE` at a time.

    In a batch of thousands hardly any tap runs, while the drops of all worlds against all pieces are the most expensive
    rule of a home.
    """
    num_worlds, objects = water.active.shape[0], model.tables.num_objects
    out = jnp.any(water.active, axis=(1, 2))
    listed = Worklist.of(out, WORLDS_AT_ONCE)

    def some(turn: Int[jax.Array, ""], done: tuple[WaterDrops, jax.Array]) -> tuple[WaterDrops, jax.Array]:
        worlds = listed.places(turn * WORLDS_AT_ONCE)  # beyond the last: `num_worlds`, which reads any and writes none
        own_water, own_poses = jax.tree.map(lambda a: a[jnp.minimum(worlds, num_worlds - 1)], (water, poses))
        return jax.tree.map(lambda a, b: a.at[worlds].set(b, mode="drop"), done, _fall(model, own_water, own_poses))

    turns = (jnp.sum(out) + WORLDS_AT_ONCE - 1) // WORLDS_AT_ONCE
    return jax.lax.fori_loop(0, turns, some, (water, jnp.zeros((num_worlds, objects), jnp.int32)))


def _fall(model: StateModel, water: WaterDrops, poses: Poses) -> tuple[WaterDrops, Int[Array, "W O"]]:
    """Moves the drops that are out, lands them, gives them back."""
    parameters, tables = model.parameters, model.tables
    dt = model.options.timestep
    num_worlds, objects = water.active.shape[0], np.arange(tables.num_objects)
    speed = water.speed + GRAVITY * dt
    fall = (water.speed + 0.5 * GRAVITY * dt) * dt

    reach = fall_contact(
        RayTargets.build(tables, objects),
        poses.body_pos,
        poses.body_quat,
        water.pos.reshape(num_worlds, -1, 3),
        fall.reshape(num_worlds, -1),
        inflate=DROP_RADIUS + TOUCHING,
    ).reshape(*water.active.shape, len(objects))
    first = jnp.min(reach, axis=-1)
    landed = water.active & jnp.isfinite(first)
    on = (jnp.argmin(reach, axis=-1)[..., None] == objects) & landed[..., None]  # [W, C, N, O]

    drop = jnp.where(landed, first, jnp.where(water.active, fall, 0.0))
    pos = water.pos - drop[..., None] * np.array([0.0, 0.0, 1.0], np.float32)
    soaking = on & np.isfinite(parameters.wetness_soaked)
    gone = jnp.any(on & takes_back(model)[:, None, :], axis=-1)
    if model.paper:
        gone |= jnp.any(soaking, axis=-1) | _in_sink(model, pos, poses)
        tap = poses.link_pos[:, parameters.water_link, 2]
        gone |= ~(pos[..., 2] >= tap[..., None] - LOST_BELOW)
    moved = dataclasses.replace(
        water,
        active=water.active & ~gone,
        pos=pos,
        speed=jnp.where(landed | ~water.active, 0.0, speed),
    )
    return moved, jnp.sum(soaking, axis=(1, 2), dtype=jnp.int32)


def takes_back(model: StateModel) -> Bool[np.ndarray, "C O"]:
    """Objects that take a source's drops on touch: itself; in the paper's rules every source and every sink."""
    parameters, objects = model.parameters, np.arange(model.tables.num_objects)
    own = parameters.water_object[:, None] == objects
    if not model.paper:
        return own
    return own | parameters.has("waterSink") | parameters.has("waterSource")


def _in_sink(model: StateModel, pos: Float[Array, "W C N 3"], poses: Poses) -> Bool[Array, "W C N"]:
    """Whether drops are at an annotated sink link (paper table A.3, DropletSinkLink)."""
    links = np.flatnonzero(model.tables.link_kind == LinkKind.WATER_SINK)
    if len(links) == 0:
        return jnp.zeros(pos.shape[:-1], bool)
    offset = pos[..., None, :] - poses.link_pos[:, None, None, links]
    half = model.tables.link_half[links]
    local = quat_rotate_inverse(poses.link_quat[:, None, None, links], offset)
    within_box = jnp.all(jnp.abs(local) <= half + DROP_RADIUS, axis=-1)
    within_reach = jnp.sum(offset * offset, axis=-1) <= SINK_REACH**2
    return jnp.any(jnp.where(np.any(half > 0, axis=-1), within_box, within_reach), axis=-1)


def _update(step: EventStep) -> EventStep:
    water, drops = update(step.model, step.states.water, step.view, step.states.toggled_on)
    return dataclasses.replace(step.having(water=water), drops=drops)


def _idle(step: EventStep) -> Bool[Array, ""]:
    """No drop is out, and no source runs or begins to."""
    water, model = step.states.water, step.model
    if len(model.parameters.water_object) == 0:
        return jnp.array(True)
    running = water.running | _switched_on(model, step.states.toggled_on)
    return ~jnp.any(water.active) & ~jnp.any(running) & jnp.all(water.age == 0)


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> int:
    mine = np.flatnonzero(model.parameters.water_object == obj)
    return int(np.asarray(states.water.active)[world, mine].sum()) if len(mine) else 0


def _from_manifest(saved: Saved) -> None:
    """From "water", {"steps_since_drop", "drops"}, with entries that are null or a position; drops start at rest."""
    drops: WaterDrops = saved.states.water
    said = saved.values.get("water", {})
    for source in np.flatnonzero(saved.model.parameters.water_object == saved.obj):
        for n, pos in enumerate(said.get("drops", ())[:NUM_DROPS]):
            if pos is not None:
                drops.active[0, source, n] = True
                drops.age[0, source, n] = 1
                drops.pos[0, source, n] = pos
        if said.get("steps_since_drop") is not None:
            drops.waited[0, source] = said["steps_since_drop"]


SPEC = StateSpec(
    name="water_source",
    get=_get,
    abilities=("waterSource",),
    unit="drops out",
    fields={"water": WaterDrops},
    initial=lambda model: {"water": no_drops(1, len(model.parameters.water_object))},
    update=_update,
    idle=_idle,
    inherit=nothing_inherited,  # drops belong to their source
    from_manifest=_from_manifest,
)
