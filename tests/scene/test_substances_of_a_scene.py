"""Substances of a scene: named when it is loaded, and kept in what is made of it."""

import pytest

import ig2mj
from ig2mj.errors import Ig2mjError, UnknownNameError


def test_a_scene_has_no_substances_unless_asked(tiny_home):
    assert tiny_home.substances == ()


def test_substances_are_part_of_what_a_scene_is(tiny_home_folder, tiny_home):
    by_name = ig2mj.load_scene(tiny_home_folder, substances=["water", "salt"])
    by_text = ig2mj.load_scene(tiny_home_folder, objects=by_name.requested)
    assert by_name.substances == by_text.substances == ("water", "salt")
    assert by_name.requested == ["substances:water,salt"]
    assert by_name.digest == by_text.digest != tiny_home.digest


def test_unknown_and_too_many_substances_are_refused(tiny_home_folder):
    with pytest.raises(UnknownNameError, match="no substance is named 'watr'"):
        ig2mj.load_scene(tiny_home_folder, substances="watr")
    many = [f"diced__food{chr(97 + n)}" for n in range(25)]
    with pytest.raises(Ig2mjError, match="at most 24"):
        ig2mj.load_scene(tiny_home_folder, substances=many)
