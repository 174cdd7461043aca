"""`Lens`: where in an encoder's picture a place is.

Axes: B samples, k places.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import matrices_on_host, relative_pose

FRAME = 3.0
"""What an encoder learns as 1 of half a picture's height or width: objects are all over it, so that what is learnt has
a deviation of about 1, as everything else."""

BESIDE = 1.2
"""Farther from the middle than so many halves of the picture nothing is said to be."""

NEAREST = 0.05
"""m: what is nearer to the camera, or behind it, counts as that far away."""


@dataclasses.dataclass(frozen=True)
class Lens:
    """A camera that stays where it is in the frame of the robot's base.

    Attributes:
      pos: of the camera, m. matrix: its axes (x right, y up, looking along -z) as columns. Both in the base's frame.
      slopes: half width and half height of the view at distance 1.
      size: pixels, height and width, of the whole picture. rows: the first that is kept, and the first below those.
    """

    pos: tuple[float, float, float]
    matrix: tuple[tuple[float, float, float], ...]
    slopes: tuple[float, float]
    size: int
    rows: tuple[int, int]

    def __call__(self, places: Float[Array, "B k 3"]) -> Float[Array, "B k 2"]:
        """Row and column, -1 in the middle of the first pixel that is kept, 1 in that of the last. `places`: m, in the
        base's frame."""
        own = (places - jnp.asarray(self.pos)) @ jnp.asarray(self.matrix)
        depth = jnp.maximum(-own[..., 2], NEAREST)
        column = own[..., 0] / (depth * self.slopes[0])
        row = -own[..., 1] / (depth * self.slopes[1])
        first, below = self.rows
        row, column = (0.5 * self.size * (a + 1.0) - 0.5 for a in (row, column))
        found = jnp.stack([(row - first) / (below - first - 1), column / (self.size - 1)], axis=-1)
        return jnp.clip(2.0 * found - 1.0, -BESIDE, BESIDE)


def lens_of(env: Any, size: int, rows: tuple[int, int] | None) -> Lens:
    """Of an environment's robot, as it stands at the start; for robots whose cameras stay there.

    Args:
      size: pixels, height and width, of an encoder's picture. rows: of those that are kept; None: all.
    """
    agent = env.reset(0).batch.world.view.agent
    poses = (jnp.asarray(a)[:1] for a in (agent.base_pos[:, 0], agent.base_quat[:, 0]))
    eye = (jnp.asarray(a)[:1] for a in (agent.eye_pos[:, 0], agent.eye_quat[:, 0]))
    pos, quat = relative_pose(*poses, *eye)
    up = float(np.tan(env.scene.tables.agent_fovy[0] / 2))
    matrix = matrices_on_host(np.asarray(quat, np.float64))[0]
    return Lens(
        tuple(np.asarray(pos)[0].tolist()), tuple(map(tuple, matrix.tolist())), (up, up), size, rows or (0, size)
    )
