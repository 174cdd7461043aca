"""Steps in which only contents and coats change are those of the plain path, bit for bit, by one small program."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from hand_world import Item
from substance_world import tilted, world

from ig2mj.predicates import compile_expression
from ig2mj.states import initial_states
from ig2mj.states.substances import coat, volume
from ig2mj.worlds import Rules
from ig2mj.worlds.incremental import IncrementalRules

HOME = world()
UPRIGHT, POURS = {}, {"quat": {"jug": tilted(100)}}
VIEWS = [
    jax.tree.map(np.asarray, HOME.view(pos, **more))
    for pos, more in (
        ({}, UPRIGHT),
        ({}, POURS),  # into the glass
        ({"glass": (1, 1, 0.06)}, POURS),  # onto the floor
        ({"glass": (1, 1, 0.06), "jug": (1.2, -1, 0.5)}, POURS),
    )
]
SEEN = [0] * 3 + [1] * 6 + [2] * 5 + [3] * 5 + [0] * 4 + [3] * 3
FLOOR, SOAP = HOME.index["floor"], "liquid_soap"


@pytest.mark.slow
def test_flow_is_that_of_the_rules_without_whole_steps(monkeypatch):
    model = HOME.model()
    rules = Rules(model, compile_expression(model, "(contains glass water)"))
    reference, stepper, whole = jax.jit(rules.step), IncrementalRules(rules, 1), []
    step = stepper._whole_step
    monkeypatch.setattr(stepper, "_whole_step", lambda *args: whole.append(None) or step(*args))
    start = volume.set_volume(model, initial_states(model, 1), HOME.index["jug"], "water", 1.2)
    start = volume.set_volume(model, start, HOME.index["jug"], SOAP, 0.4)
    ours = theirs = coat.set_covered(model, start, HOME.index["glass"], "mud", True)
    holds = []
    for k, number in enumerate(SEEN):
        done, expected = stepper.step(ours, VIEWS[number]), reference(theirs, VIEWS[number])
        for a, b in zip(jax.tree.leaves(done.states), jax.tree.leaves(expected.states), strict=True):
            np.testing.assert_array_equal(a, b, f"step {k}")
        np.testing.assert_array_equal(done.status.holds, expected.status.holds, f"step {k}")
        ours, theirs = done.states, expected.states
        holds.append(bool(done.status.holds[0]))
    assert not holds[0] and holds[-1] and float(ours.lost.sum()) > 0.1
    assert np.asarray(coat.covered(model, ours))[0, FLOOR, model.substances.names.index(SOAP)]
    assert len(whole) <= 3, "one at the start, and one where each stream begins"


@pytest.mark.slow
def test_what_moves_elsewhere_leaves_the_steps_ahead_valid(monkeypatch):
    home = world(Item("block", (((0, 0, 0), (0.04, 0.04, 0.04)),), pos=(-2, -2, 0.04)))
    model = home.model()
    rules = Rules(model, compile_expression(model, "(contains glass water)"))
    reference, stepper, asked = jax.jit(rules.step), IncrementalRules(rules, 1), []
    flow = stepper._programs.flow
    monkeypatch.setattr(stepper._programs, "flow", lambda *args: asked.append(args[2]) or flow(*args))
    elsewhere = [(-2 + 0.01 * k, -2, 0.04) for k in range(24)]
    under = [(0.12, 0, 0.3)] * 2  # in the stream
    views = [jax.tree.map(np.asarray, home.view({"block": pos}, **POURS)) for pos in (*elsewhere, *under, *elsewhere)]
    ours = theirs = volume.set_volume(model, initial_states(model, 1), home.index["jug"], "water", 1.8)
    calls = []
    for k, view in enumerate(views):
        done, expected = stepper.step(ours, view), reference(theirs, view)
        for a, b in zip(jax.tree.leaves(done.states), jax.tree.leaves(expected.states), strict=True):
            np.testing.assert_array_equal(a, b, f"step {k}")
        ours, theirs = done.states, expected.states
        calls.append(len(asked))
    assert calls[len(elsewhere) - 1] <= 6 < len(elsewhere) / 3, "one call computes several steps"
    assert calls[len(elsewhere)] == calls[len(elsewhere) - 1] + 1, "the block is in the way: what was ahead is void"
    assert np.asarray(coat.covered(model, ours))[0, home.index["block"]].any()


@pytest.mark.slow
def test_contents_at_rest_are_asked_only_where_something_moves_that_they_depend_on(monkeypatch):
    home = world(Item("block", (((0, 0, 0), (0.04, 0.04, 0.04)),), pos=(-2, -2, 0.04)))
    model = home.model()
    rules = Rules(model, compile_expression(model, "(contains glass water)"))
    reference, stepper, asked = jax.jit(rules.step), IncrementalRules(rules, 1), []
    idle = stepper._programs.idle
    monkeypatch.setattr(stepper._programs, "idle", lambda *args: asked.append(args[2]) or idle(*args))
    elsewhere = [({"block": (-2 + 0.01 * k, -2, 0.04)}, {}) for k in range(8)]
    seen = [*elsewhere, ({"glass": (0.3, 0, 0.06)}, {}), ({}, POURS), *elsewhere]
    ours = theirs = volume.set_volume(model, initial_states(model, 1), home.index["jug"], "water", 1.2)
    counts = []
    for k, (pos, more) in enumerate(seen):
        view = jax.tree.map(np.asarray, home.view(pos, **more))
        done, expected = stepper.step(ours, view), reference(theirs, view)
        for a, b in zip(jax.tree.leaves(done.states), jax.tree.leaves(expected.states), strict=True):
            np.testing.assert_array_equal(a, b, f"step {k}")
        ours, theirs = done.states, expected.states
        counts.append(asked.count(False))
    assert counts[len(elsewhere) - 1] == counts[1], "while the block moves elsewhere nothing is asked of contents"
    assert counts[len(elsewhere)] == counts[len(elsewhere) - 1] + 1, "the glass moves"
    assert float(np.asarray(ours.volume)[0, 1].sum()) > 0, "the jug poured"
