"""Table A.7 with our robots: idle Fetch, TurtleBot or humanoid, 128x128 RGB, in the scene and at (1000, 1000, 1000).

    python -m benchmarks.speed.idle_robots [--sizes 20 60 120] [--robots fetch humanoid] [--no-pictures] [--out DIR]

The paper's row is of "all objects physically simulated" with Fetch in the scene; its script puts Fetch at (1000, 1000,
1000), where it falls all the time: both are measured, and the home without a robot
next to them. Zero action: the robot's servos hold it. Homes rest 60 s; then MuJoCo alone, our physics with its view,
with all states, and with pictures are timed in short blocks in turn on one core. A step is 1/30 s, four physics steps.
Rates are medians by processor time.
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
from typing import Any

import tyro
from rich.console import Console

import ig2mj
from benchmarks.harness import plots, results
from benchmarks.harness.gl_camera import gl_backend
from benchmarks.harness.homes import WORK, Home, made_homes, named_homes
from benchmarks.harness.one_world import OneWorld
from benchmarks.harness.timing import Block, interleave, timed
from ig2mj.agents import Fetch, Humanoid, TurtleBot
from ig2mj.states.model import StateModel

SIZE = 128
"""Pixels."""

FAR = (1000.0, 1000.0, 1000.0)
"""m: where iGibson's script puts the robot."""

ROBOTS = {"fetch": Fetch, "turtlebot": TurtleBot, "humanoid": Humanoid}

LABELS = {
    "mujoco": "MuJoCo alone",
    "engine": "physics + view",
    "ig2mj": "with states",
    "ig2mj_rgb": f"with states, {SIZE}x{SIZE} RGB",
}


@dataclasses.dataclass
class Args:
    """What to measure."""

    sizes: tuple[int, ...] = (20, 60, 120)
    """Sizes of the homes made for the benchmark."""
    homes: tuple[str, ...] = ()
    """Shipped homes or converted folders instead."""
    robots: tuple[str, ...] = ("fetch", "humanoid")
    """Which robots idle."""
    rest_steps: int = 1800
    """Steps before anything is timed."""
    rounds: int = 9
    """Blocks of each kind."""
    seconds: float = 0.15
    """Length of a block."""
    pictures: bool = True
    """Time pictures too."""
    work: pathlib.Path = WORK
    """Folder for what is built on the way."""
    out: pathlib.Path = results.RESULTS
    """Folder for results."""


def measure(home: Home, robot: str | None, far: bool, args: Args, backend: str | None) -> dict[str, Any]:
    """One home with one robot, or without any."""
    agents = []
    if robot is not None:
        (x, y, z), yaw = home.robot_place()
        made = ROBOTS[robot]
        pos = FAR if far else (x, y, z + made().pos[2])
        agents = [made(pos=pos, quat=(math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))]
    scene = ig2mj.load_scene(home.folder, agents)
    world = OneWorld(scene, StateModel.of_manifest(scene.tables, scene.manifest))
    for _ in range(args.rest_steps):
        world.step()
    blocks: dict[str, Block] = {
        "mujoco": timed(world.bare().step),
        "engine": timed(world.engine_step),
        "ig2mj": timed(world.step),
    }
    if agents and backend is not None:
        blocks["ig2mj_rgb"] = timed(world.with_images(agents[0], ["rgb"], SIZE))
    rates = interleave(blocks, args.seconds, args.rounds)
    return {
        "home": home.name,
        "robot": robot,
        "far": far,
        "objects": len(scene.object_names) - len(agents),
        "awake": world.awake(),
        "rates": {name: dataclasses.asdict(rate) for name, rate in rates.items()},
    }


def label(row: dict[str, Any]) -> str:
    """What a row is of."""
    if row["robot"] is None:
        return row["home"]
    return f"{row['home']} + {row['robot']}{', far away' if row['far'] else ''}"


def main(args: Args) -> list[dict[str, Any]]:
    console = Console()
    with console.status("building and converting the homes"):
        homes = named_homes(list(args.homes)) if args.homes else made_homes(args.sizes, args.work)
        backend = gl_backend() if args.pictures else None
    rows = []
    for home in homes:
        for robot, far in [(None, False), *((robot, far) for robot in args.robots for far in (False, True))]:
            with console.status(f"measuring {home.name}, {robot or 'no robot'}{', far away' if far else ''}"):
                rows.append(measure(home, robot, far, args, backend))
    lines = [
        [label(row), *(f"{row['rates'][n]['steps_per_cpu_s']:,.0f}" if n in row["rates"] else "" for n in LABELS)]
        for row in rows
    ]
    tables = [
        results.table(
            "Table A.7 with our robots: steps of 1/30 s per second of one core", ["", *LABELS.values()], lines
        )
    ]
    settings = {"image": SIZE, "rest_steps": args.rest_steps, "rounds": args.rounds, "opengl": backend}
    folder = results.save("idle_robots", CORE, settings, rows, tables, args.out)
    plots.grouped_bars(
        folder / "plot.png",
        "Idle robots, one core",
        [label(row) for row in rows],
        plots.rates(rows, LABELS),
        "steps of 1/30 s per second of one core",
    )
    return rows


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
