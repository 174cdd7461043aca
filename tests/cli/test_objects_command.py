"""`ig2mj objects`, and `--object` of the commands that load a home."""

import importlib
import json
import typing

import pytest
from own_objects import CUP

from ig2mj import cli
from ig2mj.cli.common.hand import with_hand
from ig2mj.cli.common.objects import AddedObjects, load_home
from ig2mj.cli.objects import _description
from ig2mj.cli.web import _home
from ig2mj.scene.library import find_model

pytestmark = pytest.mark.usefixtures("own_configuration")

COMMANDS = (
    *("view", "web", "inspect", "states", "predicates", "calibrate", "warm_up", "sample", "sample_task"),
    *("play", "rollout", "train", "evaluate", "vr", "plan", "solve"),
)


def call(capsys, *words):
    status = cli.call([str(word) for word in words])
    found = capsys.readouterr()
    return status, found.out, found.err


def test_a_library_is_added_listed_and_removed(capsys, cup):
    status, out, _ = call(capsys, "objects", "add", cup.parent)
    assert status == 0 and "1 object (mug/cup)" in out and "--object mug/cup@on_top:" in out
    status, out, _ = call(capsys, "objects", "list", "--own", "--json")
    (found,) = json.loads(out)
    assert found["name"] == "mug/cup" and found["own"] and not found["fixed"] and found["bottom"] == 0.04
    status, out, _ = call(capsys, "objects", "list", "stainable", "--own")
    assert status == 0 and "mug/cup" in out
    assert call(capsys, "objects", "list", "nothing_like_it")[0] == 1
    assert call(capsys, "objects", "remove", cup.parent)[0] == 0
    assert json.loads(call(capsys, "objects", "list", "--own", "--json")[1]) == []


def test_a_library_whose_names_clash_is_not_kept(capsys, cup, tmp_path):
    import shutil

    for name in ("one", "two"):
        shutil.copytree(cup, tmp_path / "library" / name)
    status, _, err = call(capsys, "objects", "add", tmp_path / "library")
    assert status == 2 and "is 'mug/cup', as is" in err and err.count("\n") == 1
    assert call(capsys, "objects", "list", "--own")[1].startswith("no objects")


def test_an_object_is_shown_with_its_abilities(capsys, cup):
    status, out, _ = call(capsys, "objects", "show", cup, "--json")
    found = json.loads(out)
    assert status == 0 and found["category"] == "mug" and found["name"] == str(cup)
    assert found["abilities"]["stainable"] == {"stained_threshold": 0.5}


def test_only_an_object_that_can_move_is_shown_with_a_predicate_as_its_place(capsys):
    for name, place in (("mug", "on_top:OBJECT"), ("shelf/shelf_14", "X,Y,Z,YAW")):
        assert _description(find_model(name))[-1].endswith(f"@{place}")


@pytest.mark.parametrize("expected", ["mgu", "obj/nothing", "mug/mug_99"])
def test_an_object_that_does_not_exist_is_one_line_with_both_readings(capsys, expected):
    status, _, err = call(capsys, "objects", "show", expected)
    assert status == 2 and err.count("\n") == 1 and "object library" in err and "manifest.json" in err


def test_every_command_that_loads_a_home_takes_objects():
    for name in COMMANDS:
        function = importlib.import_module(f"ig2mj.cli.{name}").run
        hints = typing.get_type_hints(function, include_extras=True)
        assert "object" in hints, name
        assert name == "states" or hints["object"] == AddedObjects, name
    from ig2mj.cli.demos import collect

    assert typing.get_type_hints(collect, include_extras=True)["object"] == AddedObjects


def test_objects_are_given_several_times_and_one_without_a_place_is_reported(capsys, tiny_home_folder, cup):
    words = ["inspect", tiny_home_folder, "--object", cup, "--object", f"{cup}@0,0,1,0", "--show", "objects", "--json"]
    status, out, err = call(capsys, *words)
    names = [o["name"] for o in json.loads(out)["objects"]]
    assert status == 0 and names[-2:] == ["cup_0", "cup_1"]
    assert err.count("note: ") == 1 and "cup_0 stands outside the house" in err and "@on_top:" in err


def test_states_still_takes_names_of_the_homes_objects_with_a_remark(capsys, tiny_home_folder, cup):
    from ig2mj.cli.states import _added

    assert _added(tiny_home_folder, ["can", str(cup), "box"]) == ([str(cup)], ["can", "box"])
    assert "'--object can' is now '--only can'" in capsys.readouterr().err


def test_old_names_take_several_values_after_one_option():
    from ig2mj.cli.common.deprecated import with_new_names
    from ig2mj.cli.sample import run

    words = with_new_names(run, "ig2mj sample", ["birch", "--add", "apple", "plate", "--count", "2"])
    assert words == ["birch", "--object", "apple", "--object", "plate", "--count", "2"]


def test_what_goes_with_a_removed_object_is_said(tiny_home_folder, capsys):
    scene = load_home(tiny_home_folder, ("remove:table",))
    gone = [name for name in scene.removed if name != "table"]
    assert gone
    assert capsys.readouterr().err == f"note: {', '.join(gone)}: removed with what they stood on or in\n"


def test_a_hand_and_states_that_are_set_come_into_the_changed_home(tiny_home_folder):
    scene = load_home(tiny_home_folder, ("remove:table",))
    assert with_hand(scene, tiny_home_folder)[0].removed == scene.removed
    home = _home(str(tiny_home_folder), None, ("open=cabinet",), None, 1, "native", ("remove:table",))
    assert "table" not in [o.name for o in home.scene.manifest.objects]


def test_an_object_says_which_part_of_its_category_it_has_joined(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("ig2mj.cli.objects._write_image", lambda model, file: None)
    (tmp_path / "beaker.urdf").write_text(CUP)
    convert = ("convert", "object", "--urdf", tmp_path / "beaker.urdf", "--category", "mug", "--no-report")
    into = ("--out", tmp_path / "mine" / "beaker", "--split", "held_out")
    assert call(capsys, *convert, "--fixed", *into)[2].startswith("error: --split held_out: models of furniture")
    assert "'mug/mug_00' ships" in call(capsys, *convert, "--model", "mug_00", *into)[2]
    assert not (tmp_path / "mine").exists()
    assert call(capsys, *convert, *into)[0] == 0
    assert "  split      held_out\n" in call(capsys, "objects", "show", tmp_path / "mine" / "beaker")[1]
    assert call(capsys, "objects", "add", tmp_path / "mine")[0] == 0
    (found,) = json.loads(call(capsys, "objects", "list", "--own", "--json")[1])
    assert found["name"] == "mug/beaker" and found["split"] == "held_out"


def test_a_mesh_that_is_given_as_a_urdf_is_answered_with_what_to_write(capsys, tmp_path):
    (tmp_path / "steak.obj").write_text("v 0 0 0\n")
    status, _, err = call(
        capsys, "convert", "object", "--urdf", tmp_path / "steak.obj", "--category", "steak", "--out", tmp_path / "out"
    )
    assert status == 2 and 'is a mesh, not a URDF (write a URDF that names it: <mesh filename="steak.obj"/>' in err
