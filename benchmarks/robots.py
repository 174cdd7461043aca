"""Agent steps a second of a home with a robot that acts at random, and what went wrong meanwhile.

    python benchmarks/robots.py birch --robot humanoid --worlds 1024 4096 --minutes 1

An agent step is 1/10 s: one action, three control steps, twelve physics steps, with all extended states, guards and a
goal of ten literals, in one program under `lax.scan`. Actions are drawn evenly from the whole range of the robot's
controller, a new one in one of `--hold` agent steps. Overflow, numbers that are not finite, and objects that left the
house or moved too fast are counted over all steps; physics steps are worlds times steps.
"""

from __future__ import annotations

import argparse
import pathlib
import time

import jax
import jax.numpy as jnp
import numpy as np
import results
import scipy.ndimage
from batch_case import ten_literals
from throughput import _bits, device, memory

import ig2mj
from ig2mj.agents import Fetch, Humanoid, TurtleBot
from ig2mj.engine import make_engine
from ig2mj.engine.health import CAPACITY
from ig2mj.engine.warp.profile import EngineProfile
from ig2mj.sampling.settled import make_pool
from ig2mj.scene import Scene
from ig2mj.worlds import Batch, Core, Rules
from ig2mj.worlds.worlds import controllers_of

ROBOTS = {"humanoid": Humanoid, "fetch": Fetch, "turtlebot": TurtleBot}
CONTROL_STEPS = 3
"""Control steps of an agent step."""

SUBSTEPS = 12
"""Physics steps of an agent step."""

CALL = 10
"""Agent steps of one call."""


def freest_place(scene: Scene) -> np.ndarray:
    """x and y (m) of the point of the floor that is farthest from everything that stands on it."""
    rooms = scene.rooms
    if rooms is None or rooms.traversable is None:
        raise SystemExit(f"{scene.name} has no map of its free floor")
    distance = scipy.ndimage.distance_transform_edt(np.pad(rooms.traversable, 1))[1:-1, 1:-1]
    row, col = np.unravel_index(int(np.argmax(distance)), distance.shape)
    return (np.array([col, row]) + 0.5 - np.array(distance.shape)[::-1] / 2) * rooms.trav_resolution


def run(home: str, num_worlds: int, args: argparse.Namespace) -> dict:
    """One row."""
    robot, engine_name, minutes, hold, actions = args.robot, args.engine, args.minutes, args.hold, args.actions
    bare = ig2mj.load_scene(home)
    place = freest_place(bare)
    start = time.time()
    scene = ig2mj.load_scene(home, agents=[ROBOTS[robot](pos=(*place, ROBOTS[robot]().pos[2]))])
    rules = Rules.of_scene(scene)
    rules = rules.with_goal(ten_literals(rules.model))
    options = {"profile": EngineProfile(*args.profile)} if args.profile else {}
    if engine_name == "warp":
        options["graph_mode"] = args.graph_mode
    engine = make_engine(engine_name, scene, num_worlds, **options)
    core = Core(
        engine,
        rules,
        make_pool(bare, rules.model, 16, share=0.2),
        controllers_of(scene, CONTROL_STEPS * engine.substeps * engine.timestep),
    )
    low, high = jnp.asarray(core.controls.low), jnp.asarray(core.controls.high)

    def agent_step(carry, _):
        batch, action, key = carry
        key, draw, change = jax.random.split(key, 3)
        new = jax.random.uniform(draw, action.shape, minval=low * actions, maxval=high * actions)
        action = jnp.where(jax.random.bernoulli(change, 1 / hold, (num_worlds, 1)), new, action)
        if args.written_out:
            batch, _ = core.step_fn(batch, action)
            for _ in range(CONTROL_STEPS - 1):
                batch, status = core.step_fn(batch, None)
        else:
            batch, status = core.hold_fn(batch, action, CONTROL_STEPS)
        return (batch, action, key), status.fraction.mean()

    def physics_step(carry, _):
        """Without states, guards and goal, and of the view only what the controllers read."""
        batch, action, key = carry
        key, draw = jax.random.split(key)
        action = jax.random.uniform(draw, action.shape, minval=low * actions, maxval=high * actions)
        world = batch.world
        ctrl, controllers = core.controls.act(action, world.view, batch.controllers)
        physics, view = engine.step(world.physics, ctrl)
        for _ in range(CONTROL_STEPS - 1):
            physics, view = engine.step(physics, None)
        agent = world.view.replace(agent=view.agent, held=view.held)
        return (
            batch.replace(world=world.replace(physics=physics, view=agent), controllers=controllers),
            action,
            key,
        ), 0.0

    if args.what == "physics":
        agent_step = physics_step
    if engine.pure:
        call = jax.jit(lambda carry: jax.lax.scan(agent_step, carry, None, CALL), donate_argnums=0)
    else:

        def call(carry):
            for _ in range(CALL):
                carry, seen = agent_step(carry, None)
            return carry, seen

    carry = (core.start(0), jnp.zeros((num_worlds, len(low))), jax.random.key(1))
    carry, seen = jax.block_until_ready(call(carry))
    ready = time.time() - start
    began, calls, times = time.time(), 0, []
    while calls < 2 or time.time() - began < 60 * minutes:
        call_began = time.time()
        carry, seen = jax.block_until_ready(call(carry))
        times.append(time.time() - call_began)
        calls += 1
    seconds = time.time() - began
    if args.trace:
        with jax.profiler.trace(str(args.trace)):
            carry, seen = jax.block_until_ready(call(carry))
    batch = carry[0]
    health = engine.health(batch.world.physics)
    steps = num_worlds * calls * CALL
    parts = time_parts(core, carry[0], carry[1]) if args.parts else {}
    return {
        **parts,
        "scene": scene.name,
        "objects": bare.tables.num_objects,
        "robot": robot,
        "engine": engine_name,
        "worlds": num_worlds,
        "agent_steps_per_s": round(steps / seconds),
        "control_steps_per_s": round(CONTROL_STEPS * steps / seconds),
        "physics_steps": SUBSTEPS * num_worlds * (calls + 1) * CALL,
        "ready_s": round(ready, 1),
        "overflow": int(((np.asarray(health.overflow) & int(CAPACITY)) != 0).sum()),
        "overflow_bits": _bits(np.asarray(health.overflow)),
        "start": place.round(2).tolist(),
        "non_finite": int((~np.asarray(health.finite)).sum()),
        "troubles": core.metrics(batch),
        "what": args.what,
        "graph_mode": args.graph_mode,
        "seconds_of_calls": [round(t, 2) for t in times],
        "actions": actions,
        "hold": hold,
        "mean_goal": float(np.asarray(seen).mean()),
        **memory(num_worlds),
        **device(),
    }


