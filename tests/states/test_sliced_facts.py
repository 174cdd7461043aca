"""SlicedState: iGibson's rules, paper tables A.4 and A.5, and three bugs that are not copied."""

from __future__ import annotations

import functools

import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import IDENTITY, HandWorld, Item, step, stepper

from ig2mj.states import initial_states
from ig2mj.states.definitions import sliced
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.particles import NUM_PARTICLES, world_positions

FOOD = {"cookable": {}, "burnable": {}, "freezable": {}, "soakable": {}, "stainable": {}, "sliceable": {}}
HALF = (((0, 0, 0), (0.02, 0.04, 0.04)),)
HOME = HandWorld(
    Item("knife", (((0, 0, 0), (0.1, 0.01, 0.01)),), {"slicer": {}},
          links={"slicer": ((0.05, 0, 0), (0.05, 0.01, 0.01))}),
    Item("apple", (((0, 0, 0), (0.04, 0.04, 0.04)),), FOOD, parts={"half_a": (-0.02, 0, 0), "half_b": (0.02, 0, 0)},
          pos=(1, 2, 0.5)),
    Item("half_a", HALF, FOOD, part_of="apple", parked=True, pos=(50, 0, 0)),
    Item("half_b", HALF, FOOD, part_of="apple", parked=True, pos=(51, 0, 0)),
    Item("bread", abilities={"sliceable": {"slice_force": 20.0}}, pos=(2, 2, 2)),
    Item("stick", links={"slicer": (0, 0, 0)}, abilities={"slicer": {}}),
    Item("stove", abilities={"heatSource": {"temperature": 500.0, "heating_rate": 0.02, "distance_threshold": 0.5}},
          links={"heat_source": (0, 0, 0)}, pos=(9, 9, 9)),
)  # fmt: skip
APPLE, HALF_A, HALF_B, BREAD = (HOME.index[n] for n in ("apple", "half_a", "half_b", "bread"))


def _cut(force: float, target: str = "apple", blade: str = "knife", states=None, **view):
    model = HOME.model()
    states = initial_states(model, 1) if states is None else states
    return stepper(model)(states, HOME.view(force={(blade, target): force}, **view))


@pytest.mark.parametrize(("force", "is_cut"), [(10.0, False), (10.01, True), (0.0, False), (np.nan, False)])
def test_table_a4_sliced_state_needs_more_than_ten_newtons_on_the_blade(force, is_cut):
    states, _ = _cut(force)
    assert bool(states.sliced[0, APPLE]) == is_cut


def test_table_a4_the_force_is_configurable_per_model():
    assert not _cut(15.0, "bread")[0].sliced[0, BREAD]
    assert _cut(21.0, "bread")[0].sliced[0, BREAD]


def test_a_blade_that_is_a_mere_point_never_cuts():
    assert not _cut(100.0, blade="stick")[0].sliced.any()


def test_a_blade_may_touch_what_cannot_be_sliced():
    assert not _cut(100.0, "stove")[0].sliced.any()


def test_table_a4_slicing_is_irreversible():
    states, _ = _cut(50.0)
    again, swap = _cut(50.0, states=states)
    assert again.sliced[0, APPLE]
    assert not swap.mask.any()


def test_table_a5_halves_take_the_place_of_the_whole_and_the_whole_a_halfs():
    model = HOME.model()
    quarter = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))
    _, swap = _cut(50.0, pos={"apple": (1, 2, 3)}, quat={"apple": quarter})
    assert model.swap_objects.tolist() == [APPLE, HALF_A, HALF_B]
    assert swap.mask.tolist() == [[True] * 3]
    assert np.allclose(swap.pos[0], [[50, 0, 0], [1, 1.98, 3], [1, 2.02, 3]], atol=1e-6)
    assert np.allclose(swap.quat[0, 0], IDENTITY)
    assert np.allclose(swap.quat[0, 1:], [quarter] * 2, atol=1e-6)


def test_only_the_world_with_the_cut_is_swapped():
    model = HOME.model()
    view = HOME.view(force={("knife", "apple"): 50.0}, worlds=2)
    view = view.replace(link_force=view.link_force.at[0].set(0.0))
    states, swap = stepper(model)(initial_states(model, 2), view)
    assert states.sliced[:, APPLE].tolist() == [False, True]
    assert swap.mask.any(axis=1).tolist() == [False, True]


