"""Loose objects dropped on a home's floor, natively: what falls through, and what gains energy from the floor?

    python benchmarks/drops.py [CATEGORY ...] [--home small_home] [--drops 400] [--height 1.7] [--depth 1.0]
        [--time-constant 0.04] [--rows FILE]

Each drop begins at rest, turned at random, over free floor, and is watched for `SECONDS`. `--depth` and
`--time-constant` try other floors than the home's: boxes that reach further down from the same surface, and contacts
that give way for longer (`solref`; MuJoCo takes the mean of both geoms').
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any

import mujoco
import numpy as np
import results
import tyro
from jaxtyping import Float, Int
from loose_objects import added, floor_cells

from ig2mj.scene.scene import Scene
from ig2mj.worlds.guards import TOP_SPEED

SECONDS = 2.0

ROOM = 0.4
"""Metres of free floor on every side of the place above which things are dropped."""

GAIN = 1.05
"""Times the energy at the start from which a drop has gained some."""


@dataclasses.dataclass
class Args:
    """What to drop, and onto what."""

    categories: tyro.conf.Positional[tuple[str, ...]] = ("steak", "cheese", "carving_knife", "plate", "bowl")
    """Of the object library."""
    home: str = "small_home"
    """Where."""
    drops: int = 400
    """Of each object."""
    height: float = 1.7
    """Of the object's frame above the floor, m."""
    depth: float | None = None
    """Of the floors, m; the home's own if left out."""
    time_constant: float | None = None
    """Of the floors' contacts, s; the home's own if left out."""
    seed: int = 0
    """Of the turns and places."""
    rows: pathlib.Path | None = None
    """Rows are added to this file, as JSON lines."""


def floors_of(scene: Scene) -> Int[np.ndarray, "F"]:
    """Collision geoms of the floors."""
    floors = np.append(scene.tables.object_is_floor, False)[scene.tables.geom_object]  # -1 takes the last: no object
    return np.flatnonzero(floors & (scene.model.geom_contype != 0))


def with_floors(scene: Scene, depth: float | None, time_constant: float | None) -> mujoco.MjModel:
    """The scene's model with other floors, their surfaces where they are."""
    spec = scene.spec()
    for number in floors_of(scene):
        geom = spec.geom(scene.model.geom(int(number)).name)
        assert geom.type == mujoco.mjtGeom.mjGEOM_BOX, geom.name
        if depth is not None:
            geom.pos = [*geom.pos[:2], geom.pos[2] + geom.size[2] - depth / 2]
            geom.size = [*geom.size[:2], depth / 2]
        if time_constant is not None:
            geom.solref = [time_constant, geom.solref[1]]
    return spec.compile()


def free_place(scene: Scene) -> Float[np.ndarray, "2"]:
    """World x and y (m) of floor with the most free floor around it. Raises where there is less than `ROOM`."""
    places, room = floor_cells(scene)
    assert room.max() > ROOM
    return places[room.argmax()]


@dataclasses.dataclass
class Fall:
    """Of one drop.

    Attributes:
      lost: its centre of mass came below the floors. lowest: height (m) of the centre of mass at the lowest until then.
      speed, gain: most speed (m/s) and energy (times that at the start) since it first touched something.
    """

    lost: bool
    speed: float
    gain: float
    lowest: float


def fall(model: mujoco.MjModel, data: mujoco.MjData, name: str, bottom: float) -> Fall:
    """Runs a drop to its end. `bottom`: height of the floors' undersides."""
    body, dof = model.body(name).id, int(model.joint(f"{name}/free").dofadr[0])
    mass, inertia, gravity = model.body_mass[body], model.body_inertia[body], -model.opt.gravity[2]
    start, seen, touched = float(mass * gravity * data.xipos[body, 2]), Fall(False, 0.0, 0.0, np.inf), False
    turn, local = np.zeros(9), np.zeros(3)
    for _ in range(round(SECONDS / model.opt.timestep)):
        mujoco.mj_step(model, data)
        height = float(data.xipos[body, 2])
        if height < bottom:
            return dataclasses.replace(seen, lost=True)
        touched |= data.ncon > 0 and bool((model.geom_bodyid[data.contact.geom] == body).any())
        if not touched:
            continue
        speed = float(np.linalg.norm(data.qvel[dof : dof + 3]))
        mujoco.mju_quat2Mat(turn, model.body_iquat[body])
        mujoco.mju_mulMatTVec(local, turn.reshape(3, 3), data.qvel[dof + 3 : dof + 6])
        energy = 0.5 * mass * speed**2 + 0.5 * float(inertia @ local**2) + mass * gravity * max(height, 0.0)
        seen.speed, seen.gain = max(seen.speed, speed), max(seen.gain, energy / start)
        seen.lowest = min(seen.lowest, height)
    return seen


def run(args: Args, category: str) -> dict[str, Any]:
    """Drops one object again and again; the row."""
    scene, name = added(args.home, category)
    model = with_floors(scene, args.depth, args.time_constant)
    data, place = mujoco.MjData(model), free_place(scene)
    floors = [model.geom(scene.model.geom(int(g)).name) for g in floors_of(scene)]
    bottom = min(float(g.pos[2] - g.size[2]) for g in floors)
    seat, rng = int(model.joint(f"{name}/free").qposadr[0]), np.random.default_rng(args.seed)
    falls = []
    for _ in range(args.drops):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        quat = rng.normal(size=4)
        xy = place + rng.uniform(-ROOM / 4, ROOM / 4, 2)
        data.qpos[seat : seat + 7] = [*xy, args.height, *(quat / np.linalg.norm(quat))]
        mujoco.mj_forward(model, data)
        falls.append(fall(model, data, name, bottom))
    return {
        "benchmark": "drops",
        "home": scene.name,
        "object": category,
        "drops": args.drops,
        "height_m": args.height,
        "floor_m": round(-bottom, 3),
        "time_constant_s": float(floors[0].solref[0]),
        "lost": sum(f.lost for f in falls),
        "gained_energy": sum(bool(f.gain > GAIN) for f in falls),
        "too_fast": sum(f.speed > TOP_SPEED for f in falls),
        "fastest_m_s": round(max(f.speed for f in falls), 1),
        "most_energy": round(max(f.gain for f in falls), 2),
        "deepest_m": round(min(f.lowest for f in falls), 3),
        "mujoco": mujoco.__version__,
    }


def main(args: Args) -> list[dict[str, Any]]:
    return results.keep_rows((run(args, category) for category in args.categories), args.rows)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
