"""OnFloor(a, room): a stands on the floor, and the middle of its box is in that room (table A.1; on_floor.py).

A movable object stands on the floor where it touches it. A fixed one is as much a part of the house as the floor is,
and no engine looks for contacts between bodies that cannot move; a drawer or a door near the floor would decide by
accident. A fixed object therefore stands on the floor where its world box reaches down to it: the box begins at most
`STANDING` above the floor's surface, ends above it, and its middle is over the floor's box. So a fridge, a stove and a
cabinet are on the floor, drawers or not, and a wall cabinet is not.

The second argument is a room instance, or the floor object itself: then any room will do (paper; iGibson's code accepts
rooms only and answers False).
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import AnyArray
from ig2mj.predicates.base import ANY_ROOM, Arguments, Context, Predicate, yes
from ig2mj.scene.tables import SceneTables
from ig2mj.states.relations.rooms import room_at
from ig2mj.states.relations.touching import finite, touching

STANDING = 0.003
"""Metres: as near as engines count for touching."""


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    tables, view = context.model.tables, context.view
    if not np.any(tables.object_is_floor):
        return context.none(arguments)
    objects, rooms = arguments[:, 0], arguments[:, 1]
    centre = (jnp.asarray(view.aabb_low) + jnp.asarray(view.aabb_high))[:, objects, :2] / 2
    whole_floor = (rooms == ANY_ROOM) & context.model.paper
    return _stands(tables, view, objects) & (whole_floor | ((room_at(tables, centre) == rooms) & (rooms >= 0)))


def _stands(tables: SceneTables, view: PhysicsView, objects: Int[AnyArray, "P"]) -> Bool[Array, "W P"]:
    floors = np.flatnonzero(tables.object_is_floor)
    touches, reaches = [], []
    low, high = jnp.asarray(view.aabb_low), jnp.asarray(view.aabb_high)
    middle = (low + high)[:, objects, :2] / 2
    for floor in floors.tolist():
        touches.append(touching(view, jnp.stack([objects, jnp.full_like(objects, floor)], axis=-1)))
        surface = high[:, floor, 2, None]
        over = (middle >= low[:, floor, None, :2]) & (middle <= high[:, floor, None, :2])
        vertical = (low[:, objects, 2] <= surface + STANDING) & (high[:, objects, 2] > surface)
        reaches.append(jnp.all(over, axis=-1) & vertical & (objects != floor))
    fixed = jnp.asarray(tables.object_fixed)[objects]
    by_box = jnp.any(jnp.stack(reaches), axis=0) & finite(view)[:, objects]
    return jnp.where(fixed, by_box, jnp.any(jnp.stack(touches), axis=0))


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    tables, view, o = context.model.tables, context.view, arguments[0]
    stands = bool(tables.object_is_floor.any()) and _stands(tables, view, np.array([o]))[world, 0]
    room = int(room_at(tables, (view.aabb_low[world, o, :2] + view.aabb_high[world, o, :2]) / 2))
    how = "reaching down to" if tables.object_fixed[o] else "touching"
    return f"{how} the floor: {yes(stands)}; in {tables.room_names[room] if room >= 0 else 'no room'}"


ON_FLOOR = Predicate(
    name="on_floor",
    arguments=("object", "room"),
    evaluate=_evaluate,
    of_arguments=True,
    aliases=("onfloor",),
    why=_why,
)
