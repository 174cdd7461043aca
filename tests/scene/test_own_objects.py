"""Objects of one's own that are added to a home: from a folder, and from a library of one's own."""

import shutil

import numpy as np
import pytest
from own_objects import HALF

import ig2mj
from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
from ig2mj.scene import own_libraries
from ig2mj.scene.found_again import entries_of, find_again, requests_again
from ig2mj.scene.library import find_model, own_library
from ig2mj.scene.object_requests import read_request

pytestmark = pytest.mark.usefixtures("own_configuration")


@pytest.fixture
def shelf_of_cups(cup, tmp_path):
    """A library with the cup in `kitchen/cup`."""
    shutil.copytree(cup, tmp_path / "shelf" / "kitchen" / "cup")
    return tmp_path / "shelf"


def test_an_object_from_a_folder_is_named_after_the_folder_and_one_of_the_library_after_its_category(
    tiny_home_folder, cup
):
    scene = ig2mj.load_scene(tiny_home_folder, objects=[cup, "mug", str(cup)])
    assert [a.name for a in scene.additions] == ["cup_0", "mug_0", "cup_1"]
    assert scene.object("cup_0").category == "mug"
    assert scene.object("cup_0").abilities == find_model(str(cup)).entry.abilities != {}
    assert {str(scene.folder)} != {scene.additions[0].folder} == {str(cup)}


def test_a_folder_with_odd_letters_gives_names_that_expressions_can_hold(tiny_home_folder, cup, tmp_path):
    odd = tmp_path / "my (red) cup@home"
    shutil.copytree(cup, odd)
    scene = ig2mj.load_scene(tiny_home_folder, objects=[odd, f"{odd}@1,1,0.5,0"])
    assert [a.name for a in scene.additions] == ["my_red_cup_home_0", "my_red_cup_home_1"]


def test_an_object_of_ones_own_starts_at_its_place_and_can_move(tiny_home_folder, cup):
    scene = ig2mj.load_scene(
        tiny_home_folder, objects=[f"{cup}@0.5,0.25,1,90", f"{cup}@fixed:1,1,1,0", "mug@loose:0,0,2,0"]
    )
    data = scene.start_data()
    half = 0.5**0.5
    assert np.allclose(data.body("cup_0").xpos, (0.5, 0.25, 1)) and np.allclose(
        data.body("cup_0").xquat, (half, 0, 0, half)
    )
    assert [scene.object(n).fixed for n in ("cup_0", "cup_1", "mug_0")] == [False, True, False]
    assert [scene.object(n).assisted_grasp for n in ("cup_0", "cup_1")] == [True, False]
    assert np.allclose(data.body("mug_0").xpos, (0, 0, 2))
    again = ig2mj.load_scene(tiny_home_folder, objects=[a.requested for a in scene.additions])
    elsewhere = ig2mj.load_scene(
        tiny_home_folder, objects=[f"{cup}@0.5,0.25,1.1,90", *[a.requested for a in scene.additions[1:]]]
    )
    assert scene.digest == again.digest != elsewhere.digest
    assert again.additions == scene.additions


def test_an_object_may_not_start_inside_of_another(tiny_home_folder, cup):
    first = f"{cup}@0.5,0.25,1,0"
    with pytest.raises(Ig2mjError, match=r"starts \d+\.\d cm inside of cup_\d: .*@on_top:OBJECT"):
        ig2mj.load_scene(tiny_home_folder, objects=[first, f"{cup}@0.51,0.25,1,0"])
    assert ig2mj.load_scene(tiny_home_folder, objects=[first, f"{cup}@0.58,0.25,1,0"]).additions


def test_an_object_may_not_start_above_the_walls_or_be_fixed_in_one(cup):
    with pytest.raises(Ig2mjError, match=r"starts 5.\d m above the floor, and the walls end at [23].\d m"):
        ig2mj.load_scene("small_home", objects=[f"{cup}@0.5,0.25,5.8,90"])
    scene = ig2mj.load_scene("small_home")
    wall = next(name for name in scene.object_names if scene.object(name).category == "walls")
    data = scene.start_data()
    owned = np.asarray(scene.tables.geom_object) == scene.object_index(wall)
    geom = int(np.flatnonzero(owned & (scene.model.geom_contype > 0))[0])
    x, y, z = data.geom_xpos[geom]
    with pytest.raises(Ig2mjError, match=r"is fixed \d+ cm inside of a wall"):
        ig2mj.load_scene("small_home", objects=[f"{cup}@fixed:{x + 0.1},{y + 0.05},{z},0"])


