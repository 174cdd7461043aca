"""`make(..., home=)`, and robots that would start outside of the house."""

from __future__ import annotations

import dataclasses
import shutil

import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.errors import EngineError, InputError
from ig2mj.scene.paths import scene_folder
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.bddl.binding import BindingError
from ig2mj.tasks.bddl.task import bddl_task
from ig2mj.tasks.homes import check_inside, in_home
from ig2mj.tasks.registry import load_task

COOKING = ACTIVITIES["CookingMeat"]


@pytest.mark.slow
def test_navigation_goes_into_another_home_and_says_so_to_recordings():
    env = ig2mj.make("PointNavigation", engine="native", home="small_home", pool_size=2, observations="proprioception")
    assert env.scene.name == "small_home" and env.made_with["home"] == "small_home"
    assert list(env.reset(0).obs) == ["proprioception"]


def test_a_task_in_a_home_of_ones_own_knows_the_whole_path(tmp_path, monkeypatch):
    shutil.copytree(scene_folder("small_home"), tmp_path / "mine", symlinks=True)
    monkeypatch.chdir(tmp_path)
    task = in_home(load_task("PointNavigation"), "mine")
    assert task.home == str(tmp_path / "mine") and task.goal == "point"


def test_there_must_be_such_a_home():
    with pytest.raises(InputError, match="small_home"):
        ig2mj.make("PointNavigation", home="smal_home")


def test_what_bddl_defines_is_bound_again():
    task = bddl_task("cleaning_windows")
    other = next(home for home in ("elm", "birch") if home != task.home)
    moved = in_home(task, other)
    assert moved.home == other and moved.binding.activity is task.binding.activity
    with pytest.raises(BindingError, match="'bottling_fruit' cannot be bound in 'small_home'"):
        in_home(bddl_task("bottling_fruit"), "small_home")


def test_an_activity_of_the_paper_needs_its_furniture_where_it_is():
    assert in_home(COOKING, COOKING.home) == COOKING
    with pytest.raises(EngineError, match=r"'small_home': it has no bottom_cabinet_1"):
        in_home(COOKING, "small_home")
    with pytest.raises(EngineError, match=r"is \d+\.\d m from its position in 'birch'"):
        in_home(COOKING, "elm")


@pytest.mark.parametrize("pos", [(9.0, 0.0, 0.6), (0.5, 0.0, -3.0), (0.5, 0.0, 30.0)])
def test_a_robot_outside_of_a_house_without_a_map_is_refused(tiny_home_folder, pos):
    check_inside("a task", load_scene(tiny_home_folder, agents=[Humanoid(pos=(0.5, 1.0, 0.6))]))
    with pytest.raises(EngineError, match=r"a task: robot 'humanoid' starts at .* outside of home 'tiny_home'"):
        check_inside("a task", load_scene(tiny_home_folder, agents=[Humanoid(pos=pos)]))


def test_a_robot_of_a_task_outside_of_its_rooms_is_refused_before_anything_is_sampled(monkeypatch):
    monkeypatch.setattr("ig2mj.envs.setups.pool_of", lambda *_: pytest.fail("sampled"))
    acts = dataclasses.replace(COOKING.robots["fetch"], pos=(-9.0, -1.65, 0.0))
    with pytest.raises(EngineError, match=r"robot 'fetch' starts at \(-9\.00, -1\.65, 0\.\d+\) m"):
        ig2mj.make(dataclasses.replace(COOKING, robots={"fetch": acts}), robot="fetch", engine="native")
