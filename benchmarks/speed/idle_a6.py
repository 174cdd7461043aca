"""Table A.6: a TurtleBot idles in a home; steps of 1/30 s per second, with and without 512x512 RGB-D.

    python -m benchmarks.speed.idle_a6 [HOME ...] [--steps 2000] [--no-pictures] [--out DIR]

Protocol of iGibson's benchmark: four physics steps of 1/120 s in a step, zero action, all extended states
on, 2000 steps; a home's value is the mean over its last 100 steps, by when most objects are asleep. The table gives
mean, largest and smallest value over the homes. With pictures, every step of the last 100 also reads the sensors
`rgb` and `depth` of the robot's eye (the steps before them do not, which changes nothing but the time this takes). The
last 100 are taken several times, all kinds in turn, and the median given, by processor time. HOME is the name of a
shipped home or a converted folder; without any, all shipped homes, or where there are none those made for benchmarks.
"""

from __future__ import annotations

if __name__ == "__main__":
    from benchmarks.harness import timing

    CORE = timing.one_core()  # before JAX and OpenGL start threads
else:
    CORE = -1

import dataclasses
import math
import pathlib
import time
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track

import ig2mj
from benchmarks.harness import plots, results
from benchmarks.harness.gl_camera import gl_backend
from benchmarks.harness.homes import WORK, Home, made_homes, named_homes, shipped_homes
from benchmarks.harness.one_world import OneWorld
from benchmarks.harness.timing import interleave, timed
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.states.model import StateModel

SIZE = 512
"""Pixels."""

LAST = 100
"""Steps at the end that count."""

PAPER = {"iGibson 1.0": (100, 150, 68), "iGibson 2.0": (125, 217, 73)}
"""Mean, largest, smallest over 15 homes, with RGB-D, on an i7-5930K and a GTX 1080 Ti (paper, Table A.6)."""


@dataclasses.dataclass
class Args:
    """What to measure."""

    homes: tyro.conf.Positional[tuple[str, ...]] = ()
    """Homes, by name or folder."""
    steps: int = 2000
    """Steps in all."""
    repeats: int = 5
    """How often the last 100 are measured."""
    pictures: bool = True
    """Measure with pictures too."""
    work: pathlib.Path = WORK
    """Folder for what is built on the way."""
    out: pathlib.Path = results.RESULTS
    """Folder for results."""


def measure(home: Home, args: Args, backend: str | None) -> dict[str, Any]:
    """One home: rates over its last steps, and the rate of every 20 steps on the way there."""
    place = home.robot_place()
    start = time.perf_counter()
    pos, yaw = place
    robot = TurtleBot(pos=pos, quat=(math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))
    scene = ig2mj.load_scene(home.folder, [robot])
    load_seconds = time.perf_counter() - start
    world = OneWorld(scene, StateModel.of_manifest(scene.tables, scene.manifest))
    start = time.perf_counter()
    world.step()  # compiles
    compile_seconds = time.perf_counter() - start
    course = [20 / timed(world.step)(20)[1] for _ in range(max(1, (args.steps - LAST) // 20))]
    row: dict[str, Any] = {
        "home": home.name,
        "objects": len(scene.object_names),
        "dofs": int(scene.model.nv),
        "load_s": round(load_seconds, 2),
        "compile_s": round(compile_seconds, 2),
        "course": [round(v, 1) for v in course],
        "awake": [name for name in world.awake() if name != robot.name],
    }
    blocks = {"mujoco": timed(world.bare().step), "ig2mj": timed(world.step)}
    if backend is not None:
        blocks["ig2mj_rgbd"] = timed(world.with_images(robot, ["rgb", "depth"], SIZE))
    rates = interleave(blocks, 0.0, args.repeats, steps=LAST)
    return row | {"rates": {name: dataclasses.asdict(rate) for name, rate in rates.items()}}


KINDS = {
    "mujoco": "MuJoCo alone",
    "ig2mj": "ig2mj, all states",
    "ig2mj_rgbd": f"ig2mj, all states, {SIZE}x{SIZE} RGB-D",
}


def summary(rows: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Mean, largest, smallest over the homes, per kind."""
    found = {}
    for key, label in KINDS.items():
        values = [row["rates"][key]["steps_per_cpu_s"] for row in rows if key in row["rates"]]
        if values:
            found[label] = {"mean": float(np.mean(values)), "max": max(values), "min": min(values)}
    return found


def tables(rows: list[dict[str, Any]]) -> list:
    """The paper's table with ours below it, and one line per home."""
    paper = [[f"{name} (paper, RGB-D, with GPU)", *(f"{v}" for v in values)] for name, values in PAPER.items()]
    ours = [[label, *(f"{v[k]:,.0f}" for k in ("mean", "max", "min"))] for label, v in summary(rows).items()]
    homes = [
        [
            row["home"],
            str(row["objects"]),
            *(f"{row['rates'][key]['steps_per_cpu_s']:,.0f}" if key in row["rates"] else "" for key in KINDS),
            str(len(row["awake"])),
            f"{row['load_s']:.1f}",
            f"{row['compile_s']:.1f}",
        ]
        for row in rows
    ]
    columns = ["home", "objects", *KINDS.values(), "awake", "load s", "compile s"]
    return [
        results.table(
            f"Table A.6: steps of 1/30 s per second of one core, over {len(rows)} homes",
            ["", "mean", "max", "min"],
            paper + ours,
        ),
        results.table(f"Per home: mean of the last {LAST} steps", columns, homes),
    ]


def main(args: Args) -> list[dict[str, Any]]:
    console = Console()
    with console.status("looking for homes"):
        homes = named_homes(list(args.homes)) if args.homes else shipped_homes() or made_homes(work=args.work)
        backend = gl_backend() if args.pictures else None
    rows = [measure(home, args, backend) for home in track(homes, "measuring homes", console=console)]
    settings = {"image": SIZE, "steps": args.steps, "last": LAST, "repeats": args.repeats, "opengl": backend}
    folder = results.save("idle_a6", CORE, settings | {"summary": summary(rows)}, rows, tables(rows), args.out)
    course = {row["home"]: row["course"] for row in rows}
    plots.lines(
        folder / "plot.png", "Idle homes come to rest", course, 20, "step", "steps of 1/30 s per second of one core"
    )
    return rows


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
