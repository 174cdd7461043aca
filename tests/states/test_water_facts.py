"""Water and wetness: iGibson's rules with a worked example of a tap, paper tables A.1 to A.5."""

from __future__ import annotations

import dataclasses
import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, step

from ig2mj.states import StateModel, initial_states
from ig2mj.states.definitions import water
from ig2mj.states.definitions.water import DROP_RADIUS, NUM_DROPS
from ig2mj.states.definitions.wetness import set_soaked, soaked
from ig2mj.states.relations.worklist import Worklist

PLATE = (((0, 0, 0), (0.2, 0.2, 0.01)),)
SINK = Item(
    "sink",
    (((0, 0, 0.0), (0.3, 0.3, 0.05)),),
    {"waterSource": {}, "toggleable": {}, "waterSink": {}},
    links={"water_source": (0, 0, 0.5)},
    fixed=True,
)
RAG = Item("rag", PLATE, {"soakable": {"wetness_soaked": 1.0}}, pos=(5, 0, 0))
TRAY = Item("tray", PLATE, pos=(6, 0, 0))
KITCHEN = HandWorld(SINK, RAG, TRAY)


def _run(home: HandWorld, views: list, on_from: int = 1, **options) -> tuple[StateModel, list]:
    """States after each update; the tap is switched on just before update `on_from` (from 1)."""
    model = home.model(**options)
    states, history = initial_states(model, 1), []
    for k, view in enumerate(views, start=1):
        if k == on_from:
            states = states.replace(toggled_on=states.toggled_on.at[0, 0].set(True))
        states = step(model, states, view)
        history.append(states)
    return model, history


def _emissions(history: list) -> list[int]:
    """Updates (from 1) at which a drop appeared at the tap."""
    found = []
    for k, states in enumerate(history, start=1):
        at_tap = np.asarray(states.water.active[0, 0] & (states.water.speed[0, 0] == 0))
        height = np.asarray(states.water.pos[0, 0, :, 2])
        if (at_tap & np.isclose(height, 0.45)).any():
            found.append(k)
    return found


def test_a_tap_on_from_update_k_drops_at_k_plus_1_and_then_every_four():
    # Far from everything, no drop comes back: the tenth is the last.
    air = Item("air_tap", (((0, 0, 100), (0.1, 0.1, 0.1)),), {"waterSource": {}, "toggleable": {}},
                links={"water_source": (0, 0, 0.5)})  # fmt: skip
    home = HandWorld(air, RAG)
    k = 3
    _, history = _run(home, [home.view()] * 30, on_from=k)
    assert _emissions(history)[:7] == [k + 1 + 4 * n for n in range(7)]


@pytest.mark.parametrize("compat", ["paper", "igibson"])
def test_what_lies_under_a_tap_does_not_make_it_run_dry(compat):
    """iGibson's drops roll away after the tenth, at k + 37; ours make room, the oldest first."""
    bench = Item("bench", PLATE, pos=(0, 0, 0.3))
    _, history = _run(HandWorld(SINK, bench), [HandWorld(SINK, bench).view()] * 60, compat=compat)
    assert _emissions(history) == list(range(2, 61, 4))
    newest = np.asarray(history[-1].water.age[0, 0])
    assert sorted(newest) == [2 + 4 * n for n in range(NUM_DROPS)]  # the ten that left last
    assert history[-1].water.active.all()


def test_a_tap_whose_drops_all_still_fall_waits():
    air = Item("air_tap", (((0, 0, 100), (0.1, 0.1, 0.1)),), {"waterSource": {}}, links={"water_source": (0, 0, 0.5)})
    deep = Item("ground", PLATE, pos=(0, 0, -9.4))  # 9.8 m: 1.41 s, two updates more than ten drops take
    home = HandWorld(air, deep)
    _, history = _run(home, [home.view()] * 52, on_from=99)
    found = _emissions(history)
    assert found[:NUM_DROPS] == [2 + 4 * n for n in range(NUM_DROPS)]
    assert found[NUM_DROPS] > 2 + 4 * NUM_DROPS


@pytest.mark.parametrize("compat", ["paper", "igibson"])
def test_a_towel_under_a_tap_over_a_basin_takes_55_drops_in_220_updates(compat):
    """In iGibson the drops roll off the towel into the basin, and 55 leave the tap; as many leave it here."""
    towel = Item("towel", PLATE, {"soakable": {"wetness_soaked": 1.0}}, pos=(0, 0, 0.3))
    home = HandWorld(SINK, towel)
    model, history = _run(home, [home.view()] * 220, compat=compat)
    assert len(_emissions(history)) == 55
    assert bool(soaked(model, history[-1].wetness)[0, 1])
    if compat == "paper":
        assert float(history[-1].wetness[0, 1]) == 54.0  # the last one still falls


