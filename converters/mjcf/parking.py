"""The parking slab: where halves (and cut wholes) wait until they are needed, far outside the house.

They rest there, so that they are asleep after the first moments; MJX-Warp does not take MuJoCo's `sleep="init"`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco
import numpy as np

from ..base.transforms import rotation_from_wxyz
from ..bodies.assembly import Assembly, extent
from .model_builder import ModelBuilder

#: Distance (m) of the slab's edge from the house: out of sight and of any ray, near enough for float32 millimetres.
DISTANCE = 40.0
#: Height (m) of the slab's top; below the floor, so that nothing in the house can roll there.
HEIGHT = -5.0
#: Free space (m) between parked objects.
CLEARANCE = 0.15
SLAB_BODY = "parking_slab"


def resting_pose(assembly: Assembly) -> np.ndarray:
    """4x4 of the base in its most probable stable orientation, the object's lowest point at z = 0 below its centre."""
    pose = np.eye(4)
    orientations = assembly.model.metadata.orientations
    if orientations:
        pose[:3, :3] = rotation_from_wxyz(max(orientations, key=lambda o: o.prob).quat)
    low, high = extent(assembly, pose)
    pose[:3, 3] = -np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    return pose


def park(
    builder: ModelBuilder, groups: Mapping[str, Assembly], house_low: np.ndarray, house_high: np.ndarray
) -> dict[str, np.ndarray]:
    """Adds the slab and returns a place on it for each name: the 4x4 pose of its base there.

    Args:
      groups: name -> assembly of everything that may ever be parked, parked now or not: a whole has its place as well,
        for when it is cut.
      house_low, house_high: [3] corners of the scene's box.
    """
    if not groups:
        return {}
    resting = {name: resting_pose(assembly) for name, assembly in groups.items()}
    extents = [np.subtract(*extent(groups[name], pose)[::-1]) for name, pose in resting.items()]
    cell = float(max(max(e[0], e[1]) for e in extents)) + CLEARANCE
    columns = math.ceil(math.sqrt(len(groups)))
    half = columns * cell / 2
    centre = np.array([house_high[0] + DISTANCE + half, (house_low[1] + house_high[1]) / 2, HEIGHT])
    _add_slab(builder, centre, half)
    places = {}
    for i, (name, pose) in enumerate(resting.items()):
        cell_centre = [(i % columns + 0.5) * cell - half, (i // columns + 0.5) * cell - half, 0.0]
        placed = pose.copy()
        placed[:3, 3] += centre + cell_centre
        places[name] = placed
    return places


def _add_slab(builder: ModelBuilder, centre: np.ndarray, half: float) -> None:
    thickness = 0.1
    body = builder.spec.worldbody.add_body(name=builder.body_names.take(SLAB_BODY))
    body.pos = centre - [0.0, 0.0, thickness]
    geom = body.add_geom(builder.collision_class)
    geom.name, geom.type = f"{SLAB_BODY}/collision_0", mujoco.mjtGeom.mjGEOM_BOX
    geom.size = (half, half, thickness)
    geom.rgba = (0.5, 0.5, 0.5, 1.0)
