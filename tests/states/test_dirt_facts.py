"""Dust, stains and cleaning: iGibson's rules with worked examples, paper tables A.1 to A.5."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, step

from ig2mj.states import initial_states, particles
from ig2mj.states.definitions import cleaning
from ig2mj.states.definitions.dust import DUST
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.particles import NUM_PARTICLES

DIRT = {"dustyable": {}, "stainable": {}}
TABLE = Item("table", (((0, 0, 0), (1, 0.5, 0.01)),), DIRT)
BROOM = Item(
    "broom",
    (((0, 0, 0.5), (0.02, 0.02, 0.5)),),
    {"cleaningTool": {}},
    links={"cleaning_tool_area": ((0, 0, 0.0), (0.2, 0.1, 0.02))},
    pos=(0, 0, 9),
)
RAG = Item("rag", (((0, 0, 0), (0.1, 0.1, 0.01)),), {"cleaningTool": {}, "soakable": {}}, pos=(0, 0, 8))
VACUUM = Item("vacuum", (((0, 0, 0), (0.1, 0.1, 0.1)),), {"cleaningTool": {}, "toggleable": {}}, pos=(0, 0, 7))
ROOM = HandWorld(TABLE, BROOM, RAG, VACUUM)

# Twenty points along the table's length, 10 cm apart, on its upper face.
PLACES = np.stack([np.linspace(-0.95, 0.95, NUM_PARTICLES), np.zeros(NUM_PARTICLES), np.full(NUM_PARTICLES, 0.01)], -1)
UP = np.tile([0.0, 0.0, 1.0], (NUM_PARTICLES, 1))


_set_dusty = jax.jit(DUST.place, static_argnums=(0, 2))
_set_stained = jax.jit(STAIN.place, static_argnums=(0, 2))


def _points(valid: int = NUM_PARTICLES):
    """Arguments of set_dusty and set_stained: body, pos, normal, valid."""
    return (
        jnp.ones((1, NUM_PARTICLES), jnp.int32),
        jnp.asarray(PLACES, jnp.float32)[None],
        jnp.asarray(UP, jnp.float32)[None],
        jnp.asarray(np.arange(NUM_PARTICLES) < valid)[None],
    )


@functools.cache
def _dirty():
    """A dusty and stained table in a clean room."""
    model = ROOM.model()
    states = initial_states(model, 1)
    dusty, done = _set_dusty(model, states.dust, 0, *_points())
    stained, _ = _set_stained(model, states.stain, 0, *_points())
    assert bool(done.all())
    return states.replace(dust=dusty, stain=stained)


def _counts(states) -> tuple[int, int]:
    return int(states.dust.alive.sum()), int(states.stain.alive.sum())


@pytest.mark.parametrize(("alive", "dirty"), [(11, True), (10, False)])
def test_twenty_placed_are_dirty_at_eleven_and_clean_at_ten(alive, dirty):
    model = ROOM.model()
    rows = _dirty().dust
    rows = rows.replace(alive=rows.alive & (np.arange(NUM_PARTICLES) < alive))
    assert bool(DUST.is_dirty(model, rows)[0, 0]) == dirty
    assert bool(STAIN.is_dirty(model, rows)[0, 0]) == dirty


@pytest.mark.parametrize(("alive", "dirty"), [(16, True), (15, False)])
def test_floors_are_dirty_at_sixteen_and_clean_at_fifteen_in_igibsons_code(alive, dirty):
    home = HandWorld(Item("floor", abilities=DIRT, category="floors", floor=True))
    model = home.model(compat="igibson")
    rows, _ = _set_dusty(model, initial_states(model, 1).dust, 0, *_points())
    rows = rows.replace(alive=rows.alive & (np.arange(NUM_PARTICLES) < alive))
    assert bool(DUST.is_dirty(model, rows)[0, 0]) == dirty
    assert bool(DUST.is_dirty(home.model(), rows)[0, 0])  # the paper's threshold is one half for all


def test_table_a1_the_threshold_is_configurable_per_model():
    home = HandWorld(Item("shelf", abilities={"dustyable": {"dusty_threshold": 0.1}}))
    model = home.model()
    rows, _ = _set_dusty(model, initial_states(model, 1).dust, 0, *_points())
    rows = rows.replace(alive=rows.alive & (np.arange(NUM_PARTICLES) < 3))
    assert bool(DUST.is_dirty(model, rows)[0, 0])


def test_table_a4_levels_are_fractions_of_the_placed_particles():
    rows = _dirty().dust
    assert particles.level(rows)[0].tolist() == [1.0]
    rows = rows.replace(alive=rows.alive & (np.arange(NUM_PARTICLES) < 5))
    assert particles.level(rows)[0, 0] == 0.25
    assert particles.level(particles.no_particles(1, 1))[0, 0] == 0.0


def _swept(pos, newtons: float = 1.0, **changes):
    """A view in which the broom touches the table, through its head unless `newtons` is 0."""
    return ROOM.view(pos, touching=[("broom", "table")], force={("broom", "table"): newtons}, **changes)


def test_table_a4_any_cleaning_tool_takes_dust_in_its_region():
    # The broom's head covers x in [0.3, 0.7]: the points at 0.35, 0.45, 0.55, 0.65.
    states = step(ROOM.model(), _dirty(), _swept({"broom": (0.5, 0, 0.0)}))
    assert _counts(states) == (16, 20)
    gone = np.flatnonzero(~np.asarray(states.dust.alive[0, 0]))
    assert np.allclose(PLACES[gone, 0], [0.35, 0.45, 0.55, 0.65])


def test_without_an_annotated_area_the_whole_tool_cleans():
    states = step(ROOM.model(), _dirty(), ROOM.view({"rag": (0.0, 0, 0.02)}, touching=[("rag", "table")]))
    assert _counts(states) == (18, 20)


def test_only_contacts_through_the_annotated_area_clean():
    handle = _swept({"broom": (0.5, 0, 0.0)}, newtons=0.0)
    assert _counts(step(ROOM.model(), _dirty(), handle)) == (20, 20)
    asleep = handle.replace(awake=handle.awake & False)  # contacts of what sleeps are remembered, without their links
    assert _counts(step(ROOM.model(), _dirty(), asleep)) == (16, 20)


@pytest.mark.parametrize(("height", "left"), [(0.0229, 18), (0.0231, 20)])
def test_the_region_of_a_whole_tool_has_bullets_margin(height, left):
    """3 mm for one hull. Without it a rag that rests 2 mm off its plate would reach nothing on it."""
    states = step(ROOM.model(), _dirty(), ROOM.view({"rag": (0.0, 0, height)}, touching=[("rag", "table")]))
    assert _counts(states)[0] == left


def test_the_box_of_an_annotated_area_has_no_margin():
    """The area is a box shape in Bullet: 1 mm above the points it reaches none of them, and at their height all."""
    reach = PLACES[0, 2] + 0.02
    apart = step(ROOM.model(), _dirty(), _swept({"broom": (0.5, 0, reach + 0.001)}))
    level = step(ROOM.model(), _dirty(), _swept({"broom": (0.5, 0, reach - 0.0001)}))
    assert (_counts(apart)[0], _counts(level)[0]) == (20, 16)


@pytest.mark.parametrize(("tool", "half", "margin"), [("rag", (0.1, 0.1, 0.01), 0.003), ("broom", (0.2, 0.1, 0.02), 0)])
def test_a_region_turns_with_the_tool_and_so_does_its_margin(tool, half, margin):
    turn = (np.cos(0.4), np.sin(0.4), 0.0, 0.0)  # 0.8 rad about x
    low, high = cleaning.regions(ROOM.model(), ROOM.view({tool: (0, 0, 0)}, quat={tool: turn}))
    number = {"broom": 0, "rag": 1}[tool]
    half = np.array(half) + margin
    c, s = np.cos(0.8), np.sin(0.8)
    reach = [half[0], c * half[1] + s * half[2], s * half[1] + c * half[2]]
    np.testing.assert_allclose([-np.asarray(low[0, number]), high[0, number]], [reach, reach], atol=1e-6)


def test_the_tool_must_touch_what_it_cleans():
    states = step(ROOM.model(), _dirty(), ROOM.view({"rag": (0.0, 0, 0.02)}))
    assert _counts(states) == (20, 20)


def test_table_a4_stains_go_only_with_a_soaked_tool():
    view = ROOM.view({"rag": (0.0, 0, 0.02)}, touching=[("rag", "table")])
    wet = _dirty()
    wet = wet.replace(wetness=wet.wetness.at[0, 2].set(1.0))
    assert _counts(step(ROOM.model(), wet, view)) == (18, 18)
    broom = _swept({"broom": (0.5, 0, 0.0)})
    assert _counts(step(ROOM.model(), wet, broom))[1] == 20  # a broom cannot be soaked


def test_a_vacuum_cleaner_cleans_only_while_it_is_on():
    view = ROOM.view({"vacuum": (0.0, 0, 0.1)}, touching=[("vacuum", "table")])
    off = _dirty()
    on = off.replace(toggled_on=off.toggled_on.at[0, 3].set(True))
    assert _counts(step(ROOM.model(), off, view))[0] == 20
    assert _counts(step(ROOM.model(), on, view))[0] == 18


def test_particles_move_with_the_body_they_stick_to():
    turned = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))  # a quarter about z
    view = ROOM.view({"table": (1, 2, 3)}, quat={"table": turned})
    where = np.asarray(particles.world_positions(_dirty().dust, view))[0, 0]
    assert np.allclose(where, np.stack([1 + 0 * PLACES[:, 0], 2 + PLACES[:, 0], 3 + PLACES[:, 2]], -1), atol=1e-5)
    assert np.allclose(particles.world_normals(_dirty().dust, view)[0, 0], UP, atol=1e-6)


def test_a_tool_cleans_where_the_moved_table_is():
    view = ROOM.view({"table": (5, 0, 0), "rag": (5, 0, 0.02)}, touching=[("rag", "table")])
    assert _counts(step(ROOM.model(), _dirty(), view))[0] == 18
    view = ROOM.view({"table": (5, 0, 0), "rag": (0, 0, 0.02)}, touching=[("rag", "table")])
    assert _counts(step(ROOM.model(), _dirty(), view))[0] == 20


def test_dirtying_what_is_dirty_replaces_the_particles():
    model = ROOM.model()
    half = _dirty().dust
    half = half.replace(alive=half.alive & (np.arange(NUM_PARTICLES) < 5))
    again, done = _set_dusty(model, half, 0, *_points())
    assert bool(done[0]) and int(again.alive.sum()) == 20


def test_table_a5_dusty_false_removes_all_particles():
    clean = particles.remove(_dirty().dust, 0)
    assert not clean.alive.any()
    assert not bool(DUST.is_dirty(ROOM.model(), clean)[0, 0])
    assert not bool(STAIN.is_dirty(ROOM.model(), particles.remove(_dirty().stain, 0))[0, 0])


@pytest.mark.parametrize(
    ("compat", "valid", "works"),
    [("paper", 20, True), ("paper", 19, False), ("igibson", 5, True), ("igibson", 4, False)],
)
def test_dirt_needs_all_particles_placed_or_five_in_igibsons_code(compat, valid, works):
    model = ROOM.model(compat=compat)
    rows, done = _set_dusty(model, initial_states(model, 1).dust, 0, *_points(valid))
    assert bool(done[0]) == works
    assert int(rows.alive.sum()) == (valid if works else 0)
    assert bool(DUST.is_dirty(model, rows)[0, 0]) == works


def test_the_number_placed_is_part_of_the_state():
    # Eight of twenty left is clean; iGibson reloads it as eight of eight, dirty.
    rows = _dirty().dust
    rows = rows.replace(alive=rows.alive & (np.arange(NUM_PARTICLES) < 8))
    assert int(rows.placed.sum()) == 20
    assert not bool(DUST.is_dirty(ROOM.model(), rows)[0, 0])


def test_setting_dirt_in_some_worlds_leaves_the_others():
    model = ROOM.model()
    rows, _ = _set_stained(model, initial_states(model, 3).stain, 0, *_points(), worlds=jnp.array([True, False, True]))
    assert rows.alive.sum(axis=(1, 2)).tolist() == [20, 0, 20]


def test_stain_sizes_follow_the_median_edge():
    sizes = particles.stain_sizes(np.array([[0.1, 0.5, 3.0], [0.01, 0.01, 0.01], [5.0, 5.0, 5.0]]))
    assert sizes[0, 0] == pytest.approx(0.02) and sizes[0, -1] == pytest.approx(0.05)
    assert sizes[1, 0] == pytest.approx(0.01) and sizes[1, -1] == pytest.approx(0.02)
    assert sizes[2, -1] == pytest.approx(0.1)
    assert np.all(np.diff(sizes[0]) > 0)


def test_a_nan_table_is_not_cleaned():
    view = ROOM.view({"table": (np.nan, 0, 0), "rag": (0.0, 0, 0.02)}, touching=[("rag", "table")])
    assert _counts(step(ROOM.model(), _dirty(), view))[0] == 20


def test_objects_without_the_ability_have_no_rows():
    model = ROOM.model()
    assert DUST.row_of(model, ROOM.index["table"]) == 0
    assert DUST.row_of(model, ROOM.index["rag"]) is None
