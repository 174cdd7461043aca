"""A robot of one's own with a base, an arm and a gripper carries primitives out; others say what they lack."""

import shutil

import pytest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_robot import convert_robot
from porter import write_porter
from urdf_parts import converted, gripper

import ig2mj
from ig2mj.agents import UrdfRobot
from ig2mj.planning import PlanningError


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_converted_robot_takes_an_apple_puts_it_down_and_switches_a_stove_on(tmp_path):
    urdf = write_porter(tmp_path / "porter")
    convert_robot(urdf, tmp_path / "out", options=ConvertOptions(report=False))
    shutil.copy(urdf.parent / "layout.toml", tmp_path / "out" / "layout.toml")
    scene = ig2mj.load_scene("small_home", agents=[UrdfRobot.load(tmp_path / "out").at(-1.0, 0.0, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    for request in ("toggle_on stove_0", "grasp apple_0", "place_on_top apple_0 coffee_table_0"):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"


def test_an_arm_on_a_fixed_base_says_what_it_lacks(tmp_path, tiny_home_folder):
    robot = UrdfRobot.load(converted(tmp_path, *gripper("", "base", "0.1 0 0.1")))
    scene = ig2mj.load_scene(tiny_home_folder, agents=[robot.at(1.0, -1.4, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    with pytest.raises(PlanningError, match="robot 'arm' has no base that moves: primitives take one that drives"):
        _ = simulation.agent