@pytest.mark.parametrize("compat", ["paper", "igibson"])
def test_a_rag_held_under_a_tap_after_a_plate_gets_soaked(compat):
    plate, both = KITCHEN.view({"tray": (0, 0, 0.2)}), KITCHEN.view({"tray": (0, 0, 0.2), "rag": (0, 0, 0.35)})
    model, history = _run(KITCHEN, [plate] * 120 + [both] * 30, compat=compat)
    assert not bool(soaked(model, history[119].wetness)[0, 1])
    assert bool(soaked(model, history[-1].wetness)[0, 1])


def test_the_count_stands_still_while_the_tap_is_off():
    model = KITCHEN.model()
    states = initial_states(model, 1)
    marks = []
    for k in range(1, 14):
        on = not 3 <= k <= 6  # the first drop comes at update 2
        states = states.replace(toggled_on=states.toggled_on.at[0, 0].set(on))
        before = states.water.active.sum()
        states = step(model, states, KITCHEN.view())
        marks.append(int(states.water.active.sum() - before))
    assert [k for k, m in enumerate(marks, start=1) if m > 0][:2] == [2, 10]  # three waiting updates: 3, 8, 9


def test_a_tap_that_is_off_gives_no_water_and_one_without_a_switch_always_runs():
    _, history = _run(KITCHEN, [KITCHEN.view()] * 6, on_from=99)
    assert not history[-1].water.active.any()
    home = HandWorld(Item("spring", abilities={"waterSource": {}}, links={"water_source": (0, 0, 2)}))
    _, history = _run(home, [home.view()] * 3, on_from=99)
    assert history[-1].water.active.any()


def test_table_a4_wetness_counts_the_droplets_absorbed():
    view = KITCHEN.view({"rag": (0, 0, 0.3)})
    model, history = _run(KITCHEN, [view] * 40)
    wet = [float(s.wetness[0, 1]) for s in history]
    assert wet[-1] == 9.0  # drops of updates 2, 6, ..., 34 have fallen 15 cm by update 40
    assert all(b - a in (0.0, 1.0) for a, b in itertools.pairwise(wet))
    assert bool(soaked(model, history[-1].wetness)[0, 1])


def test_igibsons_code_keeps_a_latch_and_does_not_take_the_drop():
    view = KITCHEN.view({"rag": (0, 0, 0.3)})
    _, history = _run(KITCHEN, [view] * 40, compat="igibson")
    assert float(history[-1].wetness[0, 1]) == 1.0
    assert history[-1].water.active.sum() >= 9


def test_sinks_take_drops_in_the_paper_and_not_in_the_code():
    drain = Item("drain", PLATE, {"waterSink": {}}, links={"water_sink": (0, 0, 0)}, pos=(0, 0, 0.3))
    home = HandWorld(SINK, drain)
    _, paper = _run(home, [home.view()] * 60)
    _, code = _run(home, [home.view()] * 60, compat="igibson")
    assert not paper[-1].water.active.all()
    assert code[-1].water.active.all()


def test_table_a3_a_droplet_sink_link_takes_drops_without_any_surface():
    box = Item("hole", (((3, 0, 0), (0.1, 0.1, 0.1)),), {}, links={"water_sink": ((0, 0, 0.2), (0.1, 0.1, 0.1))})
    tap = Item("tap", (((0, 0, 5), (0.1, 0.1, 0.1)),), {"waterSource": {}}, links={"water_source": (0, 0, 0.5)})
    home = HandWorld(tap, box)
    _, history = _run(home, [home.view()] * 20)
    assert all(float(s.water.pos[0, 0, :, 2][s.water.active[0, 0]].min(initial=1.0)) > 0.05 for s in history)
    assert history[-1].water.active.sum() < 4


def test_a_drop_that_touches_the_source_itself_goes_back():
    for compat in ("paper", "igibson"):
        _, history = _run(KITCHEN, [KITCHEN.view()] * 60, compat=compat)
        assert history[-1].water.active.sum() <= 4  # 40 cm take 0.29 s, nine updates


def test_a_drop_rests_on_a_tray_and_falls_on_when_the_tray_goes():
    under, away = KITCHEN.view({"tray": (0, 0, 0.3)}), KITCHEN.view()
    _, history = _run(KITCHEN, [under] * 20)
    at_rest = history[-1].water
    first = np.asarray(at_rest.pos[0, 0, 0])
    assert first[2] == pytest.approx(0.31 + DROP_RADIUS + 0.003, abs=1e-4)
    assert float(at_rest.speed[0, 0, 0]) == 0.0
    states = history[-1].replace(toggled_on=history[-1].toggled_on & False)
    for _ in range(12):
        states = step(KITCHEN.model(), states, away)
    assert not states.water.active.any()  # they fell into the sink


