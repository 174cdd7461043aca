"""What a scene's files name lies in its folder, whatever way they say it."""

from __future__ import annotations

import json
import shutil

import pytest
from limits import run_limited

from ig2mj.errors import InputError
from ig2mj.files.inside import OutsideError, inside
from ig2mj.scene.mjcf_files import read_mjcf
from ig2mj.scene.scene import load_scene

ASSETS = '<asset><mesh name="a" file="a.obj"/></asset>'
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"


@pytest.fixture
def home(tiny_home_folder, tmp_path):
    """A copy of the small home, next to a file that is none of its business."""
    (tmp_path / "secret.obj").write_text(OBJ)
    (tmp_path / "secret.xml").write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    return shutil.copytree(tiny_home_folder, tmp_path / "home")


def with_elements(home, text: str) -> None:
    file = home / "scene.xml"
    file.write_text(file.read_text().replace("</mujoco>", f"{text}</mujoco>"))


@pytest.mark.parametrize(
    "name", ["../secret.npz", "/etc/hostname", "a/../../secret.npz", "link/secret.npz", "C:\\a.npz"]
)
def test_room_maps_outside_are_not_read(home, name):
    (home / "link").symlink_to(home.parent)
    manifest = json.loads((home / "manifest.json").read_text())
    manifest["rooms"]["file"] = name
    (home / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(OutsideError, match=r"manifest\.json: rooms\.file: "):
        load_scene(home)


@pytest.mark.parametrize(
    "text",
    [
        '<include file="../secret.xml"/>',
        '<include file="/etc/hostname"/>',
        '<include file="linked.xml"/>',
        '<include file="inner.xml"/>',
        '<asset><mesh name="a" file="../secret.obj"/></asset>',
        '<asset><mesh name="a" file="linked.obj"/></asset>',
        '<asset><texture name="a" type="cube" fileright="../secret.png"/></asset>',
        '<asset><hfield name="a" size="1 1 1 1" file="../secret.png"/></asset>',
        '<asset><model name="a" file="../secret.xml"/></asset>',
        '<compiler meshdir="folder"/>' + ASSETS,
        f'<compiler meshdir=".."/>{ASSETS}',
        f'<compiler assetdir="/tmp"/>{ASSETS}',
        f'<compiler meshdir="../meshes/.."/>{ASSETS}',
        '<compiler meshdir="../meshes"/><asset><mesh name="a" file="../secret.obj"/></asset>',
        '<deformable><skin name="a" file="../secret.skn"/></deformable>',
        '<worldbody><flexcomp name="a" type="mesh" file="../secret.obj"/></worldbody>',
    ],
)
def test_files_outside_are_not_read(home, text):
    (home / "linked.xml").symlink_to(home.parent / "secret.xml")
    (home / "linked.obj").symlink_to(home.parent / "secret.obj")
    (home / "folder").symlink_to(home.parent)
    (home / "inner.xml").write_text('<mujoco><include file="../secret.xml"/></mujoco>')
    with_elements(home, text)
    with pytest.raises(OutsideError, match=r"\.xml: (include|file|compiler.*): .* (lies outside|is absolute)"):
        load_scene(home)


def test_files_inside_are_read(home):
    (home / "inner").mkdir()
    (home / "inner" / "more.xml").write_text('<mujoco><include file="inner/last.xml"/></mujoco>')
    (home / "inner" / "last.xml").write_text(f"<mujoco>{ASSETS}</mujoco>")
    (home / "a.obj").write_text(OBJ)
    before = load_scene(home).model.nmesh
    with_elements(home, '<include file="inner/more.xml"/>')
    assert load_scene(home).model.nmesh == before + 1


@pytest.mark.parametrize("folder", ["meshes", "../meshes"])
def test_meshes_that_homes_share_lie_in_a_folder_of_that_name(home, folder):
    (home / folder).mkdir()
    (home / folder / "a.obj").write_text(OBJ)
    with_elements(home, f'<compiler meshdir="{folder}"/>{ASSETS}')
    read_mjcf(home / "scene.xml")


@pytest.mark.parametrize(
    "text, match",
    [
        ('<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>', "document type"),
        ("<mujoco>" + "<body>" * 600 + "</body>" * 600 + "</mujoco>", "nested deeper than 490"),
        ("<mujoco>", "no valid XML: no element found"),
        ("", "no valid XML"),
        ("<mujoco model='\ud800'/>", "UTF-8"),
        (
            "<mujoco>" + "".join(f'<compiler meshdir="a{k}"/><mesh file="a{k}"/>' for k in range(2000)) + "</mujoco>",
            "2000",
        ),
    ],
)
def test_what_is_no_mjcf_of_a_scene_is_refused(tmp_path, text, match):
    (tmp_path / "scene.xml").write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(InputError, match=match):
        read_mjcf(tmp_path / "scene.xml")


def test_a_scene_that_is_too_large_is_refused_unread(tmp_path):
    (tmp_path / "scene.xml").write_text("<mujoco>" + "<a/>" * 5_000_000 + "</mujoco>")
    run_limited(read_mjcf, tmp_path / "scene.xml").check(InputError, "IG2MJ_LIMIT_XML_BYTES raises it")


@pytest.mark.slow
def test_what_is_just_not_too_large_is_counted_within_the_limits(tmp_path):
    (tmp_path / "scene.xml").write_text("<mujoco>" + "<a/>" * 4_000_000 + "</mujoco>")
    run_limited(read_mjcf, tmp_path / "scene.xml").check(InputError, "IG2MJ_LIMIT_MJCF_ELEMENTS raises it")


def test_names_that_are_no_names_are_refused(tmp_path):
    for name in ("", " ", "a\0b", "a\nb"):
        with pytest.raises(InputError, match="is not a file name"):
            inside(name, tmp_path, "a.json", "a")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    with pytest.raises(InputError):
        inside("circle/a", tmp_path, "a.json", "a")
    assert inside("a/../b", tmp_path, "a.json", "a") == tmp_path.resolve() / "b"
