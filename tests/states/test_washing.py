"""Washing machines and dryers."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, step
from substance_world import FLOOR, container

from ig2mj.states import initial_states
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import coat, volume, washing

DRUM = (((0, 0, 0), (0.3, 0.3, 0.3)),)
SOFT = {"soakable": {"wetness_soaked": 1.0}}
SMALL = (((0, 0, 0), (0.05, 0.05, 0.02)),)
HOME = HandWorld(
    FLOOR,
    Item("washer", DRUM, {"toggleable": {}}, category="washer", pos=(2, 0, 0.4), fixed=True),
    Item("dryer", DRUM, category="dryer", pos=(-2, 0, 0.4), fixed=True),
    Item("tie", SMALL, SOFT, pos=(2, 0, 0.4)),
    Item("towel", SMALL, SOFT, pos=(-2, 0, 0.4)),
    container("bottle", (0.03, 0.03, 0.05), (2, 0.1, 0.4), category="detergent"),
    substances=("water", "detergent", "mud", "olive_oil", "rust"),
)
MODEL, VIEW = HOME.model(), HOME.view()


def _states(on: bool = True, wet: bool = False):
    states = initial_states(MODEL, 1)
    for name in ("mud", "olive_oil", "rust"):
        states = coat.set_covered(MODEL, states, HOME.index["tie"], name, True)
    toggled = jnp.asarray(states.toggled_on).at[0, HOME.index["washer"]].set(on)
    wetness = jnp.asarray(states.wetness).at[0, HOME.index["towel"]].set(5.0 if wet else 0.0)
    return states.replace(toggled_on=toggled, wetness=wetness)


def _covers(states) -> set[str]:
    row = MODEL.substances.row[HOME.index["tie"]]
    return {n for n, bits in zip(MODEL.substances.names, np.asarray(states.coat)[0, row], strict=True) if bits}


def test_water_washes_off_mud_and_soaks_and_oil_takes_soap():
    washed = step(MODEL, _states(), VIEW)
    assert _covers(washed) == {"olive_oil", "rust"} and float(washed.wetness[0, HOME.index["tie"]]) == 1.0
    soapy = volume.set_volume(MODEL, _states(), HOME.index["bottle"], "detergent", 0.1)
    assert _covers(step(MODEL, soapy, VIEW)) == {"rust"}


def test_a_machine_that_is_off_does_nothing():
    states = step(MODEL, _states(on=False), VIEW)
    assert len(_covers(states)) == 3 and not states.wetness.any()


@pytest.mark.slow
def test_a_dryer_without_a_switch_dries_while_it_is_closed():
    assert float(step(MODEL, _states(wet=True), VIEW).wetness[0, HOME.index["towel"]]) == 0.0


@pytest.mark.slow
def test_what_has_been_washed_is_idle():
    def idle(states) -> bool:
        return bool(washing.idle(EventStep.start(MODEL, states, VIEW, None)))

    assert not idle(_states()) and idle(step(MODEL, _states(), VIEW))
