"""PyBullet is given the same home as MuJoCo, with iGibson's settings."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the comparison needs PyBullet (extra: bench)")
pytest.importorskip("matplotlib", reason="plots need matplotlib (extra: bench)")

from benchmarks.harness.homes import Home, convert
from benchmarks.harness.idle_robot import NAME, write_robot_urdf
from benchmarks.harness.made_dataset import Item, write_dataset
from benchmarks.harness.made_dataset import _Models as Models
from benchmarks.harness.made_dataset import _write_scene as write_scene
from benchmarks.peers import pybullet_process
from benchmarks.peers.bullet_description import BulletCamera
from benchmarks.peers.pybullet_scene import write_bullet_scene, write_obj
from benchmarks.speed import idle_a7

ROBOT_AT = (0.0, 1.8, 0.0)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Home:
    """A fridge whose door opens, a countertop, and a cracker box on it."""
    work = tmp_path_factory.mktemp("bullet")
    dataset = write_dataset(work / "dataset", (20,))
    models = Models(dataset)
    items: list[Item] = [models.standing("countertop", 0.0, 0.0), models.standing("fridge", 2.0, 0.0, yaw=0.5)]
    items.append(models.standing("cracker_box", 0.0, 0.0, on=2 * items[0].pos[2], fixed=False))
    write_scene(dataset, "kitchen", items)
    return convert(work / "dataset", "kitchen", work)


@pytest.fixture(scope="module")
def bullet(home: Home, tmp_path_factory: pytest.TempPathFactory):
    """The home in PyBullet's process, with its description."""
    folder = tmp_path_factory.mktemp("urdf")
    robot = write_robot_urdf(folder, ROBOT_AT)
    camera = BulletCamera((1.0, 2.3, 1.5), (1.0, 0.0, 0.5))
    assert home.dataset is not None
    scene = write_bullet_scene(home.load(), home.dataset, folder, camera, [robot])
    with pybullet_process.PyBulletProcess(folder, "tiny") as process:
        yield scene, process, folder


def test_everything_in_use_is_loaded_where_mujoco_has_it(home, bullet) -> None:
    scene, process, _ = bullet
    poses = process.ask("poses")
    assert process.num_bodies == len(home.load().object_names) + 1
    for body in scene.bodies:
        assert np.allclose(poses[body.name]["pos"], body.pos, atol=1e-5), body.name
    assert poses["fridge_0"]["joints"]  # its doors move


def test_things_come_to_rest_where_mujoco_has_them_and_sleep_but_the_robot(home, bullet) -> None:
    _, process, _ = bullet
    process.steps(150)
    scene = home.load()
    world = idle_a7.OneWorld(scene, idle_a7.StateModel.of_manifest(scene.tables, scene.manifest))
    for _ in range(150):
        world.engine_step()
    apart = process.positions()["cracker_box_0"] - world.mujoco[1].body("cracker_box_0").xpos
    assert np.linalg.norm(apart) < 0.004  # Bullet's margins are 1 mm on each side
    assert process.ask("moving") == [NAME]


def test_a_picture_shows_the_home(bullet) -> None:
    picture = np.array(bullet[1].ask("picture", size=48))
    assert picture.shape == (48, 48, 3)
    assert picture.std() > 10


def test_each_group_of_an_obj_is_a_hull_of_its_own(tmp_path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    write_obj(tmp_path / "two.obj", [(corners, faces), (corners + 2, faces)])
    lines = (tmp_path / "two.obj").read_text().splitlines()
    assert [line for line in lines if line.startswith("o ")] == ["o convex_0", "o convex_1"]
    assert lines[-1] == "f 6 7 8"


def test_a_scene_that_cannot_be_loaded_is_told_by_its_reason(bullet, tmp_path) -> None:
    description = json.loads((bullet[2] / "bullet_scene.json").read_text())
    description["bodies"][0]["urdf"] = "absent.urdf"
    (tmp_path / "bullet_scene.json").write_text(json.dumps(description))
    with pytest.raises(pybullet_process.PyBulletError, match=r"ended.*Cannot load URDF"):
        pybullet_process.PyBulletProcess(tmp_path)


@pytest.mark.slow
def test_table_a7_runs(tmp_path: Path) -> None:
    args = idle_a7.Args(sizes=(20,), rest_steps=90, rounds=1, seconds=0.02, pictures=False, work=tmp_path, out=tmp_path)
    rows = idle_a7.main(args)
    assert [row["robot"] for row in rows] == [True, False]
    for row in rows:
        assert row["objects"] == row["pybullet_objects"] == 20
        assert row["largest_difference_m"] < 0.01
        assert row["ratios"]["physics: MuJoCo / PyBullet"]["wall"] > 0
    assert (tmp_path / "idle_a7" / "plot.png").stat().st_size > 5_000
    found = json.loads((tmp_path / "idle_a7" / "result.json").read_text())
    assert found["rows"][0]["home"] == "a7_20"
    assert found["machine"]["versions"]["pybullet"] != "absent"
