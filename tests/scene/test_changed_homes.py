"""Objects of a home removed and replaced when it is loaded."""

from __future__ import annotations

import json
import shutil

import mujoco
import numpy as np
import pytest
from own_objects import write_table

import ig2mj
from ig2mj import cli
from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.scene.changes import Change, changes_of, read_change
from ig2mj.scene.found_again import entries_of, requests_again
from ig2mj.tasks.added_objects import object_texts
from ig2mj.worlds.pool import load_pool, load_pool_scene


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A folder of a table of one's own, 0.5 m high."""
    return write_table(tmp_path_factory.mktemp("objects"))


def drift(scene) -> float:
    """m that the object that moves most moves in half a second."""
    data = scene.start_data()
    before = data.xpos.copy()
    mujoco.mj_step(scene.model, data, nstep=60)
    return float(np.linalg.norm(data.xpos - before, axis=1).max())


def test_a_removed_object_takes_with_it_what_stands_on_or_in_it():
    scene = ig2mj.load_scene("small_home", remove=["breakfast_table_0", "fridge_0"])
    assert set(scene.removed) == {
        *("breakfast_table_0", "plate_0", "bowl_0", "apple_0", "mug_0"),
        *("fridge_0", "milk_0", "butter_0"),
    }
    home = ig2mj.load_scene("small_home")
    halves = {"apple_0_part_0", "apple_0_part_1"}
    assert set(home.object_names) - set(scene.object_names) == {*scene.removed, *halves}
    assert drift(scene) < 0.005


def test_what_lies_in_a_bowl_does_not_bear_the_bowl():
    assert ig2mj.load_scene("small_home", remove="apple_0").removed == ("apple_0",)


@pytest.mark.slow
def test_what_lies_on_a_removed_carpet_stays_and_lies_on_the_floor():
    home, scene = ig2mj.load_scene("cedar"), ig2mj.load_scene("cedar", remove="carpet_2")
    assert scene.removed == ("carpet_2",)
    down = home.start_data().body("toy_1").xpos[2] - scene.start_data().body("toy_1").xpos[2]
    assert 0.002 < down < 0.03 and drift(scene) < 0.005


def test_all_else_starts_where_it_was():
    home, scene = (ig2mj.load_scene("small_home", remove=names) for names in ((), "mug_0"))
    before, after = home.start_data(), scene.start_data()
    for name in scene.object_names:
        body = scene.object(name).bodies[0]
        np.testing.assert_array_equal(after.body(body).xpos, before.body(body).xpos)
    assert home.digest != scene.digest


def test_a_replacement_has_the_name_the_room_and_the_place_of_the_old_one(table):
    scene = ig2mj.load_scene("small_home", replace={"coffee_table_0": table})
    entry, old = scene.object("coffee_table_0"), ig2mj.load_scene("small_home").object("coffee_table_0")
    assert entry.model == "side_table" and entry.fixed and entry.rooms == old.rooms != []
    home = ig2mj.load_scene("small_home")
    np.testing.assert_allclose(
        scene.start_data().body("coffee_table_0").xpos[2], home.start_data().body("coffee_table_0").xpos[2], atol=1e-3
    )


def test_what_stood_on_the_old_object_stands_on_the_new_one_where_there_is_room(table):
    scene = ig2mj.load_scene("small_home", replace={"breakfast_table_0": table})
    assert "plate_0" not in scene.removed and {"bowl_0", "apple_0"} <= set(scene.removed)
    data = scene.start_data()
    plate, top = data.body("plate_0").xpos, data.body("breakfast_table_0").xpos[2] + 0.5
    assert top - 0.01 < plate[2] < top + 0.05, "it was higher on the old one"
    assert drift(scene) < 0.005


def test_changes_are_values_of_objects_that_give_the_same_scene_again(table):
    scene = ig2mj.load_scene("small_home", objects=["mug"], remove="mug_0", replace={"coffee_table_0": table})
    assert scene.requested == ["remove:mug_0", f"replace:coffee_table_0={table}", "mug/mug_00"]
    assert [a.name for a in scene.additions] == ["mug_1"], "names of removed objects are not used again"
    again = ig2mj.load_scene("small_home", objects=scene.requested)
    assert again.digest == scene.digest and again.object_names == scene.object_names
    assert scene.spec().compile().nq == scene.model.nq