def test_furniture_is_made_by_a_command_that_the_error_names(tiny_home_folder):
    with pytest.raises(UnknownNameError, match=r"ig2mj homes model fridge --out DIR"):
        ig2mj.load_scene(tiny_home_folder, objects=["fridge@1,1,1,0"])


@pytest.mark.slow
def test_a_predicate_says_where_an_object_starts_in_the_same_place_every_time(tiny_home_folder, cup):
    expected = [f"{cup}@on_top:box", f"{cup}@on_top:box"]
    simulation = ig2mj.Simulation(tiny_home_folder, objects=expected)
    assert simulation.predicate("on_top", "cup_0", "box") and simulation.predicate("on_top", "cup_1", "box")
    places = [a.start for a in simulation.scene.additions]
    assert places[0] != places[1]
    assert [a.start for a in ig2mj.load_scene(tiny_home_folder, objects=expected).additions] == places
    simulation.step(count=30)
    assert simulation.predicate("on_top", "cup_0", "box")


def test_worlds_take_objects_and_a_loaded_scene_does_not(tiny_home_folder, tiny_home, cup):
    worlds = ig2mj.Worlds(tiny_home_folder, 1, "native", objects=cup)
    assert worlds.scene.object_names[-1] == "cup_0"
    with pytest.raises(Ig2mjError, match="is loaded already"):
        ig2mj.Worlds(tiny_home, 1, "native", objects=cup)


def test_assets_of_the_same_name_and_other_content_are_kept_apart(tiny_home_folder, cup, tmp_path):
    other = tmp_path / "cup"
    shutil.copytree(cup, other)
    file = other / "object.xml"
    file.write_text(file.read_text().replace('gap="0.003"', 'gap="0.006"'))
    scene = ig2mj.load_scene(tiny_home_folder, objects=[cup, other])
    assert [scene.model.geom(f"{name}/collision_0").gap[0] for name in ("cup_0", "cup_1")] == [0.003, 0.006]


@pytest.mark.parametrize(
    ("expected", "said"),
    [
        ("obj/cup", "near matches: cup.*there is no folder obj/cup with a manifest.json .*convert object"),
        ("nothing_like_it_at_all", "no category of the object library.*no folder nothing_like_it_at_all"),
        ("cup.urdf", "is a URDF.*convert object --urdf cup.urdf"),
        ("mug@1,2", r"'mug@1,2': the place of an object is x,y,z,yaw"),
        ("mug@loose:1,2,3,1,1,1,1", "no unit quaternion"),
        ("mug@on_tp:box", "near matches: on_top"),
        ("mug@on_top:bx", "near matches: box"),
        ("mug@inside:mug_0", "cannot be placed inside itself"),
        ("shelf@loose:1,2,3,0", "is fixed and cannot be loose"),
        ("", "neither a folder nor a name"),
    ],
)
def test_what_is_no_object_is_said_in_one_line_with_both_readings(tiny_home_folder, expected, said):
    with pytest.raises(Ig2mjError, match=said) as error:
        ig2mj.load_scene(tiny_home_folder, objects=[expected])
    assert "\n" not in str(error.value)


def test_folders_of_other_things_are_refused(tiny_home_folder, tmp_path, cup):
    (tmp_path / "empty").mkdir()
    for folder, said in ((tmp_path / "empty", "folder without manifest.json"), (tiny_home_folder, "holds a home")):
        with pytest.raises(InputError, match=said):
            ig2mj.load_scene(tiny_home_folder, objects=folder)
    robot = tmp_path / "robot"
    shutil.copytree(cup, robot)
    file = robot / "manifest.json"
    file.write_text(file.read_text().replace('"category": "mug"', '"category": "agent"'))
    with pytest.raises(InputError, match="holds a robot"):
        ig2mj.load_scene(tiny_home_folder, objects=robot)
    broken = tmp_path / "broken"
    shutil.copytree(cup, broken)
    (broken / "manifest.json").write_text("{")
    with pytest.raises(InputError, match=r"manifest\.json"):
        ig2mj.load_scene(tiny_home_folder, objects=broken)


