"""Steps in which nothing but contents and coats change: the part of a control step that is left where all other events
are known to be idle. `ig2mj.worlds.incremental` takes them on the native engine.

Axes: W worlds, O objects, K streams, N = `AHEAD` steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float, Int, Shaped

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.model import StateModel
from ig2mj.states.relations.relations import Relations
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import applying, coat, drying, flow_reads, reactions, volume, washing
from ig2mj.states.world import ExtendedStates

FIELDS = ("volume", "lost", "drawn", "coat", "absorbed")
"""Fields that the step changes."""


AHEAD = 16
"""Steps that one call computes at most. Each takes a twentieth of what a call takes by itself."""


class Flowed(NamedTuple):
    """Steps of contents and coats, as long as nothing moves and nothing else changes.

    Attributes:
      made: `FIELDS` after each step. count: steps that are those of a whole step. changes: whether each changes
        something. starts: where streams begin, m, world frame; NaN: there is none.
    """

    made: Sequence[Shaped[Array, "N W ..."]]
    count: Int[Array, ""]
    changes: Bool[Array, "N"]
    starts: Float[Array, "W K 3"]


def depend_on_moves(
    model: StateModel, before: PhysicsView, view: PhysicsView, streams: flow_reads.Reach | None
) -> bool:
    """Whether what has moved between two views can change these steps. `streams`: where there are some; None: there
    are none."""
    return bool(_others(model)) or flow_reads.depend_on_moves(model, before, view, streams)


def possible(model: StateModel) -> bool:
    """Whether a scene has such steps."""
    return (
        model.substances is not None
        and not drying.is_on(model)
        and volume.has_outlets(model)
        and all(spec.idle is not None for spec in _others(model))
    )


def _others(model: StateModel) -> list:
    """Added states of the first part that are not of substances."""
    return [s for s in model.added if s.part == "events" and s.update is not None and not s.of_substances]


def flowed(
    model: StateModel, states: ExtendedStates, view: PhysicsView, relations: Relations, steps: Int[Array, ""]
) -> Flowed:
    """The next control steps. Pure.

    Args:
      steps: how many, up to `AHEAD`.
    """
    start = EventStep.start(model, states, view, relations)
    stand = volume.standing(model, view)
    first = volume.outlets(model, states, stand)
    ends = volume.streams(model, view, first.chosen)
    applies = applying.exist(model)
    there = applying.dipped(start) if applies else None
    others = jnp.all(jnp.stack([washing.rests(start), *(spec.idle(start) for spec in _others(model) if spec.idle)]))

    def more(now: tuple) -> Bool[Array, ""]:
        count, complete, _, _ = now
        return complete & (count < steps)

    def one(now: tuple) -> tuple:
        count, _, before, made = now
        step = start.having(**dict(zip(FIELDS, before, strict=True)))
        out = volume.outlets(model, step.states, stand)
        complete = others & jnp.all(out.chosen == first.chosen)
        step = volume.poured(step, out, ends)
        if there is not None:
            complete &= applying.rests(applying.applied(step, there))
        step = reactions.update(coat.wipe(step))
        complete &= ~jnp.any(step.swap.mask) & jnp.all(step.states.wetness == states.wetness)
        if len(model.substances.things.object):  # pyright: ignore[reportOptionalMemberAccess]
            complete &= jnp.all(step.states.absent == states.absent) & jnp.all(step.states.hatched == states.hatched)
        after = _fields(step.states)
        changes = jnp.any(jnp.stack([jnp.any(a != b) for a, b in zip(after, before, strict=True)]))
        made = [
            jax.lax.dynamic_update_index_in_dim(a, b, count, 0) for a, b in zip(made, [*after, changes], strict=True)
        ]
        return count + complete, complete, after, made

    fields = _fields(states)
    room = [jnp.zeros((AHEAD, *f.shape), f.dtype) for f in (*fields, jnp.array(False))]
    count, _, _, made = jax.lax.while_loop(more, one, (jnp.int32(0), jnp.array(True), fields, room))
    starts = jnp.where(jnp.any(first.chosen, axis=-1)[..., None], jnp.stack(ends.start, axis=-1), jnp.nan)
    return Flowed(made[:-1], count, made[-1], starts)


def _fields(states: ExtendedStates) -> list[jax.Array]:
    return [jnp.asarray(getattr(states, name)) for name in FIELDS]
