"""A robot whose hands grasp at random, for very many steps: what is lost, what breaks, and does energy grow?

    python -m benchmarks.soak.grasping [TASK] [--robot humanoid] [--grasping sticky mitten] [--world-steps 1e8]
        [--worlds 4096] [--seconds 120] [--engine warp] [--rows FILE]

The robot of an environment moves both hands, fingers and its body at random, at up to the paper's 0.5 m/s and 0.5 rad/s
along each axis; a new action in one of fifteen control steps. With `sticky` hands close and open at random and take
whatever they touch, with `mitten` they stick to the activity's first object. `--task-actions`: only what an action of
the environment moves. Worlds that are flagged (`soak_watch`: overflow, not finite, fallen, outside, too fast) count
once, by the object's name and by who held it when, and begin again, as do all after `EPISODE` control steps. Energies:
`soak_energy`. A world-step is a physics step of one world (1/120 s). A row with all counts so far is printed, and
added to `--rows`, every `REPORT` seconds; the last one of a mode has `"done": true`.
"""

from __future__ import annotations

import collections
import dataclasses
import pathlib
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from flax import struct
from jaxtyping import Bool, Float, Int
from warp._src.jax import ffi

import ig2mj
from benchmarks.harness import results
from benchmarks.soak.energy import Energy, EnergyWatch
from benchmarks.soak.watch import FLAGS, Seen, Watch
from benchmarks.speed.batch import device
from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.registry import make_robot
from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment
from ig2mj.states.definitions.sliced import in_use
from ig2mj.tasks.actions import SPEED, TURN_SPEED
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.hand_resets import HandResets

STEPS = 15
"""Control steps of one call; flagged worlds start afresh after it."""

EPISODE = 600
"""Control steps after which a world starts afresh in any case: the 20 s of an activity."""

PERIOD = 1 / 30
"""Seconds of a control step, in which the robot acts once; each is examined."""

NEW_ACTION = 1 / 15
"""Chance of a new action in a control step."""

REPORT = 15.0

MOST_GRAPHS = 12
"""CUDA graphs that are kept. Each owns its temporaries; a control step has five or six for each place of buffers."""


@dataclasses.dataclass
class Args:
    """What to run."""

    task: tyro.conf.Positional[str] = "CookingMeat"
    """Environment."""
    robot: str = "humanoid"
    """humanoid or fetch."""
    grasping: tuple[str, ...] = ("sticky", "mitten")
    """How hands hold, one after the other."""
    task_actions: bool = False
    """Only what an action of the environment moves."""
    world_steps: float = 1e8
    """Physics steps of all worlds together, for each mode."""
    worlds: int = 4096
    """Worlds side by side."""
    seconds: float = 1e9
    """Time limit of each mode, without making it ready."""
    engine: str | None = None
    """warp or native (few worlds then); default: warp on a GPU."""
    seed: int = 0
    """Of the random streams."""
    pool_size: int | None = None
    """Start states; the task's own number if left out."""
    label: str = ""
    """A remark for the rows."""
    rows: pathlib.Path | None = None
    """Rows are added to this file, as JSON lines."""


@struct.dataclass
class Soak:
    """A batch and what was seen of it. `holding`: share of worlds that hold something, summed over control steps.
    `grasps`: of loose objects, and of doors and drawers."""

    batch: Batch
    seen: Seen
    energy: Energy
    action: Float[Array, "W n"]
    holding: Float[Array, ""]
    grasps: Int[Array, "2"]


def scales(env: Environment) -> Float[np.ndarray, "n"]:
    """The largest of each number of a control step's action, at the paper's speeds."""
    action, share = env.action_map, PERIOD / ACTION_PERIOD
    turns = ("roll", "pitch", "yaw", "rx", "ry", "rz", "turn_left")
    grips = ("trigger", "gripper", "reset")
    displaces = make_robot(env.robot).hand_controls[0].displaces
    largest = []
    for name, scale in zip(action.names, action.scale, strict=True):
        if name.endswith(grips):
            largest.append(1.0 if name.endswith("gripper") else 1.0 / scale)
            continue
        speed = TURN_SPEED if name.endswith(turns) else SPEED
        # Metres and radians an action, or velocities already.
        largest.append(share * speed * ACTION_PERIOD / scale if displaces else 1.0)
    return np.minimum(np.array(largest, np.float32), 1.0)


