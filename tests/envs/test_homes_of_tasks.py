"""`make(..., home=)`, and robots that would start outside of the house."""

from __future__ import annotations

import dataclasses
import shutil

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.engine.view import blank_view, replace_fields
from ig2mj.envs import registry
from ig2mj.errors import EngineError, InputError
from ig2mj.scene.bare_scenes import bare_scene
from ig2mj.scene.paths import scene_folder
from ig2mj.scene.scene import load_scene
from ig2mj.tasks import relocation
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.bddl.binding import BindingError
from ig2mj.tasks.bddl.task import bddl_task
from ig2mj.tasks.experts.quarters import quarter_turn, turned_view
from ig2mj.tasks.homes import check_inside, in_home
from ig2mj.tasks.household import Household
from ig2mj.tasks.registry import load_task
from ig2mj.tasks.relocation import reason_against
from ig2mj.tasks.task import Task

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


def test_an_activity_without_a_fit_needs_its_furniture_where_it_is():
    without_fit = dataclasses.replace(COOKING, fit=None)
    assert in_home(COOKING, COOKING.home) == COOKING
    with pytest.raises(EngineError, match=r"'small_home': it has no bottom_cabinet_1"):
        in_home(without_fit, "small_home")
    with pytest.raises(EngineError, match=r"is \d+\.\d m from its position in 'birch'"):
        in_home(without_fit, "elm")


def test_objects_at_fixed_places_need_there_what_is_next_to_them_at_home():
    """The board of CleaningStainedShelf hangs on a wall of birch."""
    shelf = ACTIVITIES["CleaningStainedShelf"]
    assert not reason_against(shelf, shelf.home)
    with pytest.raises(EngineError, match="'small_home': the activity has walls at -y next to 'shelf/shelf_14@") as e:
        in_home(shelf, "small_home")
    assert reason_against(shelf, "small_home") == str(e.value)


def bound(home, **fields):
    """An activity of a home, without `Task.fit`, that names none of its furniture."""
    empty = {"fit": None, "objects": (), "start": (), "near": (), "objects_of_interest": (), "robots": {}}
    return dataclasses.replace(COOKING, home=str(home), **{**empty, **fields})


def test_robots_need_free_floor_where_they_start(tiny_home_folder):
    robots = {"fetch": dataclasses.replace(COOKING.robots["fetch"], pos=(1.0, 1.0, 0.0))}
    assert in_home(bound(tiny_home_folder, robots=robots), "small_home").home == "small_home"
    robots = {"fetch": dataclasses.replace(COOKING.robots["fetch"], pos=(1.0, -1.5, 0.0))}
    with pytest.raises(EngineError, match="robot 'fetch' stands on free floor in 'tiny_home', and there is none here"):
        in_home(bound(tiny_home_folder, robots=robots), "small_home")


def test_objects_of_an_activity_are_named_as_in_the_home_where_it_is(tiny_home_folder):
    """The small home has a chopping board of its own."""
    start = ("(dusty chopping_board_0)",)
    moved = in_home(bound(tiny_home_folder, objects=("chopping_board",), start=start), "small_home")
    assert moved.start == ("(dusty chopping_board_1)",)
    assert moved.roles == {"chopping_board_0": "chopping_board_1"}


def test_an_activity_goes_where_another_home_has_its_furniture():
    """The robot stands before the stove, a counter in reach; its reach and its hand move with it."""
    moved = in_home(COOKING, "small_home")
    assert moved.home == "small_home" and moved.start[0] == "(on_top steak_0 bottom_cabinet_0)"
    assert moved.roles == {"bottom_cabinet_1": "bottom_cabinet_0", "stove_0": "stove_0"} and moved.turned % 90 == 0
    scene = load_scene("small_home", agents=[Humanoid(pos=moved.robots["humanoid"].pos)], objects=moved.objects)
    data = scene.start_data()
    stove = data.xpos[scene.tables.object_root[scene.object_index("stove_0")]]
    robot = np.array(moved.robots["humanoid"].pos)
    assert 0.3 < np.linalg.norm((stove - robot)[:2]) < 1.1
    own, other = (np.array(t.near[0].pos) - t.robots["humanoid"].pos for t in (COOKING, moved))
    assert np.linalg.norm(own) == pytest.approx(np.linalg.norm(other), abs=2e-3)
    assert ncon_of_robot(scene) == 0


def test_the_humanoid_is_as_high_above_higher_counters_as_at_home():
    """Seen from 0.95 m above the floor, nothing on a counter of 1.05 m is in the image."""
    at_home = COOKING.robots["humanoid"].pos
    for home, top in (("elm", 0.93), ("willow", 1.045)):
        moved = in_home(COOKING, home)
        raised = moved.robots["humanoid"].pos[2] - at_home[2]
        assert raised == pytest.approx(top - 0.93, abs=2e-3), home
        assert moved.robots["fetch"].pos[2] == 0.0, "it stands on the floor"


def test_where_objects_start_is_in_view():
    """The stove of juniper has counters on its right only: the robot stands far enough to the right to see them."""
    moved = in_home(COOKING, "juniper")
    household = Household(bare_scene("juniper"))
    low, high = household.box(moved.roles["bottom_cabinet_1"])
    spread = np.meshgrid(*(np.arange(low[k], high[k], 0.05) for k in (0, 1)))
    points = np.column_stack([*(axis.ravel() for axis in spread), np.full(spread[0].size, high[2])])
    points = points[np.linalg.norm(points - moved.near[0].pos, axis=1) < 0.9]
    yaw = np.radians(moved.robots["humanoid"].yaw)
    off = points[:, :2] - moved.robots["humanoid"].pos[:2]
    ahead, left = off @ [np.cos(yaw), np.sin(yaw)], off @ [-np.sin(yaw), np.cos(yaw)]
    assert np.mean(np.abs(left) < ahead) > 0.65


