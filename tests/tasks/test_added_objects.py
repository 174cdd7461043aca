"""Tasks with objects added to their home."""

import shutil

import pytest

from ig2mj.demos.task_hash import task_hash
from ig2mj.envs.config import EnvConfig
from ig2mj.envs.registry import find_task
from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.scene.library import find_model
from ig2mj.scene.object_requests import read_request
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.added_objects import object_texts, with_objects

pytestmark = pytest.mark.usefixtures("own_configuration")


def test_a_predicate_is_a_condition_of_an_activitys_start_states(cup):
    task = ACTIVITIES["CookingMeat"]
    changed = with_objects(task, [f"{cup}@on_top:coffee_table_0", "steak", f"{cup}@1,2,0.8,0"])
    assert changed.objects == (*task.objects, str(cup), "steak", f"{cup}@1,2,0.8,0")
    assert changed.start == (*task.start, "(on_top cup_0 coffee_table_0)")
    assert task_hash(changed, "fetch") == task_hash(task, "fetch"), "the scene's hash has the objects"


def test_in_navigation_objects_stay_where_they_are_put(cup):
    task = with_objects(find_task("InteractiveNavigation"), cup)
    assert task.added == (str(cup),)
    assert task.objects == find_task("InteractiveNavigation").objects, "only these are strewn about"


def test_tasks_that_ship_take_the_library_whatever_the_working_directory_holds(cup, tmp_path, monkeypatch):
    shutil.copytree(cup, tmp_path / "steak")
    monkeypatch.chdir(tmp_path)
    task = with_objects(ACTIVITIES["CookingMeat"], ())
    assert task.objects == ("steak",) == ACTIVITIES["CookingMeat"].objects
    assert [find_model(read_request(text).reference).own for text in (*task.objects, "steak")] == [False, True]


def test_texts_hold_whole_paths_and_are_kept_with_an_environment(cup, monkeypatch):
    monkeypatch.chdir(cup.parent)
    assert object_texts("cup@on_top:table_0") == (f"{cup}@on_top:table_0",)
    assert object_texts(["mug", cup]) == ("mug", str(cup))
    assert EnvConfig(objects=("mug",)).kept_in_files()["objects"] == ("mug",)


@pytest.mark.parametrize(
    ("expected", "error", "said"),
    [
        ("mug@1,2", Ig2mjError, "the place of an object"),
        ("mgu", UnknownNameError, "mug"),
        ("", Ig2mjError, "neither a"),
    ],
)
def test_what_is_no_object_is_an_error_of_make(expected, error, said):
    with pytest.raises(error, match=said):
        object_texts(expected)
