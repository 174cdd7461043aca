"""`Worlds`: many worlds of one scene, stepped by one pure function.

    engine = WarpEngine(scene, 4096)
    worlds = Worlds(engine, StateModel.of_manifest(scene.tables, scene.manifest), pool, goal)
    batch = worlds.start(seed=0)
    step = jax.jit(worlds.step, donate_argnums=0)
    batch, status = step(batch, ctrl)
    batch = jax.jit(worlds.reset)(batch, batch.flags != 0)

A step is physics, view, states, guards and the goal, in that order; `jax.lax.scan` can run it, and nothing leaves the
device. It works with every engine: with the native one (not pure) call it without `jit`.

Axes: W worlds, K guard flags.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import Engine, Physics, Write
from ig2mj.engine.health import Health
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import RelationPlan
from ig2mj.states.update import queries, update
from ig2mj.states.world import ExtendedStates, Swap, WorldState
from ig2mj.worlds import guards
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.random_streams import episode_keys, pick_rows


@struct.dataclass
class Batch:
    """A batch of worlds.

    Attributes:
      world: physics, view, states, keys, clocks.
      number: global number of each world; with several devices a batch is a part of all worlds.
      seed: of all random streams. episode: how often each world was reset.
      flags: `guards.Flag` of each world since its reset. troubles: how often each world was flagged, per flag.
    """

    world: WorldState
    number: Int[Array, "W"]
    seed: Int[Array, ""]
    episode: Int[Array, "W"]
    flags: Int[Array, "W"]
    troubles: Int[Array, "W K"]


class Worlds:
    """The functions of a batch; holds constants only.

    Attributes:
      floor: [O] metres; the height below which each object has left the house.
    """

    def __init__(
        self,
        engine: Engine,
        model: StateModel,
        pool: Pool | None = None,
        goal: CompiledExpression | None = None,
        initial_values: ExtendedStates | None = None,
    ):
        """Binds an engine to the rules of a scene.

        Args:
          engine: physics. model: constants of the states.
          pool: initial states to reset to; None: every episode starts where `engine.reset` starts.
          goal: evaluated at the end of every step.
          initial_values: extended states, one world, of episodes without a pool; None: everything warm, dry and clean.
        """
        self.engine, self.model, self.goal = engine, model, goal
        asked = queries(model) + (goal.queries if goal is not None else [])
        self.plan = RelationPlan.build(model, asked)
        jit_if_pure = jax.jit if engine.pure else (lambda function, **_: function)
        self._begin = jit_if_pure(self._episode_0, donate_argnums=0)
        self._react = self._rules if engine.pure else jax.jit(self._rules)
        physics = engine.reset()
        view = jit_if_pure(lambda p: jax.tree.map(lambda a: a[:1], engine.view(p)))(physics)
        self.floor = guards.lowest_support(view, model.tables.object_fixed)
        if pool is None:
            row = jax.tree.map(lambda a: a[None], engine.export(physics, 0))
            states = initial_values if initial_values is not None else initial_states(model, 1)
            pool = Pool(physics=row, states=states)
        self.pool: Pool = jax.device_put(jax.tree.map(_single_precision, pool))

    def start(self, seed: int | Int[Array, ""] = 0, first: int | Int[Array, ""] = 0) -> Batch:
        """All worlds at the start of episode 0. `first`: global number of the first one."""
        return self._begin(self.engine.reset(), seed, first)

    def _episode_0(self, physics: Physics, seed: int | Int[Array, ""], first: int | Int[Array, ""]) -> Batch:
        """The start, from physics in any state."""
        count = self.engine.num_worlds
        number = first + jnp.arange(count, dtype=jnp.int32)
        episode = jnp.zeros(count, jnp.int32)
        world = WorldState(
            physics=physics,
            view=self.engine.view(physics),
            states=initial_states(self.model, count),
            key=episode_keys(seed, number, episode),
            step=jnp.zeros(count, jnp.int32),
            time=jnp.zeros(count, jnp.float32),
        )
        batch = Batch(
            world=world,
            number=number,
            seed=jnp.asarray(seed, jnp.int32),
            episode=episode - 1,
            flags=jnp.zeros(count, jnp.int32),
            troubles=jnp.zeros((count, len(guards.Flag)), jnp.int32),
        )
        return self.reset(batch, jnp.ones(count, bool))

    def step(self, batch: Batch, ctrl: Float[Array, "W nu"] | None = None) -> tuple[Batch, GoalStatus | None]:
        """One control step of every world, and what the goal says afterwards (None without a goal)."""
        world = batch.world
        physics, view = self.engine.step(world.physics, ctrl)
        states, teleports, status, flags = self._react(world.states, view, self.engine.health(physics))
        if teleports is not None:
            physics = self.engine.write(physics, teleports)
        new = guards.count(flags & ~batch.flags)
        world = WorldState(
            physics=physics,
            view=view,
            states=states,
            key=world.key,
            step=world.step + 1,
            time=world.time + jnp.float32(self.engine.substeps * self.engine.timestep),
        )
        return dataclasses.replace(batch, world=world, flags=batch.flags | flags, troubles=batch.troubles + new), status

    def reset(self, batch: Batch, mask: Bool[Array, "W"]) -> Batch:
        """Starts a new episode in the masked worlds, from a random row of the pool."""
        world = batch.world
        episode = jnp.where(mask, batch.episode + 1, batch.episode)
        key = episode_keys(batch.seed, batch.number, episode)
        rows = self.pool.rows(jnp.asarray(pick_rows(key, self.pool.size)))
        physics = self.engine.load(world.physics, rows.physics, mask)
        view = self.engine.view(physics)

        def fresh(new: Array, old: Array) -> Array:
            return jnp.where(mask.reshape((-1,) + (1,) * (old.ndim - 1)), new, old)

        world = WorldState(
            physics=physics,
            view=view,
            states=jax.tree.map(fresh, rows.states, world.states),
            key=fresh(key, world.key),
            step=fresh(jnp.zeros_like(world.step), world.step),
            time=fresh(jnp.zeros_like(world.time), world.time),
        )
        return dataclasses.replace(batch, world=world, episode=episode, flags=jnp.where(mask, 0, batch.flags))

    def metrics(self, batch: Batch) -> dict[str, int]:
        """How often worlds were flagged so far, by flag, and episodes begun. On the host."""
        return {"episodes": int(np.asarray(batch.episode).sum()) + len(batch.number), **guards.metrics(batch.troubles)}

    def raise_flagged(self, batch: Batch) -> None:
        """Debug mode: raises EngineError for the first flagged world, naming world, flag and the setting to raise."""
        guards.raise_first(batch.flags, self.engine.health(batch.world.physics).overflow)

    def _rules(
        self, states: ExtendedStates, view: PhysicsView, health: Health
    ) -> tuple[ExtendedStates, Write | None, GoalStatus | None, Int[Array, "W"]]:
        """All of a step that is not physics. Pure."""
        relations = self.plan.evaluate(view)
        states, swap = update(self.model, states, view, relations)
        teleports = self._teleports(swap, view) if len(self.model.swap_objects) else None
        status = None if self.goal is None else self.goal.status(states, view, relations)
        return states, teleports, status, guards.check(health, view, self.floor)

    def _teleports(self, swap: Swap, view: PhysicsView) -> Write:
        """The engine's write for what slicing asks."""
        objects = self.model.swap_objects
        pos, quat = jnp.asarray(view.object_pos), jnp.asarray(view.object_quat)
        mask = jnp.zeros(pos.shape[:2], bool)
        return Write(
            object_mask=mask.at[:, objects].set(swap.mask),
            object_pos=pos.at[:, objects].set(swap.pos),
            object_quat=quat.at[:, objects].set(swap.quat),
        )


def _single_precision(array: Array) -> np.ndarray:
    values = np.asarray(array)
    return values.astype(np.float32) if values.dtype == np.float64 else values
