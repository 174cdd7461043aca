"""What covers objects, and what they have absorbed. Dust and stains have rows of particles of their own.

A substance covers points of an object: the same 20 points for all. A stream covers the points near the place where it
meets an object, and a soakable object absorbs it. A cleaning tool that touches an object wipes off the points in its
area, as it does with dust (`ig2mj.states.definitions.cleaning`), of the substances that it can remove now; it absorbs
what it wipes off.

Axes: W worlds, D objects that can be covered, U substances, N = 20 points, T tools, K streams, O objects.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.frames import Frames, dot, numbers, some, total
from ig2mj.geometry.poses import matrix_rows, quat_rotate
from ig2mj.states.branches import changed_where
from ig2mj.states.definitions import cleaning, wetness
from ig2mj.states.model import StateModel
from ig2mj.states.spec import Cut, EventStep, Saved, StateSpec
from ig2mj.states.substances.model import NUM_POINTS, of
from ig2mj.states.substances.streams import Landed

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates

DROP = 4.19e-3
"""Litres of a drop, a ball of 1 cm radius (iGibson's object_states): what soaks."""

NEAR = 0.08
"""m around the place where a stream meets an object: points that it covers. Where none is so near, the nearest is."""

BRUSHES = ("paintbrush",)
"""Categories of objects that absorb a drop, and give it to what they touch (`ig2mj.states.substances.applying`)."""

ALL = np.uint32((1 << NUM_POINTS) - 1)
"""Every point."""

BITS = (np.uint32(1) << np.arange(NUM_POINTS, dtype=np.uint32)).astype(np.uint32)


def covered(model: StateModel, states: ExtendedStates) -> Bool[Array, "W O U"]:
    """Whether at least one point of each object is covered by each substance (OmniGibson's covered.py)."""
    none = jnp.zeros((states.coat.shape[0], 1, states.coat.shape[2]), bool)
    return jnp.concatenate([jnp.asarray(states.coat) > 0, none], axis=1)[:, of(model).row]


def saturation(model: StateModel) -> Float[np.ndarray, "O"]:
    """Drops of a substance that saturate each object; inf: it absorbs none."""
    p = model.parameters
    brush = np.array([category in BRUSHES for category in model.tables.object_categories], bool)
    tool = np.where(p.has("cleaningTool") | brush, 1.0, np.inf)
    return np.where(np.isfinite(p.wetness_soaked), p.wetness_soaked, tool)


def absorbed_drops(model: StateModel, states: ExtendedStates, objects: Int[np.ndarray, "N"]) -> Float[Array, "W N U"]:
    """Drops that objects have absorbed; of water their wetness."""
    found = of(model)
    row = found.row[objects]
    there = row < len(found.covered)
    absorbed = jnp.asarray(states.absorbed)
    drops = absorbed[:, np.where(there, row, 0)] if there.any() else jnp.zeros((1, 1, 1))
    drops = jnp.where(there[:, None], drops, 0.0)
    wet = jnp.asarray(states.wetness)[:, objects, None]
    return jnp.where(np.arange(len(found.names)) == found.water, wet, drops)


def saturated(
    model: StateModel, states: ExtendedStates, objects: Int[np.ndarray, "N"] | None = None
) -> Bool[Array, "W N U"]:
    """Whether each object has absorbed as much of each substance as it takes to be soaked.

    Args:
      objects: None: all.
    """
    some = np.arange(model.tables.num_objects) if objects is None else objects
    return absorbed_drops(model, states, some) >= saturation(model)[some].astype(np.float32)[:, None]


def positions(model: StateModel, view: PhysicsView) -> Float[Array, "W D N 3"]:
    """Where the points are, m, world frame."""
    found = of(model)
    pos, quat = jnp.asarray(view.body_pos)[:, found.body], jnp.asarray(view.body_quat)[:, found.body]
    return pos + quat_rotate(quat, found.pos)


def normals(model: StateModel, view: PhysicsView) -> Float[Array, "W D N 3"]:
    """Unit, outwards, world frame."""
    found = of(model)
    return quat_rotate(jnp.asarray(view.body_quat)[:, found.body], found.normal)


def as_points(coat: UInt32[Array, "*b"]) -> Bool[Array, "*b N"]:
    """Which points each substance covers."""
    return (jnp.asarray(coat)[..., None] & BITS) > 0


def as_bits(points: Bool[Array, "*b N"]) -> UInt32[Array, "*b"]:
    """The inverse of `as_points`."""
    return jnp.sum(jnp.where(points, BITS, np.uint32(0)), axis=-1, dtype=jnp.uint32)


def spilled(
    model: StateModel,
    states: ExtendedStates,
    amounts: Float[Array, "W K U"],
    met: Int[Array, "W K"],
    points: UInt32[Array, "W K"],
    by_taps: Bool[Array, "W K"],
) -> ExtendedStates:
    """The states after streams met objects.

    Args:
      amounts: litres of each stream that met one. met: the objects, -1: none. points: of them that are covered.
      by_taps: streams of taps, which do not soak: their drops do.
    """
    found, p = of(model), model.parameters
    soakable = np.isfinite(p.wetness_soaked)
    soaking = jnp.where(by_taps[..., None], 0.0, amounts) / DROP
    wet = jnp.asarray(states.wetness)
    if found.water >= 0:
        mine = (met[..., None] == np.arange(len(soakable))) & soakable  # [W, K, O]
        water = total(jnp.where(mine, soaking[..., found.water, None], 0.0), axis=1)  # [W, O]
        soaked = wet + water if model.paper else jnp.maximum(wet, np.where(soakable, p.wetness_soaked, 0.0))
        wet = jnp.where(water > 0, soaked, wet)
    own = np.arange(len(found.names)) != found.water
    absorbs = (met[..., None] == found.covered) & soakable[found.covered]  # [W, K, D]
    drops = total(jnp.where(absorbs[..., None] & own, soaking[:, :, None], 0.0), axis=1)  # [W, D, U]
    takes = ~p.has("waterSink") & ~soakable
    rows = np.append(np.where(takes, found.row, len(found.covered)), len(found.covered))  # the last: of no object
    row = jnp.asarray(rows)[met]  # [W, K]
    coat = jnp.asarray(states.coat)
    for k in range(amounts.shape[1]):
        onto = (row[:, k, None] == np.arange(len(found.covered)))[..., None] & (amounts[:, k] > 0)[:, None]
        coat = coat | jnp.where(onto, points[:, k, None, None], np.uint32(0))
    return dataclasses.replace(states, wetness=wet, coat=coat, absorbed=states.absorbed + drops)


def points_near(model: StateModel, landed: Landed, view: PhysicsView) -> UInt32[Array, "W K"]:
    """The points that a stream covers of the object that it meets."""
    found = of(model)
    if not len(found.covered):
        return jnp.zeros(landed.object.shape, jnp.uint32)
    row = jnp.minimum(jnp.asarray(found.row)[landed.object], len(found.covered) - 1)  # [W, K]
    body, at = jnp.asarray(found.body)[row], jnp.asarray(found.pos)[row]  # [W, K, N(, 3)]
    flat = body.reshape(len(body), -1)

    def of_bodies(field: Array) -> list[Array]:
        columns = numbers(jnp.asarray(field))
        return [jnp.take_along_axis(column, flat, axis=1).reshape(body.shape) for column in columns]

    frames = Frames(matrix_rows(*of_bodies(view.body_quat)), of_bodies(view.body_pos))
    offset = [p - x[..., None] for p, x in zip(frames.points(numbers(at)), landed.pos, strict=True)]
    distance = dot(offset, offset)
    return as_bits((distance <= NEAR**2) | (distance <= jnp.min(distance, axis=-1, keepdims=True)))


def can_remove(step: EventStep) -> Bool[Array, "W T U"]:
    """Which tool can remove which substance now."""
    model, states = step.model, step.states
    found, tools = of(model), model.parameters.tool_object
    full = saturated(model, states, tools)
    by = some(full[:, :, None] & found.cleaners)
    soaked = wetness.soaked(model, states.wetness)[:, tools]
    able = by | found.dry | (found.wet & soaked[..., None])
    return able & cleaning.working(model, states.toggled_on)[..., None]


def _meeting(step: EventStep) -> Bool[Array, "W T D U"]:
    touching = cleaning.touching(step.model, step.view)[:, :, of(step.model).covered]
    return (touching[..., None] & can_remove(step)[:, :, None]) & (jnp.asarray(step.states.coat) > 0)[:, None]


def wipe(step: EventStep) -> EventStep:
    """One control step of all cleaning tools."""
    model = step.model
    if not len(model.parameters.tool_object) or not len(of(model).covered) or not len(of(model).names):
        return step

    meeting = _meeting(step)

    def wiped(fields: dict[str, Array]) -> dict[str, Array]:
        return _wiped(step.having(**fields), meeting)

    return step.having(**changed_where(jnp.any(meeting), wiped, _fields(step.states)))


def _fields(states: ExtendedStates) -> dict[str, Array]:
    return {name: jnp.asarray(getattr(states, name)) for name in ("coat", "absorbed", "wetness")}


def _wiped(step: EventStep, meeting: Bool[Array, "W T D U"]) -> dict[str, Array]:
    model, states = step.model, step.states
    found, tools = of(model), model.parameters.tool_object
    within = as_bits(cleaning.within(model, positions(model, step.view), step.view))  # [W, T, D]
    taken = jnp.where(meeting, within[..., None] & jnp.asarray(states.coat)[:, None], np.uint32(0))
    coat = jnp.asarray(states.coat)
    for tool in range(len(tools)):
        coat = coat & ~taken[:, tool]
    drops = jnp.sum(as_points(taken), axis=(2, 4))  # [W, T, U]
    drops = jnp.where(found.has_volume, drops, 0).astype(jnp.float32)
    rows = found.row[tools]
    of_row = (rows[:, None] == np.arange(len(found.covered)))[None, :, :, None]
    own = np.arange(len(found.names)) != found.water
    absorbed = states.absorbed + jnp.sum(jnp.where(of_row & own, drops[:, :, None], 0.0), axis=1)
    wet = jnp.asarray(states.wetness)
    if found.water >= 0:
        of_object = (tools[:, None] == np.arange(model.tables.num_objects))[None]
        soakable = np.isfinite(model.parameters.wetness_soaked)
        wet = wet + jnp.sum(jnp.where(of_object & soakable, drops[..., found.water, None], 0.0), axis=1)
    return {"coat": coat, "absorbed": absorbed, "wetness": wet}


def wipes_nothing(step: EventStep) -> Bool[Array, ""]:
    """No tool meets what it can remove."""
    if not len(step.model.parameters.tool_object) or not len(of(step.model).covered):
        return jnp.array(True)
    return ~jnp.any(_meeting(step))


def set_covered(model: StateModel, states: ExtendedStates, obj: int, name: str, value: bool) -> ExtendedStates:
    """The states with all points of an object covered, or none, in every world; NumPy arrays stay that."""
    return _put(model, states, "coat", obj, name, ALL if value else np.uint32(0))


def set_saturated(model: StateModel, states: ExtendedStates, obj: int, name: str, value: bool) -> ExtendedStates:
    """The states with an object that has absorbed as much as it takes, or nothing. Water: see `wetness.set_soaked`."""
    soaked = model.parameters.wetness_soaked[obj]
    least = float(soaked) if np.isfinite(soaked) else 1.0
    return _put(model, states, "absorbed", obj, name, np.float32(least if value else 0.0))


def _put(model: StateModel, states: ExtendedStates, field: str, obj: int, name: str, value: Any) -> ExtendedStates:
    found = of(model)
    own = (np.arange(len(found.covered)) == found.row[obj])[:, None] & (
        np.arange(len(found.names)) == found.names.index(name)
    )
    array = getattr(states, field)
    xp: Any = np if isinstance(array, np.ndarray) else jnp
    return dataclasses.replace(states, **{field: xp.where(own, value, array).astype(array.dtype)})


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    shape = (1, len(of(model).covered), len(of(model).names))
    dries = shape if model.options.drying_rate else (1, 0, 0)
    robots = (1, len(model.tables.agent_names), shape[2]) if model.options.soiling else (1, 0, 0)
    return {
        "coat": np.zeros(shape, np.uint32),
        "absorbed": np.zeros(shape, np.float32),
        "drying": np.zeros(dries, np.float32),  # parts of the next point that dries
        "tracked": np.zeros(robots, np.float32),  # points that robots still cover (`ig2mj.states.substances.tracks`)
    }


def _inherit(states: ExtendedStates, cut: Cut) -> dict[str, Array]:
    """Halves take over what covers their whole, at the same points, and what it has absorbed."""
    found = of(cut.model)
    source = found.row[cut.source[found.covered]]
    source = np.where(source < len(found.covered), source, np.arange(len(found.covered)))
    takes = jnp.asarray(cut.takes)[:, found.covered][..., None]
    return {
        n: jnp.where(takes, jnp.asarray(x)[:, source], x)
        for n, x in (("coat", states.coat), ("absorbed", states.absorbed))
    }


def _from_manifest(saved: Saved) -> None:
    """From "covered", {substance: 20 bits}, and "absorbed", {substance: drops}."""
    found = of(saved.model)
    row = found.row[saved.obj]
    for key, field in (("covered", "coat"), ("absorbed", "absorbed")):
        for name, value in saved.values.get(key, {}).items():
            if name in found.names and row < len(found.covered):
                getattr(saved.states, field)[0, row, found.names.index(name)] = value


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> str:
    found, row = of(model), of(model).row[obj]
    if row == len(found.covered):
        return ""
    return ", ".join(n for n, bits in zip(found.names, np.asarray(states.coat)[world, row], strict=True) if bits)


SPEC = StateSpec(
    name="coat",
    get=_get,
    abilities=None,
    of_substances=True,
    fields={
        "coat": UInt32[Array, "W D U"],
        "absorbed": Float[Array, "W D U"],
        "drying": Float[Array, "W Dd Ud"],
        "tracked": Float[Array, "W Aa Ua"],
    },
    initial=_initial,
    update=wipe,
    idle=wipes_nothing,
    inherit=_inherit,
    from_manifest=_from_manifest,
)
