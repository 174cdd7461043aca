"""`PrivilegedTargets`: what an actor that sees images learns to predict of `privileged_state`, an auxiliary task.

The simulator knows where everything is in every frame, and training may use that; the trained policy needs images
alone. Velocities are left out, since one image does not show them. A quaternion is replaced by two columns of the
rotation matrix: q and -q are the same rotation, and a network that must choose between them learns neither.

Axes: B samples, v numbers of a vector, g of a prediction.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import quat_rotate

FLAT = 0.01
"""Error, in standard deviations, below which the loss is quadratic. Beyond it the loss is the absolute error, so that
positions go on improving once they are about right."""


class PrivilegedTargets:
    """Which numbers of a vector are predicted. All methods are pure.

    Attributes:
      size: g. pose_size: of these, all but what subclasses add at the end.
      plain: which numbers of the vector are predicted as they are; they come first in the prediction.
      poses: of each object by name where in the prediction its position (3 numbers) and its rotation (6) are.
      quats: [objects with poses, 4] which of the vector's numbers are their quaternions.
      positions: [objects with poses, 3] and which are their positions.
    """

    def __init__(self, first: int, count: int, names: Sequence[str] = ()):
        """
        Args:
          first, count: of the vector's numbers that an actor does not see.
          names: of these, as `Environment.privileged_names` has them; without names all are predicted as they are.
        """
        names = list(names) or [""] * count
        assert len(names) == count, "a name for each number"
        turns = [k for k, name in enumerate(names) if name.endswith("_quat_w")]  # x, y and z follow
        turns.sort(key=lambda k: not names[k].startswith("hand_"))  # the objects' are last
        parts = {k + j for k in turns for j in range(4)}
        plain = [k for k, n in enumerate(names) if k not in parts and "_velocity_" not in n]
        self.plain = first + np.array(plain, int)
        self._turns = first + np.array([[k + j for j in range(4)] for k in turns], int).reshape(-1, 4)
        self.size = self.pose_size = len(plain) + 6 * len(turns)
        self._turned = np.arange(len(plain), self.pose_size)
        objects = [n.removesuffix("_quat_w") for n in names if n.endswith("_quat_w") and not n.startswith("hand_")]
        starts = [names.index(f"{name}_pos_x") for name in objects if f"{name}_pos_x" in names]
        self.quats = self._turns[len(turns) - len(objects) :]
        self.positions = first + np.array([[k + j for j in range(3)] for k in starts], int).reshape(-1, 3)
        first_turn = self.pose_size - 6 * len(objects)
        self.poses = {
            name: (list(range(place, place + 3)), list(range(first_turn + 6 * k, first_turn + 6 * k + 6)))
            for k, (name, place) in enumerate(zip(objects, [plain.index(k) for k in starts], strict=False))
        }

    def __call__(self, vector: Float[Array, "B v"], normal: Float[Array, "B v"]) -> Float[Array, "B g"]:
        """The targets, each number with a deviation of about 1.

        Args:
          vector: as it was observed. normal: less its mean, over its deviation.
        """
        quat = vector[:, self._turns]
        columns = [quat_rotate(quat, jnp.asarray(axis)) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
        turned = jnp.sqrt(3.0) * jnp.concatenate(columns, axis=-1)
        return jnp.concatenate([normal[:, self.plain], turned.reshape(vector.shape[0], -1)], axis=-1)

    def loss(
        self, prediction: Float[Array, "B g"], vector: Float[Array, "B v"], normal: Float[Array, "B v"]
    ) -> Float[Array, ""]:
        """Mean error of a prediction: squared for rotations, else as `prediction_loss`.

        While the orientation is ambiguous, the best prediction in absolute error is the mean, where the gradient
        vanishes; that of a squared error does not.
        """
        target = self(vector, normal)
        other = np.setdiff1d(np.arange(self.size), self._turned)
        squares = jnp.square(prediction - target)[:, self._turned].sum(-1).mean()
        plain = prediction_loss(prediction[:, other], target[:, other]) * len(other) if len(other) else 0.0
        return (squares + plain) / self.size


def prediction_loss(prediction: Float[Array, "B g"], target: Float[Array, "B g"]) -> Float[Array, ""]:
    """Mean absolute error, but quadratic near 0 (`FLAT`)."""
    return (jnp.sqrt(jnp.square(prediction - target) + FLAT**2) - FLAT).mean()
