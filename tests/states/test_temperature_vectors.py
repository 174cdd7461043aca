"""Worked examples of heat, and the facts of iGibson's rules."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, shell, step, stepper

from ig2mj.states import initial_states
from ig2mj.states.definitions import temperature

FOOD = {"cookable": {}, "burnable": {}, "freezable": {}}
OVEN = {"temperature": 250.0, "heating_rate": 0.01, "requires_inside": True, "requires_closed": True,
        "requires_toggled_on": True}  # fmt: skip
STOVE = {"temperature": 500.0, "heating_rate": 0.02, "distance_threshold": 0.2, "requires_toggled_on": True}
MICROWAVE = {**OVEN, "temperature": 1000.0, "heating_rate": 0.04}
FRIDGE = {"temperature": -18.0, "heating_rate": 0.02, "requires_inside": True, "requires_closed": True}
DEFAULT = {}


def _history(kind: str, parameters: dict, steps: int) -> np.ndarray:
    """Temperatures of a food under one source, from the start: [steps + 1]."""
    home = HandWorld(
        Item("source", shell(0.5, 0.5, 0.5), {kind: parameters, "toggleable": {}}, links={"heat_source": (0, 0, 0)}),
        Item("food", (((0, 0, 0), (0.05, 0.05, 0.05)),), FOOD),
    )
    model, view = home.model(), home.view()
    acts = np.zeros((1, 2, 1), bool)
    acts[0, 1, 0] = True  # the next test shows that such a source does act on it
    states = initial_states(model, 1)

    def step(value: jax.Array, _: None) -> tuple[jax.Array, jax.Array]:
        new = temperature.update(model, value, jnp.asarray(acts), jnp.ones((1, 2), bool), view.touching)
        return new, new[0, 1]

    _, history = jax.lax.scan(step, states.temperature, None, length=steps)
    return np.concatenate([[23.0], np.asarray(history)])


@functools.cache
def _run(name: str) -> np.ndarray:
    sources = {"oven": ("heatSource", OVEN), "stove": ("heatSource", STOVE), "microwave": ("heatSource", MICROWAVE),
               "fridge": ("coldSource", FRIDGE), "default": ("heatSource", DEFAULT)}  # fmt: skip
    return _history(*sources[name], steps=4600 if name == "oven" else 1300)


@pytest.mark.parametrize(
    ("source", "target", "first"),
    [
        ("oven", 70, 696),
        ("oven", 100, 1243),
        ("oven", 200, 4539),
        ("stove", 70, 156),
        ("stove", 100, 264),
        ("stove", 200, 696),
        ("microwave", 70, 37),
        ("microwave", 200, 150),
        ("default", 70, 232),
    ],
)
def test_first_step_at_which_a_temperature_is_reached(source, target, first):
    history = _run(source)
    assert np.flatnonzero(history >= target)[0] == first


def test_a_fridge_freezes_after_1235_steps():
    assert np.flatnonzero(_run("fridge") <= 0.0)[0] == 1235


def test_the_first_step_at_the_stove_warms_by_this_much():
    history = _run("stove")
    assert history[1] - history[0] == pytest.approx(0.318, abs=5e-4)


@functools.cache
def _kitchen() -> HandWorld:
    return HandWorld(
        Item("stove", (((0, 0, 0), (0.3, 0.3, 0.4)),), {"heatSource": STOVE, "toggleable": {}},
              links={"heat_source": (0, 0, 0.5)}),
        Item("oven", shell(0.5, 0.5, 0.5), {"heatSource": OVEN, "toggleable": {}, "openable": {}}, pos=(3, 0, 0),
              links={"heat_source": (0, 0, 0)}, joints=[(0.0, 1.5)]),
        Item("fridge", shell(0.5, 0.5, 0.5), {"coldSource": FRIDGE, "openable": {}}, pos=(-3, 0, 0),
              joints=[(0.0, 1.5)]),
        Item("fish", (((0, 0, 0), (0.05, 0.02, 0.01)),), FOOD, pos=(0, 3, 0)),
        Item("book", (((0, 0, 0), (0.05, 0.02, 0.01)),), pos=(0, 4, 0)),
    )  # fmt: skip


def _after(home: HandWorld, view, *, on: tuple[str, ...] = (), **options) -> np.ndarray:
    """Temperatures after one update."""
    model = home.model(**options)
    states = initial_states(model, 1)
    toggled = np.isin(np.arange(len(home.things)), [home.index[n] for n in on])[None]
    states = states.replace(toggled_on=jnp.asarray(toggled))
    return np.asarray(step(model, states, view).temperature)[0]


def test_table_a4_temperature_is_raised_by_a_stove_that_is_on_and_near():
    home = _kitchen()
    near, far = home.view({"fish": (0, 0.1, 0.55)}), home.view({"fish": (0, 0.25, 0.55)})
    fish = home.index["fish"]
    assert _after(home, near, on=("stove",))[fish] == pytest.approx(23.318, abs=1e-3)
    assert _after(home, near)[fish] == 23.0
    assert _after(home, far, on=("stove",))[fish] == 23.0


def test_table_a4_temperature_is_lowered_inside_a_closed_fridge_only():
    home = _kitchen()
    inside = {"fish": (-3, 0, 0)}
    fish = home.index["fish"]
    assert _after(home, home.view(inside))[fish] == pytest.approx(23 - 41 * 0.02 / 30, abs=1e-4)
    assert _after(home, home.view(inside, joints={"fridge": [1.0]}))[fish] == 23.0
    assert _after(home, home.view({"fish": (-3, 0, 0.6)}))[fish] == 23.0


def test_table_a2_an_oven_must_be_on_and_closed_and_a_fridge_needs_no_switch():
    home = _kitchen()
    view, fish = home.view({"fish": (3, 0, 0)}), home.index["fish"]
    assert _after(home, view, on=("oven",))[fish] == pytest.approx(23 + 227 * 0.01 / 30, abs=1e-4)
    assert _after(home, view)[fish] == 23.0
    opened = home.view({"fish": (3, 0, 0)}, joints={"oven": [1.0]})
    assert _after(home, opened, on=("oven",))[fish] == 23.0


def test_sources_add_up_and_switch_the_room_off():
    home = HandWorld(
        *(
            Item(f"stove_{k}", (((0, 0, -1), (0.1, 0.1, 0.1)),), {"heatSource": STOVE, "toggleable": {}},
                  links={"heat_source": (0, 0, 0)})
            for k in range(2)
        ),
        Item("fish", (((0, 0, 0), (0.05, 0.02, 0.01)),), FOOD),
    )  # fmt: skip
    after = _after(home, home.view(), on=("stove_0", "stove_1"))
    assert after[2] == pytest.approx(23 + 2 * 0.02 * 477 / 30, abs=1e-4)


def test_the_room_pulls_temperatures_to_23_degrees():
    home = _kitchen()
    model = home.model()
    states = initial_states(model, 1)
    states = states.replace(temperature=states.temperature + 10.0)
    new = step(model, states, home.view())
    fish, book = home.index["fish"], home.index["book"]
    assert new.temperature[0, fish] == pytest.approx(33 - 0.02 * 10 / 30, abs=1e-4)
    assert new.temperature[0, book] == 33.0  # neither cookable, burnable nor freezable: no temperature


def test_heat_by_contact_is_off_and_can_be_switched_on():
    home = _kitchen()
    home = HandWorld(*home.things, Item("steak", (((0, 0, 0), (0.05, 0.02, 0.01)),), FOOD, pos=(0, 3, 0.02)))
    view = home.view(touching=[("fish", "steak")])
    fish, steak = home.index["fish"], home.index["steak"]

    def after(rate: float) -> np.ndarray:
        model = home.model(contact_heat_rate=rate)
        states = initial_states(model, 1)
        states = states.replace(temperature=states.temperature.at[0, steak].set(53.0))
        return np.asarray(step(model, states, view).temperature)[0]

    assert after(0.0)[fish] == 23.0
    assert after(0.5)[fish] == pytest.approx(23 + 0.5 * 30 / 30, abs=1e-4)
    assert after(0.5)[steak] < after(0.0)[steak]


def test_table_a4_max_temperature_starts_at_minus_infinity_and_never_falls():
    home = _kitchen()
    model, fish = home.model(), home.index["fish"]
    states = initial_states(model, 1)
    assert states.max_temperature[0, fish] == -np.inf
    states = step(model, states, home.view())
    assert states.max_temperature[0, fish] == 23.0
    states = states.replace(temperature=states.temperature.at[0, fish].set(-5.0))
    states = step(model, states, home.view())
    assert states.max_temperature[0, fish] == 23.0


def test_the_rule_is_newtons_and_not_the_papers_product():
    # 23 C on a 500 C stove: the printed product would add 7.3 C in a step.
    history = _run("stove")
    assert history[1] - history[0] < 1.0
    fridge = _run("fridge")
    assert fridge[-1] < 0.0  # the product has its fixed point at 0


def test_temperature_is_differentiable():
    home = _kitchen()
    model, view, fish = home.model(), home.view({"fish": (0, 0.1, 0.55)}), home.index["fish"]
    states = initial_states(model, 1)
    states = states.replace(toggled_on=states.toggled_on.at[0, home.index["stove"]].set(True))

    def after(start: jax.Array) -> jax.Array:
        s = states.replace(temperature=states.temperature.at[0, fish].set(start))
        for _ in range(3):
            s, _ = stepper(model)(s, view)
        return s.temperature[0, fish]

    slope = jax.grad(after)(jnp.float32(23.0))
    assert slope == pytest.approx((1 - 0.02 / 30) ** 3, rel=1e-5)


def test_a_source_by_nearness_without_its_link_never_acts():
    home = HandWorld(Item("stove", abilities={"heatSource": {"temperature": 500.0}}), Item("fish", abilities=FOOD))
    assert _after(home, home.view())[1] == 23.0


def test_a_nan_pose_is_reached_by_no_source():
    home = _kitchen()
    for place in ((np.nan, 0, 0), (3, np.nan, 0)):
        after = _after(home, home.view({"fish": place}), on=("stove", "oven"))
        assert after[home.index["fish"]] == 23.0


@pytest.mark.parametrize("worlds", [1, 3])
def test_worlds_do_not_touch_each_other(worlds):
    home = _kitchen()
    model, fish = home.model(), home.index["fish"]
    states = initial_states(model, worlds)
    start = 23.0 + jnp.arange(worlds)
    states = states.replace(temperature=states.temperature.at[:, fish].set(start))
    new = step(model, states, home.view(worlds=worlds))
    expected = start + 0.02 * (23 - start) / 30
    assert np.allclose(new.temperature[:, fish], expected, atol=1e-5)
