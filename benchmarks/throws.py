"""Loose objects thrown about a home, natively: what leaves it, with its solid ceiling and without?

    python benchmarks/throws.py [CATEGORY ...] [--home birch] [--throws 1000] [--open] [--thin] [--free] [--rows FILE]

Each throw begins over free floor at a place drawn at random, turned at random, upwards or sideways at any angle, and is
watched for `SECONDS`. `--open` takes the ceiling away, `--thin` leaves outer walls as thin as they are drawn and
windows without panes, `--free` sets no limits to speeds.
"""

from __future__ import annotations

import copy
import dataclasses
import pathlib
from typing import Any
from unittest import mock

import mujoco
import numpy as np
import results
import tyro
from jaxtyping import Float
from loose_objects import added, floor_cells
from soak_watch import House

import ig2mj.scene.scene as scenes
from ig2mj.engine.base import SUBSTEPS
from ig2mj.engine.speed_limits import SpeedLimits
from ig2mj.scene.ceilings import CEILING
from ig2mj.scene.scene import Scene
from ig2mj.worlds.guards import TOP_SPEED

SECONDS = 3.0

SETTLE_SECONDS = 2.0
"""Given to the home to fall asleep, once."""

ROOM = 0.3
"""Metres of free floor on every side of the place where a throw begins."""

SPIN = 5.0
"""Standard deviation of the speed at which things turn about each axis, rad/s."""


@dataclasses.dataclass
class Args:
    """What to throw, and where."""

    categories: tyro.conf.Positional[tuple[str, ...]] = ("bowl", "steak", "cheese", "plate")
    """Of the object library."""
    home: str = "birch"
    """Where."""
    throws: int = 1000
    """Of each object."""
    speed: tuple[float, float] = (6.0, 9.0)
    """Least and most, m/s."""
    height: float = 1.2
    """Of the object's frame above the floor, m."""
    open: bool = False
    """Without the ceiling."""
    thin: bool = False
    """Without deep outer walls and panes."""
    free: bool = False
    """Without limits of speeds."""
    seed: int = 0
    """Of places, turns and directions."""
    rows: pathlib.Path | None = None
    """Rows are added to this file, as JSON lines."""


def model_of(scene: Scene, args: Args) -> mujoco.MjModel:
    """The scene's model, or one without its ceiling or with thin walls."""
    with mock.patch.object(scenes, "deepen_walls", (lambda *_: None) if args.thin else scenes.deepen_walls):
        spec = scene.spec()
    if args.open:
        spec.delete(spec.body(CEILING))
    return spec.compile()


def free_places(scene: Scene) -> Float[np.ndarray, "N 2"]:
    """World x and y (m) of all cells of floor with `ROOM` around them."""
    places, room = floor_cells(scene)
    return places[room > ROOM]


def run(args: Args, category: str) -> dict[str, Any]:
    """Throws one object again and again; the row."""
    scene, name = added(args.home, category)
    model, house, places = model_of(scene, args), House.of(scene, (0, 0, 0)), free_places(scene)
    settled, data = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, settled, 0)
    for _ in range(round(SETTLE_SECONDS / model.opt.timestep)):
        mujoco.mj_step(model, settled)
    limits = SpeedLimits(model, scene.tables.body_agent)
    joint, body = model.joint(f"{name}/free"), model.body(name).id
    seat, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
    rng, fastest, ends = np.random.default_rng(args.seed), np.zeros(args.throws), np.zeros((args.throws, 3))
    for number in range(args.throws):
        data = copy.copy(settled)
        quat, up, around = rng.normal(size=4), rng.uniform(0, np.pi / 2), rng.uniform(0, 2 * np.pi)
        direction = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
        data.qpos[seat : seat + 7] = [*rng.choice(places), args.height, *(quat / np.linalg.norm(quat))]
        data.qvel[dof : dof + 6] = [*direction * rng.uniform(*args.speed), *rng.normal(0, SPIN, 3)]
        for step in range(1, round(SECONDS / model.opt.timestep) + 1):
            mujoco.mj_step(model, data)
            if not args.free and step % SUBSTEPS == 0:
                limits.hold(data.qvel)
            fastest[number] = max(fastest[number], float(np.linalg.norm(data.qvel[dof : dof + 3])))
            if data.xipos[body, 2] < house.floors[:, 0, 2].min():
                break
        ends[number] = data.xipos[body]
    return {
        "benchmark": "throws",
        "home": scene.name,
        "object": category,
        "ceiling": not args.open,
        "deep_walls": not args.thin,
        "speed_limits": not args.free,
        "throws": args.throws,
        "speed_m_s": list(args.speed),
        "height_m": args.height,
        "lost": int((np.asarray(house.lost(ends)) > 0).sum()),
        "too_fast": int((fastest > TOP_SPEED).sum()),
        "fastest_m_s": round(float(fastest.max()), 1),
        "mujoco": mujoco.__version__,
    }


def main(args: Args) -> list[dict[str, Any]]:
    return results.keep_rows((run(args, category) for category in args.categories), args.rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
