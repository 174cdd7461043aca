"""Volumes, what covers objects, and what they absorb: conservation, capacity by tilt, where streams go, wiping."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, step
from hypothesis import given
from hypothesis import strategies as st
from substance_world import FLOOR, GLASS, JUG, SUBSTANCES, container, tilted, world

from ig2mj.states import StateModel, initial_states
from ig2mj.states.substances import coat, volume

HOME = world(Item("table", (((0, 0, 0.45), (0.2, 0.2, 0.05)),), pos=(-2, -2, 0), fixed=True))
HOLDS = jax.jit(lambda view: HOME.model().substances.containers.holds(view))
NAMES = [o for o in HOME.index if HOME.things[HOME.index[o]].inside is not None]


def _filled(model: StateModel, **litres: float):
    """Water, or with `jug_olive_oil=...` something else, in containers."""
    states = initial_states(model, 1)
    for key, value in litres.items():
        name, _, substance = key.partition("_")
        states = volume.set_volume(model, states, HOME.index[name], substance or "water", value)
    return states


def _total(states) -> np.ndarray:
    return np.asarray(states.volume).sum(1) + np.asarray(states.lost) - np.asarray(states.drawn)


def _in(states, name: str, substance: str = "water") -> float:
    return float(states.volume[0, NAMES.index(name), SUBSTANCES.index(substance)])


def _run(states, view, steps: int, model: StateModel | None = None):
    for _ in range(steps):
        states = step(model or HOME.model(), states, view)
    return states


def test_what_stands_keeps_what_it_holds_and_not_more():
    states = _run(_filled(HOME.model(), jug=1.9, glass=0.3), HOME.view(), 5)
    assert _in(states, "jug") == pytest.approx(1.9) and _in(states, "glass") == pytest.approx(0.3)
    over = _run(_filled(HOME.model(), jug=2.5), HOME.view(), 90)
    assert _in(over, "jug") == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("degrees, share", [(0, 1), (26.565, 0.75), (45, 0.5), (63.435, 0.25), (90, 0), (180, 0)])
def test_a_cube_holds_by_tilt_what_geometry_says(degrees, share):
    """Tilted by a, a cube keeps 1 - tan(a) / 2 of its content up to 45 degrees, and cot(a) / 2 beyond."""
    cube = HandWorld(container("cube", (0.05, 0.05, 0.05)), substances=("water",))
    containers = cube.model().substances.containers
    holds = float(containers.holds(cube.view(quat={"cube": tilted(degrees)}))[0, 0])
    assert holds == pytest.approx(share, abs=0.035)


@given(st.floats(0, 175), st.floats(0, 360), st.floats(0.5, 5))
def test_a_container_holds_less_the_more_it_is_tilted(degrees, direction, more):
    def quat(angle: float):
        half, way = np.deg2rad(angle) / 2, np.deg2rad(direction)
        return float(np.cos(half)), float(np.sin(half) * np.cos(way)), float(np.sin(half) * np.sin(way)), 0.0

    jug = NAMES.index("jug")
    held = [float(HOLDS(HOME.view(quat={"jug": quat(a)}))[0, jug]) for a in (degrees, degrees + more)]
    assert held[1] <= held[0] + 1e-5


def test_a_litre_poured_into_a_glass_overflows_onto_the_floor():
    model = HOME.model()
    states = _filled(model, jug=1.0)
    before = _total(states)
    view = HOME.view({"jug": (0.0, 0.0, 0.5)}, quat={"jug": tilted(110)})
    middle = _run(states, view, 10)
    assert _in(middle, "glass") > 0.1 and _in(middle, "jug") > 0.05
    end = _run(middle, view, 110)
    assert _in(end, "jug") == 0
    assert _in(end, "glass") == pytest.approx(8000 * np.prod(GLASS), rel=0.01)
    assert float(end.lost[0, 0]) == pytest.approx(1 - 8000 * np.prod(GLASS), rel=0.02)
    np.testing.assert_allclose(_total(end), before, rtol=1e-5, atol=1e-7)
    assert bool(coat.covered(model, end)[0, HOME.index["floor"], 0])


def test_a_mixture_flows_in_the_ratio_of_its_volumes():
    states = _filled(HOME.model(), jug=0.9, jug_olive_oil=0.3)
    end = _run(states, HOME.view(quat={"jug": tilted(70)}), 60)
    left = _in(end, "jug"), _in(end, "jug", "olive_oil")
    assert 0.05 < left[0] < 0.85
    assert left[0] / left[1] == pytest.approx(3, rel=1e-3)
    assert _in(end, "glass") / _in(end, "glass", "olive_oil") == pytest.approx(3, rel=1e-3)


def test_frozen_contents_stay():
    model = HOME.model()
    states = _filled(model, jug=1.0)
    cold = states.replace(temperature=jnp.full_like(states.temperature, -30.0))
    view = HOME.view(quat={"jug": tilted(180)})
    frozen = _run(cold, view, 4)
    assert bool(frozen.solid[0, NAMES.index("jug"), 0])
    assert _in(frozen, "jug") == pytest.approx(_in(_run(cold, view, 1), "jug"))
    warm = frozen.replace(temperature=jnp.full_like(states.temperature, 20.0))
    assert _in(_run(warm, view, 30), "jug") < 0.1


def test_a_tap_fills_what_stands_under_it_and_its_basin_drains():
    model, sink = HOME.model(), HOME.index["sink"]
    states = initial_states(model, 1)
    states = states.replace(toggled_on=states.toggled_on.at[0, sink].set(True))
    under = _run(states, HOME.view({"glass": (2, 0, 0.85)}), 30)
    assert _in(under, "glass") == pytest.approx(volume.TAP_RATE, rel=0.05)
    basin = _run(states, HOME.view(), 30)
    assert _in(basin, "sink") < 0.02 and float(basin.lost[0, 0]) > 0.08
    for end in (under, basin):
        np.testing.assert_allclose(_total(end), 0, atol=1e-6)


def test_a_source_that_points_down_gives_without_end():
    model = HOME.model()
    states = _filled(model, jug_salt=0.2)
    states = states.replace(stock=states.stock.at[0, NAMES.index("jug"), SUBSTANCES.index("salt")].set(True))
    end = _run(states, HOME.view({"jug": (0.15, 0, 0.5)}, quat={"jug": tilted(180)}), 120)
    given = float(end.drawn[0, SUBSTANCES.index("salt")])
    assert given == pytest.approx(volume.SOURCE_RATE * 4, rel=1e-3)
    np.testing.assert_allclose(_total(end)[0, SUBSTANCES.index("salt")], 0.2, atol=1e-5)


def test_what_is_poured_on_a_sponge_soaks_it():
    model, sponge = HOME.model(), HOME.index["sponge"]
    states = _filled(model, jug=0.3, jug_liquid_soap=0.1)
    at = {"jug": (0, 0, 0.5), "sponge": (0.15, 0, 0.3), "glass": (2, 2, 0.06)}
    end = _run(states, HOME.view(at, quat={"jug": tilted(120)}), 20)
    found = np.asarray(coat.saturated(model, end))[0, sponge]
    assert found[SUBSTANCES.index("water")] and found[SUBSTANCES.index("liquid_soap")]
    assert not found[SUBSTANCES.index("mud")] and float(end.wetness[0, sponge]) > 1


@pytest.mark.parametrize(
    "substance, needs",
    [("mud", "water"), ("mud", "liquid_soap"), ("olive_oil", "liquid_soap"), ("salt", None), ("water", None)],
)
def test_a_sponge_removes_what_it_is_saturated_for(substance, needs):
    model, sponge, table = HOME.model(), HOME.index["sponge"], HOME.index["table"]
    view = HOME.view({"sponge": (-2, -2, 0.52)}, touching=[("sponge", "table")])
    covered = coat.set_covered(model, initial_states(model, 1), table, substance, True)
    column = SUBSTANCES.index(substance)

    def left(states) -> int:
        return int(np.asarray(states.coat)[0, model.substances.row[table], column]).bit_count()

    dry = step(model, covered, view)
    assert (left(dry) < 20) == (needs is None)
    if needs == "water":
        covered = covered.replace(wetness=covered.wetness.at[0, sponge].set(1.0))
    elif needs:
        covered = coat.set_saturated(model, covered, sponge, needs, True)
    wiped = step(model, covered, view)
    assert 0 < left(wiped) < 20  # the sponge is smaller than the table
    away = step(model, covered, HOME.view({"sponge": (-2, -2, 0.52)}))
    assert left(away) == 20  # without contact nothing is wiped off


RULES = (
    "water",
    "cooked__water",
    "lemon_juice",
    "granulated_sugar",
    "lemonade",
    "grated_cheese",
    "melted__grated_cheese",
)
KITCHEN = HandWorld(
    container("pot", (0.1, 0.1, 0.1)),
    Item("spoon", category="spoon", pos=(1, 1, 1)),
    Item("bagel", abilities={"cookable": {}}, pos=(2, 2, 0)),
    substances=RULES,
)


def _kitchen(**litres: float):
    model = KITCHEN.model()
    states = initial_states(model, 1)
    for name, value in litres.items():
        states = volume.set_volume(model, states, 0, name, value)
    return model, states


def _pot(states) -> dict[str, float]:
    return {n: round(float(v), 5) for n, v in zip(RULES, states.volume[0, 0], strict=True) if v}


def test_what_is_stirred_becomes_what_its_rule_says():
    model, states = _kitchen(water=0.5, lemon_juice=0.2, granulated_sugar=0.1)
    alone = step(model, states, KITCHEN.view())
    assert _pot(alone) == {"water": 0.5, "lemon_juice": 0.2, "granulated_sugar": 0.1}
    stirred = step(model, alone, KITCHEN.view(touching=[("spoon", "pot")]))
    assert _pot(stirred) == {"lemonade": 0.8}


def test_what_is_hot_is_cooked_a_step_later():
    model, states = _kitchen(water=0.5)
    hot = states.replace(temperature=states.temperature.at[0, 0].set(90.0))
    first = step(model, hot, KITCHEN.view())
    assert _pot(first) == {"water": 0.5}
    assert _pot(step(model, first, KITCHEN.view())) == {"cooked__water": 0.5}


def test_what_covers_something_hot_melts():
    model, states = _kitchen()
    states = coat.set_covered(model, states, 2, "grated_cheese", True)
    hot = states.replace(temperature=states.temperature.at[0, 2].set(60.0))
    found = np.asarray(coat.covered(model, step(model, step(model, hot, KITCHEN.view()), KITCHEN.view())))[0, 2]
    assert [n for n, is_on in zip(RULES, found, strict=True) if is_on] == ["melted__grated_cheese"]


@given(st.lists(st.integers(0, 19), unique=True))
def test_points_are_bits(points):
    mask = np.isin(np.arange(20), points)
    assert (np.asarray(coat.as_points(coat.as_bits(jnp.asarray(mask)))) == mask).all()


@given(st.floats(0, 180), st.floats(-0.3, 0.3), st.floats(0.05, 3), st.floats(0, 1))
def test_nothing_is_made_and_nothing_vanishes(degrees, aside, water, oil):
    model = HOME.model()
    states = _filled(model, jug=water, jug_olive_oil=oil, glass=0.2)
    before = _total(states)
    view = HOME.view({"jug": (aside, 0.0, 0.6)}, quat={"jug": tilted(degrees)})
    end = _run(states, view, 6)
    np.testing.assert_allclose(_total(end), before, rtol=1e-5, atol=1e-6)
    assert (np.asarray(end.volume) >= 0).all()


@pytest.mark.slow
def test_many_worlds_do_what_one_does():
    """A batch of more worlds than are followed at once: those in which something flows are followed in turns."""
    model = HOME.model()
    one = _filled(model, jug=1.0)
    many = initial_states(model, 300)
    pours = np.arange(300) % 3 == 0
    filled = np.where(pours[:, None, None], np.asarray(one.volume), 0.0).astype(np.float32)
    many = dataclasses.replace(many, volume=jnp.asarray(filled))
    quat = {"jug": tilted(120)}
    for _ in range(3):
        one = step(model, one, HOME.view(quat=quat))
        many = step(model, many, HOME.view(quat=quat, worlds=300))
    np.testing.assert_allclose(
        np.asarray(many.volume)[pours], np.repeat(np.asarray(one.volume), pours.sum(), 0), atol=1e-6
    )
    assert not np.asarray(many.volume)[~pours].any()


@pytest.mark.slow
def test_halves_take_over_what_covers_their_whole():
    home = HandWorld(
        Item("apple", abilities={"sliceable": {"slice_force": 10.0}}, parts={"left": (0, 0.2, 0)}),
        Item("left", part_of="apple", parked=True, pos=(5, 5, 0)),
        Item("knife", abilities={"slicer": {}}, pos=(0, 0, 1), links={"slicer": ((0, 0, 0), (0.1, 0.1, 0.1))}),
        FLOOR,
        substances=("mud",),
    )
    model = home.model()
    states = coat.set_covered(model, initial_states(model, 1), 0, "mud", True)
    cut = step(model, states, home.view(force={("knife", "apple"): 50.0}))
    assert bool(cut.sliced[0, 0]) and bool(coat.covered(model, cut)[0, 1, 0])


def test_scenes_without_substances_have_none_of_it():
    plain = HandWorld(*HOME.things)
    states = initial_states(plain.model(), 1)
    assert plain.model().added == () and not hasattr(states, "volume")
    assert JUG[2] == 0.1
