"""`Starts`: what episodes of an engine's worlds start from, and the random streams that pick it.

Axes: W worlds, O objects.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.engine.base import Engine
from ig2mj.engine.model_fields import ModelFields, merged
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import ActionError, EngineError
from ig2mj.process.gc_pause import Compiled
from ig2mj.worlds import guards
from ig2mj.worlds.draw import Draw
from ig2mj.worlds.model_swaps import ModelSwaps
from ig2mj.worlds.plugin_states import completed
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.random_streams import Seeds, episode_keys, pick_rows
from ig2mj.worlds.randomization import Randomization, pick
from ig2mj.worlds.randomize import Randomize
from ig2mj.worlds.robot_starts import RobotStarts


@struct.dataclass
class Choices:
    """What each world takes from tables of a scene; None: the axis is off.

    Attributes:
      object_poses: row of the start states that differ in poses.
      models: number of the choice. robot_start: of the pose.
    """

    object_poses: Int[Array, "W"] | None = None
    models: Int[Array, "W"] | None = None
    robot_start: Int[Array, "W"] | None = None


class Starts:
    """Rows to start from, and the floor below which an object has left the house. Made when they are first needed."""

    def __init__(
        self,
        engine: Engine,
        initial: Any,
        pool: Pool | None,
        randomize: Randomize | None = None,
        swaps: ModelSwaps | None = None,
        poses: Pool | None = None,
        about: Sequence[str] = (),
    ):
        """`initial`: states of one world, for where no pool is given: then all start where the engine's reset does.
        `randomize`: what differs between episodes. `swaps`: objects whose models do. `poses`: start states in place of
        the pool's where `object_poses` differ. `about`: objects that must be within reach where `robot_start` does.

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
        self._randomize, self._swaps, self._poses, self._about = randomize, swaps, poses, tuple(about)
        self._fields = engine.compile(lambda key: (self.randomization.fields(key), self.randomization.draw(key)))

    @functools.cached_property
    def pool(self) -> Pool:
        """What episodes start from, as the engine can load it best."""
        pool = self._given
        if pool is None:
            pool = Pool(physics=jax.tree.map(lambda a: a[None], self._scene[0]), states=self._initial)
        return self._loadable(pool)

    @functools.cached_property
    def poses(self) -> Pool | None:
        """What episodes start from where `object_poses` differ."""
        return None if self._poses is None else self._loadable(self._poses)

    def _loadable(self, pool: Pool) -> Pool:
        if self._given is not None and self._initial is not None:
            pool = dataclasses.replace(pool, states=completed(pool.states, self._initial))
        return self._engine.constants(pool)

    @functools.cached_property
    def randomization(self) -> Randomization:
        """What draws it; made when the first episode begins."""
        assert self._randomize is not None
        return Randomization(self._randomize, self._engine.scene.model, self._engine.tables)

    @functools.cached_property
    def robot_starts(self) -> RobotStarts | None:
        """Poses of the robot; None: it has one. Raises EngineError: there is no room for others."""
        settings = None if self._randomize is None else self._randomize.settings("robot_start")
        if settings is None:
            return None
        return RobotStarts(self._engine.scene, self._about, settings, self._scene[0].agents)

    def rows(self, row: Int[Array, "W"], key: UInt[Array, "W 2"]) -> tuple[Pool, Draw]:
        """Rows of the pool, with the fields of the model that episodes with these keys have; and what else is drawn."""
        if self._randomize is None:
            return self.bare_rows(row), Draw()
        return self.chosen(row, key, self.choices(row, key))

    def choices(self, row: Int[Array, "W"], key: UInt[Array, "W 2"], also: Pool | None = None) -> Choices:
        """What episodes with these keys choose from tables, for rows of the pool. `also`: a pool of as many rows, with
        which models and the robot's poses must be possible, too; on the host."""
        poses = models = robot = None
        if self.poses is not None:
            row = poses = pick(key, "object_poses", self.poses.size)
        if self._swaps is not None:
            fits = self._fits if also is None else self._fits & self._swaps.fits(also)
            models = self._swaps.fitted(self._swaps.draw(key), row, fits)
        if self.robot_starts is not None:
            reach = self._reach if also is None else self._reach & self.robot_starts.reach(also)
            robot = self.robot_starts.fitted(self.robot_starts.draw(key), row, reach)
        return Choices(poses, models, robot)

    def chosen(self, row: Int[Array, "W"], key: UInt[Array, "W 2"], choices: Choices) -> tuple[Pool, Draw]:
        """`rows` with other choices than the keys'."""
        poses, models, robot = choices.object_poses, choices.models, choices.robot_start
        rows = self.bare_rows(row) if poses is None else self._bare(self.poses, poses)
        rows, draw = self.drawn(rows, key)
        if poses is not None:
            draw = dataclasses.replace(draw, object_poses=poses)
        if models is not None:
            assert self._swaps is not None
            rows = self._swaps.swapped(rows, models)
            draw = dataclasses.replace(draw, models=self._swaps.models(models))
        if robot is not None:
            assert self.robot_starts is not None
            rows = self.robot_starts.moved(rows, robot)
            draw = dataclasses.replace(draw, robot_start=jnp.asarray(self.robot_starts.offsets)[robot])
        return rows, draw

    def with_values(
        self, row: Int[np.ndarray, "W"], values: Mapping[str, Array], models: Int[np.ndarray, "W"] | None = None
    ) -> tuple[Pool, Draw]:
        """Rows of the pool with values that were drawn elsewhere. On the host.

        Args:
          values: those of `Randomization.values` and of `Draw`. Axes that are on and have none are as the scene has
            them (`Randomization.neutral`, and the robot's usual start).
          models: numbers of the choices.
        """
        values = {**self.randomization.neutral(len(row)), **values}
        fields = self.randomization.fields_of(values)
        rows = self.bare_rows(row)
        rows = dataclasses.replace(rows, physics=dataclasses.replace(rows.physics, model_fields=fields))
        named = {f.name for f in dataclasses.fields(Draw)} & values.keys()
        draw = self._usual(Draw(**{name: values[name] for name in named}), len(row))
        if models is not None:
            assert self._swaps is not None
            rows = self._swapped(rows, models)
            draw = dataclasses.replace(draw, models=self._swaps.models(models))
        if self.robot_starts is not None:
            usual = np.zeros((len(row), 3), np.float32)
            offsets = np.asarray(values.get("robot_start", usual), np.float32)
            rows = self.robot_starts.moved_by(rows, offsets)
            draw = dataclasses.replace(draw, robot_start=offsets)
        return rows, draw

    @functools.cached_property
    def _swapped(self) -> Compiled:
        """`ModelSwaps.swapped` as one program."""
        assert self._swaps is not None
        return Compiled(self._swaps.swapped)

    @functools.cached_property
    def _fits(self) -> Bool[np.ndarray, "P K"]:
        """Which models fit into which rows."""
        assert self._swaps is not None
        return self._swaps.fits(self._table)

    @functools.cached_property
    def _reach(self) -> Bool[np.ndarray, "P K"]:
        """From which poses of the robot the objects of which rows are within reach."""
        assert self.robot_starts is not None
        with jax.ensure_compile_time_eval():
            return self.robot_starts.reach(self._table)

    @property
    def _table(self) -> Pool:
        """Rows that episodes start from, on the host."""
        return next(pool for pool in (self._poses, self._given, self.pool) if pool is not None)

    def bare_rows(self, row: Int[Array, "W"]) -> Pool:
        """Rows of the pool without fields of the model where episodes draw them."""
        return self._bare(self.pool, row)

    def _bare(self, pool: Pool | None, row: Int[Array, "W"]) -> Pool:
        assert pool is not None
        rows = pool.rows(row)
        if self._randomize is None:
            return rows
        return dataclasses.replace(rows, physics=dataclasses.replace(rows.physics, model_fields=ModelFields()))

    def drawn(self, rows: Pool, key: UInt[Array, "W 2"]) -> tuple[Pool, Draw]:
        """The same of rows from anywhere; fields of the model that they have stay."""
        if self._randomize is None:
            return rows, Draw()
        fields, draw = self._fields(key)
        draw = self._usual(draw, key.shape[0])  # of rows from elsewhere, unless their draw says otherwise
        fields = merged(fields, rows.physics.model_fields)
        return dataclasses.replace(rows, physics=dataclasses.replace(rows.physics, model_fields=fields)), draw

    def no_draw(self, worlds: int) -> Draw:
        """As `rows` gives it, before any episode."""
        if self._randomize is None:
            return Draw()
        return self._usual(self._fields(jnp.zeros((worlds, 2), jnp.uint32))[1], worlds)

    def _usual(self, draw: Draw, worlds: int) -> Draw:
        """With the first choice of everything that is chosen from tables."""
        zero = np.zeros(worlds, np.int32)
        if self._swaps is not None:
            draw = dataclasses.replace(draw, models=self._swaps.models(zero))
        if self._poses is not None:
            draw = dataclasses.replace(draw, object_poses=zero)
        if self.robot_starts is not None:
            draw = dataclasses.replace(draw, robot_start=np.zeros((worlds, 3), np.float32))
        return draw

    @functools.cached_property
    def floor(self) -> Float[np.ndarray, "O"]:
        """Metres: the height below which each object has left the house."""
        floor = guards.lowest_support(self._scene[1], self._engine.tables.object_fixed)
        return floor if self._swaps is None else self._swaps.lowest(floor)

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
