"""The share of extended states and predicates in a control step of one world on the native engine.

    python -m benchmarks.speed.states_share [HOME ...] [--sizes 20 60 120] [--out DIR]

Three cases per home: settled (everything asleep), idle robot (one body is awake, as in Tables A.6 and A.7), disturbed
(a floating hand pushes objects about; its motion is recorded once and replayed by every variant, so that all do the
same work). Four variants, in blocks in turn: MuJoCo alone; physics and view; all states too; a goal of ten literals
too. The share is that of states and literals in the last one's time, by processor time.
"""

from __future__ import annotations

if __name__ == "__main__":
    from benchmarks.harness import timing

    CORE = timing.one_core()  # before JAX starts threads
else:
    CORE = -1

import dataclasses
import pathlib
from typing import Any

import jax
import mujoco
import numpy as np
import tyro
from rich.console import Console

import ig2mj
from benchmarks.harness import plots, results
from benchmarks.harness.batch_case import ten_literals
from benchmarks.harness.homes import WORK, Home, made_homes, named_homes
from benchmarks.harness.one_world import BarePhysics, OneWorld
from benchmarks.harness.timing import Block, interleave, timed
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.calibration.pushing import push, start_pushing
from ig2mj.calibration.reach import Reach, find_reach
from ig2mj.predicates.compile import compile_expression
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.worlds.random_streams import episode_keys

VARIANTS = {"mujoco": "MuJoCo", "engine": "view", "states": "states", "goal": "10 literals"}
"""In the order in which each adds to the one before."""


@dataclasses.dataclass
class Args:
    """What to measure."""

    homes: tyro.conf.Positional[tuple[str, ...]] = ()
    """Homes, by name or folder; default those made for benchmarks."""
    sizes: tuple[int, ...] = (20, 60, 120)
    """Sizes of the homes made for benchmarks."""
    rest_steps: int = 150
    """Steps before anything is timed."""
    episode: int = 90
    """Steps of the hand's motion before it starts again."""
    rounds: int = 9
    """Blocks of each kind."""
    seconds: float = 0.15
    """Length of a block."""
    work: pathlib.Path = WORK
    """Folder for what is built on the way."""
    out: pathlib.Path = results.RESULTS
    """Folder for results."""


class Replay:
    """The hand's recorded motion, played to a world again and again from the same start."""

    def __init__(self, world: OneWorld | BarePhysics, controls: np.ndarray, start: Any):
        self._world, self._controls, self._start = world, controls, start
        self._step = 0

    def next(self) -> np.ndarray:
        """Controls [nu] of the next step; brings the world back to the start when the motion is over."""
        number = self._step % len(self._controls)
        self._step += 1
        if number == 0:
            if isinstance(self._world, BarePhysics):
                mujoco.mj_copyData(self._world.data, self._world.model, self._start)
            else:
                self._world.physics = self._world.engine.load(self._world.physics, self._start)
        return self._controls[number]


def record(
    scene: Scene, model: StateModel, reach: Reach, rest_steps: int, steps: int
) -> tuple[OneWorld, np.ndarray, float]:
    """A world at rest with a hand in it, controls [steps, nu] that push objects about, and how many are awake then."""
    world = OneWorld(scene, model)
    for _ in range(rest_steps):
        world.engine_step()
    start = world.engine.export(world.physics, 0)
    key = episode_keys(0, np.zeros(1, np.int32), np.zeros(1, np.int32))
    seconds = world.engine.substeps * world.engine.timestep
    act = jax.jit(lambda pusher, com, palm, step: push(reach, pusher, com, palm, key, step, seconds))
    pusher, rows, awake = start_pushing(reach, 1, scene.model.nu), [], []
    for step in range(steps):
        view = world.view
        pusher = act(pusher, view.object_com, view.agent.base_pos[:, 0], np.array([step], np.int32))
        rows.append(np.asarray(pusher.ctrl[0], np.float64))
        world.engine_step(rows[-1])
        awake.append(int(np.asarray(world.view.awake).sum()))
    world.physics = world.engine.load(world.physics, start)
    world.view = world.engine.view(world.physics)
    return world, np.array(rows), float(np.mean(awake))


