"""ToggledState: iGibson's rules with a worked example, paper table A.4."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, step

from ig2mj.states import initial_states
from ig2mj.states.definitions.toggled_on import set_toggled_on

LAMP = HandWorld(
    Item("lamp", abilities={"toggleable": {}}, links={"toggle_button": (0, 0, 1)}),
    Item("rock", links={"toggle_button": (0, 0, 1)}, pos=(0.02, 0, 0)),
    Item("radio", abilities={"toggleable": {}}, pos=(3, 0, 0)),
    fingers=2,
)
NEAR, AWAY = [(0, 0, 5), (0, 0.09, 1)], [(0, 0, 5), (0, 0.11, 1)]


def _press(pattern: str, start: bool = False) -> list[bool]:
    """The lamp's switch after each update; 1 is a finger at the button, 0 is none."""
    model = LAMP.model()
    states = initial_states(model, 1)
    states = states.replace(toggled_on=states.toggled_on.at[0, 0].set(start))
    found = []
    for mark in pattern:
        states = step(model, states, LAMP.view(fingers=NEAR if mark == "1" else AWAY))
        found.append(bool(states.toggled_on[0, 0]))
    return found


def test_a_finger_in_range_for_eight_steps_flips_the_switch_at_update_five_only():
    assert _press("11111111") == [False] * 4 + [True] * 4


def test_table_a4_toggled_state_flips_back_after_leaving_and_pressing_again():
    assert _press("11111011111") == [False] * 4 + [True] * 6 + [False]


def test_an_interrupted_press_starts_over():
    assert not any(_press("1111011110"))


def test_the_reach_is_strictly_ten_centimetres_from_the_finger_frame():
    model = LAMP.model()
    states = initial_states(model, 1)
    at_the_edge = LAMP.view(fingers=[(0, 0, 5), (0, 0.1001, 1)])
    for _ in range(6):
        states = step(model, states, at_the_edge)
    assert not states.toggled_on.any()


def test_only_toggleable_objects_with_a_button_have_a_switch():
    model = LAMP.model()
    states = initial_states(model, 1)
    for _ in range(5):
        states = step(model, states, LAMP.view(fingers=[(0, 0, 1), (3, 0, 0)]))
    assert states.toggled_on[0].tolist() == [True, False, False]


def test_a_nan_finger_presses_nothing():
    model = LAMP.model()
    states = initial_states(model, 1)
    for _ in range(6):
        states = step(model, states, LAMP.view(fingers=[(np.nan, 0, 1), (0, 0, 5)]))
    assert not states.toggled_on.any()


@pytest.mark.parametrize("value", [True, False])
def test_table_a5_toggled_on_is_set_to_the_wanted_value(value):
    model = LAMP.model()
    everything = jnp.ones((2, 3), bool)
    states = initial_states(model, 2)
    toggled = set_toggled_on(model, ~states.toggled_on if not value else states.toggled_on, everything, value)
    assert (np.asarray(toggled[:, [0, 2]]) == value).all()


def test_a_held_button_counts_without_end():
    model = LAMP.model()
    states = initial_states(model, 1)
    for _ in range(12):
        states = step(model, states, LAMP.view(fingers=NEAR))
    assert states.press_count[0, 0] == 6
    assert states.toggled_on[0, 0]
