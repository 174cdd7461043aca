"""What is dipped absorbs, a brush gives it to what it touches, a spray covers what is first in its cone."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
from hand_world import HandWorld, Item
from substance_world import FLOOR, SPONGE, container

from ig2mj.states import initial_states
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import applying, coat, volume
from ig2mj.states.substances.specs import COAT

SUBSTANCES = ("water", "house_paint", "rubbing_alcohol")
POT = (0.06, 0.06, 0.06)
HOME = HandWorld(
    FLOOR,
    container("pot", POT, (0, 0, 0.2)),
    Item("brush", (((0, 0, 0), (0.02, 0.02, 0.02)),), category="paintbrush", pos=(1, 0, 0.3)),
    Item("board", (((0, 0, 0), (0.1, 0.1, 0.01)),), pos=(2, -2, 0.5)),
    container("spray", (0.02, 0.02, 0.05), (-1, 0, 0.5), category="atomizer", abilities={"toggleable": {}}),
    Item("near", (((0, 0, 0), (0.02, 0.1, 0.1)),), pos=(-0.7, 0, 0.55)),
    Item("far", (((0, 0, 0), (0.02, 0.1, 0.1)),), pos=(-0.5, 0, 0.55)),
    dataclasses.replace(SPONGE, pos=(2, 2, 0.02)),
    substances=SUBSTANCES,
)
MODEL = HOME.model()
PAINT, ALCOHOL = "house_paint", "rubbing_alcohol"


@jax.jit
def _step(states, view):
    return COAT.update(EventStep.start(MODEL, states, view, None)).states


def _run(states, view, steps=1):
    for _ in range(steps):
        states = _step(states, view)
    return states


def _covers(states, name: str, substance: str) -> int:
    row, column = MODEL.substances.row[HOME.index[name]], SUBSTANCES.index(substance)
    return int(np.bitwise_count(np.asarray(states.coat)[0, row, column]))


def _total(states) -> np.ndarray:
    return np.asarray(states.volume).sum(1) + np.asarray(states.lost) - np.asarray(states.drawn)


@pytest.mark.parametrize("name, substance", [("brush", PAINT), ("sponge", PAINT), ("sponge", "water")])
def test_what_is_dipped_absorbs_until_it_is_saturated(name, substance):
    states = volume.set_volume(MODEL, initial_states(MODEL, 1), HOME.index["pot"], substance, 0.5)
    before = _total(states)
    out = _run(states, HOME.view(), 3)
    assert not np.asarray(coat.saturated(MODEL, out)).any()
    for _ in range(2):
        states = _run(states, HOME.view({name: (0, 0, 0.2)}), 3)
        assert np.asarray(coat.saturated(MODEL, states))[0, HOME.index[name], SUBSTANCES.index(substance)]
        assert float(states.volume.sum()) == pytest.approx(0.5 - coat.DROP, abs=1e-6), "a drop, and not more"
    np.testing.assert_allclose(_total(states), before, atol=1e-6)


def test_a_brush_covers_what_it_touches_until_it_is_dry():
    touching = HOME.view({"brush": (2, -2, 0.53)}, touching=[("brush", "board")])
    dry = _run(initial_states(MODEL, 1), touching, 2)
    assert _covers(dry, "board", PAINT) == 0
    loaded = coat.set_saturated(MODEL, initial_states(MODEL, 1), HOME.index["brush"], PAINT, True)
    painted = _run(loaded, touching)
    number = _covers(painted, "board", PAINT)
    assert 0 < number < 20, "those under the brush"
    left = float(coat.absorbed_drops(MODEL, painted, np.array([HOME.index["brush"]]))[0, 0, 1])
    assert left == pytest.approx(1 - number / applying.POINTS_PER_DROP, abs=1e-5)
    assert _covers(_run(painted, touching, 2), "board", PAINT) == number, "each point takes paint once"
    beside = HOME.view({"brush": (2.05, -2, 0.53)})
    assert _covers(_run(loaded, beside), "board", PAINT) == 0, "without contact nothing is painted"


@pytest.mark.parametrize("stock", [False, True])
def test_a_spray_that_is_on_covers_the_first_object_ahead_of_it(stock):
    spray = HOME.index["spray"]
    states = volume.set_volume(MODEL, initial_states(MODEL, 1), spray, ALCOHOL, 0.05)
    if stock:
        row = MODEL.substances.containers.row_of(spray)
        states = dataclasses.replace(states, stock=states.stock.at[:, row, 2].set(True))
    assert _covers(_run(states, HOME.view(), 2), "near", ALCOHOL) == 0, "it is off"
    on = dataclasses.replace(states, toggled_on=states.toggled_on.at[:, spray].set(True))
    after = _run(on, HOME.view(), 15)
    assert _covers(after, "near", ALCOHOL) > 0 and _covers(after, "far", ALCOHOL) == 0
    litres = 15 * applying.SPRAY_RATE * MODEL.options.timestep
    assert float(after.lost[0, 2]) == pytest.approx(litres, rel=1e-4)
    assert float(after.volume.sum()) == pytest.approx(0.05 - (0 if stock else litres), rel=1e-4)
    np.testing.assert_allclose(_total(after), _total(on), atol=1e-6)
    turned = HOME.view(quat={"spray": (0.0, 0.0, 0.0, 1.0)})
    assert _covers(_run(on, turned, 3), "near", ALCOHOL) == 0, "it points away"


def test_a_spray_soaks_a_sponge():
    spray = HOME.index["spray"]
    states = volume.set_volume(MODEL, initial_states(MODEL, 1), spray, "water", 0.05)
    states = dataclasses.replace(states, toggled_on=states.toggled_on.at[:, spray].set(True))
    view = HOME.view({"sponge": (-0.8, 0, 0.55)})
    after = _run(states, view, 70)
    assert float(after.wetness[0, HOME.index["sponge"]]) == pytest.approx(
        70 * applying.SPRAY_RATE * MODEL.options.timestep / coat.DROP, rel=1e-3
    )
    assert bool(coat.saturated(MODEL, after)[0, HOME.index["sponge"], 0])
    assert _covers(after, "sponge", "water") == 0 and _covers(after, "near", "water") == 0
