"""Which sizes the Warp engine takes for a scene with a robot."""

from __future__ import annotations

import shutil

import msgspec
import pytest

import ig2mj
from ig2mj.agents import FloatingHand, Humanoid, TurtleBot
from ig2mj.calibration.measuring import calibrate
from ig2mj.engine.warp.profile import (
    PROFILE_FILE,
    EngineProfile,
    default_profile,
    profile_file,
    profile_of_scene,
    save_profile,
)

PROFILE = EngineProfile(awake_dofs=12, constraints=64, contacts=16, convex_contacts=8)


@pytest.fixture
def home(tiny_home_folder, tmp_path):
    """A home's folder to write into, without a profile."""
    folder = shutil.copytree(tiny_home_folder, tmp_path / "home")
    (folder / PROFILE_FILE).unlink(missing_ok=True)
    return folder


def test_files_are_named_after_robots_but_the_hand():
    assert profile_file([]) == profile_file([FloatingHand()]) == "engine_profile.json"
    assert profile_file([TurtleBot(), FloatingHand()]) == "engine_profile.turtlebot.json"
    assert profile_file([TurtleBot(name="b"), Humanoid(), TurtleBot()]) == "engine_profile.humanoid.turtlebot.json"


def test_a_robot_gets_its_own_sizes_else_the_scenes_and_room_for_itself_else_safe_ones(home):
    bare, robot = ig2mj.load_scene(home), ig2mj.load_scene(home, agents=[TurtleBot()])
    assert profile_of_scene(robot) == default_profile(robot.model)
    save_profile(PROFILE, home)
    assert profile_of_scene(bare) == PROFILE
    wider = profile_of_scene(robot)
    assert wider.awake_dofs == PROFILE.awake_dofs + robot.model.nv - bare.model.nv
    assert wider.contacts > PROFILE.contacts and wider.convex_contacts > PROFILE.convex_contacts
    assert wider.constraints >= PROFILE.constraints + 4 * (wider.contacts - PROFILE.contacts)
    own = msgspec.structs.replace(PROFILE, contacts=99)
    save_profile(own, home, "engine_profile.turtlebot.json")
    assert profile_of_scene(robot) == own and profile_of_scene(bare) == PROFILE


def test_added_objects_get_room_for_themselves(home):
    bare, added = ig2mj.load_scene(home), ig2mj.load_scene(home, objects=["apple", "jar"])
    assert profile_of_scene(added) == default_profile(added.model)
    save_profile(PROFILE, home)
    wider = profile_of_scene(added)
    assert wider.awake_dofs == PROFILE.awake_dofs + added.model.nv - bare.model.nv
    assert wider.contacts > PROFILE.contacts and wider.convex_contacts > PROFILE.convex_contacts
    assert wider.constraints > PROFILE.constraints + 4 * (wider.contacts - PROFILE.contacts), "a lid has a limit"
    assert profile_of_scene(bare) == PROFILE


def test_a_robot_that_acts_is_measured(home):
    scene = ig2mj.load_scene(home, agents=[TurtleBot()])
    profile = calibrate(scene, engine="native", num_worlds=2, rounds=1)
    assert profile.awake_dofs >= scene.model.nv - ig2mj.load_scene(home).model.nv, "a robot never sleeps"
