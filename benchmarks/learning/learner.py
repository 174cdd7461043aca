"""Updates a second of the learners alone: no environment, a rollout of made-up numbers.

    python -m benchmarks.learning.learner --algo sac --batch 1024 [--obs rgbd] [--set updates=64]
    python -m benchmarks.learning.learner --algo dagger --obs rgbd --pixels 128 --rows 80:128 --batch 512 \
        --capacity 200000 \
        --starts 16384 --set net=glimpses shift=0 actor=160,160 recall=1 --kernels 40

An iteration is what `ig2mj train` does after the worlds have stepped: the rollout goes into the replay buffer and all
updates of the iteration are made, in one program. The buffer holds `--capacity` steps.
"""

from __future__ import annotations

import argparse
import pathlib
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.harness import results
from benchmarks.harness.kernel_times import profiled
from ig2mj.envs.observations import Space
from ig2mj.learn.collect import Transition
from ig2mj.learn.dagger import GUESSED, RECALLED, Dagger, DaggerConfig
from ig2mj.learn.options import configured
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.projection import Lens
from ig2mj.learn.sac import SAC, SACConfig

PROPRIOCEPTION, PRIVILEGED, ACTIONS = 40, 60, 6
"""Numbers of a humanoid with one hand in CookingMeat, about."""

POSES = tuple(
    f"{thing}_{part}" for thing in "ab" for part in ("pos_x", "pos_y", "pos_z", *(f"quat_{c}" for c in "wxyz"))
)
"""What the first of the privileged numbers are: poses of two objects."""

AHEAD = ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""The axes of a camera that looks straight ahead."""


def spaces(obs: str) -> dict[str, Space]:
    """Observations of the size of an activity's."""
    found = {
        "proprioception": Space((PROPRIOCEPTION,), np.float32, -np.inf, np.inf),
        "privileged_state": Space((PRIVILEGED,), np.float32, -np.inf, np.inf),
    }
    if obs == "rgbd":
        found["rgb"] = Space((128, 128, 3), np.uint8, 0.0, 255.0)
        found["depth"] = Space((128, 128, 1), np.float32, 0.0, 10.0)
    return found


def perceived(args: argparse.Namespace) -> Perception:
    """What the networks see."""
    if args.obs == "state":
        return Perception(spaces("state"))
    first, below = (int(row) for row in args.rows.split(":")) if args.rows else (0, args.pixels)
    names = [*POSES, *(f"number_{k}" for k in range(PRIVILEGED - len(POSES)))]
    lens = Lens((0.0, 0.0, 0.0), AHEAD, (1.0, 1.0), args.pixels, (first, below))
    felt = ["right_hand_is_grasping", *(f"felt_{k}" for k in range(PROPRIOCEPTION - 1))]
    return Perception(spaces("rgbd"), "rgbd", args.pixels, (first, below), names, lens, felt)


def seen_by(perception: Perception, *count: int) -> Seen:
    """Random numbers and pictures."""
    rng, shape = np.random.default_rng(0), perception.picture_shape
    size = 0 if shape is None else int(np.prod(shape))
    pictures = rng.integers(0, 256, (*count, size), np.uint8)
    return Seen(jnp.asarray(rng.standard_normal((*count, perception.vector_size)), jnp.float32), jnp.asarray(pictures))


def made_up(algorithm: SAC | PPO | Dagger, worlds: int) -> Transition:
    """A rollout of random numbers, in which one episode of two hundred ends at each step."""
    perception, length, rng = algorithm.perception, algorithm.length, np.random.default_rng(0)

    def normal(*tail: int) -> jax.Array:
        return jnp.asarray(rng.standard_normal((length, worlds, *tail)), jnp.float32)

    ends = rng.random((length, worlds)) < 0.005
    raw = normal(ACTIONS)
    extra: dict[str, Any] = {"raw": raw, "chance": normal()} if algorithm.name == "ppo" else {}
    if isinstance(algorithm, Dagger):
        extra = {"label": jnp.tanh(raw), **({RECALLED: normal(algorithm.recall.size)} if algorithm.recall else {})}
        extra |= {GUESSED: normal(algorithm.guesses)} if algorithm.guesses else {}
    terminated = jnp.asarray(ends & (rng.random((length, worlds)) < 0.5))
    seen = seen_by(perception, length, worlds)
    return Transition(seen, jnp.tanh(raw), extra, normal(), terminated, jnp.asarray(ends) & ~terminated, seen)