class Run:
    """One mode of grasping."""

    def __init__(self, args: Args, grasping: str):
        self.args = args
        self.env = env = ig2mj.make(
            args.task,
            robot=args.robot,
            worlds=args.worlds,
            engine=args.engine,
            grasping=grasping,
            whole_actions=not args.task_actions,
            period=PERIOD,
            pool_size=args.pool_size,
        )
        self.core, engine = env.core, env.core.engine
        self.core.hand_resets = HandResets(engine, self.core.controllers, False)  # no hand is asked back, none jumps
        assert self.core.rules is not None
        self.model = self.core.rules.model
        self.watch = Watch(engine, (0.0, 0.0, 0.0))
        self.energy = EnergyWatch(engine, np.asarray(~engine.tables.object_fixed), EPISODE)
        self.scale = scales(env)
        self._resets = np.array([name.endswith("_reset") for name in env.action_map.names])
        self.lasting = STEPS * engine.substeps * args.worlds
        # One program with donated arrays: Warp captures its graphs again where arrays have moved, and keeps them all.
        self.many = jax.jit(self._steps, donate_argnums=0) if engine.pure else self._steps
        self._draw = jax.jit(self._actions)
        self._look = jax.jit(self._looked)

    def start(self) -> Soak:
        """All worlds at the start of an episode."""
        batch = self.core.start(self.args.seed)
        shape = (self.args.worlds, self.env.action_map.size)
        zero = jnp.zeros((), jnp.float32)
        action = jnp.zeros(shape, jnp.float32)
        seen = self.watch.start(batch.world.physics)
        return Soak(batch, seen, self.energy.start(), action, zero, jnp.zeros(2, jnp.int32))

    def _actions(self, key: Array, step: Array, before: Float[Array, "W n"]) -> Float[Array, "W n"]:
        """The next control step's: those before, or new ones."""
        size = before.shape[1]

        def draw(k: Array, n: Array) -> Array:
            return jax.random.uniform(jax.random.fold_in(k, n), (1 + size,))

        drawn = jax.vmap(draw)(key, step)
        new = jnp.where(self._resets, -1.0, (2 * drawn[:, 1:] - 1) * self.scale)
        return jnp.where((drawn[:, :1] < NEW_ACTION) | (step == 0)[:, None], new, before)

    def _looked(
        self, soak: Soak, batch: Batch, cut: Bool[Array, "W"]
    ) -> tuple[Seen, Energy, Float[Array, ""], Int[Array, "2"]]:
        """What is seen after a control step."""
        world = batch.world
        used = in_use(self.model, world.states.sliced)
        seen = self.watch.look(soak.seen, world.physics, world.view, used)
        before, since = soak.seen.since, seen.since
        energy = self.energy.look(
            soak.energy, world.physics, world.view, before, since, seen.flags == 0, used, cut, world.step
        )
        each, fixed = ((since == 0) & (before != 0)).sum(0), self.core.engine.tables.object_fixed
        taken = jnp.stack([each[~fixed].sum(), each[fixed].sum()]).astype(jnp.int32)
        return seen, energy, (since == 0).any(1).mean(dtype=jnp.float32), taken

    def _step(self, soak: Soak, _: Any) -> tuple[Soak, None]:
        world = soak.batch.world
        action = self._draw(world.key, world.step, soak.action)
        sliced = jnp.asarray(world.states.sliced)
        batch, _ = self.core.step_fn(soak.batch, self.env.action_map(action))
        cut = (jnp.asarray(batch.world.states.sliced) != sliced).any(1)
        looked = self._look if self.core.engine.pure else self._looked
        seen, energy, holding, taken = looked(soak, batch, cut)
        return Soak(batch, seen, energy, action, soak.holding + holding, soak.grasps + taken), None

    def _steps(self, soak: Soak) -> Soak:
        """Flagged worlds, and those whose episodes are over, start afresh; then `STEPS` control steps."""
        over = (soak.seen.flags != 0) | (jnp.asarray(soak.batch.world.step) >= EPISODE)
        if self.core.engine.pure:
            soak = jax.lax.cond(over.any(), self._restart, lambda same, _: same, soak, over)
            return jax.lax.scan(self._step, soak, None, STEPS)[0]
        if np.asarray(over).any():
            soak = self._restart(soak, np.asarray(over))
        for _ in range(STEPS):
            soak, _ = self._step(soak, None)
        return soak

    def _restart(self, soak: Soak, mask: Array) -> Soak:
        batch = self.core.reset_fn(soak.batch, mask)
        return dataclasses.replace(
            soak,
            batch=batch,
            seen=self.watch.fresh(soak.seen, batch.world.physics, mask),
            energy=self.energy.fresh(soak.energy, mask),
        )


