"""`ig2mj inspect`: the tables and the JSON of a scene."""

from __future__ import annotations

import json

import pytest

from ig2mj import cli
from ig2mj.scene import paths
from ig2mj.scene.manifest import load_manifest


def inspect_json(capsys, *argv: str) -> dict:
    assert cli.call(["inspect", *argv, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("file", ["", "scene.xml", "manifest.json"])
def test_a_scene_is_named_by_folder_or_by_either_file(tiny_home_folder, capsys, file):
    manifest = load_manifest(tiny_home_folder)
    out = inspect_json(capsys, str(tiny_home_folder / file))
    assert [o["name"] for o in out["objects"]] == [o.name for o in manifest.objects]


def test_json_holds_objects_joints_abilities_and_rooms(tiny_home_folder, capsys):
    manifest = load_manifest(tiny_home_folder)
    out = inspect_json(capsys, str(tiny_home_folder))
    assert {j["name"] for j in out["joints"]} == {j.name for o in manifest.objects for j in o.joints}
    openable = {p.joint for o in manifest.objects for p in o.openable}
    assert {j["name"] for j in out["joints"] if j["openable"]} == openable
    apple = next(o for o in manifest.objects if o.name == "apple")
    assert out["abilities"]["sliceable"]["apple"] == apple.abilities["sliceable"]
    assert [r["name"] for r in out["rooms"]] == list(manifest.rooms.instances)


def test_show_leaves_the_other_tables_out(tiny_home_folder, capsys):
    assert set(inspect_json(capsys, str(tiny_home_folder), "--show", "joints")) == {"name", "joints"}


def test_objects_can_be_picked_by_category_and_room(tiny_home_folder, capsys):
    manifest = load_manifest(tiny_home_folder)
    out = inspect_json(capsys, str(tiny_home_folder), "--category", "apple")
    assert [o["name"] for o in out["objects"]] == ["apple"]
    room = next(iter(manifest.rooms.instances))
    out = inspect_json(capsys, str(tiny_home_folder), "--room", room)
    assert [o["name"] for o in out["objects"]] == [o.name for o in manifest.objects if room in o.rooms]


def test_the_tables_name_every_object_joint_and_ability(tiny_home_folder, capsys):
    manifest = load_manifest(tiny_home_folder)
    assert cli.call(["inspect", str(tiny_home_folder)]) == 0
    out = capsys.readouterr().out
    for o in manifest.objects:
        assert o.name in out
        assert all(j.name in out for j in o.joints)
        assert all(a in out for a in o.abilities)
        assert all(f"[{kind}]" in out for kind in o.links)


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [("--category", "aple", "near matches: apple"), ("--room", "kitchen_9", "near matches: kitchen_0")],
)
def test_unknown_names_suggest_near_ones(tiny_home_folder, capsys, option, value, says):
    assert cli.call(["inspect", str(tiny_home_folder), option, value]) == 2
    assert says in capsys.readouterr().err


def test_a_folder_without_a_manifest_is_status_2(tmp_path, capsys):
    assert cli.call(["inspect", str(tmp_path)]) == 2
    assert "manifest.json" in capsys.readouterr().err


def test_a_home_that_comes_with_ig2mj_goes_by_its_bare_name(tiny_home_folder, capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(paths, "SHIPPED_HOMES", tiny_home_folder.parent)
    monkeypatch.chdir(tmp_path)
    assert inspect_json(capsys, tiny_home_folder.name)["name"] == load_manifest(tiny_home_folder).name


def test_a_home_that_does_not_exist_suggests_near_names(tiny_home_folder, capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(paths, "SHIPPED_HOMES", tiny_home_folder.parent)
    monkeypatch.chdir(tmp_path)
    assert cli.call(["inspect", tiny_home_folder.name + "y"]) == 2
    error = capsys.readouterr().err
    assert "there is no such scene" in error and f"near matches: {tiny_home_folder.name}" in error
    assert cli.call(["inspect", "zzzzzz"]) == 2
    assert f"or one of {tiny_home_folder.name}" in capsys.readouterr().err


@pytest.mark.parametrize("home", ["small_home", "birch"])
def test_inspect_and_homes_list_count_the_same_objects(home, capsys):
    """Neither counts parked halves or the building (`ObjectEntry.in_household`)."""
    assert cli.call(["homes", "list", "--json"]) == 0
    listed = next(h for h in json.loads(capsys.readouterr().out) if h["home"] == home)
    assert cli.call(["inspect", home, "--show", "rooms"]) == 0
    title = capsys.readouterr().out.splitlines()[0]
    assert title.startswith(f"{home}: {listed['objects']} objects ({listed['movable']} movable,")
    assert "of the building" in title
