"""Static boxes that exist in physics only: transparent geoms of the collision group that belong to no object.

Tables, predicates and maps do not contain them, and images and rays skip transparent geoms.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.scene.floors import TIME_CONSTANT
from ig2mj.scene.geom_groups import COLLISION_GROUP


def add_invisible_colliders(
    spec: mujoco.MjSpec, name: str, boxes: list[Float[np.ndarray, "2 3"]], like: mujoco.MjsGeom
) -> None:
    """Adds a body of this name with boxes of these low and high corners (world frame).

    Args:
      like: gives friction, gap and margin; contacts last as long as the floors'.
    """
    body = spec.worldbody.add_body(name=name)
    for number, (low, high) in enumerate(boxes):
        body.add_geom(
            name=f"{name}/collision_{number}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=(low + high) / 2,
            size=(high - low) / 2,
            group=COLLISION_GROUP,
            rgba=[0.0, 0.0, 0.0, 0.0],
            mass=0.0,
            friction=like.friction,
            gap=like.gap,
            margin=like.margin,
            solref=[TIME_CONSTANT, 1.0],
        )
