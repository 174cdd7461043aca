"""Transition rules: what contents of containers, objects, and coats of objects become (`ig2mj.knowledge.transitions`).

Rules are one table, applied at once: in each step the first rule that applies in a container turns all of its inputs
there into its output. Substances become a substance at equal volume, and objects one at the volume of their collision
pieces; objects that a rule makes appear over the opening, as warm as the container, and cooked where the rule takes
heat. A rule with one substance as input works on what covers an object, too, at the object's temperature. Objects melt,
and are diced by a blade, wherever they are.

Axes: W worlds, C containers, D objects that can be covered, U substances, Q rules in use, X objects that can come and
go, O objects.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.geometry.frames import some, total
from ig2mj.knowledge.transitions import MIXERS, STIRRERS, Transition
from ig2mj.scene.tables import SceneTables
from ig2mj.states.definitions import sliced
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import coat, things
from ig2mj.states.substances.model import of
from ig2mj.states.substances.volume import CONTAINS
from ig2mj.states.swap import Swap

BLADE_FORCE = 10.0
"""N on a blade that dice an object, as many as slice one (iGibson's sliced.py)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Reactions:
    """The rules of a scene.

    Attributes:
      rules: the Q axis. inputs, output: of each, by substance. temperature: Celsius, least. stir: it takes stirring.
        single: it has one input. stirrers: objects that stir. mixers: containers that mix while they are on.
    """

    rules: tuple[Transition, ...]
    inputs: Bool[np.ndarray, "Q U"]
    output: Bool[np.ndarray, "Q U"]
    temperature: Float[np.ndarray, "Q"]
    stir: Bool[np.ndarray, "Q"]
    single: Bool[np.ndarray, "Q"]
    stirrers: Int[np.ndarray, "N"]
    mixers: Bool[np.ndarray, "C"]


def reactions(model: StateModel) -> Reactions:
    """Those of a scene with substances."""
    found = of(model)
    rules, names = found.rules, found.names
    return Reactions(
        rules=rules,
        inputs=np.array([[n in r.inputs for n in names] for r in rules], bool).reshape(len(rules), len(names)),
        output=np.array([[n == r.output for n in names] for r in rules], bool).reshape(len(rules), len(names)),
        temperature=np.array([r.temperature for r in rules], np.float32),
        stir=np.array([r.stir for r in rules], bool),
        single=np.array([len(r.inputs) == 1 and not r.objects and not r.count for r in rules], bool),
        stirrers=_of_categories(model.tables, STIRRERS),
        mixers=np.isin(found.containers.object, _of_categories(model.tables, MIXERS)),
    )


def _of_categories(tables: SceneTables, wanted: tuple[str, ...]) -> Int[np.ndarray, "N"]:
    return np.flatnonzero([category in wanted for category in tables.object_categories])


def _stirred(step: EventStep, table: Reactions) -> Bool[Array, "W C"]:
    objects = of(step.model).containers.object
    found = jnp.asarray(step.states.toggled_on)[:, objects] & table.mixers
    if len(table.stirrers):
        found |= jnp.any(jnp.asarray(step.view.touching)[:, objects][:, :, table.stirrers], axis=-1)
    return found


class _Now(NamedTuple):
    """What applies in this step.

    Attributes:
      first: the rule of each container. taken: objects that it uses up there. turned: objects that melt or are diced by
        themselves. target: substance that each becomes.
    """

    first: Bool[Array, "W C Q"]
    taken: Bool[Array, "W C X"]
    turned: Bool[Array, "W X"]
    target: Int[Array, "W X"]


def _in_containers(step: EventStep, table: Reactions, there: Bool[Array, "W C X"]) -> Bool[Array, "W C Q"]:
    """The first rule that applies in each container; one that makes objects, in one container at a time."""
    found, own = of(step.model), of(step.model).things
    has = jnp.asarray(step.states.volume) >= CONTAINS
    complete = jnp.all(has[:, :, None] | ~table.inputs, axis=-1) & things.enough(there, own)
    complete &= things.can_make(jnp.asarray(step.states.absent), own)[:, None]
    warm = jnp.asarray(step.states.warm)[:, found.row[found.containers.object], : len(table.rules)]
    able = complete & warm & (~table.stir | _stirred(step, table)[..., None])
    number = np.arange(len(table.rules))
    first = number == jnp.min(jnp.where(able, number, len(number)), axis=-1, keepdims=True)
    for kind in range(len(own.kinds)):
        mine = first & (own.makes == kind)
        before = jnp.cumsum(jnp.any(mine, axis=-1), axis=-1)[..., None]
        first &= ~mine | (before == 1)
    return first


def _turned(step: EventStep) -> tuple[Bool[Array, "W X"], Int[Array, "W X"]]:
    """Objects that melt or are diced now, and the substances that they become."""
    found, own = of(step.model), of(step.model).things
    gone = jnp.asarray(step.states.absent)
    if not (np.any(own.melts >= 0) or np.any(own.dices >= 0)):
        return jnp.zeros(gone.shape, bool), jnp.zeros(gone.shape, int)
    latches = jnp.asarray(step.states.warm)[:, np.minimum(found.row[own.object], len(found.covered) - 1)]
    melts = (own.melts >= 0) & latches[..., -2]
    parked = ~sliced.in_use(step.model, step.states.sliced)[:, own.object]
    least = np.full(step.model.tables.num_objects, BLADE_FORCE, np.float32)
    pressed = sliced.under_blade(step.model, step.view, least)[:, own.object] & ~step.cut_now[:, own.object]
    dices = (own.dices >= 0) & pressed
    cooked = latches[..., -1] & (own.dices_cooked >= 0)
    target = jnp.where(dices, jnp.where(cooked, own.dices_cooked, own.dices), own.melts)
    return (melts | dices) & ~gone & ~parked, target


def _now(step: EventStep, table: Reactions) -> _Now:
    found, own = of(step.model), of(step.model).things
    gone = jnp.asarray(step.states.absent)
    worlds, containers = gone.shape[0], len(found.containers.object)
    there = jnp.zeros((worlds, containers, gone.shape[1]), bool)
    if len(own.kinds) and containers:
        there = things.in_containers(step.model, gone, step.view)
    first = jnp.zeros((worlds, containers, len(table.rules)), bool)
    if containers and len(table.rules):
        first = _in_containers(step, table, there)
    taken, used = things.used_up(there, first, own)
    turned, target = _turned(step) if gone.shape[1] else (gone, jnp.zeros(gone.shape, int))
    return _Now(first, taken, turned & ~used, target)


def _on_objects(step: EventStep, table: Reactions) -> Bool[Array, "W D Q"]:
    """Rules that change what covers each object."""
    covers = jnp.any((jnp.asarray(step.states.coat) > 0)[:, :, None] & table.inputs, axis=-1)
    warm = jnp.asarray(step.states.warm)[..., : len(table.rules)]
    return covers & warm & _on_surfaces(table)


def _on_surfaces(table: Reactions) -> Bool[np.ndarray, "Q"]:
    limited = np.isfinite(table.temperature) | np.array([np.isfinite(r.cold) for r in table.rules], bool)
    return table.single & limited & ~table.stir


def update(step: EventStep) -> EventStep:
    """One control step of all rules."""
    table, own = reactions(step.model), of(step.model).things
    if not len(table.rules) and not len(own.object):
        return step
    changes = _on_objects(step, table)
    coats = jnp.asarray(step.states.coat)
    for rule in np.flatnonzero(_on_surfaces(table)):
        source, target = int(table.inputs[rule].argmax()), int(table.output[rule].argmax())
        now = jnp.where(changes[..., rule], coats[..., source], np.uint32(0))
        columns = np.arange(coats.shape[-1])
        coats = jnp.where(columns == target, coats | now[..., None], coats)
        coats = jnp.where(columns == source, coats & ~now[..., None], coats)
    step = step.having(coat=coats)
    now = _now(step, table)
    volume = jnp.asarray(step.states.volume)
    if volume.shape[1] and len(table.rules):
        rule = jnp.min(jnp.where(now.first, np.arange(len(table.rules)), len(table.rules)), axis=-1)  # [W, C]
        taken, made = _of_rule(table.inputs, rule), _of_rule(table.output, rule)  # [W, C, U]
        becomes = some(made)[..., None]
        litres = jnp.sum(jnp.where(now.taken, own.litres, 0.0), axis=-1, keepdims=True)
        amount = total(jnp.where(taken, volume, 0.0))[..., None]
        step = step.having(
            volume=jnp.where(taken, 0.0, volume) + jnp.where(made, amount + litres, 0.0),
            drawn=step.states.drawn + jnp.sum(jnp.where(made, litres, 0.0), axis=1),
            lost=step.states.lost + jnp.sum(jnp.where(taken & ~becomes, volume, 0.0), axis=1),
        )
    return _objects_changed(step, now) if len(own.object) else step


def _of_rule(of_rules: Bool[np.ndarray, "Q U"], rule: Int[Array, "W C"]) -> Bool[Array, "W C U"]:
    """The rows of a table of rules; of no rule, whose number is `Q`, none."""
    return jnp.asarray(np.concatenate([of_rules, np.zeros_like(of_rules[:1])]))[rule]


def _objects_changed(step: EventStep, now: _Now) -> EventStep:
    """The step after objects came and went."""
    model, states, found, own = step.model, step.states, of(step.model), of(step.model).things
    gone = jnp.asarray(states.absent)
    placed, number = things.made(gone, now.first, own)
    comes, goes = jnp.any(placed, axis=1), jnp.any(now.taken, axis=1) | now.turned
    kept = {name: jnp.asarray(getattr(states, name)) for name in ("volume", "coat", "drawn", "lost")}
    fields = jax.lax.cond(jnp.any(now.turned), lambda: _spread(step, now), lambda: kept)
    heats = np.array([np.isfinite(rule.temperature) for rule in found.rules], bool)
    baked = jnp.any(placed & jnp.any(now.first & heats, axis=-1)[..., None], axis=1)
    numbers = np.arange(1, placed.shape[1] + 1, dtype=np.int32)[:, None]
    origin = 2 * jnp.sum(jnp.where(placed, numbers, 0), axis=1) + baked
    centre = jnp.stack(found.containers.openings(step.view).centre, axis=-1)
    over = jnp.sum(jnp.where(placed[..., None], centre[:, :, None], 0.0), axis=1)
    over = over + jnp.stack([0.0 * number, 0.0 * number, things.DROP + things.APART * number], axis=-1)
    moves, columns = comes | goes, _columns(model)
    swap = step.swap
    pos = jnp.where(comes[..., None], over, own.park)
    upright = jnp.broadcast_to(jnp.array([1.0, 0.0, 0.0, 0.0]), (*moves.shape, 4))
    swap = Swap(
        mask=jnp.asarray(swap.mask).at[:, columns].set(swap.mask[:, columns] | moves),
        pos=jnp.asarray(swap.pos).at[:, columns].set(jnp.where(moves[..., None], pos, swap.pos[:, columns])),
        quat=jnp.asarray(swap.quat).at[:, columns].set(jnp.where(moves[..., None], upright, swap.quat[:, columns])),
    )
    step = dataclasses.replace(step, swap=swap)
    return step.having(
        **fields,
        absent=(gone & ~comes) | goes,
        hatched=jnp.where(comes, origin, jnp.asarray(states.hatched)).astype(jnp.int32),
    )


def _columns(model: StateModel) -> Int[np.ndarray, "X"]:
    """Places of objects that come and go in `StateModel.swap_objects`."""
    place = {int(o): column for column, o in enumerate(model.swap_objects)}
    return np.array([place[int(o)] for o in of(model).things.object], int)


def _spread(step: EventStep, now: _Now) -> dict[str, Array]:
    """What objects that melt or are diced become: content of their container, else on what they lie on."""
    model, states, found, own = step.model, step.states, of(step.model), of(step.model).things
    becomes = now.turned[..., None] & (now.target[..., None] == np.arange(len(found.names)))  # [W, X, U]
    litres = jnp.where(becomes, own.litres[:, None], 0.0)
    there = jnp.zeros((*jnp.asarray(states.volume).shape[:2], becomes.shape[1]), bool)
    if there.shape[1]:
        there = things.in_containers(model, jnp.asarray(states.absent), step.view)
    outside = ~jnp.any(there, axis=1)[..., None]
    bits, pos = jnp.asarray(states.coat), coat.positions(model, step.view)
    for x, obj in enumerate(own.object):
        offset = pos - jnp.asarray(step.view.object_com)[:, obj, None, None]
        distance = jnp.sum(offset * offset, axis=-1)
        near = (distance <= coat.NEAR**2) | (distance <= jnp.min(distance, axis=-1, keepdims=True))
        under = jnp.asarray(step.view.touching)[:, obj, found.covered] & outside[:, x]
        new = jnp.where(under[..., None, None] & becomes[:, x, None, :, None], near[:, :, None], False)
        bits = bits | coat.as_bits(new)
    return {
        "volume": jnp.asarray(states.volume) + jnp.sum(jnp.where(there[..., None], litres[:, None], 0.0), axis=2),
        "coat": bits,
        "drawn": states.drawn + jnp.sum(litres, axis=1),
        "lost": states.lost + jnp.sum(jnp.where(outside, litres, 0.0), axis=1),
    }


def idle(step: EventStep) -> Bool[Array, ""]:
    """No rule applies."""
    table, own = reactions(step.model), of(step.model).things
    if not len(table.rules) and not len(own.object):
        return jnp.array(True)
    now = _now(step, table)
    return ~jnp.any(_on_objects(step, table)) & ~jnp.any(now.first) & ~jnp.any(now.turned)