def test_an_arm_stands_where_its_surface_is_not_on_its_right():
    """Fetch stands farther to the right than the humanoid in juniper, and as at home elsewhere."""

    def ahead_of(home):
        moved = in_home(COOKING, home)
        yaw = np.radians(moved.robots["fetch"].yaw)
        off = np.subtract(moved.robots["fetch"].pos[:2], moved.robots["humanoid"].pos[:2])
        return float(off @ [-np.sin(yaw), np.cos(yaw)])

    at_home = COOKING.robots["humanoid"].pos[0] - COOKING.robots["fetch"].pos[0]
    assert ahead_of("elm") == pytest.approx(at_home, abs=2e-3)
    assert ahead_of("juniper") == pytest.approx(at_home - 0.2, abs=2e-3)


def side_of_stove(task: Task) -> float:
    """m to the left of the humanoid where the burners are, in the home that a task is in."""
    acts, yaw = task.robots["humanoid"], np.radians(task.robots["humanoid"].yaw)
    off = Household(bare_scene(task.home)).link("stove_0", COOKING.fit.link) - acts.pos
    return float(off[:2] @ [-np.sin(yaw), np.cos(yaw)])


@pytest.mark.parametrize("home", ["birch", "spruce"])
def test_a_home_has_further_places_at_other_furniture(home):
    """Counters on the left and on the right of the stove: at the second place the robot turns the other way."""
    first, second = in_home(COOKING, home), in_home(COOKING, f"{home}:1")
    assert second.home == first.home == home and first.start != second.start
    assert second.roles["bottom_cabinet_1"] != first.roles.get("bottom_cabinet_1", "bottom_cabinet_1")
    assert side_of_stove(first) < -0.4 and side_of_stove(second) > 0.4
    scene = load_scene(home, agents=[Humanoid(pos=second.robots["humanoid"].pos)], objects=second.objects)
    assert ncon_of_robot(scene) == 0
    with pytest.raises(EngineError, match=f"place 2 of CookingMeat in '{home}': it can be done at 2 places, 0 to 1"):
        in_home(COOKING, f"{home}:2")


def test_homes_with_one_place_say_so():
    with pytest.raises(EngineError, match="place 1 of CookingMeat in 'juniper': it can be done at one place"):
        in_home(COOKING, "juniper:1")
    with pytest.raises(EngineError, match="only the paper's activities have several places"):
        in_home(load_task("PointNavigation"), "birch:1")
    assert in_home(COOKING, "birch:0") == COOKING


def test_a_folder_may_be_named_as_a_place_is(tmp_path, monkeypatch):
    shutil.copytree(scene_folder("small_home"), tmp_path / "mine:1", symlinks=True)
    monkeypatch.chdir(tmp_path)
    assert in_home(load_task("PointNavigation"), "mine:1").home == str(tmp_path / "mine:1")


def ncon_of_robot(scene) -> int:
    """Contacts of the robot with anything at the start."""
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.start_data().qpos
    mujoco.mj_forward(scene.model, data)
    robot = scene.tables.body_object[scene.model.geom_bodyid] < 0
    robot &= np.isin(scene.model.body_rootid[scene.model.geom_bodyid], scene.tables.agent_body)
    return sum(bool(robot[c.geom1] or robot[c.geom2]) for c in data.contact)


def test_a_home_where_nothing_is_in_reach_says_so(tiny_home_folder):
    with pytest.raises(EngineError, match=r"CookingMeat cannot be done in 'tiny_home': nowhere on its free floor"):
        in_home(COOKING, tiny_home_folder)


def test_experts_see_the_world_turned_as_at_home():
    """A view turned by a quarter has points turned, and boxes that still are boxes."""
    view = blank_view({axis: 2 for axis in "WOBLJAQHFY"})
    low, high = np.array([1.0, 2.0, 0.0], np.float32), np.array([2.0, 4.0, 1.0], np.float32)
    view = replace_fields(view, {"object_pos": view.object_pos + low, "aabb_low": view.aabb_low + low})
    view = replace_fields(view, {"aabb_high": view.aabb_high + high})
    seen = turned_view(view, quarter_turn(90))
    np.testing.assert_allclose(seen.object_pos[0, 0], [-2.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(seen.aabb_low[0, 0], [-4.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(seen.aabb_high[0, 0], [-2.0, 2.0, 1.0], atol=1e-6)


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


def test_a_home_of_ones_own_is_looked_at_each_time(monkeypatch, tmp_path):
    """It may change while a process runs; homes that ship do not, and a training asks twice for each."""
    asked = []
    monkeypatch.setattr(relocation, "_difference", lambda task, folder: asked.append(folder.name) or "")
    own = tmp_path / "mine"
    shutil.copytree(scene_folder("small_home"), own)
    task = dataclasses.replace(COOKING)
    for home in (own, own, "maple", "maple"):
        relocation.relocated(task, home)
    assert asked == ["mine", "mine", "maple"]


def test_all_homes_are_checked_before_the_first_is_made(monkeypatch):
    made = []
    monkeypatch.setattr(registry, "_make", lambda task, config: made.append(config.home))
    with pytest.raises(InputError, match="no_home: there is no such scene"):
        registry.make("GraspingBook", worlds=2, home=["small_home", "no_home"])
    assert not made
