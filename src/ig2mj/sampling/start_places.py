"""Where objects that are added to a home start, so that a predicate holds of each: `load_scene` asks for it."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from ig2mj.errors import StateError, UnknownNameError
from ig2mj.sampling.many import sample
from ig2mj.sampling.rules import PLACEMENTS
from ig2mj.scene.object_requests import Pose
from ig2mj.scene.resting import DECIMALS
from ig2mj.scene.scene import Scene

SEEDS = 5
"""Seeds that are tried before there is no place for them."""


def sample_places(scene: Scene, requested: Sequence[tuple[str, str, str]]) -> dict[str, Pose]:
    """Poses of objects' frames, at rest, by name; the same ones in every run.

    Args:
      scene: without agents; the objects are outside the house. requested: object, predicate ("on_top"), object or room.

    Raises:
      UnknownNameError: no such predicate, object or room. StateError, AbilityError: it can never hold, or was not
        found to.
    """
    for name, predicate, target in requested:
        if predicate not in PLACEMENTS:
            raise UnknownNameError(f"predicate that places '{name}'", predicate, PLACEMENTS)
        if name == target:
            raise StateError(f"'{name}' cannot be placed {predicate} itself")
    conditions = [f"({predicate} {name} {target})" for name, predicate, target in requested]
    reasons = ""
    for seed in range(SEEDS):
        found = sample(scene, conditions, 1, seed)
        if found.pool is not None:
            data = scene.start_data()
            data.qpos[: scene.model.nq] = np.asarray(found.pool.physics.whole("qpos"))[0][: scene.model.nq]
            mujoco.mj_kinematics(scene.model, data)
            return {name: _pose(scene, data, name) for name, _, _ in requested}
        reasons = ", ".join(f"{reason} ({count})" for reason, count in found.rejected.most_common(3))
    raise StateError(f"found no place where {' and '.join(conditions)}: {reasons}")


def _pose(scene: Scene, data: mujoco.MjData, name: str) -> Pose:
    root = scene.tables.object_root[scene.object_index(name)]
    x, y, z, qw, qx, qy, qz = (round(float(v), DECIMALS) for v in (*data.xpos[root], *data.xquat[root]))
    return (x, y, z, qw, qx, qy, qz)
