"""The viewer in the browser: pictures a second that several pages get while everything in a home moves.

    python benchmarks/web_viewer.py [--home birch] [--pages 3] [--seconds 20]

All loose objects are thrown about (a random push every half second), so that every one of them is sent in every
picture. Pages are programs without a screen in a process of their own: they take and decode what a browser would, and
draw nothing. What a browser itself can draw depends on its graphics card.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import pathlib
import sys
import threading
import time
from typing import Any

import numpy as np
import tyro

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests"))

from results import keep_row, machine

PUSH = 0.5
"""m/s and rad/s."""


@dataclasses.dataclass
class Args:
    """What to measure."""

    home: str = "birch"
    pages: int = 3
    seconds: float = 20.0
    out: pathlib.Path | None = None
    """A file to which the row is added."""


def watch(port: int, pages: int, seconds: float, found: Any) -> None:
    """Opens pages one after the other, and counts what they get."""
    from web_page import Page

    opened, opening = [], []
    for _ in range(pages):
        start = time.perf_counter()
        page = Page(port)
        page.receive(lambda page=page: "ReplayDoneMessage" in page.messages)
        opening.append(time.perf_counter() - start)
        opened.append(page)
    rows: list[dict[str, float]] = [{} for _ in opened]

    def count(page: Page, row: dict[str, float]) -> None:
        before, moved, pictures = page.size, 0, 0
        start = time.perf_counter()
        page.messages.clear()
        while time.perf_counter() - start < seconds:
            page.receive(lambda seen=moved: page.messages.get("SetPositionMessage", 0) > seen, timeout=1.0)
            pictures += page.messages.get("SetPositionMessage", 0) > moved
            moved = page.messages.get("SetPositionMessage", 0)
        taken = time.perf_counter() - start
        row.update(pictures=pictures / taken, poses=moved / taken, kilobytes=(page.size - before) / taken / 1000)

    threads = [threading.Thread(target=count, args=pair) for pair in zip(opened, rows, strict=True)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found.put((opening, rows, time.process_time()))


class Thrown:
    """A home in which all loose objects are pushed about; else as the source."""

    def __init__(self, source: Any):
        self._source, self._rng, self._steps = source, np.random.default_rng(0), 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)

    def step(self) -> None:
        if self._steps % 15 == 0:
            model, data = self._source.mujoco(0)
            data.qvel[:] += self._rng.uniform(-PUSH, PUSH, model.nv)
        self._steps += 1
        self._source.step()


def main(args: Args) -> None:
    """Measures, prints, writes."""
    from ig2mj.engine.registry import make_engine
    from ig2mj.scene.scene import load_scene
    from ig2mj.web.access import access_for
    from ig2mj.web.sources import Home
    from ig2mj.web.viewer import WebViewer
    from ig2mj.worlds.core import Core
    from ig2mj.worlds.rules import Rules

    scene = load_scene(args.home)
    source: Any = Thrown(Home(scene, Core(make_engine("native", scene, 1), Rules.of_scene(scene))))
    spawn = multiprocessing.get_context("spawn")
    with WebViewer(source, access_for(None, 0)) as viewer:
        viewer._stopped.wait(2.0)
        found = spawn.Queue()
        process = spawn.Process(target=watch, args=(viewer.port, args.pages, args.seconds, found))
        process.start()
        while viewer.pages < args.pages:
            viewer._stopped.wait(0.1)
        viewer._stopped.wait(1.0)
        frames, steps, poses = viewer.frames, viewer.runner.steps, viewer.stage.sent["poses"]
        clock, work = time.perf_counter(), time.process_time()
        viewer._stopped.wait(args.seconds - 2.0)
        clock, work = time.perf_counter() - clock, time.process_time() - work
        frames, steps = viewer.frames - frames, viewer.runner.steps - steps
        poses = viewer.stage.sent["poses"] - poses
        opening, rows, _ = found.get()
        process.join()
    row = {
        "home": args.home,
        "objects": scene.tables.num_objects,
        "pages": args.pages,
        "pictures_per_second": frames / clock,
        "pictures_per_second_at_pages": [r["pictures"] for r in rows],
        "bodies_per_picture": poses / max(frames, 1),
        "kilobytes_per_second_and_page": float(np.mean([r["kilobytes"] for r in rows])),
        "seconds_until_a_page_has_the_home": max(opening),
        "speed_of_physics": steps * source.period / clock,
        "processor_seconds_per_second": work / clock,
        "processor_ms_per_picture": 1000 * work / max(frames, 1),
    }
    for name, value in row.items():
        print(f"{name:36} {value if not isinstance(value, float) else round(value, 2)}")
    keep_row(row | {"machine": machine(-1)}, args.out)


if __name__ == "__main__":
    main(tyro.cli(Args))
