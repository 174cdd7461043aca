"""`Hidden`: what an actor that sees pictures learns to tell of `privileged_state`, an auxiliary task of its encoder.

The simulator knows where everything is in every frame, and training may use that; what acts later needs the pictures
alone. Velocities are left out, since one picture does not show them. A quaternion stands for two columns of the
rotation matrix: q and -q are the same rotation, and a network that must choose between them learns neither.

Axes: B samples, v numbers of a vector, g of a guess.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import quat_rotate
from ig2mj.learn.projection import FRAME, Lens

FLAT = 0.01
"""Error, in standard deviations, below which a guess's loss is quadratic. Beyond it is the absolute error: centimetres
count as much as decimetres, so that places go on getting better once they are about right."""


class Hidden:
    """Which numbers of a vector are to be guessed. All methods are pure.

    Attributes:
      size: g. objects: how many objects, hands apart, have a pose and are to be found in the picture.
      plain: which numbers of the vector are guessed as they are; they come first in the guess.
      poses: of each object by name where in the guess its place (3 numbers) is, and how it is turned (6).
      quats: [objects with poses, 4] which of the vector's numbers say how these are turned.
    """

    def __init__(self, first: int, count: int, names: Sequence[str] = (), lens: Lens | None = None):
        """
        Args:
          first, count: of the vector's numbers that an actor does not see.
          names: of these, as `Environment.privileged_names` has them; without names all are guessed as they are.
          lens: where objects are in the picture; None: that is not guessed.
        """
        names = list(names) or [""] * count
        assert len(names) == count, "a name for each number"
        turns = [k for k, name in enumerate(names) if name.endswith("_quat_w")]  # x, y and z follow
        turns.sort(key=lambda k: not names[k].startswith("hand_"))  # the objects' are last
        parts = {k + j for k in turns for j in range(4)}
        plain = [k for k, n in enumerate(names) if k not in parts and "_velocity_" not in n]
        self.plain = first + np.array(plain, int)
        self._turns = first + np.array([[k + j for j in range(4)] for k in turns], int).reshape(-1, 4)
        self.size = len(plain) + 6 * len(turns)
        whole = [n.removesuffix("_quat_w") for n in names if n.endswith("_quat_w") and not n.startswith("hand_")]
        self.quats = self._turns[len(turns) - len(whole) :]
        self._turned = np.arange(len(plain), self.size)
        starts = [names.index(f"{name}_pos_x") for name in whole if f"{name}_pos_x" in names]
        self._spots = first + np.array([[k + j for j in range(3)] for k in starts], int).reshape(-1)
        self._lens, self.objects = lens, len(starts) if lens is not None else 0
        places = [plain.index(k) for k in starts]
        first_turn = self.size - 6 * len(whole)
        self.poses = {
            name: (list(range(place, place + 3)), list(range(first_turn + 6 * k, first_turn + 6 * k + 6)))
            for k, (name, place) in enumerate(zip(whole, places, strict=False))
        }

    def __call__(
        self, vector: Float[Array, "B v"], normal: Float[Array, "B v"], count: int | None = None
    ) -> Float[Array, "B g"]:
        """What is to be guessed, each number with a deviation of about 1.

        Args:
          vector: as it was observed. normal: less its mean, over its deviation.
          count: of the numbers; where that is more than g, rows and columns of the objects in the picture follow.
        """
        quat = vector[:, self._turns]
        columns = [quat_rotate(quat, jnp.asarray(axis)) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
        turned = jnp.sqrt(3.0) * jnp.concatenate(columns, axis=-1)
        found = [normal[:, self.plain], turned.reshape(vector.shape[0], -1)]
        if self._lens is not None and count is not None and count > self.size:
            places = vector[:, self._spots].reshape(-1, self.objects, 3)
            found.append(FRAME * self._lens(places).reshape(vector.shape[0], -1))
        return jnp.concatenate(found, axis=-1)

    def loss(
        self, guess: Float[Array, "B g"], vector: Float[Array, "B v"], normal: Float[Array, "B v"]
    ) -> Float[Array, ""]:
        """Mean error of a guess: squared of rotations, else as `guess_loss`.

        Whoever cannot tell yet which way round a thing is guesses the middle. There an absolute error is flat, and is
        left late; a squared one is steep on both sides.
        """
        wanted = self(vector, normal, guess.shape[-1])
        other = np.setdiff1d(np.arange(guess.shape[-1]), self._turned)
        squares = jnp.square(guess - wanted)[:, self._turned].sum(-1).mean()
        plain = guess_loss(guess[:, other], wanted[:, other]) * len(other) if len(other) else 0.0
        return (squares + plain) / guess.shape[-1]


def guess_loss(guess: Float[Array, "B g"], wanted: Float[Array, "B g"]) -> Float[Array, ""]:
    """Mean absolute error, but quadratic near 0 (`FLAT`)."""
    return (jnp.sqrt(jnp.square(guess - wanted) + FLAT**2) - FLAT).mean()
