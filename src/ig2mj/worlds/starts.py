"""`Starts`: what episodes of an engine's worlds start from, and the random streams that pick it.

Axes: W worlds, O objects.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.engine.base import Engine
from ig2mj.engine.model_fields import ModelFields, merged
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import ActionError, EngineError
from ig2mj.worlds import guards
from ig2mj.worlds.draw import Draw
from ig2mj.worlds.model_swaps import ModelSwaps
from ig2mj.worlds.plugin_states import completed
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.random_streams import Seeds, episode_keys, pick_rows
from ig2mj.worlds.randomization import Randomization
from ig2mj.worlds.randomize import Randomize


class Starts:
    """Rows to start from, and the floor below which an object has left the house. Made when they are first needed."""

    def __init__(
        self,
        engine: Engine,
        initial: Any,
        pool: Pool | None,
        randomize: Randomize | None = None,
        swaps: ModelSwaps | None = None,
    ):
        """`initial`: states of one world, for where no pool is given: then all start where the engine's reset does.
        `randomize`: what differs between episodes. `swaps`: objects whose models do.

        Raises EngineError: the pool is of another scene, of other added objects, or of the scene before it was changed.
        """
        if pool is not None and not isinstance(pool, Pool):
            raise EngineError(f"a pool is what load_pool(file) of ig2mj.worlds.pool returns, not {pool!r}")
        if pool is not None and pool.digest is not None and not engine.scene.owns(pool.digest):
            raise EngineError(
                f"the pool is not of scene '{engine.scene.name}' with its objects as they are now (make one with "
                "`ig2mj sample` or `ig2mj sample-task`)"
            )
        self._engine, self._initial, self._given = engine, initial, pool
        self._draw = engine.compile(self._draw_fn)
        self._randomize, self._swaps = randomize, swaps
        self._fields = engine.compile(lambda key: (self.randomization.fields(key), self.randomization.draw(key)))

    @functools.cached_property
    def pool(self) -> Pool:
        """What episodes start from, as the engine can load it best."""
        pool = self._given
        if pool is None:
            pool = Pool(physics=jax.tree.map(lambda a: a[None], self._scene[0]), states=self._initial)
        elif self._initial is not None:
            pool = dataclasses.replace(pool, states=completed(pool.states, self._initial))
        return self._engine.constants(pool)

    @functools.cached_property
    def randomization(self) -> Randomization:
        """What draws it; made when the first episode begins."""
        assert self._randomize is not None
        return Randomization(self._randomize, self._engine.scene.model, self._engine.tables)

    def rows(self, row: Int[Array, "W"], key: UInt[Array, "W 2"]) -> tuple[Pool, Draw]:
        """Rows of the pool, with the fields of the model that episodes with these keys have; and what else is drawn."""
        rows, draw = self.drawn(self.bare_rows(row), key)
        if self._swaps is None:
            return rows, draw
        choice = self._swaps.fitted(self._swaps.draw(key), row, self._fits)
        return self._swaps.swapped(rows, choice), dataclasses.replace(draw, models=self._swaps.models(choice))

    @functools.cached_property
    def _fits(self) -> Bool[np.ndarray, "P K"]:
        """Which models fit into which rows."""
        assert self._swaps is not None
        return self._swaps.fits(self._given if self._given is not None else self.pool)

    def bare_rows(self, row: Int[Array, "W"]) -> Pool:
        """Rows of the pool without fields of the model where episodes draw them."""
        rows = self.pool.rows(row)
        if self._randomize is None:
            return rows
        return dataclasses.replace(rows, physics=dataclasses.replace(rows.physics, model_fields=ModelFields()))

    def drawn(self, rows: Pool, key: UInt[Array, "W 2"]) -> tuple[Pool, Draw]:
        """The same of rows from anywhere; fields of the model that they have stay."""
        if self._randomize is None:
            return rows, Draw()
        fields, draw = self._fields(key)
        if self._swaps is not None:  # rows from elsewhere have the first choice, unless their draw says otherwise
            draw = dataclasses.replace(draw, models=self._swaps.models(jnp.zeros(key.shape[0], jnp.int32)))
        fields = merged(fields, rows.physics.model_fields)
        return dataclasses.replace(rows, physics=dataclasses.replace(rows.physics, model_fields=fields)), draw

    def no_draw(self, worlds: int) -> Draw:
        """As `rows` gives it, before any episode."""
        if self._randomize is None:
            return Draw()
        draw = self._fields(jnp.zeros((worlds, 2), jnp.uint32))[1]
        if self._swaps is None:
            return draw
        return dataclasses.replace(draw, models=self._swaps.models(jnp.zeros(worlds, jnp.int32)))

    @functools.cached_property
    def floor(self) -> Float[np.ndarray, "O"]:
        """Metres: the height below which each object has left the house."""
        return guards.lowest_support(self._scene[1], self._engine.tables.object_fixed)

    @functools.cached_property
    def _scene(self) -> tuple[Snapshot, PhysicsView]:
        """One world where the engine's reset puts it."""
        return self._engine.first_world()

    def draw(
        self, seed: Seeds, number: Int[Array, "W"], episode: Int[Array, "W"], mask: Bool[Array, "W"]
    ) -> tuple[Int[Array, "W"], UInt[Array, "W 2"], Int[Array, "W"]]:
        """Episodes after a reset of the masked worlds, their keys, and the row of the pool that each begins with."""
        return self._draw(seed, number, episode, mask)

    def _draw_fn(
        self, seed: Seeds, number: Int[Array, "W"], episode: Int[Array, "W"], mask: Bool[Array, "W"]
    ) -> tuple[Int[Array, "W"], UInt[Array, "W 2"], Int[Array, "W"]]:
        episode = jnp.where(mask, episode + 1, episode)
        key = episode_keys(seed, number, episode)
        return episode, key, pick_rows(key, self.pool.size)


def checked_mask(mask: Any, num_worlds: int) -> Bool[Array, "W"]:
    """A mask of worlds: an array of JAX, traced or not, stays one; lists and other arrays become arrays of NumPy.

    Raises:
      ActionError: it is not one truth value (or 0 or 1) for each world.
    """
    if not isinstance(mask, jax.Array):
        mask = np.asarray(mask)
    if mask.shape != (num_worlds,):
        raise ActionError(f"a mask of worlds has shape {(num_worlds,)}, not {mask.shape}")
    if mask.dtype != bool:
        whole = jnp.issubdtype(mask.dtype, jnp.integer)
        if not whole or not isinstance(mask, np.ndarray) or not np.isin(mask, (0, 1)).all():
            raise ActionError(f"a mask of worlds is true or false for each, not of {mask.dtype}: {mask}")
        mask = mask.astype(bool)
    return mask
