"""The page as a browser shows it: headless Chromium, drawing in software."""

from __future__ import annotations

import io
import shutil

import numpy as np
import pytest
from PIL import Image

from ig2mj.engine.registry import make_engine
from ig2mj.scene.scene import load_scene
from ig2mj.web.access import access_for
from ig2mj.web.sources import Home
from ig2mj.worlds.core import Core
from ig2mj.worlds.rules import Rules

pytest.importorskip("viser")
playwright = pytest.importorskip("playwright.sync_api")

TOKEN = "a-token-of-twenty-letters"
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def browser():
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("there is no Chromium here")
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=program, args=[*SOFTWARE, "--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def viewer():
    from ig2mj.web.viewer import WebViewer

    scene = load_scene("small_home")
    rules = Rules.of_scene(scene)
    source = Home(scene, Core(make_engine("native", scene, 1), rules), rules.compiled("(open fridge_0)"))
    with WebViewer(source, access_for("127.0.0.1", 0, TOKEN)) as made:
        yield made


@pytest.fixture
def page(browser, viewer):
    """A page that came in by its token; also what it asked other hosts for, and its errors."""
    context = browser.new_context(viewport={"width": 900, "height": 600})
    opened = context.new_page()
    opened.set_default_timeout(120_000)
    opened.strangers, opened.errors = [], []
    here = (f"http://127.0.0.1:{viewer.port}", "blob:", "data:", "about:")
    opened.on("request", lambda r: None if r.url.startswith(here) else opened.strangers.append(r.url))
    opened.on("pageerror", lambda e: opened.errors.append(str(e)))
    opened.goto(viewer.url, wait_until="commit")
    opened.get_by_text("bodies that moved").wait_for()
    yield opened
    context.close()


def picture(page) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), float)


def test_the_page_shows_the_home_and_asks_no_other_host_for_anything(page, viewer):
    page.wait_for_timeout(8000)
    seen = picture(page)[:, :560]
    assert seen.std() > 15 and len(np.unique(seen.reshape(-1, 3).astype(int) // 16, axis=0)) > 60
    assert page.get_by_text("(open fridge_0)").is_visible()
    assert page.strangers == [] and page.errors == []
    assert page.url == f"http://127.0.0.1:{viewer.port}/"  # no token in it


def test_buttons_and_lists_of_the_panel_work(page, viewer):
    page.get_by_role("button", name="Pause").click()
    page.get_by_text("paused").wait_for()
    assert not viewer.runner.playing
    viewer.controls.choose(viewer.runner.source.scene.object_index("fridge_0"))
    page.get_by_text("fridge, fixed").wait_for()
    page.get_by_role("button", name="Play").click()
    page.get_by_text("x real time").wait_for()


def test_a_stranger_gets_a_form_and_comes_in_with_the_token(browser, viewer):
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(120_000)
    page.goto(f"http://127.0.0.1:{viewer.port}/")
    page.get_by_label("token").fill("not-the-right-token-at-all")
    page.get_by_role("button", name="Open").click()
    page.get_by_text("That is not the token").wait_for()
    page.get_by_label("token").fill(TOKEN)
    page.get_by_role("button", name="Open").click()
    page.get_by_text("bodies that moved").wait_for()
    context.close()


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)], ids=["desktop", "phone"])
def test_buttons_of_the_selected_object_let_a_robot_act(browser, tiny_home_folder, size):
    from ig2mj.planning import problem_of
    from ig2mj.web.planning import Planned
    from ig2mj.web.viewer import WebViewer

    source = Planned(problem_of(str(tiny_home_folder), "(toggled_on stove)"))
    with WebViewer(source, access_for(None, 0)) as viewer:
        page = browser.new_page(viewport=dict(zip(("width", "height"), size, strict=True)))
        page.set_default_timeout(120_000)
        page.goto(viewer.url, wait_until="commit")
        page.get_by_text("its hands are empty").wait_for()
        viewer.controls.choose(source.scene.object_index("stove"))
        viewer.runner.speed = 10.0
        page.get_by_role("button", name="Switch on").click()
        page.get_by_text("toggle_on stove").wait_for()
        for _ in range(300):
            if source.report.rows and source.report.rows[-1][2] != "now":
                break
            page.wait_for_timeout(500)
        (_, text, state, _), *_ = source.report.rows
        assert text == "toggle_on stove" and state != "now"
        page.get_by_text(state).first.wait_for()
        page.close()
