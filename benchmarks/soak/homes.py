"""Random actions in all homes, with hand, humanoid and Fetch and all modes of grasping, in parts that go on later.

    python -m benchmarks.soak.homes FILE [--minutes 10] [--share 1/4] [--world-steps 2.1e7] [--engine warp]
    python -m benchmarks.soak.homes FILE... --summary

A *cell* is a home with an agent and a mode of grasping. Each home has three that move: the floating hand (physical
grasping), the humanoid and Fetch; the modes of the robots rotate through the homes, so that each pair of robot and mode
occurs in four homes. A fourth one leaves the home at rest for 10^5 physics steps and looks at what energy it gains.

Each part runs one cell in a process of its own, for what the rows in the file lack of its steps, and adds a row. The
program begins no part that could not end before `--minutes` are over; called again with the same file it goes on.
`--share 2/4` takes every fourth cell, for one of four GPUs (each with a file of its own; `--summary` reads several).

The summary counts world-steps (physics steps of one world) by home, agent and mode, and says which limits hold:
10^9 world-steps, 5 x 10^7 in every home, every robot and mode in two homes; no overflow and nothing that is not
finite; fewer than one object in 10^8 world-steps lost or too fast; at rest at most 1 J gained. Hands and robots are
those of `soak.py` and `grasping.py`.
"""

from __future__ import annotations

import collections
import dataclasses
import json
import pathlib
import subprocess
import sys
import time
from typing import Any

import jax
import mujoco
import numpy as np
import tyro
import warp as wp

from benchmarks.harness import results
from benchmarks.harness.homes import shipped_homes
from benchmarks.harness.paths import environment, module
from benchmarks.soak import grasping, soak
from benchmarks.soak.energy import EnergyWatch
from benchmarks.soak.watch import FLAGS
from ig2mj.agents.grasping.grasp import MODES
from ig2mj.engine.native.settle import settle
from ig2mj.engine.registry import make_engine
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.scene.scene import load_scene

REST, HAND = "rest", "hand"

REST_STEPS = 10**5
"""Physics steps of each world of a home at rest."""

REST_GAIN = 1.0
"""J that a home at rest may gain in them."""

LOST = 1e-8
"""Objects lost or too fast, together, for each world-step."""

HOME_STEPS = 5e7
"""World-steps of every home."""

ALL_STEPS = 1e9

OVERHEAD = 240.0
"""Seconds that a part may take to be ready, when nothing is cached."""

TRIES = 2
"""Parts of a cell that end with an error before it is left out."""


@dataclasses.dataclass
class Args:
    """What to run."""

    rows: tyro.conf.Positional[tuple[pathlib.Path, ...]] = ()
    """Files of rows, as JSON lines; the first one is added to."""
    minutes: float = 10.0
    """Time limit of this call."""
    share: str = "1/1"
    """"2/4": the second of four shares of the cells."""
    world_steps: float = 2.1e7
    """Physics steps of all worlds together, for each cell."""
    worlds: int = 4096
    """Worlds side by side."""
    part_seconds: float = 150.0
    """Longest time of a part, without making it ready."""
    engine: str = "warp"
    """warp or native (few worlds then)."""
    homes: tuple[str, ...] = ()
    """Homes; default: all that ship."""
    summary: bool = False
    """Only the counts."""
    cell: str | None = None
    """Used between processes: one part of this cell."""
    seed: int = 0
    """Used between processes."""


@dataclasses.dataclass(frozen=True)
class Cell:
    """A home with what moves in it."""

    home: str
    agent: str
    mode: str

    @property
    def name(self) -> str:
        return f"{self.home} {self.agent} {self.mode}"


