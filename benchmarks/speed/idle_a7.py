"""Table A.7: an idle home of about 20, 60 and 120 objects, 128x128 RGB, next to PyBullet on the same scenes.

    python -m benchmarks.speed.idle_a7 [--sizes 20 60] [--dataset ROOT --scenes NAME ...] [--no-pictures] [--out DIR]

Both engines load the same scenes from the same URDF source, begin from the same poses, rest 60 s and are then timed in
short blocks in turn on one processor core: A B C A B C ..., medians. PyBullet runs with iGibson's settings (see
`pybullet_worker.py`). A step is 1/30 s, four physics steps of 1/120 s. Twice: with a body of a TurtleBot's size idling
in the home, as robots in iGibson never sleep, and without. The ratio is the result.
"""

from __future__ import annotations

if __name__ == "__main__":
    from benchmarks.harness import timing

    CORE = timing.one_core()  # before JAX and OpenGL start threads
else:
    CORE = -1

import contextlib
import dataclasses
import pathlib
import tempfile
from typing import Any

import numpy as np
import tyro
from rich.console import Console

from benchmarks.harness import plots, results
from benchmarks.harness.gl_camera import Camera, gl_backend
from benchmarks.harness.homes import WORK, Home, Place, convert, made_homes
from benchmarks.harness.idle_robot import NAME, eye_camera, write_robot_urdf
from benchmarks.harness.one_world import OneWorld
from benchmarks.harness.timing import Block, Rate, interleave, timed
from benchmarks.peers.pybullet_process import PyBulletError, PyBulletProcess
from benchmarks.peers.pybullet_scene import write_bullet_scene
from ig2mj.states.model import StateModel

SIZE = 128
"""Pixels."""

FIRST = 60
"""Steps at the start that are timed by themselves: objects fall onto what is below them and come to rest.

Bullet lets nothing sleep before two seconds, MuJoCo as soon as an object lies still for some steps.
"""

LABELS = {
    "mujoco": "MuJoCo alone",
    "engine": "ig2mj physics + view",
    "ig2mj": "ig2mj with states",
    "pybullet": "PyBullet physics only",
    "ig2mj_rgb": "ig2mj with states, RGB",
    "pybullet_egl": "PyBullet, RGB (OpenGL)",
    "pybullet_tiny": "PyBullet, RGB (TinyRenderer)",
}


@dataclasses.dataclass
class Args:
    """What to measure."""

    sizes: tuple[int, ...] = (20, 60, 120)
    """Sizes of the homes made for the benchmark."""
    dataset: pathlib.Path | None = None
    """A dataset root in iGibson's layout to take scenes from instead."""
    scenes: tuple[str, ...] = ()
    """Scenes of that dataset; default all."""
    rest_steps: int = 1800
    """Steps before anything is timed."""
    rounds: int = 9
    """Blocks of each kind."""
    seconds: float = 0.15
    """Length of a block."""
    pictures: bool = True
    """Time the renderers too."""
    pybullet: bool = True
    """Measure PyBullet as well; without it there are no ratios."""
    work: pathlib.Path = WORK
    """Folder for what is built on the way."""
    out: pathlib.Path = results.RESULTS
    """Folder for results."""


def measure(home: Home, place: Place | None, args: Args, backend: str | None) -> dict[str, Any]:
    """One home, with an idle robot at `place` or without."""
    assert home.dataset is not None
    scene = home.load(place)
    camera = eye_camera(*(place or home.robot_place()))
    world = OneWorld(scene, StateModel.of_manifest(scene.tables, scene.manifest))
    with contextlib.ExitStack() as stack:
        falling = OneWorld(scene, world.model)
        first = {"engine": timed(falling.engine_step)(FIRST)}
        for _ in range(args.rest_steps):
            world.step()
        blocks: dict[str, Block] = {
            "mujoco": timed(world.bare().step),
            "engine": timed(world.engine_step),
            "ig2mj": timed(world.step),
        }
        compared: dict[str, Any] = {}
        folder = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if args.pybullet:
            robot = [] if place is None else [write_robot_urdf(folder, *place)]
            bullet = write_bullet_scene(scene, home.dataset, folder, camera, robot)
            bare_bullet = stack.enter_context(PyBulletProcess(folder))
            first["pybullet"] = bare_bullet.steps(FIRST)
            bare_bullet.steps(args.rest_steps)
            compared = _compare(world, bare_bullet, [b.name for b in bullet.bodies if not b.fixed])
            compared["pybullet_objects"] = len({b.object for b in bullet.bodies} - {NAME})
            blocks["pybullet"] = bare_bullet.steps
        notes = []
        if args.pictures and args.pybullet and place is not None:
            blocks |= _with_pictures(stack, world, folder, args, backend, notes)
        rates = interleave(blocks, args.seconds, args.rounds)
    return {
        "home": home.name,
        "robot": place is not None,
        "objects": len(scene.object_names),
        "free_objects": int((~scene.tables.object_fixed & ~scene.tables.object_parked).sum()),
        "dofs": int(scene.model.nv),
        "collision_geoms": int(((scene.model.geom_contype | scene.model.geom_conaffinity) != 0).sum()),
        **compared,
        "notes": notes,
        "first_steps_per_cpu_s": {name: FIRST / cpu for name, (_, cpu) in first.items()},
        "rates": {name: dataclasses.asdict(rate) for name, rate in rates.items()},
        "ratios": _ratios(rates),
    }


