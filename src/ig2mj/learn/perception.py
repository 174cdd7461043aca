"""`Perception`: what networks see of an environment's observations.

Two arrays for each world: `vector`, all observations that are lists of numbers, `privileged_state` last; and `picture`,
colours and depth as bytes, averaged down to the size of the encoder, or the rows of that which matter. A critic sees
the whole vector. An actor sees

| mode | of the vector | picture |
|---|---|---|
| `state` | all of it | none |
| `rgbd` | all but `privileged_state`: what the paper's agents observe | yes |

Axes: W worlds, v numbers of the vector, q bytes of a picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
from flax import struct
from jaxtyping import Float, UInt8

from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.learn.hidden import Hidden
from ig2mj.learn.projection import Lens
from ig2mj.learn.recall import grips_of, hands_of

MODES = ("state", "rgbd")

PRIVILEGED = "privileged_state"

SIZE = 32
"""Pixels, height and width, that pictures are averaged down to if nothing else is said."""

FAR = 3.0
"""m: depth beyond this is white. All six activities are within reach of an arm."""


@struct.dataclass
class Seen:
    """What networks see. `picture` has no columns where the mode has none."""

    vector: Float[Array, "*w v"]
    picture: UInt8[Array, "*w q"]


class Perception:
    """See the module's text.

    Attributes:
      mode: "state" or "rgbd". vector_names: the observations that the vector is made of.
      vector_size: v. actor_size: how many of them, from the first on, an actor sees.
      picture_shape: height, width, channels; None without pictures.
      rows: the first row of the encoder's picture that is kept, and the first below those.
      hidden: what an actor with pictures can learn to guess; None where it sees everything.
      grips, hands: which numbers of the vector say whether a hand holds something, and where it is (`recall.hands_of`).
    """

    def __init__(
        self,
        spaces: Mapping[str, Any],
        mode: str = "state",
        size: int = SIZE,
        rows: tuple[int, int] | None = None,
        hidden_names: Sequence[str] = (),
        lens: Lens | None = None,
        felt_names: Sequence[str] = (),
    ):
        """
        Args:
          spaces: of an environment (`Environment.observation_spaces`).
          size: pixels, height and width, to which pictures are averaged down. rows: of those that are kept; None: all.
          hidden_names: of the privileged state (`Environment.privileged_names`), for `hidden`. lens: the camera, from
            which an actor learns where in the picture objects are. felt_names: of the numbers of `proprioception`
            (`Environment.proprioception_names`), for `grips`.

        Raises:
          UnknownNameError: no such mode. Ig2mjError: the environment has no observation that the mode needs.
        """
        if mode not in MODES:
            raise UnknownNameError("kind of observation", mode, MODES)
        flat = [name for name, space in spaces.items() if len(space.shape) == 1]
        self.mode = mode
        self.vector_names = (*(n for n in flat if n != PRIVILEGED), *(n for n in flat if n == PRIVILEGED))
        self.sizes = tuple(spaces[name].shape[0] for name in self.vector_names)
        self.vector_size = sum(self.sizes)
        self.grips = grips_of(self.vector_names, self.sizes, felt_names)
        self.hands = hands_of(self.grips, self.vector_names, self.sizes, felt_names)
        hidden = self.sizes[-1] if mode == "rgbd" and PRIVILEGED in flat else 0
        self.actor_size = self.vector_size - hidden
        self._pictures = tuple(n for n in ("rgb", "depth") if n in spaces) if mode == "rgbd" else ()
        self.picture_shape, self.rows = None, rows or (0, size)
        self.hidden = Hidden(self.actor_size, hidden, hidden_names, lens) if hidden else None
        if mode == "rgbd":
            if not self._pictures:
                raise Ig2mjError("pixels were requested, but the environment observes neither rgb nor depth")
            side = spaces[self._pictures[0]].shape[0]
            if size < 1 or side % size:
                raise Ig2mjError(f"pictures of {side} pixels cannot be averaged down to {size}")
            top, bottom = self.rows
            if not 0 <= top < bottom <= size:
                raise Ig2mjError(f"rows {top} to {bottom} of pictures of {size} rows: there are none")
            self._side = size
            self.picture_shape = (bottom - top, size, sum(spaces[n].shape[-1] for n in self._pictures))
        elif not self.vector_size:
            raise Ig2mjError("the environment has no observation that is a list of numbers")

    @property
    def objects(self) -> int:
        """How many objects there are that an actor can learn to find in the picture."""
        return self.hidden.objects if self.hidden else 0

    @property
    def names(self) -> tuple[str, ...]:
        """The observations that are looked at."""
        return (*self.vector_names, *self._pictures)

    def __call__(self, obs: Mapping[str, Array]) -> Seen:
        """What is seen of observations by name. Pure."""
        vectors = [jnp.asarray(obs[name], jnp.float32) for name in self.vector_names]
        worlds = next(iter(obs.values())).shape[0]
        vector = jnp.concatenate(vectors, axis=-1) if vectors else jnp.zeros((worlds, 0), jnp.float32)
        if self.picture_shape is None:
            return Seen(vector, jnp.zeros((worlds, 0), jnp.uint8))
        top, bottom = self.rows
        small = [shrunk(obs[name], name, self._side, top, bottom) for name in self._pictures]
        return Seen(vector, jnp.concatenate(small, axis=-1).reshape(worlds, -1))


def shrunk(picture: Array, name: str, size: int, top: int, bottom: int) -> UInt8[Array, "W h size c"]:
    """A picture averaged over areas to `size` rows and columns, of which rows from `top` up to `bottom` are kept, as
    bytes; depth from 0 to `FAR` metres."""
    worlds, side, _, channels = picture.shape
    cell = side // size
    values = jnp.asarray(picture[:, top * cell : bottom * cell], jnp.float32)
    if name == "depth":
        # 0 means that nothing was hit: as far as can be
        values = jnp.where(values > 0, jnp.minimum(values, FAR), FAR) * (255.0 / FAR)
    mean = values.reshape(worlds, bottom - top, cell, size, cell, channels).mean((2, 4))
    return jnp.round(mean).astype(jnp.uint8)


def blank(perception: Perception, count: int) -> Seen:
    """Nothing seen, in the right shapes."""
    shape = perception.picture_shape
    size = 0 if shape is None else shape[0] * shape[1] * shape[2]
    return Seen(jnp.zeros((count, perception.vector_size)), jnp.zeros((count, size), jnp.uint8))
