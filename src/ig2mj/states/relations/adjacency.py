"""Vertical and horizontal adjacency: which objects rays from an object's centre of mass enter (iGibson's adjacency.py).

iGibson shoots rays for every object and lists all that they hit. Here only named pairs (object, target) are asked, and
of the target only its own pieces: a ray enters a piece whose surface it crosses from outside at 0 <= t <= length,
nothing occludes anything, and any number of pieces may lie on the ray (Bullet's loop loses hits beyond ten in
arbitrary order).

The directions: up and down; and, in the horizontal plane, both ways along the axes at 0, 22.5, 45, 67.5 and 90 degrees
and their perpendiculars. The last plane is the first one again, so eight distinct lines.

Axes: W worlds, P pairs, R lines.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import AnyArray
from ig2mj.geometry.targets import RayTargets, lines_enter_targets
from ig2mj.states.model import StateModel

Poses = tuple[Float[AnyArray, "W B 3"], Float[AnyArray, "W B 4"]]

HORIZONTAL_ANGLES = np.deg2rad([0.0, 22.5, 45.0, 67.5])
"""Of the first axis of each plane; the second one is perpendicular."""

HORIZONTAL_LENGTH = {"paper": 100.0, "igibson": 1.0}
"""Metres. The paper's axes have no end; 100 m is longer than any house (docs/design/rules.md#axes)."""

VERTICAL_LENGTH = {"paper": 100.0, "igibson": 5.0}
"""Metres."""

INFLATE = {"paper": 0.0, "igibson": 0.00175}
"""Metres by which Bullet's rays see hulls grown (measured in PyBullet)."""


def _horizontal_lines() -> Float[np.ndarray, "R 3"]:
    """The first axes of the four planes, then the second ones (z cross first)."""
    c, s, zero = np.cos(HORIZONTAL_ANGLES), np.sin(HORIZONTAL_ANGLES), np.zeros(4)
    return np.concatenate([np.stack([c, s, zero], -1), np.stack([-s, c, zero], -1)]).astype(np.float32)


HORIZONTAL_LINES = _horizontal_lines()
VERTICAL_LINE = np.array([[0.0, 0.0, 1.0]], np.float32)


@dataclasses.dataclass(frozen=True, eq=False)
class AdjacencyPairs:
    """Pairs whose rays are computed together, laid out once; `pairs` may be traced."""

    model: StateModel
    pairs: Int[AnyArray, "P 2"]
    targets: RayTargets

    @classmethod
    def build(cls, model: StateModel, pairs: Int[np.ndarray, "P 2"]) -> AdjacencyPairs:
        """`pairs` are object indices: whose rays, against whose pieces."""
        return cls(model, pairs, RayTargets.build(model.tables, pairs[:, 1]))

    def vertical(self, view: PhysicsView, poses: Poses | None = None) -> tuple[Bool[Array, "W P"], Bool[Array, "W P"]]:
        """Whether the target is above the object, and whether it is below (both may hold, or neither).

        `poses`: of the bodies that `targets` counts, where these are not all of the scene.
        """
        up, down = self._lines(view, poses, VERTICAL_LINE, VERTICAL_LENGTH)
        return up[..., 0], down[..., 0]

    def horizontal(
        self, view: PhysicsView, poses: Poses | None = None
    ) -> tuple[Bool[Array, "W P R"], Bool[Array, "W P R"]]:
        """Whether the target is on the positive and on the negative side, for each of `HORIZONTAL_LINES`."""
        return self._lines(view, poses, HORIZONTAL_LINES, HORIZONTAL_LENGTH)

    def _lines(
        self, view: PhysicsView, poses: Poses | None, lines: Float[np.ndarray, "R 3"], length: dict[str, float]
    ) -> tuple[Bool[Array, "W P R"], Bool[Array, "W P R"]]:
        compat = self.model.options.compat
        lengths = np.full(len(lines), length[compat], np.float32)
        origins = jnp.asarray(view.object_com)[:, self.pairs[:, 0]]
        pos, quat = poses or (view.body_pos, view.body_quat)
        return lines_enter_targets(self.targets, pos, quat, origins, lines, lengths, INFLATE[compat])
