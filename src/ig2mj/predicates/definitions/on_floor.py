"""OnFloor(a, room): a touches the floor, and the middle of its box is in that room (table A.1, spec/states.md 5.6).

The second argument is a room instance, or the floor object itself: then any room will do (paper; iGibson's code accepts
rooms only and answers False).
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import ANY_ROOM, Arguments, Context, Predicate, yes
from ig2mj.states.relations.rooms import room_at
from ig2mj.states.relations.touching import touching


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    tables, view = context.model.tables, context.view
    floors = np.flatnonzero(tables.object_is_floor)
    if len(floors) == 0:
        return context.none(arguments)
    objects, rooms = arguments[:, 0], arguments[:, 1]
    pairs = np.stack([np.repeat(objects, len(floors)), np.tile(floors, len(objects))], axis=-1)
    on = jnp.any(touching(view, pairs).reshape(context.num_worlds, len(objects), len(floors)), axis=-1)
    centre = (jnp.asarray(view.aabb_low) + jnp.asarray(view.aabb_high))[:, objects, :2] / 2
    whole_floor = (rooms == ANY_ROOM) & context.model.paper
    return on & (whole_floor | ((room_at(tables, centre) == rooms) & (rooms >= 0)))


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    tables, view, o = context.model.tables, context.view, arguments[0]
    touch = np.any(np.asarray(view.touching)[world, o, tables.object_is_floor])
    room = int(room_at(tables, (view.aabb_low[world, o, :2] + view.aabb_high[world, o, :2]) / 2))
    return f"touching the floor: {yes(touch)}; in {tables.room_names[room] if room >= 0 else 'no room'}"


ON_FLOOR = Predicate(
    name="on_floor",
    arguments=("object", "room"),
    reads=("view.touching", "view.aabb_low", "view.aabb_high", "tables.room_map"),
    evaluate=_evaluate,
    aliases=("onfloor",),
    why=_why,
)
