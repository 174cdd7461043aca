"""What the pushing hand does in homes, on the native engine: does it touch and move objects at all?

    python benchmarks/hand_activity.py [HOME ...] [--made 20 60 120] [--seconds 10] [--worlds 4] [--out DIR]

Without homes: all shipped ones and those of `made_home.py`. The hand starts where `ig2mj.calibration.reach` puts
it, and does what it does in `throughput.py` and in `ig2mj calibrate`.
"""

from __future__ import annotations

import dataclasses
import pathlib
import tempfile
import time
from typing import Any

import jax
import numpy as np
import results
import tyro
from disturbance import MOVED, geoms_of
from homes_at_hand import shipped_homes
from made_home import write_home
from rich.console import Console

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.calibration.pushing import push, start_pushing
from ig2mj.calibration.reach import find_reach
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.settle import settle
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.worlds.random_streams import episode_keys

HAND_DOFS = 16


@dataclasses.dataclass
class Args:
    """What to look at."""

    homes: tyro.conf.Positional[tuple[str, ...]] = ()
    """Homes, by name or folder; default: all shipped ones and those made."""
    made: tuple[int, ...] = (20, 60, 120)
    """Numbers of objects of the homes made by `made_home.py`, where no homes are named."""
    seconds: float = 10.0
    """Simulated."""
    worlds: int = 4
    """Worlds with random streams of their own."""
    out: pathlib.Path = results.RESULTS
    """Folder for results."""


def measure(home: str, args: Args) -> dict[str, Any]:
    """One home."""
    bare = ig2mj.load_scene(home)
    settled, start = settle(bare), time.process_time()
    reach = find_reach(bare, settled)
    reach_seconds = time.process_time() - start
    scene = ig2mj.load_scene(home, [FloatingHand(pos=reach.start)])
    hand, thing = geoms_of(scene)
    engine = NativeEngine(scene, args.worlds)
    physics = engine.load(engine.reset(), settle(scene))
    view = engine.view(physics)
    before = np.array(view.object_com)
    key = episode_keys(0, np.arange(args.worlds), np.zeros(args.worlds, np.int32))
    seconds = engine.substeps * engine.timestep
    act = jax.jit(lambda p, com, palm, step: push(reach, p, com, palm, key, step, seconds))
    pusher = start_pushing(reach, args.worlds, scene.model.nu)
    touched, awake = [], []
    for step in range(round(args.seconds / seconds)):
        pusher = act(pusher, view.object_com, view.agent.base_pos[:, 0], np.full(args.worlds, step, np.int32))
        physics, view = engine.step(physics, np.asarray(pusher.ctrl))
        for w in range(args.worlds):
            data = engine.to_mujoco(physics, w)[1]
            geom = data.contact.geom[data.contact.dist <= 0]
            touched.append(
                bool(((hand[geom[:, 0]] & thing[geom[:, 1]]) | (hand[geom[:, 1]] & thing[geom[:, 0]])).any())
            )
            awake.append(data.nv_awake - HAND_DOFS)
    loose = loose_objects(scene.tables)
    moved = (np.linalg.norm(np.array(view.object_com) - before, axis=-1)[:, loose] > MOVED).sum(1)
    return {
        "home": scene.name,
        "objects": scene.tables.num_objects,
        "loose": len(loose),
        "reachable": len(reach.objects),
        "contact_share": float(np.mean(touched)),
        "moved": moved.tolist(),
        "awake_dofs_mean": float(np.mean(awake)),
        "awake_dofs_peak": int(np.max(awake)),
        "reach_cpu_s": reach_seconds,
    }


def main(args: Args) -> list[dict[str, Any]]:
    console, rows = Console(), []
    with tempfile.TemporaryDirectory() as work:
        homes = list(args.homes)
        if not homes:
            homes = [str(write_home(pathlib.Path(work) / f"made_{n}", n)) for n in args.made]
            homes += [str(home.folder) for home in shipped_homes()]
        for home in homes:
            with console.status(f"pushing in {pathlib.Path(home).name}"):
                rows.append(measure(home, args))
    lines = [
        [
            row["home"],
            *(str(row[name]) for name in ("objects", "loose", "reachable")),
            f"{row['contact_share']:.0%}",
            f"{np.mean(row['moved']):.1f}",
            f"{row['awake_dofs_mean']:.1f}",
            str(row["awake_dofs_peak"]),
        ]
        for row in rows
    ]
    columns = ["home", "objects", "loose", "in reach", "steps in contact", "moved > 2 cm", "awake dofs, mean", "peak"]
    title = f"A pushing hand, {args.seconds:g} s, mean of {args.worlds} worlds; degrees of freedom beside its own"
    settings = {"seconds": args.seconds, "worlds": args.worlds}
    results.save("hand_activity", -1, settings, rows, [results.table(title, columns, lines)], args.out)
    return rows


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
