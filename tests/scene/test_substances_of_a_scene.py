"""Substances of a scene: named when it is loaded, and kept in what is made of it."""

import numpy as np
import pytest

import ig2mj
from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.worlds import Rules


def test_a_scene_has_no_substances_unless_asked(tiny_home):
    assert tiny_home.substances == ()


def test_substances_are_part_of_what_a_scene_is(tiny_home_folder, tiny_home):
    by_name = ig2mj.load_scene(tiny_home_folder, substances=["water", "salt"])
    by_text = ig2mj.load_scene(tiny_home_folder, objects=by_name.requested)
    assert by_name.substances == by_text.substances == ("water", "salt")
    assert by_name.requested == ["substances:water,salt"]
    assert by_name.digest == by_text.digest != tiny_home.digest


def test_containers_are_filled_at_the_start():
    scene = ig2mj.load_scene("small_home", substances=["water", "milk@mug_0", "salt"])
    assert scene.substances == ("water", "milk", "salt")
    assert scene.requested == ["substances:water,milk@mug_0,salt"]
    again = ig2mj.load_scene("small_home", objects=scene.requested)
    empty = ig2mj.load_scene("small_home", substances=["water", "milk", "salt"])
    assert scene.digest == again.digest != empty.digest
    (mug,) = [o for o in scene.manifest.objects if o.name == "mug_0"]
    assert mug.inside is not None
    assert np.asarray(Rules.of_scene(scene).initial.volume).sum() == pytest.approx(0.6 * mug.inside.litres, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("milk@", "a substance and the container"),
        ("milk@nothing_0", "no object is named 'nothing_0'"),
        ("milk@sofa_0", "is no container"),
        ("mud@mug_0", "does not fill containers"),
    ],
)
def test_what_cannot_be_filled_at_the_start_is_refused(text, said):
    with pytest.raises(Ig2mjError, match=said):
        ig2mj.load_scene("small_home", substances=text)


def test_unknown_and_too_many_substances_are_refused(tiny_home_folder):
    with pytest.raises(UnknownNameError, match="no substance is named 'watr'"):
        ig2mj.load_scene(tiny_home_folder, substances="watr")
    many = [f"diced__food{chr(97 + n)}" for n in range(25)]
    with pytest.raises(Ig2mjError, match="at most 24"):
        ig2mj.load_scene(tiny_home_folder, substances=many)
