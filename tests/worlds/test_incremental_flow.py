"""Steps in which only contents and coats change are those of the plain path, bit for bit, by one small program."""

from __future__ import annotations

import jax
import numpy as np
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
