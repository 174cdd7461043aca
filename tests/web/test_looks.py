"""How states look in the browser, and what the panels write."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("viser")

import ig2mj
from ig2mj.geometry.poses import quat_rotate
from ig2mj.sensors.tints import TINTS
from ig2mj.web.looks import COLD, COLOURS, HOT, WET, looks_of, patches_of, upright
from ig2mj.web.shots import Shot
from ig2mj.web.tables import goal_tree, object_rows, object_table, status


@pytest.fixture
def world(tiny_home) -> ig2mj.Simulation:
    return ig2mj.Simulation(tiny_home)


def look(world, name: str, colours: str = "states"):
    return looks_of(world.state_model, world.states, 0, colours).get(world.scene.object_index(name))


def shot(world) -> Shot:
    return Shot(world.view, world.states, 0, world.time)


def test_what_is_as_at_the_start_looks_plain(world):
    assert looks_of(world.state_model, world.states, 0) == {}


def test_warmth_and_cold_colour_an_object_more_and_more(world):
    weights = []
    for degrees in (23.5, 40.0, 69.0):
        world.set_state("temperature", "apple", degrees)
        weights.append(0.0 if look(world, "apple") is None else look(world, "apple").weight)
    assert weights == sorted(weights) and weights[0] == 0 and weights[-1] > 0 and look(world, "apple").colour == HOT
    world.set_state("temperature", "apple", 5.0)
    assert look(world, "apple").colour == COLD


def test_what_a_camera_sees_goes_before_warmth(world):
    world.set_state("cooked", "apple", True)
    cooked = next(t for t in TINTS if t.predicate.name == "cooked")
    assert (look(world, "apple").weight, look(world, "apple").colour) == (cooked.weight, cooked.colour)


def test_a_few_drops_show_before_something_is_soaked(world):
    world.set_state("wetness", "sponge", 0.5)
    assert look(world, "sponge").colour == WET
    assert look(world, "sponge", "wetness") is not None and look(world, "sponge", "plain") is None


@pytest.mark.parametrize("colours", COLOURS)
def test_every_choice_of_colours_works_with_numbers_that_are_lost(world, colours):
    lost = np.full_like(np.asarray(world.states.temperature), np.nan)
    looks = looks_of(world.state_model, dataclasses.replace(world.states, temperature=lost), 0, colours)
    assert all(np.isfinite([look.weight, look.brightness, *look.colour]).all() for look in looks.values())
    if colours == "temperature":  # all grey: neither hot nor cold
        assert len({look.colour for look in looks.values()}) == 1


def test_dust_stands_on_the_surface_of_its_body(world):
    world.set_state("dusty", "table", True)
    found = patches_of(world.state_model, world.states, 0)
    assert {kind for kind, _ in found} == {"dust"} and sum(len(p.pos) for p in found.values()) == 20


def test_rotations_turn_the_z_axis_to_the_normal():
    normals = np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0], [0.6, 0, 0.8]], np.float32)
    z = np.tile(np.array([0, 0, 1], np.float32), (5, 1))
    np.testing.assert_allclose(np.asarray(quat_rotate(upright(normals).astype(np.float32), z)), normals, atol=1e-5)


def test_the_table_has_states_first_and_long_ones_last(world):
    rows = object_rows(world.state_model, shot(world), world.scene.object_index("apple"))
    names = [name for name, _ in rows]
    assert dict(rows)["temperature"] == "23 C" and dict(rows)["cooked"] == "no"
    assert names.index("temperature") < names.index("cooked") < names.index("pose")


def test_names_and_messages_are_escaped(world):
    assert "<script>" not in status([("<script>", "<script>")], "<script>alert(1)</script>")
    assert "<b>apple</b>" in object_table(world.state_model, shot(world), world.scene.object_index("apple"))


def test_the_goal_is_written_with_marks_and_reasons(world):
    text = goal_tree(world.compiled("(and (cooked apple) (not (toggled_on stove)))"), shot(world))
    assert "1 of 2 literals" in text and "&#10003;" in text and "&#10007;" in text and "cooks at 70.0 C" in text