def time_parts(core: Core, batch: Batch, action: jax.Array) -> dict[str, float]:
    """Milliseconds of the parts of a control step, each compiled and called by itself."""
    world = batch.world
    parts = {
        "control": (lambda a, v, c: core.controls.act(a, v, c), (action, world.view, batch.controllers)),
        "physics": (lambda p: core.engine.step(p, None)[0], (world.physics,)),
        "view": (core.engine.view, (world.physics,)),
        "rules": (core.rules.step, (world.states, world.view)),
    }
    found = {}
    for name, (act, operands) in parts.items():
        call = jax.jit(act)
        jax.block_until_ready(call(*operands))
        times = []
        for _ in range(3):
            start = time.time()
            jax.block_until_ready(call(*operands))
            times.append(time.time() - start)
        found[f"{name}_ms"] = round(1e3 * min(times), 2)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("homes", nargs="+")
    parser.add_argument("--robot", choices=ROBOTS, default="humanoid")
    parser.add_argument("--worlds", type=int, nargs="+", default=[4096])
    parser.add_argument("--engine", choices=["native", "warp"], default="warp")
    parser.add_argument("--minutes", type=float, default=0.5, help="wall time of the timed calls of a row")
    parser.add_argument("--hold", type=int, default=5, help="mean number of agent steps that an action is held")
    parser.add_argument("--actions", type=float, default=1.0, help="share of the action range that is drawn from")
    parser.add_argument("--what", choices=["full", "physics"], default="full", help="physics: without states and goal")
    parser.add_argument("--graph-mode", help="of the Warp engine")
    parser.add_argument("--written-out", action="store_true", help="control steps one after the other, not as a loop")
    parser.add_argument("--trace", type=pathlib.Path, help="one more call under JAX's profiler, kept in this folder")
    parser.add_argument("--parts", action="store_true", help="also time the parts of a control step, each by itself")
    parser.add_argument(
        "--profile", type=int, nargs=4, help="buffers: awake dofs, constraints, contacts, convex contacts of a world"
    )
    parser.add_argument("--rows", type=pathlib.Path, help="rows are added to this file, as JSON lines")
    args = parser.parse_args()
    for home in args.homes:
        for worlds in args.worlds:
            results.keep_row(run(home, worlds, args), args.rows)


if __name__ == "__main__":
    main()
