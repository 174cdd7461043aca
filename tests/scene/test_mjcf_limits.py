"""A scene's MJCF that asks for more than the limits is refused before MuJoCo reads it."""

from __future__ import annotations

import struct

import pytest
from limits import run_limited
from tiny_home import write_tiny_home

from ig2mj.errors import InputError
from ig2mj.scene import load_scene
from ig2mj.scene.mjcf_limits import check_mjcf

REPLICATE = (
    '<replicate count="1000" offset="1 0 0"><replicate count="1000" offset="0 1 0"><geom size=".1"/></replicate>'
    "</replicate></worldbody>"
)
HUGE = {
    "height field": (
        "<asset>",
        '<asset><hfield name="h" nrow="30000" ncol="30000"/>',
        "<hfield>.*cells",
    ),
    "replicate in a replicate": ("</worldbody>", REPLICATE, "<geom>.*elements"),
    "texture": ("<asset>", '<asset><texture builtin="flat" type="cube" width="9000" height="9000"/>', "<texture>"),
    "user data": ("<option", '<size nuserdata="1000000000"/><option', "<size>.*cells"),
    "composite": (
        "</worldbody>",
        '<body><composite type="particle" count="900 900 900"><geom size=".1"/></composite></body></worldbody>',
        "<composite>",
    ),
    "deep": ("</worldbody>", "<body>" * 600 + "</body>" * 600 + "</worldbody>", "nested deeper than 490"),
    "not XML": ("</worldbody>", "", "no valid XML"),
}


@pytest.fixture
def home(tmp_path):
    return write_tiny_home(tmp_path / "home")


@pytest.mark.parametrize("what", HUGE)
def test_one_element_that_asks_for_everything_is_refused(home, what):
    old, new, message = HUGE[what]
    file = home / "scene.xml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    run_limited(load_scene, str(home)).check(InputError, f"scene.xml.*{message}")


def test_what_is_included_counts(home):
    (home / "more.xml").write_text(f"<mujoco><worldbody>{REPLICATE}</mujoco>")
    file = home / "scene.xml"
    file.write_text(file.read_text().replace("<asset>", '<include file="more.xml"/><asset>', 1))
    with pytest.raises(InputError, match=r"more.xml.*elements"):
        check_mjcf(file)


def test_files_that_include_one_another_end(tmp_path):
    file = tmp_path / "a.xml"
    file.write_text('<mujoco><include file="a.xml"/></mujoco>')
    with pytest.raises(InputError, match="more than 50 files"):
        check_mjcf(file)


def test_an_image_that_declares_too_many_pixels_is_refused(tmp_path):
    head = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 60_000, 60_000)
    (tmp_path / "t.png").write_bytes(head)
    file = tmp_path / "a.xml"
    file.write_text('<mujoco><asset><texture file="t.png"/></asset></mujoco>')
    with pytest.raises(InputError, match=r"a.xml.*t.png.*pixels"):
        check_mjcf(file)


def test_a_limit_is_a_variable_of_the_environment(home, monkeypatch):
    monkeypatch.setenv("IG2MJ_LIMIT_MJCF_ELEMENTS", "20")
    with pytest.raises(InputError, match="IG2MJ_LIMIT_MJCF_ELEMENTS raises it"):
        load_scene(home)
    monkeypatch.setenv("IG2MJ_LIMIT_MJCF_ELEMENTS", "2000")
    assert load_scene(home).object_names