@pytest.mark.slow
def test_pools_know_the_changes_of_their_home(tmp_path, capsys):
    file = tmp_path / "pool.npz"
    line = ["sample", "small_home", "(on_top mug_0 coffee_table_0)", "--count", "1", "--remove", "hardback_0"]
    assert cli.call([*line, "--jobs", "1", "--out", str(file)]) == 0
    scene = load_pool_scene(file)
    assert scene.removed == ("hardback_0",)
    assert load_pool(file, scene).size == 1
    with pytest.raises(Ig2mjError, match="with other changes"):
        load_pool(file, ig2mj.load_scene("small_home"))


def test_commands_take_changes(table, capsys):
    line = ["inspect", "small_home", "--json", "--remove=mug_0", "--replace", f"coffee_table_0={table}"]
    assert cli.call(line) == 0
    found = {o["name"]: o for o in json.loads(capsys.readouterr().out)["objects"]}
    assert "mug_0" not in found and found["coffee_table_0"]["model"] == "side_table"
    assert cli.call(["inspect", "small_home", "--remove"]) == 2
    assert "--remove needs a value: --remove NAME" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"remove": "mg_0"}, "no object of small_home is named 'mg_0'; near matches: mug_0"),
        ({"remove": "walls"}, "'walls' is a part of the house"),
        ({"remove": "apple_0_part_0"}, "a part of apple_0 and cannot be taken out; take apple_0"),
        ({"remove": "breakfast_table_0", "replace": {"mug_0": "cup"}}, "what it stands on is removed"),
        ({"remove": ["mug_0", "mug_0"]}, "'mug_0' is removed or replaced twice"),
        ({"replace": {"mug_0": "nothing"}}, "no category of the object library is named 'nothing'"),
        ({"replace": {"bowl_0": "pool"}}, "the object in place of 'bowl_0' stands"),
        pytest.param({"replace": {"mug_0": "ladder"}}, "'mug_0' does not come to rest", marks=pytest.mark.slow),
        ({"objects": "replace:mug_0"}, "write remove:NAME, or replace:NAME=MODEL"),
    ],
)
def test_what_cannot_be_changed_is_refused(given, problem):
    with pytest.raises(Ig2mjError) as error:
        ig2mj.load_scene("small_home", **given)
    assert problem in str(error.value)


def test_a_change_is_told_from_an_object_to_add(tmp_path, monkeypatch):
    assert read_change("remove:mug_0") == Change("mug_0") and read_change("replace:a=b/c") == Change("a", "b/c")
    assert read_change("mug@on_top:table_0") is None
    assert changes_of("a", {"b": "c"}) == ["remove:a", "replace:b=c"]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "remove:it").mkdir()
    (tmp_path / "remove:it" / "manifest.json").touch()
    assert read_change("remove:it") is None


@pytest.mark.slow
def test_the_home_is_changed_in_environments(table):
    with pytest.raises(UnknownNameError, match="object of"):
        ig2mj.make("CookingMeat", objects=["remove:nothing_0"])


def test_files_that_were_made_with_changes_give_them_back(table):
    scene = ig2mj.load_scene("small_home", objects=["mug"], remove="mug_0")
    found = requests_again(scene.requested, entries_of(scene.additions), "a file")
    assert list(found) == scene.requested
    assert requests_again(["remove:mug_0"], [], "a file") == ("remove:mug_0",)
    assert object_texts(["remove:mug_0", f"replace:bowl_0={table}"])[0] == "remove:mug_0"


def test_a_folder_that_replaces_an_object_is_found_again_by_its_hash(table, tmp_path, monkeypatch):
    was, now = tmp_path / "was" / "table", tmp_path / "now" / "table"
    shutil.copytree(table, was)
    scene = ig2mj.load_scene("small_home", objects=["mug"], replace={"breakfast_table_0": was})
    assert [a.name for a in scene.replacements] == ["breakfast_table_0"]
    digest, wanted, entries = scene.digest, scene.requested, entries_of((*scene.replacements, *scene.additions))
    now.parent.mkdir()
    was.rename(now)
    monkeypatch.setenv("IG2MJ_OBJECTS", str(now.parent))
    found = requests_again(wanted, entries, "run.h5")
    assert list(found) == [f"replace:breakfast_table_0={now}", *wanted[1:]]
    assert ig2mj.load_scene("small_home", objects=found).digest == digest
