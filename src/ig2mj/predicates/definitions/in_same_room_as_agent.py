"""InSameRoomAsAgent(o): o is in the room instance the agent's base is in (table A.1; states/rooms.py)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.predicates.base import Arguments, Context, Predicate
from ig2mj.states.relations.rooms import in_room, room_at, rooms_of


def _evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
    tables, view, objects = context.model.tables, context.view, arguments[:, 0]
    found = context.none(arguments)
    for agent in range(view.agent.base_pos.shape[1]):
        room = room_at(tables, jnp.asarray(view.agent.base_pos)[:, agent, :2])
        found |= in_room(tables, view, objects, jnp.broadcast_to(room[:, None], found.shape))
    return found & context.known(objects)


def _why(context: Context, arguments: tuple[int, ...], world: int) -> str:
    tables, view = context.model.tables, context.view
    if view.agent.base_pos.shape[1] == 0:
        return "there is no agent"
    rooms = [int(room_at(tables, place[:2])) for place in jnp.asarray(view.agent.base_pos)[world]]
    agents = ", ".join(tables.room_names[room] if room >= 0 else "no room" for room in rooms)
    where = ", ".join(rooms_of(tables, view, arguments[0], world)) or "no room"
    return f"it is in {where}, {'the agent' if len(rooms) == 1 else 'agents'} in {agents}"


IN_SAME_ROOM_AS_AGENT = Predicate(
    name="in_same_room_as_agent",
    arguments=("object",),
    evaluate=_evaluate,
    of_arguments=True,
    aliases=("in_same_room_as_robot", "insameroomasagent", "insameroomasrobot"),
    why=_why,
)