def _with_pictures(
    stack: contextlib.ExitStack,
    world: OneWorld,
    folder: pathlib.Path,
    args: Args,
    backend: str | None,
    notes: list[str],
) -> dict[str, Block]:
    """Blocks of steps that each end with a picture from the robot's eye."""
    blocks: dict[str, Block] = {}
    if backend is None:
        notes.append("no OpenGL here: ig2mj's pictures are not timed")
    else:
        model, data = world.mujoco
        camera = stack.enter_context(Camera(model, f"{NAME}/eye", SIZE, backend))

        def step() -> None:
            world.step()
            camera.take(data)

        blocks["ig2mj_rgb"] = timed(step)
    for renderer in ("egl", "tiny"):
        try:
            process = stack.enter_context(PyBulletProcess(folder, renderer))
        except PyBulletError as e:
            notes.append(f"PyBullet's renderer '{renderer}' is not timed: {e}")
            continue
        process.steps(args.rest_steps)
        blocks[f"pybullet_{renderer}"] = lambda count, process=process: process.steps(count, SIZE)
    return blocks


def _compare(world: OneWorld, bullet: PyBulletProcess, bodies: list[str]) -> dict[str, Any]:
    """How far the two engines' free bodies lie apart after the rest, and which are still awake in each."""
    _, data = world.mujoco
    poses = bullet.positions()
    apart = {name: float(np.linalg.norm(poses[name] - data.body(name).xpos)) for name in bodies}
    worst = max(apart, key=lambda name: apart[name], default="")
    return {
        "median_difference_m": float(np.median(list(apart.values()))) if apart else 0.0,
        "largest_difference_m": apart.get(worst, 0.0),
        "largest_difference_of": worst,
        "awake": [name for name in world.awake() if name != NAME],
        "pybullet_awake": [name for name in bullet.ask("moving") if name != NAME],
    }


def _ratios(rates: dict[str, Rate]) -> dict[str, dict[str, float]]:
    """Of ig2mj's rate to PyBullet's, by processor time and on the wall; pictures against the faster renderer."""
    found = {}
    for name, ours, theirs in (
        ("physics: MuJoCo / PyBullet", "mujoco", ["pybullet"]),
        ("ig2mj with states / PyBullet physics only", "ig2mj", ["pybullet"]),
        ("with RGB: ig2mj with states / PyBullet", "ig2mj_rgb", ["pybullet_egl", "pybullet_tiny"]),
    ):
        there = [rates[t] for t in theirs if t in rates]
        if ours in rates and there:
            found[name] = {
                "wall": rates[ours].steps_per_s / max(r.steps_per_s for r in there),
                "cpu": rates[ours].steps_per_cpu_s / max(r.steps_per_cpu_s for r in there),
            }
    return found


def tables(rows: list[dict[str, Any]]) -> list:
    """Rates, ratios, and whether the comparison is fair."""
    names = [name for name in LABELS if any(name in row["rates"] for row in rows)]
    rates = [
        [_label(row), *(f"{row['rates'][n]['steps_per_cpu_s']:,.0f}" if n in row["rates"] else "" for n in names)]
        for row in rows
    ]
    kinds = list(dict.fromkeys(kind for row in rows for kind in row["ratios"]))
    ratios = [
        [
            _label(row),
            *(f"{r['cpu']:.2f} ({r['wall']:.2f})" if (r := row["ratios"].get(kind)) else "" for kind in kinds),
        ]
        for row in rows
    ]
    beside = [row for row in rows if "pybullet" in row["rates"]]
    fair = [
        [
            _label(row),
            f"{row['objects']} / {row['pybullet_objects']}",
            f"{row['free_objects']}",
            f"{1e3 * row['median_difference_m']:.1f}",
            f"{1e3 * row['largest_difference_m']:.1f} ({row['largest_difference_of']})",
            f"{len(row['awake'])} / {len(row['pybullet_awake'])}",
        ]
        for row in beside
    ]
    start = [
        [_label(row), f"{ours:,.0f}", f"{theirs:,.0f}", f"{ours / theirs:.2f}"]
        for row in beside
        for ours, theirs in [(row["first_steps_per_cpu_s"]["engine"], row["first_steps_per_cpu_s"]["pybullet"])]
    ]
    columns = ["home", "objects, ours / PyBullet", "free", "median mm apart", "most mm apart", "awake, ours / PyBullet"]
    return [
        results.table(
            "Table A.7: steps of 1/30 s per second of one core", ["home", *(LABELS[n] for n in names)], rates
        ),
        results.table("Ratios (of wall times, on a machine that was not idle)", ["home", *kinds], ratios),
        results.table(
            f"The first {FIRST} steps: things fall and come to rest (MuJoCo puts to sleep sooner than Bullet)",
            ["home", "ig2mj physics + view", "PyBullet", "ratio"],
            start,
        ),
        results.table("The same scene? After the rest", columns, fair),
    ]


def _label(row: dict[str, Any]) -> str:
    return f"{row['home']}{' + robot' if row['robot'] else ''}"


def main(args: Args) -> list[dict[str, Any]]:
    console = Console()
    with console.status("building and converting the homes"):
        if args.dataset is None:
            homes = made_homes(args.sizes, args.work)
        else:
            from ig2mj_converters.reading.dataset import Dataset

            homes = [convert(args.dataset, s, args.work) for s in args.scenes or Dataset(args.dataset).scenes()]
        backend = gl_backend() if args.pictures else None
    rows = []
    for home in homes:
        for place in (home.robot_place(), None):
            with console.status(f"measuring {home.name}{' with a robot' if place else ''}"):
                rows.append(measure(home, place, args, backend))
    settings = {"image": SIZE, "rest_steps": args.rest_steps, "rounds": args.rounds, "block_s": args.seconds}
    folder = results.save("idle_a7", CORE, settings | {"opengl": backend}, rows, tables(rows), args.out)
    plots.grouped_bars(
        folder / "plot.png",
        "Idle homes, one core",
        [_label(row) for row in rows],
        plots.rates(rows, LABELS),
        "steps of 1/30 s per second of one core",
    )
    return rows


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