def test_a_library_of_ones_own_is_kept_until_it_is_removed(tiny_home_folder, shelf_of_cups, own_configuration):
    with pytest.raises(UnknownNameError):
        find_model("mug/cup")
    path, found = own_libraries.add_library(shelf_of_cups)
    assert found == [path / "kitchen" / "cup"] and own_libraries.registry_file().is_relative_to(own_configuration)
    scene = ig2mj.load_scene(tiny_home_folder, objects=["mug/cup", "mug"])
    assert [(a.name, a.model) for a in scene.additions] == [("mug_0", "cup"), ("mug_1", find_model("mug").model)]
    assert find_model("mug").own is False, "the library that ships comes first"
    own_libraries.remove_library(shelf_of_cups)
    assert own_library() == {}
    with pytest.raises(InputError, match="is no library that was added"):
        own_libraries.remove_library(shelf_of_cups)


def test_the_environment_names_libraries_too(shelf_of_cups, monkeypatch, tmp_path):
    monkeypatch.setenv("IG2MJ_OBJECTS", str(shelf_of_cups))
    assert find_model("mug/cup").folder == shelf_of_cups / "kitchen" / "cup"
    monkeypatch.setenv("IG2MJ_OBJECTS", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match=r"\$IG2MJ_OBJECTS: names the library .*nowhere"):
        find_model("mug/cup")


def test_two_models_of_one_name_in_libraries_are_refused_with_both_folders(shelf_of_cups, monkeypatch):
    shutil.copytree(shelf_of_cups / "kitchen" / "cup", shelf_of_cups / "second")
    monkeypatch.setenv("IG2MJ_OBJECTS", str(shelf_of_cups))
    with pytest.raises(InputError, match=r"second: is 'mug/cup', as is .*kitchen/cup"):
        find_model("mug/cup")


def test_objects_of_a_library_within_another_count_once(shelf_of_cups, own_configuration):
    own_libraries.add_library(shelf_of_cups / "kitchen")
    own_libraries.add_library(shelf_of_cups)
    assert list(own_library()["mug"]) == ["cup"]


def test_a_folder_without_objects_is_no_library(tmp_path):
    (tmp_path / "empty").mkdir()
    for name in ("empty", "absent"):
        with pytest.raises(InputError, match=name):
            own_libraries.add_library(tmp_path / name)


def test_an_object_that_has_moved_is_found_again_in_a_library_by_its_hash(tiny_home_folder, cup, tmp_path, monkeypatch):
    was = tmp_path / "was" / "cup"
    shutil.copytree(cup, was)
    additions = ig2mj.load_scene(tiny_home_folder, objects=was).additions
    assert find_again(additions, "run.h5") == list(additions)
    now = tmp_path / "now" / "cup"
    now.parent.mkdir()
    was.rename(now)
    with pytest.raises(
        InputError,
        match=r"run.h5: needs the object 'cup_0' \(mug/cup, hash .*neither in .*was/cup nor in a library",
    ):
        find_again(additions, "run.h5")
    monkeypatch.setenv("IG2MJ_OBJECTS", str(now.parent))
    (found,) = find_again(additions, "run.h5")
    assert found.folder == str(now)
    scenes = [ig2mj.load_scene(tiny_home_folder, objects=a.requested) for a in (found,)]
    assert scenes[0].object_names[-1] == "cup_0"


def test_texts_of_a_file_lead_to_where_an_object_is_now(tiny_home_folder, cup, tmp_path, monkeypatch):
    was, now = tmp_path / "was" / "cup", tmp_path / "now" / "cup"
    shutil.copytree(cup, was)
    entries = entries_of(ig2mj.load_scene(tiny_home_folder, objects=[was, "mug"]).additions)
    now.parent.mkdir()
    was.rename(now)
    monkeypatch.setenv("IG2MJ_OBJECTS", str(now.parent))
    texts = requests_again([f"{was}@on_top:box", "remove:can", "mug"], entries, "policy.npz")
    assert sorted(texts) == sorted((f"{now}@on_top:box", "remove:can", "mug"))
    for wrong in ([], [{"name": 3}]):
        with pytest.raises(InputError, match=r"policy\.npz"):
            requests_again(["mug"], wrong, "policy.npz")


def test_requests_tell_folder_place_and_predicate_apart():
    assert read_request("a/b").reference == "a/b"
    assert read_request("a/b@1,2,3,4").place == (1, 2, 3, 4)
    assert read_request("me@home/b@on_top:t").predicate == ("on_top", "t")
    assert read_request("me@home/b@on_top:t").reference == "me@home/b"
    assert read_request("a@loose:1,2,3,1,0,0,0").kind == "loose"


def test_half_of_the_cup_is_as_high_as_the_tests_say(cup):
    assert find_model(str(cup)).entry.bounding_box[2] == pytest.approx(2 * HALF, abs=1e-3)
