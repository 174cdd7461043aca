"""Every sensor, by name: its space holds, and what cannot be made is refused in one line."""

from __future__ import annotations

import numpy as np
import pytest
from perceiving import Perceiving

from ig2mj.agents.fetch import Fetch
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.agents.humanoid import Humanoid
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.sensors.base import SensorOptions
from ig2mj.sensors.registry import SENSORS, find_sensor

OPTIONS = {"width": 20, "height": 12, "scan_rays": 11, "lidar_columns": 6, "grid_size": 32}
ROBOTS = {
    "humanoid": Humanoid(pos=(0, -1.2, 0.55)),
    "fetch": Fetch(pos=(0, -1.2, 0)),
    "turtlebot": TurtleBot(pos=(0, -1.2, 0)),
}


@pytest.mark.parametrize(
    "robot", ["humanoid", *(pytest.param(r, marks=pytest.mark.slow) for r in ROBOTS if r != "humanoid")]
)
def test_every_sensor_keeps_to_its_space(tiny_home_folder, robot):
    world = Perceiving(tiny_home_folder, ROBOTS[robot], worlds=2)
    suite = world.suite(*SENSORS, **OPTIONS)
    readings, memory = world.read(suite)
    again, _ = world.read(suite, memory)
    assert list(suite.spaces) == list(SENSORS)
    for name, space in suite.spaces.items():
        array = readings[name]
        assert array.shape == (2, *space.shape), name
        assert array.dtype == space.dtype, name
        assert space.low <= array.min() and array.max() <= space.high, name
        np.testing.assert_allclose(array.astype(float), again[name].astype(float), atol=1e-5, err_msg=name)


def test_names_are_those_of_igibson():
    """iGibson's; without task_obs, which tasks make, and what needs a network."""
    theirs = {"rgb", "depth", "pc", "optical_flow", "scene_flow", "normal", "seg", "ins_seg", "scan", "occupancy_grid"}
    assert theirs | {"bump", "proprioception"} <= set(SENSORS)


def test_an_unknown_name_lists_what_is_near():
    with pytest.raises(UnknownNameError, match="no sensor is named 'optical_flw'; near matches: optical_flow"):
        find_sensor("optical_flw")


def test_a_robot_without_a_laser_has_no_scan(tiny_home_folder):
    world = Perceiving(tiny_home_folder, FloatingHand(pos=(0, 0, 1)))
    with pytest.raises(EngineError, match="has no laser scanner"):
        world.suite("scan")
    assert world.see("rgb", width=8, height=8)["rgb"].shape == (1, 8, 8, 3)


def test_other_engines_feel_but_do_not_look(tiny_home_folder, monkeypatch):
    world = Perceiving(tiny_home_folder, ROBOTS["turtlebot"])
    monkeypatch.setattr(world.engine, "name", "jax")
    monkeypatch.setattr(world.engine, "renderer", "")
    with pytest.raises(EngineError, match="the jax engine neither renders images nor casts rays"):
        world.suite("rgb")
    assert world.see("bump")["bump"].tolist() == [[0.0]]


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ({"width": 0}, "width = 0"),
        ({"depth_low": 3.0, "depth_high": 2.0}, "depth_low must be"),
        ({"scan_noise_rate": 1.5}, "a probability is between 0 and 1"),
        ({"scan_angle": 400.0}, "between 0 and 360 degrees"),
        ({"particles": -1}, "particles = -1: at least 0"),
    ],
)
def test_settings_out_of_range_are_refused(setting, says):
    with pytest.raises(EngineError, match=says):
        SensorOptions(**setting)


def test_bump_counts_everything_but_floors(tiny_home_folder):
    """The TurtleBot stands on the floor; in the table's leg it touches the table."""
    free = Perceiving(tiny_home_folder, TurtleBot(pos=(0, -1.2, 0)))
    floor = free.scene.tables.object_is_floor
    assert np.asarray(free.engine.view(free.physics).agent.touching)[0, 0, floor].any(), "it stands on the floor"
    assert free.see("bump")["bump"].tolist() == [[0.0]]
    assert Perceiving(tiny_home_folder, TurtleBot(pos=(0.35, -0.35, 0))).see("bump")["bump"].tolist() == [[1.0]]


def test_ground_truth_is_that_of_the_view(tiny_home_folder):
    world = Perceiving(tiny_home_folder, ROBOTS["humanoid"])
    seen, view = world.see("object_poses", "base_pose", "eye_pose"), world.engine.view(world.physics)
    table = world.scene.object_index("table")
    np.testing.assert_array_equal(seen["object_poses"][0, table, :3], np.asarray(view.object_pos)[0, table])
    assert seen["base_pose"][0] == pytest.approx([0, -1.2, 0.55, 1, 0, 0, 0], abs=1e-6)
    pos, axes = world.eye()
    assert seen["eye_pose"][0, :3] == pytest.approx(pos)
    assert -axes[:, 2] == pytest.approx([1, 0, 0], abs=1e-6), "it looks ahead"
