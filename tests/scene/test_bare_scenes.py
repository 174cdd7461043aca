"""Homes that ship are loaded once for all that is asked of them without robots."""

from __future__ import annotations

from ig2mj.scene.bare_scenes import bare_scene
from ig2mj.scene.library import find_model
from ig2mj.scene.paths import SHIPPED_HOMES


def test_a_home_that_ships_is_loaded_once_with_the_same_objects():
    first = bare_scene("small_home", ["steak"])
    assert bare_scene(SHIPPED_HOMES / "small_home", ("steak",)) is first and first.agents == ()
    assert bare_scene("small_home") is not first and first.additions


def test_files_that_may_change_are_read_again(tiny_home_folder):
    assert bare_scene(tiny_home_folder) is not bare_scene(tiny_home_folder)
    steak = find_model("steak").folder
    assert bare_scene("small_home", [steak]) is not bare_scene("small_home", [steak])
