"""How long a browser takes to show a home: headless Chromium, which draws in software, with nothing in its cache.

    python benchmarks/web_opening.py [--home birch] [--times 5] [--picture out/home.png]

From the address to: the page has arrived; the panel's text; a picture in which something of the home is drawn; the last
change of the picture, after which all is there. Each page is opened in a window of its own, whose own start
(about:blank, and the processes that Chromium starts for itself) is over before. The processor time of Chromium and of
the server is given beside the wall time, since on a busy machine only that says anything. A graphics card makes the
last part short: it compiles shaders and draws. With `--again` the window stays, so that what a browser keeps is there.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import shutil
import statistics
import time
from typing import Any

from results import keep_row, machine

SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]

DRAWN = 15.0
"""Deviation of the pixels of a picture with a home in it; before, the page has one colour."""

REST = 1.5
"""Seconds without a change after which a picture is whole."""

TICKS = os.sysconf("SC_CLK_TCK")


def processor_seconds(root: int) -> float:
    """Of a process and all that it started, so far; of those that ended, where their parent waited for them."""
    children: dict[int, list[int]] = {}
    used: dict[int, float] = {}
    for folder in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        pid = int(folder.name)
        children.setdefault(int(fields[1]), []).append(pid)
        used[pid] = sum(map(int, fields[11:15])) / TICKS
    total, left = 0.0, [root]
    while left:
        pid = left.pop()
        total += used.get(pid, 0.0)
        left += children.get(pid, [])
    return total


SPREAD = """() => {
    const canvas = document.querySelector("canvas[data-engine]"), small = document.createElement("canvas");
    if (!canvas || !canvas.width) return 0;
    small.width = small.height = 24;
    const paint = small.getContext("2d", {willReadFrequently: true});
    paint.drawImage(canvas, 0, 0, 24, 24);
    const values = Array.from(paint.getImageData(0, 0, 24, 24).data).filter((_, k) => k % 4 < 3);
    const mean = values.reduce((a, b) => a + b) / values.length;
    return Math.sqrt(values.reduce((a, b) => a + (b - mean) ** 2, 0) / values.length);
}"""
"""Deviation of the pixels of the page's picture of the home, from 0 to 255; the page is too slow to take whole ones."""


def window(browser: Any) -> Any:
    """A new window that has come to rest."""
    page = browser.new_context(viewport={"width": 900, "height": 600}).new_page()
    page.set_default_timeout(120_000)
    page.goto("about:blank")
    page.wait_for_timeout(2500)
    return page


def opened(page: Any, url: str, pid: int, picture: pathlib.Path | None) -> dict[str, float]:
    """Opens the page once."""
    own, theirs, began = time.process_time(), processor_seconds(pid), time.perf_counter()
    row: dict[str, float] = {}

    def note(name: str) -> None:
        row[f"{name}_s"] = time.perf_counter() - began
        row[f"{name}_processor_s"] = processor_seconds(pid) - theirs

    page.goto(url, wait_until="commit")
    note("address")
    page.get_by_text("bodies that moved").wait_for()
    note("panel")
    seen = 0.0
    while seen < DRAWN:
        page.wait_for_timeout(50)
        seen = page.evaluate(SPREAD)
    note("drawn")
    note("whole")
    until = time.perf_counter() + REST
    while time.perf_counter() < until:
        page.wait_for_timeout(50)
        before, seen = seen, page.evaluate(SPREAD)
        if seen != before:
            note("whole")
            until = time.perf_counter() + REST
    row["server_processor_s"] = time.process_time() - own
    if picture is not None:
        page.wait_for_timeout(3000)
        picture.parent.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=str(picture))
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--home", default="birch")
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--again", action="store_true", help="in one window")
    parser.add_argument("--picture", type=pathlib.Path, help="a picture of the last page")
    parser.add_argument("--out", type=pathlib.Path, help="a file to which the row is added")
    args = parser.parse_args()
    from playwright.sync_api import sync_playwright

    from ig2mj.engine.registry import make_engine
    from ig2mj.scene.scene import load_scene
    from ig2mj.web.access import access_for
    from ig2mj.web.sources import Home
    from ig2mj.web.viewer import WebViewer
    from ig2mj.worlds.core import Core
    from ig2mj.worlds.rules import Rules

    program = shutil.which("chromium") or shutil.which("google-chrome")
    assert program is not None, "there is no Chromium here"
    scene = load_scene(args.home)
    source = Home(scene, Core(make_engine("native", scene, 1), Rules.of_scene(scene)))
    with WebViewer(source, access_for(None, 0)) as viewer, sync_playwright() as started:
        viewer.runner.play(False)
        browser = started.chromium.launch(executable_path=program, args=[*SOFTWARE, "--no-sandbox"])
        rows, page = [], None
        for k in range(args.times):
            last = args.picture if k == args.times - 1 else None
            if page is None or not args.again:
                page = window(browser)
            rows.append(opened(page, viewer.url, os.getpid(), last))
            if not args.again:
                page.context.close()
        browser.close()
    row: dict[str, Any] = {"home": args.home, "times": args.times, "again": args.again}
    for name in rows[0]:
        values = [r[name] for r in rows]
        row[name] = {"least": round(min(values), 2), "median": round(statistics.median(values), 2)}
    keep_row(row | {"machine": machine(-1)}, args.out)


if __name__ == "__main__":
    main()