def cells(homes: list[str]) -> list[Cell]:
    """All cells, those of a home one after the other. A home that ships has the same whatever the other homes are."""
    found, every = [], [home.name for home in shipped_homes()]
    for home in homes:
        k = every.index(home) if home in every else len(every)
        robots = [Cell(home, robot, MODES[(k + 2 * n) % len(MODES)]) for n, robot in enumerate(("humanoid", "fetch"))]
        found += [Cell(home, HAND, "physical"), *robots, Cell(home, REST, "")]
    return found


def target(cell: Cell, args: Args) -> float:
    """World-steps of a cell."""
    return REST_STEPS if cell.agent == REST else args.world_steps


def part(cell: Cell, args: Args) -> dict[str, Any]:
    """Runs a cell for so many world-steps or seconds; counts."""
    began = time.monotonic()
    if cell.agent == REST:
        found = at_rest(cell.home, args)
    elif cell.agent == HAND:
        own = soak.Args(
            world_steps=args.world_steps,
            worlds=args.worlds,
            engine=args.engine,
            seed=args.seed,
            dumps=0,
            minutes=args.part_seconds / 60,
        )
        found = soak.soak(cell.home, own)
    else:
        loose = load_scene(cell.home)
        first, second = (loose.tables.object_names[i] for i in loose_objects(loose.tables)[:2])
        of_robot = grasping.Args(
            task=f"goal/{cell.home} (touching {first} {second})",
            robot=cell.agent,
            world_steps=args.world_steps,
            worlds=args.worlds,
            seconds=args.part_seconds,
            engine=args.engine,
            seed=args.seed,
            pool_size=16,
        )
        found = grasping.soak(of_robot, cell.mode)
    keep = ("world_steps", "world_steps_per_s", "ready_s", "flagged", "events", "gain_J", "held_when_flagged")
    counted = {name: found[name] for name in keep if name in found}
    versions = {"jax": jax.__version__, "warp": wp.__version__, "mujoco": mujoco.__version__}
    of = {"device": str(jax.devices()[0].device_kind), "worlds_together": args.worlds, **versions}
    return {"wall_s": round(time.monotonic() - began, 1), **counted, **of}


def at_rest(home: str, args: Args) -> dict[str, Any]:
    """A settled home without anybody: the largest gain of energy that any world shows at the end of a call."""
    scene, worlds = load_scene(home), min(args.worlds, 64)
    engine = make_engine(args.engine, scene, worlds)
    energy = EnergyWatch(engine, ~np.asarray(engine.tables.object_fixed), 1)
    steps = 250

    def some(physics: Any) -> tuple[Any, Any]:
        for _ in range(0 if engine.pure else steps):
            physics, _ = engine.step(physics)
        if engine.pure:
            physics = jax.lax.scan(lambda now, _: (engine.step(now)[0], None), physics, None, steps)[0]
        return physics, energy.of_objects(engine.view(physics))

    many = jax.jit(some, donate_argnums=0) if engine.pure else some
    physics = engine.load(engine.reset(), settle(scene))
    first = np.asarray(energy.of_objects(engine.view(physics)))
    gain = 0.0
    for _ in range(0, REST_STEPS, steps * engine.substeps):
        physics, now = many(physics)
        gain = max(gain, float((np.asarray(now) - first).max()))
    health = engine.health(physics)
    bad = {
        "overflow": int((np.asarray(health.overflow) != 0).sum()),
        "not_finite": int((~np.asarray(health.finite)).sum()),
    }
    return {"world_steps": REST_STEPS, "worlds": worlds, "gain_J": round(gain, 6), "flagged": bad}


def read(files: tuple[pathlib.Path, ...]) -> list[dict[str, Any]]:
    """All rows; a line that was cut off is left out."""
    rows = []
    for line in (line for file in files if file.exists() for line in file.read_text().splitlines()):
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return rows


