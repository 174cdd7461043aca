"""Objects of one's own on every engine: they stand where they start, are grasped, heat and are recorded."""

import re

import numpy as np
import pytest
from own_objects import HALF, write_object
from robot_world import GraspingWorld

import ig2mj
from ig2mj.agents import Fetch
from ig2mj.errors import InputError

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("own_configuration")]


@pytest.fixture(scope="module")
def top_of_box(tiny_home):
    """m: height of the box of the tiny home."""
    data = tiny_home.start_data()
    body = tiny_home.tables.object_root[tiny_home.object_index("box")]
    entry = tiny_home.object("box")
    return float(data.xpos[body, 2] + entry.base_link_offset[2] + entry.bounding_box[2] / 2), data.xpos[body, :2]


@pytest.mark.parametrize("engine", ["native", "warp"])
def test_a_cup_stays_on_the_box_on_both_engines(tiny_home_folder, cup, top_of_box, engine):
    z, (x, y) = top_of_box
    place = f"{cup}@{x},{y},{z + HALF},0"
    worlds = ig2mj.Worlds(tiny_home_folder, 2, engine, objects=place, goal="(on_top cup_0 box)")
    batch = worlds.start(0)
    for _ in range(30):
        batch, status = worlds.step(batch)
    assert np.asarray(status.holds).all()


def test_a_gripper_takes_a_cup_of_ones_own_and_lifts_it(tiny_home_folder, tiny_home, cup):
    x, y, _ = tiny_home.start_data().body("can").xpos
    robot = Fetch(pos=(0.3, 0.85, 0.0), quat=(np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5)))
    foot = tiny_home.start_data().body("can").xpos[2] - 0.06
    expected = ["remove:can", f"{cup}@{x},{y},{foot + HALF},0"]
    world = GraspingWorld(ig2mj.load_scene(tiny_home_folder, [robot], expected))
    cup_pos = world.body("cup_0")
    world.gripper_to(cup_pos + np.array([0, 0, 0.2]), 25, gripper=1.0)
    world.gripper_to(cup_pos + np.array([0, 0, 0.02]), 12, gripper=1.0)
    world.act(times=4, gripper=-1.0)
    assert world.held == ["cup_0"]
    world.act(times=12, eef_z=1.0, gripper=-1.0)
    assert world.body("cup_0")[2] > cup_pos[2] + 0.1


def test_a_recording_names_the_object_that_a_simulation_lacks(tiny_home_folder, cup, tmp_path):
    simulation = ig2mj.Simulation(tiny_home_folder, objects=f"{cup}@0,0,1,0")
    with simulation.record(tmp_path / "run.h5"):
        simulation.step(count=3)
    again = ig2mj.Simulation(tiny_home_folder, objects=f"{cup}@0,0,1,0").replay(tmp_path / "run.h5")
    assert (again.frames, again.differences) == (4, [])
    with pytest.raises(
        InputError, match=r"it needs 'cup_0' \(mug/cup, hash \w{12}, from .*load_scene\(\.\.\., objects"
    ):
        ig2mj.Simulation(tiny_home_folder).replay(tmp_path / "run.h5")


def test_annotations_work_the_hot_plate_of_the_guide_cooks(repository, tiny_home_folder, tmp_path):
    """The files of docs/guide/objects.md."""
    text = (repository / "docs" / "guide" / "objects.md").read_text(encoding="utf-8")
    urdf, toml = (re.search(rf"```{kind}\n(.*?)```", text, re.DOTALL)[1] for kind in ("xml", "toml"))
    (tmp_path / "plate.toml").write_text(toml)
    plate = write_object(tmp_path, "hot_plate", urdf, category="hot_plate", annotations=tmp_path / "plate.toml")
    expected = [f"{plate}@fixed:0.5,0.25,1,0", "steak@loose:0.5,0.25,1.1,0"]
    simulation = ig2mj.Simulation(tiny_home_folder, objects=expected)
    simulation.set_state("toggled_on", "hot_plate_0", True)
    simulation.step(count=300)
    assert simulation.state("temperature", "steak_0") > 60
