"""`StateSpec.idle` and `heat_source.all_out_of_reach`: where they say that nothing happens, nothing does."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, shell

from ig2mj.states import initial_states
from ig2mj.states.definitions import heat_source
from ig2mj.states.relations.plan import RelationPlan
from ig2mj.states.spec import EventStep
from ig2mj.states.update import EVENTS, queries, sources

SMALL = (((0, 0, 0), (0.05, 0.05, 0.05)),)
FOOD = {"cookable": {}, "sliceable": {}}
HOME = HandWorld(
    Item("oven", shell(0.6, 0.6, 0.6), {"heatSource": {"temperature": 250.0, "requires_inside": True}}),
    Item("stove", SMALL, {"heatSource": {"temperature": 200.0, "requires_toggled_on": True}, "toggleable": {}},
         links={"toggle_button": (0, 0, 0.1), "heat_source": (0, 0, 0.1)}),
    Item("fish", SMALL, FOOD, pos=(3, 0, 1)),
    Item("table", (((0, 0, 0), (1, 1, 0.02)),), {"dustyable": {}}, pos=(3, 0, 0)),
    Item("rag", SMALL, {"cleaningTool": {}, "soakable": {}}, pos=(9, 0, 0)),
    Item("tap", SMALL, {"waterSource": {}, "toggleable": {}}, links={"water_source": (0, 0, -0.1)}, pos=(9, 0, 1)),
    Item("knife", SMALL, {"slicer": {}}, links={"slicer": ((0, 0, 0), (0.1, 0.1, 0.1))}, pos=(20, 0, 0)),
    fingers=1,
)  # fmt: skip
MODEL = HOME.model(drying_rate=0.5)
PLAN = RelationPlan.build(MODEL, queries(MODEL))
CASES = 80


@jax.jit
def _verdicts(states, view):
    """Of each state: whether it is idle, and whether its update changes anything."""
    found = []
    for spec in EVENTS:
        step = EventStep.start(MODEL, states, view, PLAN.evaluate(view))
        after = spec.update(step)
        pairs = zip(jax.tree.leaves(states), jax.tree.leaves(after.states), strict=True)
        changes = (
            jnp.any(jnp.array([jnp.any(a != b) for a, b in pairs])) | jnp.any(after.drops) | jnp.any(after.cut_now)
        )
        found.append((spec.idle(step), changes))
    return found


def _case(rng):
    """Random states and a random view; most of what could happen does not, in most of them."""
    n, few = len(HOME.things), lambda *shape: rng.random(shape) < 0.15
    states = initial_states(MODEL, 1)
    water = dataclasses.replace(
        states.water, active=few(*states.water.active.shape) & few(1, 1, 1), running=few(*states.water.running.shape)
    )
    dust = dataclasses.replace(
        states.dust,
        alive=few(*states.dust.alive.shape) & (rng.random() < 0.5),
        body=np.full_like(states.dust.body, HOME.index["table"] + 1),
    )
    states = states.replace(
        toggled_on=few(1, n) & np.asarray(MODEL.parameters.has("toggleable")),
        wetness=np.float32(few(1, n) & few(1, 1)),
        sliced=few(1, n) & few(1, 1),
        water=water,
        dust=dust,
    )
    view = HOME.view(
        {"rag": np.array([3, 0, 0.06]) + rng.uniform(-0.05, 0.05, 3)},
        touching=[("rag", "table")] if rng.random() < 0.5 else [],
        force={("knife", "fish"): 50.0} if few(1) else {},
        fingers=[(0, 0, 0.1)] if few(1) else [(0, 0, 9)],
    )
    return states, view


@pytest.mark.slow
def test_an_idle_state_is_not_changed_by_its_update():
    rng, counts = np.random.default_rng(0), np.zeros((len(EVENTS), 2), int)
    for case in range(CASES):
        for k, (idle, changes) in enumerate(_verdicts(*_case(rng))):
            assert not (idle and changes), (case, EVENTS[k].name)
            counts[k] += bool(idle), bool(changes)
    for spec, (idle, changes) in zip(EVENTS, counts, strict=True):
        if spec.name != "stain":  # nothing is stainable here
            assert idle > CASES / 4 and changes, f"{spec.name}: idle {idle}, changed {changes}"


@functools.cache
def _acts():
    return jax.jit(lambda states, view: sources(MODEL, states, view, PLAN.evaluate(view)))


def test_out_of_reach_of_all_sources_nothing_is_heated():
    rng = np.random.default_rng(1)
    on = initial_states(MODEL, 1).replace(toggled_on=np.asarray(MODEL.parameters.has("toggleable"))[None])
    away = acting = 0
    for _ in range(CASES):
        view = HOME.view({"fish": rng.uniform(-0.6, 0.6, 3), "stove": rng.uniform(-2, 2, 3)}, fingers=[(0, 0, 9)])
        acts = bool(np.asarray(_acts()(on, view)).any())
        out = heat_source.all_out_of_reach(MODEL, view)
        assert not (acts and out)
        away, acting = away + out, acting + acts
    assert away > 5 and acting > 5


def test_what_is_nowhere_is_not_out_of_reach():
    view = HOME.view({"fish": (np.nan, 0, 0)}, fingers=[(0, 0, 9)])
    assert not heat_source.all_out_of_reach(MODEL, view)
