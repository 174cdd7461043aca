"""Appliers: what is dipped absorbs, a brush gives what it has absorbed to what it touches, a spray covers what is in
front of it.

- Dipped: an object that can absorb, with a point in the inside of a container, absorbs what it holds, in the ratio of
  its volumes, until it is saturated.
- A brush (`BRUSHES`) that touches an object covers its points within `MARGIN` of the brush's box with the substances it
  has absorbed. Each new point takes a part of a drop.
- A spray (`SPRAYS`) that is on gives 2 ml/s in a cone along its x axis. The first object in the cone, that of the
  nearest point which faces the nozzle, is covered at its points there; a soakable one absorbs.

OmniGibson's particle_modifier.py has the kinds: appliers by contact and by a cone, with a margin of 2 cm.

Axes: W worlds, A objects that can absorb, B brushes, P sprays, C containers, D objects that can be covered, N = 20
points, U substances.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.geometry.frames import Frames, numbers, some
from ig2mj.geometry.poses import AnyArray, namespace, quat_rotate
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import coat
from ig2mj.states.substances.model import of
from ig2mj.states.substances.volume import CONTAINS

BRUSHES = coat.BRUSHES
"""Categories of objects that cover what they touch."""

SPRAYS = ("atomizer", "spray_can", "spray_paint_can")
"""Categories of containers that spray while they are on."""

MARGIN = 0.02
"""m around the box of a brush (OmniGibson's particle_modifier.py)."""

POINTS_PER_DROP = 20
"""Points that a brush covers with a drop: one object."""

SPRAY_RATE = 0.002
"""l/s: two strokes of a trigger, of 1 ml each."""

REACH, SLOPE = 0.6, 0.36
"""m from the nozzle up to which a spray reaches, and the tangent of the half angle of its cone, 20 degrees."""

LAYER = 0.1
"""m behind the nearest point in a cone up to which points are covered, too."""


def _of(model: StateModel, categories: tuple[str, ...]) -> Int[np.ndarray, "N"]:
    found = [o for o, category in enumerate(model.tables.object_categories) if category in categories]
    return np.array([o for o in found if of(model).row[o] < len(of(model).covered)], int)


def absorbers(model: StateModel) -> Int[np.ndarray, "A"]:
    """Loose objects that can absorb."""
    able = np.isfinite(coat.saturation(model)) & ~model.tables.object_fixed
    return np.flatnonzero(able & (of(model).row < len(of(model).covered)))


def sprays(model: StateModel) -> Int[np.ndarray, "P"]:
    """Rows of containers that spray, on the C axis."""
    has_switch = model.parameters.has("toggleable")
    sprays = [o for o in _of(model, SPRAYS) if has_switch[o]]
    return np.flatnonzero(np.isin(of(model).containers.object, sprays))


def dipped(step: EventStep) -> Bool[Array, "W A C"]:
    """Which object that can absorb is in which container."""
    return jnp.any(_points_in(step), axis=-1)


def _points_in(step: EventStep) -> Bool[Array, "W A C N"]:
    """Which points of objects that can absorb are in which container, but for those of the container itself."""
    found, view = of(step.model), step.view
    rows, containers = found.row[absorbers(step.model)], found.containers
    points = Frames.of(view.body_pos, view.body_quat, found.body[rows]).points(numbers(found.pos[rows]))  # [W, A, N]
    frames = containers.frames(view).with_axes(1, 3)  # [W, 1, C, 1]
    local = frames.local(frames.offset([x[:, :, None] for x in points]))
    within: Array = (containers.object != absorbers(step.model)[:, None])[None, :, :, None]
    for x, low, high in zip(local, numbers(found.things.low), numbers(found.things.high), strict=True):
        within = within & (x >= low[:, None]) & (x <= high[:, None])
    return jnp.asarray(within)


class Applied(NamedTuple):
    """What is to be applied in a step.

    Attributes:
      soaks: litres that each object takes from each container. brushes: with what each brush covers. sprays: litres
        that leave each spray, of which `given` come from nothing, since it is a source.
    """

    soaks: Float[Array, "W A C U"]
    brushes: Bool[Array, "W B U"]
    sprays: Float[Array, "W P U"]
    given: Float[Array, "W P U"]


def applied(step: EventStep, there: Bool[Array, "W A C"]) -> Applied:
    """What is to be applied. `there`: from `dipped`."""
    model, states, found = step.model, step.states, of(step.model)
    worlds, width = states.temperature.shape[0], len(found.names)
    own, rows = absorbers(model), sprays(model)
    free = jnp.where(states.solid, 0.0, states.volume)
    soaks = jnp.zeros((worlds, len(own), len(found.containers.object), width))
    if len(own) and len(found.containers.object):
        wants = jnp.maximum(_lacking(step), 0.0) * coat.DROP  # litres [W, A, U]
        has = free >= CONTAINS
        first = np.arange(there.shape[2]) == jnp.argmax(there & jnp.any(has, axis=-1)[:, None], axis=2)[..., None]
        number = jnp.maximum(jnp.sum(there, axis=1), 1)[:, None, :, None]  # they share
        soaks = jnp.minimum(wants[:, :, None], jnp.where(has, free, 0.0)[:, None] / number)
        soaks = jnp.where((there & first)[..., None], soaks, 0.0)
    loaded = _loaded(step)
    on = jnp.asarray(states.toggled_on)[:, found.containers.object[rows]][..., None]
    litres = np.float32(SPRAY_RATE * model.options.timestep)
    given = jnp.where(on & jnp.asarray(states.stock)[:, rows] & ~states.solid[:, rows], litres, 0.0)
    content = jnp.asarray(free)[:, rows]
    total = jnp.sum(content, axis=-1, keepdims=True)
    out = jnp.where(on & (given <= 0), content / jnp.maximum(total, 1e-12) * jnp.minimum(total, litres), 0.0)
    return Applied(soaks, loaded, out + given, given)


def _lacking(step: EventStep) -> Float[Array, "W A U"]:
    """Drops that objects that can absorb lack."""
    own = absorbers(step.model)
    enough = coat.saturation(step.model)[own].astype(np.float32)[:, None]
    return enough - coat.absorbed_drops(step.model, step.states, own)


def _loaded(step: EventStep) -> Bool[Array, "W B U"]:
    """With what brushes cover what they touch."""
    model, brushes, found = step.model, _of(step.model, BRUSHES), of(step.model)
    if not len(brushes):
        return jnp.zeros((step.states.temperature.shape[0], 0, len(found.names)), bool)
    touches = jnp.any(jnp.asarray(step.view.touching)[:, brushes][:, :, found.covered], axis=-1)
    return touches[..., None] & (coat.absorbed_drops(model, step.states, brushes) >= 1.0 / POINTS_PER_DROP)


def may_act(step: EventStep) -> Bool[Array, ""]:
    """False: nothing is applied. It costs less than `applied`."""
    found, states = of(step.model), step.states
    acts = jnp.any(_loaded(step))
    if len(absorbers(step.model)) and len(found.containers.object):
        has = (jnp.asarray(states.volume) >= CONTAINS) & ~states.solid
        takes = some(has[:, None] & (_lacking(step) > 0.0)[:, :, None])  # [W, A, C]
        acts |= jnp.any(_points_in(step) & takes[..., None])
    rows = sprays(step.model)
    if len(rows):
        acts |= jnp.any(jnp.asarray(states.toggled_on)[:, found.containers.object[rows]])
    return acts


def rests(made: Applied) -> Bool[Array, ""]:
    """Nothing is applied."""
    return ~(jnp.any(made.soaks > 0) | jnp.any(made.brushes) | jnp.any(made.sprays > 0))


def exist(model: StateModel) -> bool:
    """Whether a scene has appliers, or what can be dipped."""
    has_containers = len(of(model).containers.object) > 0
    return bool(len(_of(model, BRUSHES)) or len(sprays(model)) or (has_containers and len(absorbers(model))))


def update(step: EventStep, made: Applied) -> EventStep:
    """One control step of all appliers."""
    model = step.model
    if len(absorbers(model)) and len(of(model).containers.object):
        taken = jnp.sum(made.soaks, axis=1)
        step = step.having(
            volume=jnp.maximum(jnp.asarray(step.states.volume) - taken, 0.0),
            lost=step.states.lost + jnp.sum(taken, axis=1),
        )
        step = _absorbed(step, absorbers(model), jnp.sum(made.soaks, axis=2) / coat.DROP)
    for number, brush in enumerate(_of(model, BRUSHES).tolist()):
        step = _brushed(step, brush, made.brushes[:, number])
    for number, row in enumerate(sprays(model).tolist()):
        step = _sprayed(step, row, made.sprays[:, number], made.given[:, number])
    return step


def _absorbed(step: EventStep, objects: Int[np.ndarray, "A"], drops: Float[Array, "W A U"]) -> EventStep:
    """The step after objects absorbed more (or less) drops."""
    found, states = of(step.model), step.states
    more = jnp.asarray(states.absorbed)
    own = np.arange(len(found.names)) != found.water
    of_row = found.row[objects][:, None] == np.arange(len(found.covered))  # [A, D]
    more = jnp.maximum(more + jnp.sum(jnp.where(of_row[..., None] & own, drops[:, :, None], 0.0), axis=1), 0.0)
    wet = jnp.asarray(states.wetness)
    if found.water >= 0:
        of_object = objects[:, None] == np.arange(wet.shape[1])
        wet = jnp.maximum(wet + jnp.sum(jnp.where(of_object, drops[..., found.water, None], 0.0), axis=1), 0.0)
    return step.having(absorbed=more, wetness=wet)


def _brushed(step: EventStep, brush: int, loaded: Bool[Array, "W U"]) -> EventStep:
    model, found, view = step.model, of(step.model), step.view
    pos = coat.positions(model, view)
    low, high = (jnp.asarray(x)[:, brush, None, None] for x in (view.aabb_low, view.aabb_high))
    near = jnp.all((pos >= low - MARGIN) & (pos <= high + MARGIN), axis=-1)
    touched = jnp.asarray(view.touching)[:, brush, found.covered][..., None]
    bits = jnp.where(touched, coat.as_bits(near)[..., None], np.uint32(0))  # [W, D, 1]
    before = jnp.asarray(step.states.coat)
    new = jnp.where(loaded[:, None], bits & ~before, np.uint32(0))
    drops = jnp.sum(coat.as_points(new), axis=(1, 3)).astype(jnp.float32) / POINTS_PER_DROP
    return _absorbed(step.having(coat=before | new), np.array([brush]), -drops[:, None])


def in_cone(
    positions: Float[AnyArray, "*b D N 3"],
    normals: Float[AnyArray, "*b D N 3"],
    nozzle: Float[AnyArray, "*#b 1 1 3"],
    ahead: Float[AnyArray, "*#b 1 1 3"],
    others: Bool[np.ndarray, "D"],
) -> tuple[Bool[AnyArray, "*b D N"], Float[AnyArray, "*b D N"]]:
    """Which points of surfaces are in the cone of a spray and face it, and how far along its axis they are, m; of NumPy
    arrays NumPy arrays.

    Args:
      nozzle: m. ahead: unit, of its axis. others: objects that are not the spray itself.
    """
    xp = namespace(positions)
    offset = positions - nozzle
    along = xp.sum(offset * ahead, axis=-1)
    aside = xp.sqrt(xp.maximum(xp.sum(offset * offset, axis=-1) - along * along, 0.0))
    faces = xp.sum(normals * offset, axis=-1) < 0.0
    return (along > 0.0) & (along <= REACH) & (aside <= SLOPE * along) & faces & others[:, None], along


def _sprayed(step: EventStep, row: int, litres: Float[Array, "W U"], given: Float[Array, "W U"]) -> EventStep:
    model, states, found, view = step.model, step.states, of(step.model), step.view
    body, spray = found.containers.body[row], int(found.containers.object[row])
    at, quat = jnp.asarray(view.body_pos)[:, body], jnp.asarray(view.body_quat)[:, body]
    nozzle = at + quat_rotate(quat, found.containers.centre[row])
    ahead = quat_rotate(quat, np.array([1.0, 0.0, 0.0], np.float32))[:, None, None]
    inside, along = in_cone(
        coat.positions(model, view), coat.normals(model, view), nozzle[:, None, None], ahead, found.covered != spray
    )
    depth = jnp.where(inside, along, jnp.inf)
    least = jnp.min(depth, axis=-1)
    met = jnp.argmin(least, axis=-1)  # [W]
    hits = jnp.isfinite(jnp.min(least, axis=-1))
    mine = (np.arange(len(found.covered)) == met[:, None]) & hits[:, None]  # [W, D]
    bits = coat.as_bits(inside & (along <= least[..., None] + LAYER))
    absorbs = np.isfinite(model.parameters.wetness_soaked)[found.covered]  # [D]
    covers = (mine & ~absorbs)[..., None] & (litres > 0)[:, None]
    new = jnp.asarray(states.coat) | jnp.where(covers, bits[..., None], np.uint32(0))
    drops = jnp.where(mine[:, absorbs, None], litres[:, None] / coat.DROP, 0.0)
    own = np.arange(len(found.containers.object)) == row
    volume = jnp.asarray(states.volume)
    step = step.having(
        coat=new,
        volume=jnp.maximum(volume - jnp.where(own[:, None], (litres - given)[:, None], 0.0), 0.0),
        lost=states.lost + litres,
        drawn=states.drawn + given,
    )
    return _absorbed(step, found.covered[absorbs], drops)
