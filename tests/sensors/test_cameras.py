"""Cameras by name: on the head, on hands, in rooms and any other of the scene, each with images of its own size."""

from __future__ import annotations

import numpy as np
import pytest
from perceiving import Perceiving, matrix

from ig2mj.agents.fetch import Fetch
from ig2mj.agents.humanoid import Humanoid
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.demos.model_hash import appearance_hash
from ig2mj.demos.origin import _without_wrist_cameras
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.process.opengl import GL_BACKENDS, probe_gl
from ig2mj.sensors.base import SensorOptions
from ig2mj.sensors.cameras import _spread, camera_names, camera_view, split_name

SIZE = {"width": 32, "height": 24}

drawn = pytest.mark.skipif(all(probe_gl(b) for b in GL_BACKENDS), reason="no OpenGL draws on this machine")


@pytest.fixture(scope="module")
def world(tiny_home_folder):
    return Perceiving(tiny_home_folder, Humanoid(pos=(0, -1.2, 0.55), quat=(0.7071, 0, 0, 0.7071)), worlds=2)


@drawn
def test_images_of_several_cameras_have_their_own_sizes_and_leave_the_heads_as_they_are(world):
    alone = world.see("rgb", **SIZE)["rgb"]
    cameras = {"left_wrist": [40, 16], "right_wrist": 16}
    seen = world.see("left_wrist/rgb", "rgb", "head/depth", "right_wrist/depth", cameras=cameras, **SIZE)
    assert {name: a.shape[1:] for name, a in seen.items()} == {
        "left_wrist/rgb": (16, 40, 3),
        "rgb": (24, 32, 3),
        "head/depth": (24, 32, 1),
        "right_wrist/depth": (16, 16, 1),
    }
    np.testing.assert_array_equal(seen["rgb"], alone)
    assert seen["left_wrist/rgb"].std() > 5


@drawn
def test_flow_of_a_hands_camera_is_of_that_camera(world):
    suite = world.suite("optical_flow", "right_wrist/optical_flow", **SIZE)
    _, memory = world.read(suite)
    assert set(memory.others) == {"right_wrist"}
    still, _ = world.read(suite, memory)
    assert np.abs(still["right_wrist/optical_flow"]).max() < 1e-4
    turned = memory.replace(
        others={"right_wrist": (memory.others["right_wrist"][0] + 0.05, memory.others["right_wrist"][1])}
    )
    flow, _ = world.read(suite, turned)
    assert np.abs(flow["right_wrist/optical_flow"]).max() > 0.01 and np.abs(flow["optical_flow"]).max() < 1e-4


@pytest.mark.parametrize("robot", [Humanoid(pos=(0, -1.2, 0.55)), Fetch(pos=(0, -1.2, 0))], ids=["humanoid", "fetch"])
def test_a_hands_camera_looks_at_where_the_hand_grasps(tiny_home_folder, robot):
    import ig2mj

    scene = ig2mj.load_scene(tiny_home_folder, agents=[robot])
    data = scene.start_data()
    wrists = scene.manifest.agents[0].wrist_cameras
    assert set(wrists) == {"humanoid": {"left_wrist", "right_wrist"}, "fetch": {"right_wrist"}}[robot.name]
    rays = robot.hand_rays()
    for name, camera in wrists.items():
        palm = rays[0 if name == "left_wrist" or len(rays) == 1 else 1]
        body, eye = data.body(palm.palm), data.cam(camera)
        grasp = body.xpos + body.xmat.reshape(3, 3) @ palm.grasp_point
        offset = eye.xmat.reshape(3, 3).T @ (grasp - eye.xpos)
        assert 0.05 < -offset[2] < 0.4 and np.abs(offset[:2]).max() < 0.35 * -offset[2]


def test_a_riding_camera_has_the_pose_that_mujoco_gives_it(world):
    view = world.engine.view(world.physics)
    camera = camera_view(world.scene, world.controller, 0, "left_wrist")
    pos, quat = (np.asarray(a)[1] for a in camera.pose(view, world.state))
    data = world.engine.to_mujoco(world.physics, 1)[1].cam("humanoid/left_wrist")
    np.testing.assert_allclose(pos, data.xpos, atol=1e-5)
    np.testing.assert_allclose(matrix(quat), data.xmat.reshape(3, 3), atol=1e-5)


def test_the_camera_of_a_room_is_that_of_the_room_that_the_robot_is_in():
    import ig2mj
    from ig2mj.engine.registry import make_engine

    def camera_of(room: str):
        home = ig2mj.load_scene("small_home")
        x, y = home.rooms.centre(room)
        scene = ig2mj.load_scene("small_home", agents=[TurtleBot(pos=(float(x), float(y), 0))])
        view = camera_view(scene, TurtleBot().controller(scene.tables, 0), 0, "room")
        engine = make_engine("native", scene, 1)
        physics = engine.reset()
        return np.asarray(view.pose(engine.view(physics), None)[0])[0], scene.start_data().cam(room).xpos

    for room in ("kitchen_0", "living_room_0"):
        found, expected = camera_of(room)
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_cells_without_a_room_belong_to_the_nearest_one():
    cells = np.array([[0, -1, -1, 1], *[[-1] * 4] * 3], np.int32)
    assert _spread(cells).tolist() == [[0, 0, 1, 1]] * 4


def test_what_there_is_no_camera_for_is_refused(world, tiny_home_folder):
    assert split_name("rgb") == ("head", "rgb") and split_name("humanoid/eye/rgb") == ("humanoid/eye", "rgb")
    with pytest.raises(UnknownNameError, match=r"'right_wrst'.*right_wrist"):
        world.suite("right_wrst/rgb")
    with pytest.raises(EngineError, match="'scan' has no images of a camera"):
        world.suite("room/scan")
    with pytest.raises(EngineError, match="'left_wrist' = \\[0, 3\\]"):
        SensorOptions.of({"cameras": {"left_wrist": [0, 3]}})
    trolley = Perceiving(tiny_home_folder, TurtleBot(pos=(0, -1.2, 0)))
    with pytest.raises(EngineError, match="'turtlebot' has no camera 'right_wrist'"):
        trolley.suite("right_wrist/rgb")
    assert "head" in camera_names(trolley.scene) and "right_wrist" not in camera_names(trolley.scene)


def test_cameras_on_hands_do_not_count_in_the_hash_of_what_is_visible(world):
    before = _without_wrist_cameras(world.scene)
    assert before.ncam == world.scene.model.ncam - 2
    assert appearance_hash(before) == appearance_hash(world.scene.model)