def run(args: Args) -> None:
    """Parts until the time is over, or nothing is left."""
    began, (number, count) = time.monotonic(), (int(word) for word in args.share.split("/"))
    homes = list(args.homes) or [home.name for home in shipped_homes()]
    for cell in cells(homes)[number - 1 :: count]:
        while True:
            rows = [row for row in read(args.rows[:1]) if row["cell"] == cell.name]
            left = target(cell, args) - sum(row.get("world_steps", 0) for row in rows)
            failed = sum("error" in row for row in rows)
            if left <= 0 or failed >= TRIES:
                break
            spare = 60 * args.minutes - (time.monotonic() - began)
            known = max((row["wall_s"] - args.part_seconds for row in rows if "wall_s" in row), default=OVERHEAD)
            seconds = min(args.part_seconds, spare - max(known, 30.0))
            if seconds < 20:
                print(f"time is over; the same command goes on with {cell.name}", file=sys.stderr)
                return
            row = _in_a_process(cell, args, left, seconds, len(rows), spare)
            row |= {**results.provenance()}
            results.keep_row({"cell": cell.name, **dataclasses.asdict(cell), **row}, args.rows[0])


def _in_a_process(cell: Cell, args: Args, left: float, seconds: float, seed: int, spare: float) -> dict[str, Any]:
    """The row of a part; one with "error" where it ended otherwise."""
    words = ["--cell", cell.name, "--world-steps", str(left), "--worlds", str(args.worlds), "--engine", args.engine]
    command = [sys.executable, *module("soak.homes"), *words, "--part-seconds", str(seconds), "--seed", str(seed)]
    try:
        ended = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=spare)
    except subprocess.TimeoutExpired:
        return {"cut_off": True}
    if ended.returncode:
        return {"error": (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[-1][:300]}
    return json.loads(ended.stdout.strip().splitlines()[-1])


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts, and whether each limit holds."""
    moved = [row for row in rows if row["agent"] != REST and "world_steps" in row]
    steps = sum(row["world_steps"] for row in moved)
    by_home, by_pair = collections.Counter[str](), collections.defaultdict[str, set[str]](set)
    flagged = collections.Counter[str]()
    for row in moved:
        by_home[row["home"]] += row["world_steps"]
        by_pair[f"{row['agent']} {row['mode']}"].add(row["home"])
    for row in rows:
        flagged.update(row.get("flagged", {}))
    pairs = [f"{robot} {mode}" for robot in ("humanoid", "fetch") for mode in MODES] + [f"{HAND} physical"]
    rest = {row["home"]: row["gain_J"] for row in rows if "gain_J" in row}
    lost = sum(flagged[kind] for kind in FLAGS if kind not in ("overflow", "not_finite"))
    homes = [home.name for home in shipped_homes()]
    return {
        "world_steps": steps,
        "by_home": dict(by_home),
        "homes_of_pairs": {pair: len(by_pair[pair]) for pair in pairs},
        "flagged": dict(flagged),
        "lost_and_too_fast_per_step": lost / steps if steps else None,
        "most_gained_at_rest_J": max(rest.values(), default=None),
        "errors": {row["cell"]: row["error"] for row in rows if "error" in row},
        "holds": {
            "steps": steps >= ALL_STEPS,
            "every home": all(by_home[home] >= HOME_STEPS for home in homes),
            "every pair in two homes": all(len(by_pair[pair]) >= 2 for pair in pairs),
            "overflow 0": flagged["overflow"] == 0,
            "not finite 0": flagged["not_finite"] == 0,
            "lost and too fast": steps > 0 and lost < LOST * steps,
            "rest": len(rest) == len(homes) and max(rest.values()) <= REST_GAIN,
        },
    }


def main(args: Args) -> None:
    if args.cell is not None:
        print(json.dumps(part(Cell(*(args.cell + " ").split(" ")[:3]), args)), flush=True)
        return
    if not args.rows:
        raise SystemExit("error: name a file for the rows: python -m benchmarks.soak.homes FILE")
    args.rows[0].parent.mkdir(parents=True, exist_ok=True)
    if not args.summary:
        run(args)
    print(json.dumps(summary(read(args.rows)), indent=1))


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
