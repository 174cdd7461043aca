"""`Core`: how worlds start, step and reset. There is no other stepping in this package.

    core = Core(make_engine("native", scene, 64), Rules.of_scene(scene).with_goal("(cooked fish_0)"))
    batch = core.start(seed=0)
    batch, status = core.step(batch)
    batch = core.reset(batch, status.holds)

A control step is, in this order: the robots' controllers, physics, its view, extended states and the goal, what slicing
moves, what hands take hold of and let go of, guards, clocks. It is the same function for every engine; the engine
decides how functions run (`ig2mj.engine.base`). `step`, `reset`, `rollout`, `write` and `load` consume the batch they
are given: continue with the one that is returned. A consumed batch raises StaleStateError; `fork` copies one first.

`step_fn`, `reset_fn` and `start_fn` are the same functions, not compiled: call them inside your own `jax.jit` or
`lax.scan` where the engine's physics can be traced, or directly on any engine.

The faces are `Worlds` (a batch, by names), `DebugWorlds` (watched), `ShardedWorlds` (several devices) and
`ig2mj.Simulation` (one world).

Axes: W worlds, O objects, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.agents.base import Controller
from ig2mj.agents.grasping import Grasping
from ig2mj.engine.base import Engine, Physics, Write
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import LostWorldError
from ig2mj.predicates.compile import GoalStatus
from ig2mj.process import entry_point
from ig2mj.process.gc_pause import GC_PAUSED, compile_together
from ig2mj.states.world import ExtendedStates, Swap, WorldState
from ig2mj.worlds import guards
from ig2mj.worlds.agent_cameras import AgentCameras
from ig2mj.worlds.batch import Batch, select_worlds
from ig2mj.worlds.controls import Controls
from ig2mj.worlds.hand_resets import HandResets
from ig2mj.worlds.hands import Hands, Held
from ig2mj.worlds.incremental import rules_step
from ig2mj.worlds.model_swaps import ModelSwaps
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.random_streams import Seeds
from ig2mj.worlds.randomize import Randomize
from ig2mj.worlds.rules import Outcome, Rules, States
from ig2mj.worlds.starts import Starts, checked_mask

Policy = Callable[[Batch, Any], tuple[Float[Array, "W n"] | None, Any]]
"""The next step's action (or controls) from the batch and a carry, and the new carry. Pure."""


class Advanced(NamedTuple):
    """Result of a control step: physics, its view, states, status of the goal, and what hands hold."""

    physics: Physics
    view: PhysicsView
    states: States
    status: GoalStatus
    grasps: Held


