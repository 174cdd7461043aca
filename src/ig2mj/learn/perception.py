"""`Perception`: what networks see of an environment's observations.

Two arrays for each world: `vector`, all observations that are lists of numbers, `privileged_state` last; and `image`,
colours and depth as bytes, averaged down to the size of the encoder, or some rows of that. A critic sees the whole
vector. An actor sees

| mode | of the vector | image |
|---|---|---|
| `state` | all of it | none |
| `rgbd` | all but `privileged_state`: what the paper's agents observe | yes |

Axes: W worlds, v numbers of the vector, q bytes of an image.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
from flax import struct
from jaxtyping import Float, UInt8

from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.learn.privileged_targets import PrivilegedTargets

MODES = ("state", "rgbd")

PRIVILEGED = "privileged_state"

SIZE = 32
"""Pixels, height and width, that images are averaged down to by default."""

DEPTH_RANGE = 3.0
"""m: depth beyond this is white, where neither a card nor an environment says otherwise."""


@struct.dataclass
class Seen:
    """What networks see. `image` has no columns where the mode has none."""

    vector: Float[Array, "*w v"]
    image: UInt8[Array, "*w q"]


class Perception:
    """See the module's text.

    Attributes:
      mode: "state" or "rgbd". vector_names, sizes: the observations that the vector is made of, and their lengths.
      vector_size: v. actor_size: how many of them, from the first on, an actor sees.
      image_shape: height, width, channels; None without images.
      side: height and width that images are averaged down to. rows: the first of these rows that is kept, and the first
        below those.
      depth_range: m, that a byte of depth covers.
      targets: what an actor with images can learn to predict; None where it sees everything.
    """

    def __init__(
        self,
        spaces: Mapping[str, Any],
        mode: str = "state",
        size: int = SIZE,
        rows: tuple[int, int] | None = None,
        privileged_names: Sequence[str] = (),
        depth_range: float = DEPTH_RANGE,
    ):
        """
        Args:
          spaces: of an environment (`Environment.observation_spaces`).
          size: pixels, height and width, to which images are averaged down. rows: of those that are kept; None: all.
          privileged_names: of the privileged state (`Environment.privileged_names`), for `targets`.

        Raises:
          UnknownNameError: no such mode. Ig2mjError: the environment has no observation that the mode needs.
        """
        if mode not in MODES:
            raise UnknownNameError("kind of observation", mode, MODES)
        flat = [name for name, space in spaces.items() if len(space.shape) == 1]
        self.mode, self.depth_range = mode, depth_range
        self.vector_names = (*(n for n in flat if n != PRIVILEGED), *(n for n in flat if n == PRIVILEGED))
        self.sizes = tuple(spaces[name].shape[0] for name in self.vector_names)
        self.vector_size = sum(self.sizes)
        hidden = self.sizes[-1] if mode == "rgbd" and PRIVILEGED in flat else 0
        self.actor_size = self.vector_size - hidden
        self._images = tuple(n for n in ("rgb", "depth") if n in spaces) if mode == "rgbd" else ()
        self.image_shape: tuple[int, int, int] | None = None
        self.side, self.rows = size, rows or (0, size)
        self.targets = PrivilegedTargets(self.actor_size, hidden, privileged_names) if hidden else None
        if mode == "rgbd":
            if not self._images:
                raise Ig2mjError("pixels were requested, but the environment observes neither rgb nor depth")
            side = spaces[self._images[0]].shape[0]
            if size < 1 or side % size:
                raise Ig2mjError(f"images of {side} pixels cannot be averaged down to {size}")
            top, bottom = self.rows
            if not 0 <= top < bottom <= size:
                raise Ig2mjError(f"rows {top} to {bottom} of images of {size} rows: there are none")
            self.image_shape = (bottom - top, size, sum(spaces[n].shape[-1] for n in self._images))
        elif not self.vector_size:
            raise Ig2mjError("the environment has no observation that is a list of numbers")

    @property
    def names(self) -> tuple[str, ...]:
        """The observations that are used."""
        return (*self.vector_names, *self._images)

    @property
    def image_bytes(self) -> int:
        """q."""
        return 0 if self.image_shape is None else self.image_shape[0] * self.image_shape[1] * self.image_shape[2]

    def __call__(self, obs: Mapping[str, Array]) -> Seen:
        """What is seen of observations by name. Pure."""
        vectors = [jnp.asarray(obs[name], jnp.float32) for name in self.vector_names]
        worlds = next(iter(obs.values())).shape[0]
        vector = jnp.concatenate(vectors, axis=-1) if vectors else jnp.zeros((worlds, 0), jnp.float32)
        if self.image_shape is None:
            return Seen(vector, jnp.zeros((worlds, 0), jnp.uint8))
        small = [shrunk(obs[name], name, self.side, *self.rows, self.depth_range) for name in self._images]
        return Seen(vector, jnp.concatenate(small, axis=-1).reshape(worlds, -1))


def depth_range_of(env: Any) -> float:
    """m: the depth that an actor's images cover. The task says how far away what matters is (`Task.depth_range`); else
    it is the range of the depth sensor."""
    stated = getattr(getattr(env, "task", None), "depth_range", None)
    if stated is not None:
        return float(stated)
    space = env.observation_spaces.get("depth")
    return DEPTH_RANGE if space is None else float(space.high)


def shrunk(
    image: Array, name: str, size: int, top: int, bottom: int, depth_range: float = DEPTH_RANGE
) -> UInt8[Array, "W h size c"]:
    """An image averaged over areas to `size` rows and columns, of which rows from `top` up to `bottom` are kept, as
    bytes; depth from 0 to `depth_range` metres."""
    worlds, side, _, channels = image.shape
    cell = side // size
    values = jnp.asarray(image[:, top * cell : bottom * cell], jnp.float32)
    if name == "depth":
        # 0 means that nothing was hit: as far away as can be
        values = jnp.where(values > 0, jnp.minimum(values, depth_range), depth_range) * (255.0 / depth_range)
    mean = values.reshape(worlds, bottom - top, cell, size, cell, channels).mean((2, 4))
    return jnp.round(mean).astype(jnp.uint8)


def blank(perception: Perception, count: int) -> Seen:
    """Nothing seen, in the right shapes."""
    return Seen(jnp.zeros((count, perception.vector_size)), jnp.zeros((count, perception.image_bytes), jnp.uint8))
