"""OpenGL, the ray caster and pages of browsers show a home in the same light: 24 views of birch."""

from __future__ import annotations

import io
import math
import shutil

import mujoco
import numpy as np
import pytest
from PIL import Image

from ig2mj.agents.humanoid import Humanoid
from ig2mj.engine.registry import make_engine
from ig2mj.looks import visual_of
from ig2mj.process.opengl import GL_BACKENDS, probe_gl
from ig2mj.scene.scene import load_scene
from ig2mj.sensors.suite import CAMERAS
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.viewer.offscreen import FreeView, render
from ig2mj.viewer.room_views import room_view

MOST = 6.0
"""Mean absolute difference of a channel, of 255."""

WIDTH, HEIGHT, FOVY = 96, 72, 60.0
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.skipif(all(probe_gl(b) for b in GL_BACKENDS), reason="no OpenGL draws on this machine"),
]


@pytest.fixture(scope="module")
def home():
    return load_scene("birch")


@pytest.fixture(scope="module")
def views(home) -> list[FreeView]:
    found = []
    for name in home.rooms.names:
        view = room_view(home, name)
        turn, tilt = math.radians(view.azimuth), math.radians(view.elevation)
        ahead = np.array([math.cos(tilt) * math.cos(turn), math.cos(tilt) * math.sin(turn), math.sin(tilt)])
        eye = np.asarray(view.lookat) - view.distance * ahead
        for k in range(5):
            turn = math.radians(view.azimuth + 20.0 * (k - 2))
            ahead = np.array([math.cos(tilt) * math.cos(turn), math.cos(tilt) * math.sin(turn), math.sin(tilt)])
            found.append(FreeView(tuple((eye + ahead).tolist()), 1.0, math.degrees(turn), view.elevation, fovy=FOVY))
    return found[:24]


def eye_of(view: FreeView) -> tuple[np.ndarray, np.ndarray]:
    """Position, and orientation of a camera that looks along its -z axis."""
    turn, tilt = math.radians(view.azimuth), math.radians(view.elevation)
    z = -np.array([math.cos(tilt) * math.cos(turn), math.cos(tilt) * math.sin(turn), math.sin(tilt)])
    x = np.array([math.sin(turn), -math.cos(turn), 0.0])
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.stack([x, np.cross(z, x), z], 1).ravel())
    return np.asarray(view.lookat) + view.distance * z, quat


def seen_by(home, views, engine_name: str) -> np.ndarray:
    """Images of a robot's kind of camera, on an engine."""
    import importlib

    engine = make_engine(engine_name, home, 1)
    module, kind = CAMERAS[engine.renderer].split(":")
    model = StateModel.of_manifest(home.tables, home.manifest)
    camera = home.model.camera(1).name
    made = getattr(importlib.import_module(module), kind)(
        engine, model, [camera], width=WIDTH, height=HEIGHT, particles=4, looks="day"
    )
    physics = engine.reset()
    view, states = engine.view(physics), initial_states(model, 1)
    images = []
    for one in views:
        pos, quat = eye_of(one)
        eyes = {camera: (pos[None].astype(np.float32), quat[None].astype(np.float32))}
        images.append(np.asarray(made(physics, view, states, eyes).rgb)[0, 0].astype(float))
    return np.stack(images)


def test_the_ray_caster_and_opengl_agree(views):
    home = load_scene("birch", agents=[Humanoid(pos=(1.2, -1.2, 0.55))])  # it has a costume, and arms that follow
    native, warp = (seen_by(home, views, name) for name in ("native", "warp"))
    apart = np.abs(native - warp).mean(axis=(0, 1, 2))
    print("ray caster", apart, np.abs(native - warp).mean(axis=(1, 2, 3)).max())
    assert (apart <= MOST).all(), apart


def test_pages_and_opengl_agree(home, views):
    pytest.importorskip("viser")
    playwright = pytest.importorskip("playwright.sync_api")
    from ig2mj.web.access import access_for
    from ig2mj.web.sources import Home
    from ig2mj.web.viewer import WebViewer
    from ig2mj.worlds.core import Core
    from ig2mj.worlds.rules import Rules

    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("there is no Chromium here")
    rules = Rules.of_scene(home)
    source = Home(home, Core(make_engine("native", home, 1), rules), None)
    visual = visual_of(home)
    data, total = visual.data(home.model, home.start_data()), np.zeros(3)
    with (
        WebViewer(source, access_for("127.0.0.1", 0, "a-token-of-twenty-letters")) as viewer,
        playwright.sync_playwright() as started,
    ):
        browser = started.chromium.launch(executable_path=program, args=[*SOFTWARE, "--no-sandbox"])
        page = browser.new_context(viewport={"width": 760, "height": 360}).new_page()
        page.set_default_timeout(120_000)
        page.goto(viewer.url, wait_until="commit")
        page.get_by_text("bodies that moved").wait_for()
        page.wait_for_timeout(8000)
        for view in views:
            pos, _ = eye_of(view)
            for client in viewer.stage._server.get_clients().values():
                client.camera.position, client.camera.look_at = tuple(pos), view.lookat
                client.camera.fov, client.camera.near = math.radians(FOVY), 0.02
            page.wait_for_timeout(1200)
            shot = Image.open(io.BytesIO(page.locator("canvas").first.screenshot())).convert("RGB")
            drawn = render(visual.model, data, view, width=shot.width, height=shot.height)
            right = slice(290, None)  # on the left there is a notice
            total += np.abs(np.asarray(shot, float) - drawn)[:, right].mean(axis=(0, 1)) / len(views)
        browser.close()
    print("pages", total)
    assert (total <= MOST).all(), total
