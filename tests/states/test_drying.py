"""Options beyond the paper: liquids dry at a rate that doubles every ten degrees, and dirt spreads by contact."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from hand_world import HandWorld, Item
from substance_world import FLOOR, SPONGE

from ig2mj.states import initial_states
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import coat, drying

SUBSTANCES = ("water", "olive_oil", "mud")
HOME = HandWorld(
    FLOOR,
    Item("board", (((0, 0, 0), (0.1, 0.1, 0.01)),), pos=(0, 0, 0.02)),
    Item("shelf", (((0, 0, 0), (0.1, 0.1, 0.01)),), pos=(1, 0, 0.5), fixed=True),
    SPONGE,
    substances=SUBSTANCES,
)
DRIES, SOILS = HOME.model(drying_rate=1.0), HOME.model(soiling=True)
BOARD, SPONGE_AT, GROUND = HOME.index["board"], HOME.index["sponge"], HOME.index["floor"]


@jax.jit
def _dry(states, view, steps):
    def one(_, states):
        return drying.update(EventStep.start(DRIES, states, view, None)).states

    return jax.lax.fori_loop(0, steps, one, states)


@jax.jit
def _touch(states, view):
    return drying.update(EventStep.start(SOILS, states, view, None)).states


def _points(states, obj: int, substance: str) -> int:
    bits = np.asarray(states.coat)[0, SOILS.substances.row[obj], SUBSTANCES.index(substance)]
    return int(np.bitwise_count(bits))


@pytest.mark.parametrize("temperature, seconds", [(23.0, 20.0), (33.0, 10.0), (13.0, 40.0)])
def test_twenty_points_of_water_dry_in_a_time_that_halves_every_ten_degrees(temperature, seconds):
    states = initial_states(DRIES, 1).replace(temperature=np.full((1, 4), temperature, np.float32))
    for substance in ("water", "olive_oil"):
        states = coat.set_covered(DRIES, states, BOARD, substance, True)
        states = coat.set_saturated(DRIES, states, SPONGE_AT, "olive_oil", True)
    steps = round(seconds / DRIES.options.timestep)
    states = _dry(states, HOME.view(), steps // 2)
    assert 9 <= _points(states, BOARD, "water") <= 11
    states = _dry(states, HOME.view(), steps // 2 + 3)
    assert _points(states, BOARD, "water") == 0
    assert _points(states, BOARD, "olive_oil") == 20, "oil does not dry"
    assert coat.saturated(DRIES, states)[0, SPONGE_AT, 1]


def test_what_touches_mud_gets_muddy_and_makes_others_muddy():
    states = coat.set_covered(SOILS, initial_states(SOILS, 1), BOARD, "mud", True)
    assert _points(_touch(states, HOME.view()), GROUND, "mud") == 0, "they do not touch"
    on_shelf = HOME.view({"board": (1, 0, 0.52)}, touching=[("board", "shelf")])
    soiled = _touch(states, on_shelf)
    assert _points(soiled, HOME.index["shelf"], "mud") > 0 and _points(soiled, HOME.index["shelf"], "water") == 0
    away = HOME.view({"board": (1.5, 0, 0.52)}, touching=[("board", "shelf")])
    assert _points(_touch(states, away), HOME.index["shelf"], "mud") == 0, "no point of one is near one of the other"
    clean = coat.set_covered(SOILS, soiled, BOARD, "mud", False)
    assert _points(_touch(clean, on_shelf), BOARD, "mud") > 0


def test_tools_and_what_is_fixed_soil_nothing():
    states = coat.set_covered(SOILS, initial_states(SOILS, 1), HOME.index["shelf"], "mud", True)
    view = HOME.view({"sponge": (1, 0, 0.53)}, touching=[("sponge", "shelf"), ("shelf", "floor")])
    after = _touch(states, view)
    assert _points(after, SPONGE_AT, "mud") == 0 and _points(after, GROUND, "mud") == 0
