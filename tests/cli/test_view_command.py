"""`ig2mj view`: pictures, and what it refuses."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from PIL import Image

from ig2mj import cli
from ig2mj.cli.view import _view


@pytest.fixture(scope="module")
def can_draw() -> None:
    from ig2mj.viewer import offscreen

    if all(offscreen.probe(b) is not None for b in ("egl", "osmesa")):
        pytest.skip("no OpenGL without a display here (`ig2mj doctor` tells how to get it)")


@pytest.mark.parametrize("options", [[], ["--from", "2", "-2", "2", "--at", "0", "0", "0.4"], ["--collision"]])
def test_a_picture_has_the_size_asked_for_and_shows_something(can_draw, tiny_home_folder, tmp_path, options):
    file = tmp_path / "out.png"
    status = cli.call(["view", str(tiny_home_folder), "--image", str(file), "--size", "160", "120", *options])
    assert status == 0
    image = np.asarray(Image.open(file))
    assert image.shape == (120, 160, 3)
    assert image.std() > 5


def test_a_free_view_stands_where_it_was_put_and_looks_where_it_was_told(tiny_home):
    eye, target = (1.0, -2.0, 1.5), (0.2, 0.1, 0.4)
    view = _view(tiny_home, None, None, eye, target)
    azimuth, elevation = math.radians(view.azimuth), math.radians(view.elevation)
    forward = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    np.testing.assert_allclose(np.array(view.lookat) - view.distance * forward, eye, atol=1e-9)
    camera, scene = mujoco.MjvCamera(), mujoco.MjvScene(tiny_home.model, maxgeom=1000)
    camera.lookat[:], camera.distance = view.lookat, view.distance
    camera.azimuth, camera.elevation = view.azimuth, view.elevation
    data = mujoco.MjData(tiny_home.model)
    mujoco.mjv_updateScene(
        tiny_home.model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene
    )
    middle = (np.array(scene.camera[0].pos) + np.array(scene.camera[1].pos)) / 2
    np.testing.assert_allclose(middle, eye, atol=1e-4)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--camera", "top", "--from", "0", "0", "1", "--at", "0", "0", "0"], "either --camera or"),
        (["--from", "0", "0", "1"], "must be given together"),
        (["--from", "0", "0", "1", "--at", "0", "0", "1"], "same point"),
        (["--from", "nan", "0", "1", "--at", "0", "0", "0"], "finite"),
        (["--seconds", "-1"], "must be between 0 and"),
        (["--size", "0", "10"], "between 1 and 8192"),
        (["--camera", "no_such_camera"], "no camera is named 'no_such_camera'"),
    ],
)
def test_contradictions_are_one_line_and_status_2(can_draw, tiny_home_folder, tmp_path, capsys, options, says):
    status = cli.call(["view", str(tiny_home_folder), "--image", str(tmp_path / "a.png"), *options])
    assert status == 2
    line = capsys.readouterr().err
    assert says in line
    assert line.count("\n") == 1
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("file", "says"),
    [("a.doc", "not an image format"), ("none/a.png", "does not exist"), ("a", "not an image format")],
)
def test_a_picture_file_that_cannot_be_written_is_told_before_loading(tiny_home_folder, tmp_path, capsys, file, says):
    assert cli.call(["view", str(tiny_home_folder), "--image", str(tmp_path / file)]) == 2
    assert says in capsys.readouterr().err


def test_a_file_that_is_no_scene_is_named(tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("hello")
    assert cli.call(["view", str(tmp_path / "notes.txt")]) == 2
    assert "notes.txt: is not a file of a converted scene" in capsys.readouterr().err


def test_a_missing_scene_is_status_2(tmp_path, capsys):
    assert cli.call(["view", str(tmp_path / "nowhere")]) == 2
    assert "nowhere" in capsys.readouterr().err
