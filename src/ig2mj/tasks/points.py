"""Points that a task's distances are measured between: hands, objects, taps, burners, the nearest stain.

A point is data; `locate` turns it into positions in all worlds. Where a point does not exist (an object that was cut,
a shelf without stains) it is undefined, and what is measured from it keeps its last value (`ig2mj.tasks.reward`).

Axes: W worlds, N particles.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import AbilityError
from ig2mj.geometry.poses import quat_rotate
from ig2mj.scene.scene import Scene
from ig2mj.scene.tables import LinkKind
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

WATER_BELOW = 0.1
"""m below a tap's water source (appendix of the paper)."""


@dataclasses.dataclass(frozen=True)
class Hand:
    """A hand of the first robot by its number among that robot's hands; the humanoid's are left, right."""

    number: int


@dataclasses.dataclass(frozen=True)
class At:
    """An object's centre of mass (iGibson's position), `above` metres higher."""

    object: str
    above: float = 0.0


@dataclasses.dataclass(frozen=True)
class Water:
    """`WATER_BELOW` a tap's water source."""

    object: str


@dataclasses.dataclass(frozen=True)
class Heat:
    """The heat source of a stove or an oven."""

    object: str


@dataclasses.dataclass(frozen=True)
class NearestStain:
    """The stain of `object` that is nearest to `to`."""

    object: str
    to: str


Point = Hand | At | Water | Heat | NearestStain

Located = tuple[Float[Array, "W 3"], Bool[Array, "W"]]
"""Positions in the world frame (m), and whether the point exists."""

Locate = Callable[[PhysicsView, ExtendedStates], Located]


def locator(point: Point, scene: Scene, model: StateModel) -> Locate:
    """The pure function that finds a point.

    Raises:
      UnknownNameError: no such object. AbilityError: it has no tap, no heat source, or no stains.
    """
    if isinstance(point, Hand):
        hand = int(np.flatnonzero(scene.tables.hand_agent == 0)[point.number])
        return lambda view, states: _always(jnp.asarray(view.agent.hand_pos)[:, hand])
    obj = scene.object_index(point.object)
    if isinstance(point, At):
        return _at(obj, point.above)
    if isinstance(point, Water):
        return _link(model, obj, point.object, LinkKind.WATER_SOURCE, -WATER_BELOW)
    if isinstance(point, Heat):
        return _link(model, obj, point.object, LinkKind.HEAT_SOURCE, 0.0)
    return _nearest_stain(model, point.object, obj, scene.object_index(point.to))


def _always(pos: Float[Array, "W 3"]) -> Located:
    return pos, jnp.ones(pos.shape[0], bool)


def _at(obj: int, above: float) -> Locate:
    up = np.array([0.0, 0.0, above], np.float32)

    def locate(view: PhysicsView, states: ExtendedStates) -> Located:
        return jnp.asarray(view.object_com)[:, obj] + up, ~jnp.asarray(states.sliced)[:, obj]

    return locate


def _link(model: StateModel, obj: int, name: str, kind: LinkKind, above: float) -> Locate:
    found = np.flatnonzero((model.tables.link_object == obj) & (model.tables.link_kind == kind))
    if not len(found):
        raise AbilityError(f"'{name}' has no {kind.name.lower().replace('_', ' ')}")
    link, up = int(found[0]), np.array([0.0, 0.0, above], np.float32)
    return lambda view, states: _always(jnp.asarray(view.link_pos)[:, link] + up)


def _nearest_stain(model: StateModel, name: str, obj: int, to: int) -> Locate:
    row = STAIN.row_of(model, obj)
    if row is None:
        raise AbilityError(f"'{name}' cannot be stained")

    def locate(view: PhysicsView, states: ExtendedStates) -> Located:
        rows, worlds = states.stain, np.arange(states.sliced.shape[0])
        alive, body = jnp.asarray(rows.alive)[:, row], jnp.asarray(rows.body)[:, row]
        pos, quat = jnp.asarray(view.body_pos), jnp.asarray(view.body_quat)
        at = worlds[:, None]
        place = pos[at, body] + quat_rotate(quat[at, body], jnp.asarray(rows.pos)[:, row])  # [W, N, 3]
        apart = jnp.sum(jnp.square(place - jnp.asarray(view.object_com)[:, [to]]), axis=-1)
        nearest = jnp.argmin(jnp.where(alive, apart, jnp.inf), axis=1)
        return place[worlds, nearest], alive.any(1)

    return locate