def test_no_drop_is_missed_at_speed():
    # A thin rag 8 m below: 12.5 m/s, 42 cm in one update.
    thin = Item("rag", (((0, 0, 0), (0.1, 0.1, 0.001)),), {"soakable": {}}, pos=(0, 0, -8))
    tap = Item("tap", (((0, 0, 5), (0.1, 0.1, 0.1)),), {"waterSource": {}}, links={"water_source": (0, 0, 0.5)})
    home = HandWorld(tap, thin)
    _, history = _run(home, [home.view()] * 45)
    assert float(history[-1].wetness[0, 1]) >= 1.0


def test_a_drop_that_leaves_the_house_comes_back():
    tap = Item("tap", (((0, 0, 5), (0.1, 0.1, 0.1)),), {"waterSource": {}}, links={"water_source": (0, 0, 0.5)})
    home = HandWorld(tap)
    _, history = _run(home, [home.view()] * 120)
    assert sum(int(s.water.active[0].all()) for s in history[80:]) < 40


def test_a_source_without_its_link_crashes_nothing():
    home = HandWorld(Item("sink", abilities={"waterSource": {}, "toggleable": {}}), RAG)
    _, history = _run(home, [home.view()] * 2)
    assert history[-1].water.active.shape == (1, 0, NUM_DROPS)
    assert float(history[-1].wetness.sum()) == 0.0


def test_drying_is_off_and_can_be_switched_on():
    wet = initial_states(KITCHEN.model(), 1)
    wet = wet.replace(wetness=wet.wetness.at[0, 1].set(2.0))
    assert float(step(KITCHEN.model(), wet, KITCHEN.view()).wetness[0, 1]) == 2.0
    drying = KITCHEN.model(drying_rate=3.0)
    assert float(step(drying, wet, KITCHEN.view()).wetness[0, 1]) == pytest.approx(1.9)
    dry = wet.replace(wetness=wet.wetness * 0)
    assert float(step(drying, dry, KITCHEN.view()).wetness[0, 1]) == 0.0


def test_table_a5_soaked_sets_the_level_to_the_threshold_or_zero():
    home = HandWorld(Item("rag", abilities={"soakable": {"wetness_soaked": 3.0}}), Item("rock"))
    model = home.model()
    wetness = initial_states(model, 1).wetness
    wet = set_soaked(model, wetness, jnp.ones((1, 2), bool), True)
    assert wet[0].tolist() == [3.0, 0.0]
    assert set_soaked(model, wet, jnp.ones((1, 2), bool), False)[0].tolist() == [0.0, 0.0]


def test_a_nan_pose_catches_no_drop():
    _, history = _run(KITCHEN, [KITCHEN.view({"rag": (0, np.nan, 0.3)})] * 20)
    assert float(history[-1].wetness[0, 1]) == 0.0


@pytest.mark.parametrize("search", [True, False])
def test_drops_of_many_worlds_move_as_they_do_in_a_world_alone(monkeypatch, search):
    """Eleven worlds, four at a time: in some no drop is out, in the others drops are above, on and beside a rag."""
    rng, worlds = np.random.default_rng(0), 11
    model, view = KITCHEN.model(), KITCHEN.view(worlds=worlds)
    low, high = np.array([-0.5, -0.5, -0.2]), np.array([0.5, 0.5, 0.6])
    rag = rng.uniform(low, high, (worlds, 3)).astype(np.float32)
    body_pos = np.array(view.body_pos)
    body_pos[:, 1 + KITCHEN.index["rag"]] = rag
    view = dataclasses.replace(view, body_pos=body_pos)
    drops = water.no_drops(worlds, 1)
    shape = drops.active.shape
    drops = dataclasses.replace(
        drops,
        active=(rng.random(shape) < 0.6) & (np.arange(worlds) % 3 != 1)[:, None, None],
        pos=rng.uniform(low, high, (*shape, 3)).astype(np.float32),
        speed=rng.choice([0.0, 1.0, 8.0], shape).astype(np.float32),
        age=rng.integers(0, 9, shape).astype(np.int32),
    )
    on = rng.random((worlds, 3)) < 0.5

    monkeypatch.setattr(water.Worklist, "of", functools.partial(Worklist.of, search=search))
    monkeypatch.setattr(water, "WORLDS_AT_ONCE", 4)
    together = jax.jit(water.update, static_argnums=0)(model, drops, view, on)
    assert np.asarray(together[1]).any() and not np.asarray(together[1]).all()
    for w in range(worlds):
        one_drops, one_view = jax.tree.map(lambda a, w=w: a[w : w + 1], (drops, view))
        alone = jax.jit(water.update, static_argnums=0)(model, one_drops, one_view, on[w : w + 1])
        for name, a, b in zip(
            ["active", "pos", "speed", "age", "waited", "running", "contacts"],
            [*jax.tree.leaves(alone[0]), alone[1]],
            [*jax.tree.leaves(together[0]), together[1]],
            strict=True,
        ):
            np.testing.assert_array_equal(np.asarray(a)[0], np.asarray(b)[w], err_msg=f"{name} in world {w}")