@functools.cache
def _used():
    """An apple that is hot, wet, and stained on its left side."""
    model = HOME.model()
    states = initial_states(model, 1)
    pos = np.tile([-0.04, 0.01, 0.0], (NUM_PARTICLES, 1)).astype(np.float32)[None]
    normal = np.tile([-1.0, 0, 0], (NUM_PARTICLES, 1)).astype(np.float32)[None]
    rows, done = STAIN.place(
        model,
        states.stain,
        STAIN.row_of(model, APPLE),
        jnp.full((1, NUM_PARTICLES), APPLE + 1, jnp.int32),
        jnp.asarray(pos),
        jnp.asarray(normal),
        jnp.ones((1, NUM_PARTICLES), bool),
    )
    assert bool(done[0])
    rows = rows.replace(alive=rows.alive & (np.arange(NUM_PARTICLES) < 13))
    return states.replace(
        temperature=states.temperature.at[0, APPLE].set(90.0),
        max_temperature=states.max_temperature.at[0, APPLE].set(120.0),
        wetness=states.wetness.at[0, APPLE].set(2.0),
        stain=rows,
    )


def test_table_a5_halves_inherit_every_scalar_state():
    states, _ = _cut(50.0, states=_used())
    for half in (HALF_A, HALF_B):
        assert states.temperature[0, half] == pytest.approx(90 - 0.02 * 67 / 30, abs=1e-4)  # and cools in the same step
        assert states.max_temperature[0, half] == 120.0
        assert states.wetness[0, half] == 2.0
        assert states.sliced[0, half]


def test_halves_inherit_particles_where_they_are():
    model = HOME.model()
    states, swap = _cut(50.0, states=_used())
    where = {"apple": (50, 0, 0), "half_a": swap.pos[0, 1].tolist(), "half_b": swap.pos[0, 2].tolist()}
    placed = world_positions(states.stain, HOME.view(where))
    for half, expected in ((HALF_A, (0.96, 2.01, 0.5)), (HALF_B, (1.0, 2.01, 0.5))):
        row = STAIN.row_of(model, half)
        assert int(states.stain.alive[0, row].sum()) == 13
        assert int(states.stain.placed[0, row].sum()) == NUM_PARTICLES
        # The left half has them on its skin; the right one, that lost that side, on its cut.
        assert np.allclose(placed[0, row], expected, atol=1e-5)
        assert bool(STAIN.is_dirty(model, states.stain)[0, row])


def test_halves_are_heated_in_the_step_of_the_cut_like_the_whole():
    states, _ = _cut(50.0, pos={"stove": (1, 2, 0.8)})
    assert states.temperature[0, HALF_A] == pytest.approx(23.318, abs=1e-3)


def test_parked_halves_and_a_parked_whole_are_not_updated():
    model = HOME.model()
    start = initial_states(model, 1)
    start = start.replace(temperature=start.temperature + 50.0)
    before = step(model, start, HOME.view())
    assert before.temperature[0, APPLE] < 73.0
    assert before.temperature[0, HALF_A] == 73.0
    assert np.isneginf(before.max_temperature[0, [HALF_A, HALF_B]]).all()  # no update yet
    after, _ = _cut(50.0, states=start)
    assert after.temperature[0, APPLE] == 73.0
    assert after.temperature[0, HALF_A] < 73.0


def test_a_half_that_is_cut_is_marked_and_nothing_moves():
    states, _ = _cut(50.0)
    states, swap = _cut(50.0, "half_a", states=states)
    assert states.sliced[0, HALF_A]
    assert not swap.mask.any()


def test_table_a5_sliced_can_be_set():
    model = HOME.model()
    mask = np.zeros((1, len(HOME.things)), bool)
    mask[0, APPLE] = True
    states, swap = sliced.set_sliced(model, _used(), jnp.asarray(mask), HOME.view())
    assert states.sliced[0, APPLE] and states.sliced[0, HALF_A]
    assert states.max_temperature[0, HALF_B] == 120.0
    assert swap.mask.all()
    _, swap = sliced.set_sliced(model, states, jnp.asarray(mask), HOME.view())
    assert not swap.mask.any()
