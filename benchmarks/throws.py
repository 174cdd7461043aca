"""Loose objects thrown about a home, natively: what leaves it, with its solid ceiling and without?

    python benchmarks/throws.py [CATEGORY ...] [--home birch] [--throws 1000] [--open] [--rows FILE]

Each throw begins over free floor at a place drawn at random, turned at random, upwards or sideways at any angle, and is
watched for `SECONDS`. `--open` takes the ceiling away.
"""

from __future__ import annotations

import copy
import dataclasses
import pathlib
from typing import Any

import mujoco
import numpy as np
import results
import tyro
from jaxtyping import Float
from loose_objects import added, floor_cells
from soak_watch import House

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
    seed: int = 0
    """Of places, turns and directions."""
    rows: pathlib.Path | None = None
    """Rows are added to this file, as JSON lines."""


def model_of(scene: Scene, without_ceiling: bool) -> mujoco.MjModel:
    """The scene's model, or one without its ceiling."""
    if not without_ceiling:
        return scene.model
    spec = scene.spec()
    spec.delete(spec.body(CEILING))
    return spec.compile()


def free_places(scene: Scene) -> Float[np.ndarray, "N 2"]:
    """World x and y (m) of all cells of floor with `ROOM` around them."""
    places, room = floor_cells(scene)
    return places[room > ROOM]


def run(args: Args, category: str) -> dict[str, Any]:
    """Throws one object again and again; the row."""
    scene, name = added(args.home, category)
    model, house, places = model_of(scene, args.open), House.of(scene, (0, 0, 0)), free_places(scene)
    settled, data = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, settled, 0)
    for _ in range(round(SETTLE_SECONDS / model.opt.timestep)):
        mujoco.mj_step(model, settled)
    joint, body = model.joint(f"{name}/free"), model.body(name).id
    seat, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
    rng, fastest, ends = np.random.default_rng(args.seed), np.zeros(args.throws), np.zeros((args.throws, 3))
    for number in range(args.throws):
        data = copy.copy(settled)
        quat, up, around = rng.normal(size=4), rng.uniform(0, np.pi / 2), rng.uniform(0, 2 * np.pi)
        direction = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
        data.qpos[seat : seat + 7] = [*rng.choice(places), args.height, *(quat / np.linalg.norm(quat))]
        data.qvel[dof : dof + 6] = [*direction * rng.uniform(*args.speed), *rng.normal(0, SPIN, 3)]
        for _ in range(round(SECONDS / model.opt.timestep)):
            mujoco.mj_step(model, data)
            fastest[number] = max(fastest[number], float(np.linalg.norm(data.qvel[dof : dof + 3])))
            if data.xipos[body, 2] < house.floors[:, 0, 2].min():
                break
        ends[number] = data.xipos[body]
    return {
        "benchmark": "throws",
        "home": scene.name,
        "object": category,
        "ceiling": not args.open,
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
