"""How long a browser takes to show a home: headless Chromium, which draws in software, with nothing in its cache.

    python benchmarks/web_opening.py [--home birch] [--times 5] [--picture out/home.png]

From the address to: the panel's text; the home's geometry (every node of the scene is there); a picture in which the
home is drawn. The processor time of Chromium's processes and of the server is given beside the wall time, since on a
busy machine only that says anything. A graphics card makes the last part short: it compiles shaders and draws.
"""

from __future__ import annotations

import argparse
import io
import os
import pathlib
import shutil
import statistics
import time
from typing import Any

import numpy as np
from PIL import Image
from results import keep_row, machine

SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]

DRAWN = 15.0
"""Deviation of the pixels of a picture with a home in it; before, the page has one colour."""

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


def opened(browser: Any, url: str, server: Any, pid: int, picture: pathlib.Path | None) -> dict[str, float]:
    """Opens the page once."""
    context = browser.new_context(viewport={"width": 900, "height": 600})
    page = context.new_page()
    page.set_default_timeout(120_000)
    own, theirs, began = time.process_time(), processor_seconds(pid), time.perf_counter()
    row: dict[str, float] = {}

    def note(name: str) -> None:
        row[f"{name}_s"] = time.perf_counter() - began
        row[f"{name}_processor_s"] = processor_seconds(pid) - theirs

    page.goto(url, wait_until="commit")
    note("address")
    page.get_by_text("bodies that moved").wait_for()
    note("panel")
    while True:
        seen = page.screenshot(clip={"x": 0, "y": 0, "width": 560, "height": 600})
        if np.asarray(Image.open(io.BytesIO(seen)).convert("RGB"), float).std() > DRAWN:
            break
    note("drawn")
    row["server_processor_s"] = time.process_time() - own
    if picture is not None:
        page.wait_for_timeout(3000)
        picture.parent.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=str(picture))
    context.close()
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--home", default="birch")
    parser.add_argument("--times", type=int, default=5)
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
        rows = []
        for k in range(args.times):
            last = args.picture if k == args.times - 1 else None
            rows.append(opened(browser, viewer.url, viewer, os.getpid(), last))
        browser.close()
    row: dict[str, Any] = {"home": args.home, "times": args.times}
    for name in rows[0]:
        values = [r[name] for r in rows]
        row[name] = {"least": round(min(values), 2), "median": round(statistics.median(values), 2)}
    keep_row(row | {"machine": machine(-1)}, args.out)


if __name__ == "__main__":
    main()