def measure(home: Home, case: str, args: Args) -> dict[str, Any]:
    """One home in one case ("settled", "idle robot", "disturbed")."""
    scene, reach = home.load(home.robot_place() if case == "idle robot" else None), None
    if case == "disturbed":
        reach = find_reach(scene)
        scene = ig2mj.load_scene(home.folder, [FloatingHand(pos=reach.start)])
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    goal = compile_expression(model, ten_literals(model))
    worlds = {"engine": OneWorld(scene, model), "states": OneWorld(scene, model), "goal": OneWorld(scene, model, goal)}
    resting, controls, awake = None, None, 0.0
    if reach is not None:
        resting, controls, awake = record(scene, model, reach, args.rest_steps, args.episode)
        start = resting.engine.export(resting.physics, 0)
        for world in worlds.values():
            world.physics = world.engine.load(world.physics, start)
    else:
        for world in worlds.values():
            for _ in range(args.rest_steps):
                world.engine_step()
        awake = float(len(worlds["engine"].awake()))
    blocks: dict[str, Block] = {}
    bare = (resting or worlds["engine"]).bare()
    blocks["mujoco"] = timed(_stepper(bare, controls, _copy(bare)))
    for name, world in worlds.items():
        start = world.engine.export(world.physics, 0)
        blocks[name] = timed(_stepper(world, controls, start, physics_only=name == "engine"))
    rates = interleave(blocks, args.seconds, args.rounds)
    micro = {name: 1e6 / rate.steps_per_cpu_s for name, rate in rates.items()}
    return {
        "home": home.name,
        "case": case,
        "objects": len(scene.object_names),
        "awake": awake,
        "rates": {name: dataclasses.asdict(rate) for name, rate in rates.items()},
        "microseconds": micro,
        "parts": _parts(micro),
        "share": max(0.0, 1 - micro["engine"] / micro["goal"]),
    }


def _copy(bare: BarePhysics) -> mujoco.MjData:
    data = mujoco.MjData(bare.model)
    mujoco.mj_copyData(data, bare.model, bare.data)
    return data


def _stepper(world: OneWorld | BarePhysics, controls: np.ndarray | None, start: Any, physics_only: bool = False):
    step = world.engine_step if physics_only and isinstance(world, OneWorld) else world.step
    if controls is None:
        return step
    replay = Replay(world, controls, start)
    return lambda: step(replay.next())


def _parts(micro: dict[str, float]) -> dict[str, float]:
    """Microseconds that each variant adds to the one before; noise below zero counts as zero."""
    names = list(VARIANTS)
    return {name: max(0.0, micro[name] - (micro[names[k - 1]] if k else 0.0)) for k, name in enumerate(names)}


def tables(rows: list[dict[str, Any]]) -> list:
    """Microseconds of each part of a step, and the shares."""
    lines = [
        [
            f"{row['home']}, {row['case']}",
            f"{row['awake']:.1f}",
            *(f"{row['parts'][name]:,.0f}" for name in VARIANTS),
            f"{row['microseconds']['goal']:,.0f}",
            f"{row['rates']['goal']['steps_per_cpu_s']:,.0f}",
            f"{row['share']:.0%}",
        ]
        for row in rows
    ]
    columns = ["home, case", "awake", *(f"{v} us" for v in VARIANTS.values()), "all us", "steps/s", "states' share"]
    return [results.table("Parts of a control step (four physics steps), one world, native engine", columns, lines)]


def main(args: Args) -> list[dict[str, Any]]:
    console = Console()
    with console.status("building and converting the homes"):
        homes = named_homes(list(args.homes)) if args.homes else made_homes(args.sizes, args.work)
    rows = []
    for home in homes:
        for case in ("settled", "idle robot", "disturbed"):
            with console.status(f"measuring {home.name}, {case}"):
                rows.append(measure(home, case, args))
    settings = {"rest_steps": args.rest_steps, "episode": args.episode, "rounds": args.rounds, "block_s": args.seconds}
    folder = results.save("states_share", CORE, settings, rows, tables(rows), args.out)
    parts = {label: [row["parts"][name] for row in rows] for name, label in VARIANTS.items()}
    groups = [f"{row['home']}\n{row['case']}" for row in rows]
    title = "A control step of one world, native engine, one core"
    plots.stacked_bars(folder / "plot.png", title, groups, parts, "microseconds")
    return rows


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
