"""Where in an encoder's image a position is, and the rows and columns of objects as targets to predict.

Axes: B samples, k positions, v numbers of a vector, g of a prediction.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError
from ig2mj.geometry.poses import matrices_on_host, relative_pose
from ig2mj.learn.perception import Perception
from ig2mj.learn.privileged_targets import PrivilegedTargets

FRAME = 3.0
"""What an encoder learns as 1 for half an image's height or width: objects are all over it, so that the target has a
deviation of about 1, as all others have."""

OUTSIDE = 1.2
"""Positions are clipped to so many halves of the image from its middle."""

NEAREST = 0.05
"""m: what is nearer to the camera, or behind it, counts as that far away."""


@dataclasses.dataclass(frozen=True)
class CameraProjection:
    """A camera that stays where it is in the frame of the robot's base.

    Attributes:
      pos: of the camera, m. matrix: its axes (x right, y up, looking along -z) as columns. Both in the base's frame.
      slopes: half width and half height of the view at distance 1.
      size: pixels, height and width, of the whole image. rows: the first that is kept, and the first below those.
    """

    pos: tuple[float, float, float]
    matrix: tuple[tuple[float, float, float], ...]
    slopes: tuple[float, float]
    size: int
    rows: tuple[int, int]

    def __call__(self, positions: Float[Array, "B k 3"]) -> Float[Array, "B k 2"]:
        """Row and column, -1 in the middle of the first pixel that is kept, 1 in that of the last.

        Args:
          positions: m, in the base's frame.
        """
        own = (positions - jnp.asarray(self.pos)) @ jnp.asarray(self.matrix)
        depth = jnp.maximum(-own[..., 2], NEAREST)
        column = own[..., 0] / (depth * self.slopes[0])
        row = -own[..., 1] / (depth * self.slopes[1])
        first, below = self.rows
        row, column = (0.5 * self.size * (a + 1.0) - 0.5 for a in (row, column))
        found = jnp.stack([(row - first) / (below - first - 1), column / (self.size - 1)], axis=-1)
        return jnp.clip(2.0 * found - 1.0, -OUTSIDE, OUTSIDE)


def camera_projection(env: Any, perception: Perception) -> CameraProjection:
    """Of the camera of an environment's robot, as it stands at the start; for robots whose cameras stay there.

    Args:
      perception: how images are averaged down and cut.
    """
    agent = env.reset(0).batch.world.view.agent
    poses = (jnp.asarray(a)[:1] for a in (agent.base_pos[:, 0], agent.base_quat[:, 0]))
    eye = (jnp.asarray(a)[:1] for a in (agent.eye_pos[:, 0], agent.eye_quat[:, 0]))
    pos, quat = relative_pose(*poses, *eye)
    up = float(np.tan(env.scene.tables.agent_fovy[0] / 2))
    matrix = matrices_on_host(np.asarray(quat, np.float64))[0]
    where = tuple(np.asarray(pos)[0].tolist()), tuple(map(tuple, matrix.tolist()))
    return CameraProjection(*where, (up, up), perception.side, perception.rows)


class ObjectTargets(PrivilegedTargets):
    """Privileged targets, then row and column of each object that has a position. Attributes: objects: how many."""

    def __init__(self, first: int, count: int, names: Sequence[str], projection: CameraProjection):
        """`projection`: of the camera that the images are of. Others: of `PrivilegedTargets`."""
        super().__init__(first, count, names)
        self._projection, self.objects = projection, len(self.positions)
        self.size += 2 * self.objects

    def __call__(self, vector: Float[Array, "B v"], normal: Float[Array, "B v"]) -> Float[Array, "B g"]:
        places = self._projection(vector[:, self.positions])
        points = FRAME * places.reshape(vector.shape[0], -1)
        return jnp.concatenate([super().__call__(vector, normal), points], axis=-1)


def with_object_targets(perception: Perception, names: Sequence[str], projection: CameraProjection) -> Perception:
    """A perception whose targets include where in the image objects are.

    Args:
      names: of the privileged state (`Environment.privileged_names`).

    Raises:
      Ig2mjError: an actor of this perception has nothing to predict, or no object has a pose.
    """
    hidden = perception.vector_size - perception.actor_size
    if not hidden or perception.image_shape is None:
        raise Ig2mjError("encoder=glimpses: only for actors of images that observe privileged_state (obs = rgbd)")
    targets = ObjectTargets(perception.actor_size, hidden, names, projection)
    if not targets.objects:
        raise Ig2mjError("encoder=glimpses: no number of privileged_state is the pose of an object")
    new = copy.copy(perception)
    new.targets = targets
    return new