def forget_graphs() -> int:
    """Frees all captured graphs if there are more than `MOST_GRAPHS`; nothing may run meanwhile. Returns their number.

    Warp captures a graph for each set of addresses and keeps up to 32. JAX's allocator may move a program's buffers.
    """
    captured = sum(len(each.captures) for each in ffi._FFI_CALLABLE_REGISTRY.values())
    if captured > MOST_GRAPHS:
        ffi.clear_jax_callable_graph_cache()
    return captured


def row_of(run: Run, soak: Soak, events: list[dict[str, Any]], numbers: dict[str, Any]) -> dict[str, Any]:
    """All counts so far."""
    kinds = collections.Counter(event["kind"] for event in events)
    troubles = run.core.metrics(soak.batch)
    return {
        "benchmark": "soak_grasping",
        "environment": run.args.task,
        "label": run.args.label,
        "robot": run.args.robot,
        "grasping": run.env.grasping,
        "actions": "the task's" if run.args.task_actions else "whole robot",
        "home": run.env.task.home,
        "objects": run.env.scene.tables.num_objects,
        "worlds": run.args.worlds,
        "engine": run.core.engine.name,
        **numbers,
        "flagged": {kind: kinds.get(kind, 0) for kind in FLAGS},
        "objects_flagged": {
            kind: dict(collections.Counter(e["object"] for e in events if e["kind"] == kind).most_common(8))
            for kind in kinds
        },
        "held_when_flagged": sum(e.get("free_for") == 0 for e in events),
        "held_within_1_s": sum(e.get("free_for", 31) <= 30 for e in events),
        "troubles": troubles,
        "energy": run.energy.report(soak.energy),
        "events": events[:30],
        **device(),
    }


def soak(args: Args, grasping: str) -> dict[str, Any]:
    """Runs one mode; the last row."""
    began = time.monotonic()
    run = Run(args, grasping)
    state = run.start()
    events: list[dict[str, Any]] = []
    done, calls, timed, told, graphs = 0, 0, 0.0, 0.0, 0
    ready = time.monotonic() - began
    while True:
        start = time.monotonic()
        state = jax.block_until_ready(run.many(state)) if run.core.engine.pure else run.many(state)
        done, calls, graphs = done + run.lasting, calls + 1, forget_graphs()
        flags = np.asarray(state.seen.flags)
        events += [run.watch.report(state.seen, int(world)) for world in np.flatnonzero(flags)]
        last = done >= args.world_steps or timed >= args.seconds
        if calls <= 2:  # these compile
            ready += time.monotonic() - start
        else:
            timed += time.monotonic() - start
        if last or timed - told > REPORT:
            told = timed
            numbers = {
                "world_steps": done,
                "world_steps_per_s": round((done - 2 * run.lasting) / timed) if timed else None,
                "ready_s": round(ready, 1),
                "share_of_worlds_that_hold": round(float(state.holding) / (calls * STEPS), 4),
                "grasps": {"loose objects": int(state.grasps[0]), "doors and drawers": int(state.grasps[1])},
                "captured_graphs": graphs,
                "done": last,
            }
            row = row_of(run, state, events, numbers)
            results.keep_row(row, args.rows)
            if last:
                return row


def main(args: Args) -> list[dict[str, Any]]:
    return [soak(args, grasping) for grasping in args.grasping]


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
