"""Orientations that placed objects are given: stable ones, turned about the vertical or tipped onto a side.

Quaternions are w-x-y-z, in the world frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.sampling.query import SceneQuery

TILT = 0.35
"""Radians by which a tipped object leans at most."""


class StableOrientations:
    """Draws stable orientations of a scene's objects (`ObjectEntry.orientations`)."""

    def __init__(self, query: SceneQuery):
        """`query`: the world in which objects are placed."""
        self._query = query
        self._stable = [_quats_and_probabilities(entry.orientations) for entry in query.scene.manifest.objects]

    def draw(
        self, object_index: int, rng: np.random.Generator, along: int, flat: bool, as_it_is: bool = False
    ) -> Float[np.ndarray, "4"]:
        """A stable orientation, drawn by its probability and turned about the vertical.

        Args:
          along: index of an object whose sides the orientation is aligned with; -1: any angle.
          flat: take the stable orientation in which the object is lowest, instead of drawing one.
          as_it_is: take the present orientation, instead of drawing one.
        """
        quats, prob = self._stable[object_index]
        if quats is None or as_it_is:
            quat = np.array(self._query.view.object_quat[0, object_index], float)
        elif flat:
            shapes = [self._query.footprint(object_index, q, np.zeros(2)) for q in quats]
            quat = quats[int(np.argmin([shape.high - shape.low for shape in shapes]))]
        else:
            quat = quats[rng.choice(len(prob), p=prob)]
        angle = _yaw(rng, np.asarray(self._query.view.object_quat[0, along], float) if along >= 0 else None)
        w, x, y, z = quat
        c, s = np.cos(angle / 2), np.sin(angle / 2)
        turned = np.array([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w])
        return turned / np.linalg.norm(turned)


def tipped(
    quat: Float[np.ndarray, "4"], rng: np.random.Generator, along: Float[np.ndarray, "4"] | None
) -> Float[np.ndarray, "4"]:
    """An orientation turned onto another side and tilted by up to `TILT`, as a book leans in a bag.

    Args:
      along: orientation of the container, about one of whose horizontal axes the object is turned; None: any axis.
    """
    angle = _yaw(rng, along)
    turn = (np.pi / 2 + rng.uniform(-TILT, TILT)) / 2
    w, (x, y) = np.cos(turn), np.sin(turn) * np.array([np.cos(angle), np.sin(angle)])
    a, b, c, d = quat
    return np.array([w * a - x * b - y * c, w * b + x * a + y * d, w * c + y * a - x * d, w * d + x * c - y * b])


def _yaw(rng: np.random.Generator, along: Float[np.ndarray, "4"] | None) -> float:
    """A random angle about the vertical, in radians; with `along` one of the four that align with its axes."""
    angle = rng.uniform(-np.pi, np.pi)
    if along is None:
        return angle
    w, x, y, z = along
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) + rng.integers(4) * np.pi / 2


def _quats_and_probabilities(entries: Sequence) -> tuple[np.ndarray | None, np.ndarray]:
    if not entries:
        return None, np.zeros(0)
    prob = np.array([e.prob for e in entries], float)
    return np.array([e.quat for e in entries], float), prob / prob.sum()
