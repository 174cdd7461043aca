"""`Carried`: what goes along when an object is put elsewhere, such as what lies in a bag or on a tray.

Axes: N objects that go along, O objects of the scene.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from ig2mj.engine.writes import teleports
from ig2mj.geometry.host_rotations import quat_conjugate, quat_multiply, quat_rotate
from ig2mj.sampling.query import SceneQuery


@dataclasses.dataclass(frozen=True)
class Carried:
    """An object and what goes along with it.

    Attributes:
      bearer: index of the object. objects: of those that go along.
      pos, quat: poses of their main bodies in the frame of the bearer's, metres, w-x-y-z.
    """

    bearer: int
    objects: Int[np.ndarray, "N"]
    pos: Float[np.ndarray, "N 3"]
    quat: Float[np.ndarray, "N 4"]

    @staticmethod
    def now(query: SceneQuery, bearer: int, objects: Sequence[int] = ()) -> Carried:
        """As the objects lie in the world now."""
        view, indices = query.view, np.array(objects, int)
        pos, quat = (np.asarray(a[0], float) for a in (view.object_pos, view.object_quat))
        back = quat_conjugate(quat[bearer])
        return Carried(
            bearer, indices, quat_rotate(back, pos[indices] - pos[bearer]), quat_multiply(back, quat[indices])
        )

    @property
    def all(self) -> tuple[int, ...]:
        """Indices of all that moves."""
        return (self.bearer, *self.objects.tolist())

    def put(self, query: SceneQuery, pos: Float[np.ndarray, "3"], quat: Float[np.ndarray, "4"]) -> None:
        """Puts the bearer's main body somewhere (world frame, w-x-y-z) with what goes along, at rest and awake."""
        places = np.concatenate([pos[None], pos + quat_rotate(quat, self.pos)])
        turns = np.concatenate([quat[None], quat_multiply(quat, self.quat)])
        query.write(teleports(query.scene.tables.num_objects, np.array(self.all), places, turns))