def main() -> None:
    """Measures one setting, and prints one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--algo", default="sac", choices=("sac", "ppo", "dagger"))
    parser.add_argument("--obs", default="state", choices=("state", "rgbd"))
    parser.add_argument("--worlds", type=int, default=2048)
    parser.add_argument("--batch", type=int, default=0, help="samples of an update of SAC or DAgger")
    parser.add_argument("--capacity", type=int, default=0, help="steps that are kept, of all worlds together")
    parser.add_argument("--pixels", type=int, default=32, help="height and width of pictures")
    parser.add_argument("--rows", help="of these the first that are seen and the first below those, such as 80:128")
    parser.add_argument("--starts", type=int, default=0, help="DAgger's pictures of start states")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE")
    parser.add_argument("--kernels", type=int, default=0, metavar="N", help="print the N longest kernels")
    parser.add_argument("--out", type=pathlib.Path)
    args = parser.parse_args()
    perception = perceived(args)
    changes = list(args.set)
    changes += [f"batch={args.batch}"] * bool(args.batch) + [f"capacity={args.capacity}"] * bool(args.capacity)
    if args.algo == "sac":
        algorithm = SAC(perception, ACTIONS, configured(SACConfig(), changes))
    elif args.algo == "dagger":
        starts = seen_by(perception, args.starts) if args.starts else None
        algorithm = Dagger(perception, ACTIONS, None, configured(DaggerConfig(), changes), None, starts)
    else:
        algorithm = PPO(perception, ACTIONS, configured(PPOConfig(), changes))
    learner, memory = algorithm.init(jax.random.PRNGKey(0)), algorithm.memory(args.worlds)
    rollout = made_up(algorithm, args.worlds)
    learn = jax.jit(algorithm.learn, donate_argnums=(0, 1))

    def iteration(learner, memory, key, ready):  # type: ignore[no-untyped-def]
        return learn(learner, memory, rollout, key, jnp.float32(0), jnp.bool_(ready))

    began = time.perf_counter()
    key = jax.random.PRNGKey(1)
    learner, memory, _ = jax.block_until_ready(iteration(learner, memory, key, False))
    compile_s = time.perf_counter() - began
    # the buffer is filled before the clock starts
    rows = max(getattr(algorithm.config, "capacity", 0) // (args.worlds * algorithm.length), 1)
    for _ in range(rows):
        learner, memory, _ = iteration(learner, memory, key, False)
    learner, memory, _ = jax.block_until_ready(iteration(learner, memory, key, True))
    times, began = [], time.perf_counter()
    while time.perf_counter() - began < args.seconds:
        key, now = jax.random.split(key)
        start = time.perf_counter()
        learner, memory, _ = jax.block_until_ready(iteration(learner, memory, now, True))
        times.append(time.perf_counter() - start)
    seconds = float(np.median(times))
    batch = rollout.reward.size // algorithm.config.parts if isinstance(algorithm, PPO) else algorithm.config.batch
    weights = sum(a.size for a in jax.tree.leaves(learner.actor))
    row = {
        "algo": args.algo,
        "obs": args.obs,
        "pixels": args.pixels if args.obs == "rgbd" else None,
        "worlds": args.worlds,
        "batch": batch,
        "updates_per_iteration": algorithm.samples,
        "updates_per_second": round(algorithm.samples / seconds, 1),
        "iteration_ms": round(1e3 * seconds, 3),
        "compile_s": round(compile_s, 1),
        "actor_weights": weights,
        "device": jax.devices()[0].device_kind,
        "settings": changes,
    }  # fmt: skip
    if args.kernels:
        key, now = jax.random.split(key)
        _, row["kernels"] = profiled(
            lambda: iteration(learner, memory, now, True), algorithm.samples, args.kernels, "update"
        )
    results.keep_row(row, args.out)


if __name__ == "__main__":
    main()
