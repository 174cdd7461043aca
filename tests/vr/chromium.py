"""Headless Chromium for tests of pages, and a headset of IWER in it. Tests are skipped where one of these is absent."""

from __future__ import annotations

import contextlib
import pathlib
import shutil
from collections.abc import Iterator
from typing import Any

import pytest

IWER = pathlib.Path(__file__).resolve().parents[2] / "web" / "node_modules" / "iwer" / "build" / "iwer.min.js"

HEADSET = """
const device = window.headset = new IWER.XRDevice(IWER.metaQuest3, {stereoEnabled: true});
device.installRuntime({forceInstall: true});
device.position.set(0, 1.6, 0);
window.pulses = [];
"""
"""Chromium has a `navigator.xr` of its own, without devices."""

PLACE = """([hand, pos, quat, trigger, squeeze]) => {
  const one = headset.controllers[hand];
  one.position.set(...pos);
  one.quaternion.set(...quat);
  one.updateButtonValue("trigger", trigger);
  one.updateButtonValue("squeeze", squeeze);
}"""

STICK = """([hand, x, y]) => headset.controllers[hand].updateAxes("thumbstick", x, y)"""

HEAD = """([pos, quat]) => { headset.position.set(...pos); headset.quaternion.set(...quat); }"""


@contextlib.contextmanager
def chromium(width: int, height: int) -> Iterator[Any]:
    """A browser's window (Playwright's `Page`) that fails the test on errors of the page."""
    playwright = pytest.importorskip("playwright.sync_api")
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("needs Chromium (Debian: apt-get install chromium)")
    arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=program, args=arguments)
        page = browser.new_page(viewport={"width": width, "height": height})
        errors: list[str] = []
        strangers: list[str] = []
        here = ("http://127.0.0.1:", "ws://127.0.0.1:", "blob:", "data:", "about:")
        page.on("request", lambda request: None if request.url.startswith(here) else strangers.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.set_default_timeout(120_000)
        yield page
        browser.close()
        assert errors == [] and strangers == []  # nothing is loaded from other hosts


def wear_headset(page: Any) -> None:
    """To be called before the page is opened."""
    if not IWER.is_file():
        pytest.skip("needs IWER (`make web`)")
    page.add_init_script(path=str(IWER))
    page.add_init_script(HEADSET)
