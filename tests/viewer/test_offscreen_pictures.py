"""Pictures without a display: every backend that says it works draws the same, and none takes the process down."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest

from ig2mj.errors import MissingDependencyError, UnknownNameError
from ig2mj.process import opengl
from ig2mj.viewer import offscreen

XML = """<mujoco><worldbody><light pos="0 0 3"/><camera name="above" pos="0 0 3"/>
  <geom name="red" type="box" size=".5 .25 .1" rgba="1 0 0 1"/>
  <geom name="hidden" type="sphere" group="3" pos="0 .6 0" size=".1" rgba="0 1 0 1"/>
  <body pos="-.7 0 0"><geom name="blue" type="mesh" mesh="tent" rgba="0 0 1 1"/></body>
</worldbody><asset><mesh name="tent" vertex="0 0 0 .2 0 0 0 .2 0 0 0 .2"/></asset></mujoco>"""

BACKENDS = ("egl", "warp")  # a process can use one of EGL and OSMesa only


@pytest.fixture(scope="module")
def scene():
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    yield model, data
    offscreen.close()


@pytest.fixture(params=BACKENDS)
def backend(request):
    reason = offscreen.probe(request.param)
    if reason is not None:
        pytest.skip(f"{request.param} does not draw on this machine: {reason}")
    return request.param


ABOVE = offscreen.FreeView((0, 0, 0), 3, azimuth=90, elevation=-90, height=2.0)


@pytest.mark.slow
def test_an_orthographic_free_view_is_to_scale(scene, backend):
    seen = offscreen.render(*scene, ABOVE, width=200, height=200, segmentation=True, backend=backend)
    assert seen.dtype == np.int32 and seen.shape == (200, 200)
    rows, columns = np.nonzero(seen == scene[0].geom("red").id)
    assert (columns.min(), columns.max()) == pytest.approx((50, 149), abs=1)
    assert (rows.min(), rows.max()) == pytest.approx((75, 124), abs=1)
    blue = np.nonzero(seen == scene[0].geom("blue").id)
    assert len(blue[0]) and blue[1].max() < 60, "x goes to the right"
    assert seen[0, 0] == -1


def test_numbers_of_geoms_are_not_blended_where_they_meet(scene, monkeypatch):
    """Multisampling gives numbers of other geoms, or of none, on OpenGL that heeds it in any pass."""
    if offscreen.default_backend() == "warp":
        pytest.skip("no OpenGL works on this machine")
    samples = []
    real = mujoco.Renderer

    def renderer(model, *arguments, **named):
        samples.append(int(model.vis.quality.offsamples))
        return real(model, *arguments, **named)

    offscreen.close()
    monkeypatch.setattr(mujoco, "Renderer", renderer)
    for segmentation in (True, False):
        offscreen.render(*scene, ABOVE, width=32, height=32, segmentation=segmentation)
    assert samples == [0, 4] and scene[0].vis.quality.offsamples == 4


@pytest.mark.slow
def test_colours_and_shape_of_the_picture(scene, backend):
    image = offscreen.render(*scene, "above", width=64, height=48, backend=backend)
    assert image.dtype == np.uint8 and image.shape == (48, 64, 3)
    red = image[24, 32].astype(int)
    assert red[0] > 60 + red[1] and red[0] > 60 + red[2]


def test_groups_choose_what_is_drawn(scene, backend):
    def ids(groups):
        picture = offscreen.render(
            *scene, ABOVE, width=64, height=64, groups=groups, segmentation=True, backend=backend
        )
        return set(np.unique(picture).tolist())

    green = scene[0].geom("hidden").id
    assert green not in ids((0, 1, 2)) and ids((3,)) == {-1, green}


def test_a_picture_may_be_larger_than_the_models_frame_buffer_and_leaves_the_model_alone(scene):
    model, data = scene
    if offscreen.probe("egl") is not None:
        pytest.skip("EGL does not draw on this machine")
    before = (model.vis.global_.offwidth, model.vis.global_.offheight, model.vis.global_.fovy)
    assert offscreen.render(model, data, ABOVE, width=1000, height=700, backend="egl").shape == (700, 1000, 3)
    assert (model.vis.global_.offwidth, model.vis.global_.offheight, model.vis.global_.fovy) == before


def test_pictures_of_many_sizes_do_not_spoil_one_another(scene):
    """Contexts beyond the number that is kept are freed, each in its own OpenGL context."""
    if offscreen.default_backend() == "warp":
        pytest.skip("no OpenGL without a display here (`ig2mj doctor` tells how to get it)")
    offscreen.close()
    sizes = [(60 + 10 * k, 50) for k in range(offscreen._MAX_RENDERERS)]
    before = [offscreen.render(*scene, ABOVE, width=w, height=h) for w, h in sizes]
    offscreen.render(*scene, ABOVE, width=200, height=50)  # the first of the sizes has to go, the last is current
    for (w, h), picture in list(zip(sizes, before, strict=True))[:0:-1]:
        assert (offscreen.render(*scene, ABOVE, width=w, height=h) == picture).all()


def test_an_unknown_camera_is_named_with_what_there_is(scene):
    with pytest.raises(UnknownNameError, match=r"abov.*near matches: above"):
        offscreen.render(*scene, "abov")
    with pytest.raises(UnknownNameError):
        offscreen.render(*scene, 7)
    with pytest.raises(UnknownNameError):
        offscreen.probe("vulkan")


def test_a_backend_that_kills_its_process_is_only_reported(monkeypatch):
    monkeypatch.setattr(opengl, "_PROBE", "import os; os.abort()")
    _forget_probes()
    try:
        assert "killed by signal 6" in str(offscreen.probe("egl"))
        monkeypatch.setattr(opengl, "_PROBE", "import time; time.sleep(60)")
        assert "did not draw" in str(offscreen.probe("osmesa", timeout_s=0.2))
    finally:
        _forget_probes()


def _forget_probes() -> None:
    offscreen.probe.cache_clear()
    opengl.probe_gl.cache_clear()


def test_where_nothing_draws_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setattr(offscreen, "used_gl", lambda: None)
    monkeypatch.setattr(offscreen, "probe", lambda name: "broken")
    with pytest.raises(MissingDependencyError, match=r"apt-get install .*libegl1"):
        offscreen.default_backend()


def test_a_process_that_drew_exits_without_noise():
    """EGL's display is gone before Python's objects are unless the contexts are freed first."""
    if offscreen.probe("egl") is not None:
        pytest.skip("EGL does not draw on this machine")
    code = (
        "import mujoco; from ig2mj.viewer import offscreen;"
        "m = mujoco.MjModel.from_xml_string('<mujoco/>'); d = mujoco.MjData(m);"
        "print(offscreen.render(m, d, width=16, height=16, backend='egl').shape)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "(16, 16, 3)\n", "")
