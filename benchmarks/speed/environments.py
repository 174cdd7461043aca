"""Agent steps a second of environments under random actions, and what went wrong meanwhile.

    python -m benchmarks.speed.environments CookingMeat --robot humanoid --worlds 1024 4096 --observations rgb depth

An agent step is 1/10 s: the action, three control steps (twelve physics steps) with all extended states and the goal,
grasps, guards, reward, observations, and new episodes where some are over, all in one program under `lax.scan`. Actions
are drawn evenly from the whole range, a new one in one of `--hold` steps. Overflow and numbers that are not finite are
counted over all steps. Compilation is timed apart.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import pathlib
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import ig2mj
from benchmarks.harness import results
from benchmarks.harness.kernel_times import profiled
from benchmarks.harness.turns import exclusive, preparing
from benchmarks.speed.batch import device, memory
from ig2mj.engine.warp.profile import EngineProfile
from ig2mj.scene.scene import LOOKS
from ig2mj.sensors.base import CAMERA_LOOKS

CALL = 10
"""Agent steps of one call."""


@dataclasses.dataclass
class Prepared:
    """An environment, the compiled function of `CALL` agent steps and its carry, and what was timed.

    Attributes:
      looks: how its images show the home. ready: s until it could be timed. times: s, of each call. totals: means of
        what the steps of each call gave.
    """

    looks: str
    env: Any
    call: Callable[[Any], Any]
    carry: Any
    ready: float
    times: list[float] = dataclasses.field(default_factory=list)
    totals: list[list[float]] = dataclasses.field(default_factory=list)

    def measure(self) -> None:
        """One timed call."""
        start = time.time()
        self.carry, seen = jax.block_until_ready(self.call(self.carry))
        self.times.append(time.time() - start)
        self.totals.append([float(np.mean(s)) for s in seen])


def run(name: str, num_worlds: int, args: argparse.Namespace) -> list[dict]:
    """A row for each of `--looks`, whose calls are timed in turns."""
    made = []
    with preparing(args.lock, args.patience):
        for looks in args.looks:
            began = time.time()
            parts = prepared(name, num_worlds, looks, args)
            made.append(Prepared(looks, *parts, ready=time.time() - began))
    rows = []
    with exclusive(args.lock, args.patience):
        for each in made:
            each.carry, _ = jax.block_until_ready(each.call(each.carry))
        while len(made[0].times) < 2 or sum(sum(each.times) for each in made) < 60 * args.minutes * len(made):
            for each in made:
                each.measure()
        for each in made:
            kernels: dict = {}
            if args.kernels:
                call = functools.partial(each.call, each.carry)
                (each.carry, _), kernels = profiled(call, CALL, args.kernels, "agent step")
            rows.append(_row(name, num_worlds, each, kernels, args))
    return rows


def _row(name: str, num_worlds: int, each: Prepared, kernels: dict, args: argparse.Namespace) -> dict:
    env, times, state = each.env, each.times, each.carry[0]
    steps = num_worlds * len(times) * CALL
    reward, done, held, success = np.mean(each.totals, axis=0)
    return {
        "environment": name,
        "looks": each.looks,
        "label": args.label,
        "robot": args.robot,
        "grasping": args.grasping,
        "engine": env.core.engine.name,
        "observations": args.observations,
        "home": env.task.home,
        "objects": env.scene.tables.num_objects,
        "worlds": num_worlds,
        "agent_steps_per_s": round(steps / sum(times)),
        "ms_per_agent_step": round(1e3 * sum(times) / len(times) / CALL, 2),
        "ready_s": round(each.ready, 1),
        "physics_steps": 12 * (steps + num_worlds * CALL * (2 if kernels else 1)),
        **({"kernels": kernels} if kernels else {}),
        "metrics": env.metrics(state),
        "mean_reward": round(float(reward), 5),
        "episodes_over_per_step": round(float(done), 6),
        "holding": round(float(held), 4),
        "successes": round(float(success * steps)),
        "slowest_over_median": round(max(times) / float(np.median(times)), 2),
        **memory(num_worlds),
        **device(),
    }


def prepared(name: str, num_worlds: int, looks: str, args: argparse.Namespace) -> tuple[Any, Callable, Any]:
    """An environment, the compiled function of `CALL` agent steps, and the carry to begin with."""
    options: dict[str, Any] = {"profile": EngineProfile(*args.profile)} if args.profile else {}
    env = ig2mj.make(
        name,
        robot=args.robot,
        worlds=num_worlds,
        engine=args.engine,
        grasping=args.grasping,
        observations=("proprioception", "privileged_state", *args.observations),
        pool_size=args.pool_size,
        looks=looks,
        **options,
    )
    size = env.action_space.shape[0]

    def agent_step(carry: Any, _: None) -> Any:
        state, action, key = carry
        key, draw, change = jax.random.split(key, 3)
        new = jax.random.uniform(draw, action.shape, minval=-1.0, maxval=1.0)
        action = jnp.where(jax.random.bernoulli(change, 1 / args.hold, (num_worlds, 1)), new, action)
        after: Any = env.step_autoreset_fn(state, action)
        info = {k: v for k, v in after.info.items() if k != "final_obs"}
        seen = after.reward.mean(), after.done.mean(), after.info["held"].mean(), after.terminated.mean()
        return (after.replace(info=info), action, key), seen

    if env.core.engine.pure:
        program = jax.jit(lambda carry: jax.lax.scan(agent_step, carry, None, CALL), donate_argnums=0)
    else:

        def program(carry):
            every = []
            for _ in range(CALL):
                carry, seen = agent_step(carry, None)
                every.append(seen)
            return carry, tuple(np.stack(each) for each in zip(*every, strict=True))

    state = env.reset(0)
    carry = (state, jnp.zeros((num_worlds, size)), jax.random.key(1))
    call = program.lower(carry).compile() if env.core.engine.pure else program
    return env, call, carry


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("environments", nargs="+")
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--grasping", default="mitten")
    parser.add_argument("--engine")
    parser.add_argument("--worlds", type=int, nargs="+", default=[4096])
    parser.add_argument("--observations", nargs="*", default=[], help="besides proprioception and privileged state")
    parser.add_argument("--looks", nargs="+", default=[CAMERA_LOOKS], choices=LOOKS, help="several are timed in turns")
    parser.add_argument("--minutes", type=float, default=0.2, help="of the timed calls of a row")
    parser.add_argument("--hold", type=int, default=5, help="mean number of agent steps that an action is held")
    parser.add_argument("--pool-size", type=int, help="rows of the pool; the task's own number if left out")
    parser.add_argument(
        "--profile", type=int, nargs=4, help="buffers: awake dofs, constraints, contacts, convex contacts of a world"
    )
    parser.add_argument("--kernels", type=int, default=0, metavar="N", help="print the N longest kernels of a GPU")
    parser.add_argument("--lock", type=pathlib.Path, help="file to lock while timing, as of throughput.py")
    parser.add_argument("--label", default="", help="a remark for the rows")
    parser.add_argument("--patience", type=float, default=0.0, help="seconds to wait for others, as of throughput.py")
    parser.add_argument("--rows", type=pathlib.Path, help="rows are added to this file, as JSON lines")
    args = parser.parse_args()
    for name in args.environments:
        for worlds in args.worlds:
            results.keep_rows(run(name, worlds, args), args.rows)


if __name__ == "__main__":
    main()
