"""The room an object is in (iGibson's InsideRoomTypes), from the map of room instances.

Rooms are numbered as `SceneTables.room_names`; -1 is no room.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import AnyArray
from ig2mj.scene.tables import SceneTables

NO_ROOM = -1


def room_at(tables: SceneTables, xy: Float[Array, "*b 2"]) -> Int[Array, "*b"]:
    """Room instance at a point, metres; -1 outside the map, where no room is, and for NaN.

    The pixel is truncated towards zero, as iGibson does (room_states.py).
    """
    rows, columns = tables.room_map.shape
    if rows == 0 or columns == 0:
        return jnp.full(xy.shape[:-1], NO_ROOM, jnp.int32)
    pixel = jnp.trunc(jnp.asarray(xy) / tables.room_resolution + np.array([columns / 2, rows / 2], np.float32))
    inside = jnp.all((pixel >= 0) & (pixel < np.array([columns, rows])), axis=-1)  # false for NaN
    place = jnp.where(inside[..., None], pixel, 0).astype(jnp.int32)
    return jnp.where(inside, jnp.asarray(tables.room_map)[place[..., 1], place[..., 0]].astype(jnp.int32) - 1, NO_ROOM)


def in_room(
    tables: SceneTables, view: PhysicsView, objects: Int[AnyArray, "P"], rooms: Int[Array, "W P"]
) -> Bool[Array, "W P"]:
    """Whether each object is in a room (one per world and object, -1: false).

    A fixed object with annotated rooms is in all of those; any other where its centre of mass is. iGibson compares the
    room's instance with a movable object's room type, which is never equal; not here.
    """
    if not tables.room_names:
        return jnp.zeros(rooms.shape, bool)
    at = room_at(tables, jnp.asarray(view.object_com)[:, objects, :2])
    annotated = jnp.asarray(tables.object_rooms)[objects]
    listed = jnp.take_along_axis(
        jnp.broadcast_to(annotated, (rooms.shape[0], *annotated.shape)), jnp.maximum(rooms, 0)[..., None], axis=-1
    )[..., 0]
    fixed = jnp.asarray(tables.object_fixed)[objects] & jnp.any(annotated, axis=-1)
    return (rooms >= 0) & jnp.where(fixed, listed, at == rooms)


def rooms_of(tables: SceneTables, view: PhysicsView, obj: int, world: int = 0) -> list[str]:
    """Names of the rooms an object is in; empty where it is in none. Of one world, on the host."""
    annotated = np.flatnonzero(tables.object_rooms[obj]) if tables.room_names else []
    if tables.object_fixed[obj] and len(annotated):
        return [tables.room_names[r] for r in annotated]
    room = int(room_at(tables, jnp.asarray(view.object_com[world, obj, :2])))
    return [tables.room_names[room]] if room >= 0 else []