@entry_point
class Core:
    """Start, step and reset of the worlds of one engine.

    Attributes:
      engine: physics. rules: states and goal. controllers: of the scene's robots. controls: from actions to MuJoCo's
        controls. hands: what they hold. hand_resets: hands that are reset. cameras: of the robots, in views.
      grasping: how hands hold. starts: what episodes start from. advance: see `advance_fn`.
    """

    def __init__(
        self,
        engine: Engine,
        rules: Rules | None = None,
        pool: Pool | None = None,
        controllers: Sequence[Controller] = (),
        grasping: Grasping | None = None,
        hand_resets: bool = False,
        randomize: Randomize | None = None,
        swaps: ModelSwaps | None = None,
        poses: Pool | None = None,
        about: Sequence[str] = (),
    ):
        """Binds an engine to the rules of its scene.

        Args:
          rules: states and goal; None: physics only, which `advance` alone can step.
          pool: what episodes start from; None: from where the engine's `reset` stands, with `rules.initial`.
          controllers: one for each robot of the scene, in the order of its actuators; actions go through them. Without
            any, an action is MuJoCo's controls.
          grasping: how hands take hold of objects; None: by friction alone.
          hand_resets: hands that an action asks back are teleported where they are out of reach; makes compiled
            programs larger.
          randomize: what differs between episodes; the engine must have its `model_fields`.
          swaps: objects whose models do. poses: start states in place of the pool's where `object_poses` differ.
          about: objects that must be within reach where `robot_start` differs.
        """
        self.engine, self.rules, self.controllers = engine, rules, tuple(controllers)
        self.grasping, self.hands = (
            grasping,
            Hands(engine, grasping, self.controllers, None if rules is None else rules.model.joints),
        )
        self.cameras = AgentCameras(engine, self.controllers)
        self.hand_resets = HandResets(engine, self.controllers, hand_resets)
        self.controls = Controls(engine, self.controllers)
        self.starts = Starts(engine, rules.initial if rules is not None else None, pool, randomize, swaps, poses, about)
        self.physics_step = engine.step  # a world at rest steps in under 2 us: even looking up a name counts
        self._count = guards.counter(engine, lambda: self.starts.floor, engine.substeps * engine.timestep)
        self._select = engine.compile(select_worlds)
        self.advance = engine.program(self.advance_fn)
        self._step = engine.program(self.step_fn, self.check, donate_argnums=0)
        self._reset = engine.program(self.reset_fn, self.check, donate_argnums=0)
        self._rollout = engine.program(self._rollout_fn, self.check, static_argnums=(2, 3), donate_argnums=(0, 1))
        self._begin = engine.program(self.start_fn, donate_argnums=0)
        self._write = engine.program(self.write_fn, self.check, donate_argnums=0)
        self._load = engine.program(self.load_fn, self.check, donate_argnums=0)
        self._rules_step = self._no_rules if rules is None else rules_step(rules, engine)
        self._no_status = GoalStatus.empty(engine.num_worlds)

    # A control step.

    def step(self, batch: Batch, action: Float[Array, "W n"] | None = None) -> tuple[Batch, GoalStatus]:
        """One control step of every world.

        Args:
          action: of the robots, clipped to the limits of `controls`; without controllers, MuJoCo's controls
            [W, nu]. None: the previous controls are kept.

        Returns:
          The batch after the step, and the status of the goal: of the states after it, and of the view before slicing
          moved anything.
        """
        return self._step(batch, action)

    def step_fn(self, batch: Batch, action: Float[Array, "W n"] | None = None) -> tuple[Batch, GoalStatus]:
        """`step`, not compiled."""
        if self.controllers and action is not None:
            batch, action = self.act(batch, action)
        return self._control_step(batch, action)

    def repeat_action_fn(self, batch: Batch, action: Float[Array, "W n"], steps: int) -> tuple[Batch, GoalStatus]:
        """`steps` control steps of one action, not compiled: controllers act once, and their controls are kept."""
        if self.controllers:
            batch, action = self.act(batch, action)
        return self.engine.repeat(lambda batch: self._control_step(batch, action), batch, steps)

    def act(self, batch: Batch, action: Float[Array, "W n"]) -> tuple[Batch, Float[Array, "W nu"]]:
        """The controllers' part of a step: the batch after it, and MuJoCo's controls for an action; not compiled."""
        world = batch.world
        ctrl, controllers = self.controls.act(action, world.view, batch.controllers)
        physics = self.hand_resets.act(world.physics, world.view, action, controllers)
        world = dataclasses.replace(world, physics=physics)
        return dataclasses.replace(batch, world=world, controllers=controllers), ctrl

    def _control_step(self, batch: Batch, ctrl: Float[Array, "W nu"] | None) -> tuple[Batch, GoalStatus]:
        """One control step of MuJoCo's controls: `advance_fn`, guards and clocks."""
        world, controllers = batch.world, batch.controllers
        try:
            physics, view = self.physics_step(world.physics, ctrl)
        except LostWorldError:  # the other worlds were stepped; guards flag this one
            physics, view = world.physics, self.engine.view(world.physics)
        after = self.after_physics(physics, view, world.states, controllers, batch.grasps)
        clocks = (world.step, world.time, batch.flags, batch.troubles)
        step, time, flags, troubles = self._count(*clocks, self.engine.health(after.physics), after.view.object_com)
        world = WorldState(
            physics=after.physics, view=after.view, states=after.states, key=world.key, step=step, time=time
        )
        batch = dataclasses.replace(batch, world=world, grasps=after.grasps, flags=flags, troubles=troubles)
        return batch, after.status

    def advance_fn(
        self,
        physics: Physics,
        states: States,
        ctrl: Float[Array, "W nu"] | None = None,
        controllers: tuple[Any, ...] = (),
        grasps: Held = None,
    ) -> Advanced:
        """One control step without clocks, guards and episodes, for callers that keep physics and states themselves.

        `advance` is the same, compiled where the engine compiles steps. Only `physics` is consumed.

        Args:
          ctrl: MuJoCo's controls; None keeps the previous ones.
          controllers: states of the robots' controllers, on which camera poses and grasps may depend; (): cameras are
            where they were compiled.
          grasps: what hands hold; None: no hand takes hold of anything.

        Raises:
          LostWorldError: (native engine) a world is no longer finite, which `step` only flags.
        """
        physics, view = self.physics_step(physics, ctrl)
        return self.after_physics(physics, view, states, controllers, grasps)

    def after_physics(
        self, physics: Physics, view: PhysicsView, states: States, controllers: tuple[Any, ...], grasps: Held
    ) -> Advanced:
        """The rest of a control step: states and goal, what slicing moves, grasps.

        With `physics_step` it is `advance_fn` in two parts, for callers that keep the physics between them.
        """
        view = self.cameras.placed(view, controllers)
        before = states
        physics, view, states, status = self._apply_rules(physics, view, states, controllers)
        physics, after, grasps = self.hands.act(physics, view, grasps, controllers, states)
        physics, after = self.hands.join(physics, after, grasps, before, states)
        if after is not view:
            view = self.cameras.placed(after, controllers)
        return Advanced(physics, view, states, status, grasps)

    def _apply_rules(
        self, physics: Physics, view: PhysicsView, states: States, controllers: tuple[Any, ...]
    ) -> tuple[Physics, PhysicsView, States, GoalStatus]:
        states, swap, status = self._rules_step(states, view)
        if swap is not None:
            physics, view = self.teleport(physics, view, swap)
            view = self.cameras.placed(view, controllers)
        return physics, view, states, status

    def prepare(self, physics: Physics, states: States) -> None:
        """Compiles the rules' programs before the first step where they are programs of their own."""
        if self.engine.tracks_changes:
            self._rules_step(states, self.engine.view(physics))

    def teleport(self, physics: Physics, view: PhysicsView, swap: Swap) -> tuple[Physics, PhysicsView]:
        """Physics and view after what slicing moves; worlds where it moves nothing keep their view."""
        assert self.rules is not None, "without rules nothing is sliced"
        rules, cut = self.rules, jnp.asarray(swap.mask).any(1)

        def act(physics: Physics, view: PhysicsView) -> tuple[Physics, PhysicsView]:
            return self.engine.write_with_view(physics, rules.teleports(swap, view), view, cut)

        return self.engine.when_any(cut, act, physics, view)

    def rollout(self, batch: Batch, carry: Any, policy: Policy, length: int) -> tuple[Batch, Any]:
        """`length` control steps, without leaving the device where the engine compiles steps.

        Args:
          policy: gives each step's action. The same function object each time, or it is compiled again.
          carry: what the policy remembers; consumed, as the batch is.
        """
        return self._rollout(batch, carry, policy, length)

    def _no_rules(self, states: States, view: PhysicsView) -> Outcome:
        return Outcome(states, None, self._no_status)

    def _rollout_fn(self, batch: Batch, carry: Any, policy: Policy, length: int) -> tuple[Batch, Any]:
        def body(state: tuple[Batch, Any]) -> tuple[tuple[Batch, Any], None]:
            batch, carry = state
            action, carry = policy(batch, carry)
            return (self.step_fn(batch, action)[0], carry), None

        return self.engine.repeat(body, (batch, carry), length)[0]

    def watch_physics(self, watch: Callable[[], AbstractContextManager[Any]]) -> None:
        """Takes every physics step inside `watch()`; a second call replaces the first.

        For timing next to an engine whose steps run in Python. Without it a step calls the engine directly: an empty
        context would take a part of the two microseconds of a world at rest.
        """

        def watched(physics: Physics, ctrl: Float[Array, "W nu"] | None = None) -> tuple[Physics, PhysicsView]:
            with watch():
                return self.engine.step(physics, ctrl)

        self.physics_step = watched

    # Episodes.

    @GC_PAUSED
    def start(self, seed: Seeds = 0, first: int | Int[Array, ""] = 0) -> Batch:
        """All worlds at the start of their first episode.

        Args:
          seed: of everything random; [W]: each world starts as world 0 with its seed. first: number of the first world.

        Raises:
          EngineError: kernels of the engine could not be compiled.
        """
        if (reset := self.engine.pending_reset_program()) is not None:
            shape = (self.engine.num_worlds, len(self.controls.low))
            action = jax.ShapeDtypeStruct(shape, jnp.float32) if self.controllers else None
            begin = self._begin.traced(reset.returned, seed, first)
            compile_together([self._step.traced(begin.returned, action), begin, reset])
        return self._begin(self.engine.reset(), seed, first)

    def start_fn(self, physics: Physics, seed: Seeds = 0, first: int | Int[Array, ""] = 0) -> Batch:
        """`start`, not compiled.

        Args:
          physics: `engine.reset()`; in a compiled program it would be thousands of constants. Others: of `start`.
        """
        count, seed = self.engine.num_worlds, jnp.asarray(seed, jnp.int32)
        nothing = jnp.zeros(count, jnp.int32)
        world = WorldState(
            physics=physics,
            view=self.cameras.placed(self.engine.view(physics), self.controls.first()),
            states=self.starts.pool.rows(np.zeros(count, int)).states,
            key=jnp.zeros((count, 2), jnp.uint32),
            step=nothing,
            time=jnp.zeros(count, jnp.float32),
        )
        batch = Batch(
            world=world,
            controllers=self.controls.first(),
            grasps=self.hands.read(physics),
            number=nothing if seed.ndim else first + jnp.arange(count, dtype=jnp.int32),
            seed=seed,
            episode=nothing - 1,
            flags=nothing,
            troubles=jnp.zeros((count, len(guards.Flag)), jnp.int32),
            draw=self.starts.no_draw(count),
        )
        return self.reset_fn(batch, jnp.ones(count, bool))

    def reset(self, batch: Batch, mask: Bool[Array, "W"]) -> Batch:
        """Starts a new episode in the masked worlds, each from a random row of the pool. Raises ActionError."""
        return self._reset(batch, checked_mask(mask, self.engine.num_worlds))

    def reset_fn(self, batch: Batch, mask: Bool[Array, "W"]) -> Batch:
        """`reset`, not compiled."""
        world = batch.world
        episode, key, row = self.starts.draw(batch.seed, batch.number, batch.episode, mask)
        rows, draw = self.starts.rows(row, key)
        physics = self.engine.load(world.physics, rows.physics, mask)
        zero = jnp.zeros_like(world.step), jnp.zeros_like(world.time)
        started = (rows.states, key, *zero, self.controls.first(), self.hands.read(physics), draw)
        going = (world.states, world.key, world.step, world.time, batch.controllers, batch.grasps, batch.draw)
        states, key, step, time, controllers, grasps, draw = self._select(mask, started, going)
        view = self.cameras.placed(self.engine.view(physics), controllers)
        world = WorldState(physics=physics, view=view, states=states, key=key, step=step, time=time)
        flags = jnp.where(mask, 0, batch.flags)
        return dataclasses.replace(
            batch, world=world, controllers=controllers, grasps=grasps, episode=episode, flags=flags, draw=draw
        )

    # Changes from outside.

    def write(self, batch: Batch, write: Write) -> Batch:
        """Moves objects and joints, or switches grasps, without passing time."""
        return self._write(batch, write)

    def write_fn(self, batch: Batch, write: Write) -> Batch:
        """`write`, not compiled."""
        physics = self.engine.write(batch.world.physics, write)
        batch = self._with(batch, physics, batch.world.states)
        return dataclasses.replace(batch, grasps=self.hands.after_write(physics, batch.world.view, batch.grasps, write))

    def load(
        self,
        batch: Batch,
        physics: Snapshot,
        states: ExtendedStates | None = None,
        mask: Bool[Array, "W"] | None = None,
    ) -> Batch:
        """Replaces worlds by saved ones; clocks, keys and flags stay.

        Args:
          physics, states: of every world, physics also of one without the world axis; None: they stay. mask: None: all.
        """
        return self._load(batch, physics, states, None if mask is None else checked_mask(mask, self.engine.num_worlds))

    def load_fn(
        self,
        batch: Batch,
        physics: Snapshot,
        states: ExtendedStates | None = None,
        mask: Bool[Array, "W"] | None = None,
    ) -> Batch:
        """`load`, not compiled."""
        world = batch.world
        if states is None:
            states = world.states
        elif mask is not None:
            states = self._select(mask, states, world.states)
        loaded = self.engine.load(world.physics, physics, mask)
        grasps = self.hands.after_load(loaded, batch.grasps, mask)
        return dataclasses.replace(self._with(batch, loaded, states), grasps=grasps)

    def _with(self, batch: Batch, physics: Physics, states: ExtendedStates) -> Batch:
        view = self.cameras.placed(self.engine.view(physics), batch.controllers)
        world = dataclasses.replace(batch.world, physics=physics, view=view, states=states)
        return dataclasses.replace(batch, world=world)

    def check(self, batch: Batch) -> None:
        """Raises StaleStateError: the batch was consumed. Nothing while tracing."""
        self.engine.check(batch.world.physics)

    def fork(self, batch: Batch) -> Batch:
        """An independent copy, which goes on as the batch does; not for compiled programs. Raises StaleStateError."""
        self.check(batch)
        return self.engine.copied(batch)

    # What went wrong.

    def metrics(self, batch: Batch) -> dict[str, int]:
        """How often worlds were flagged so far, by flag, and episodes begun. On the host."""
        return {"episodes": int(np.asarray(batch.episode).sum()) + len(batch.number), **guards.metrics(batch.troubles)}

    def raise_flagged(self, batch: Batch) -> None:
        """Raises EngineError for the first flagged world, naming world, flag and the setting to raise. On the host."""
        guards.raise_first(batch.flags, self.engine.health(batch.world.physics).overflow)
