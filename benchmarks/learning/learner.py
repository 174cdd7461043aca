"""Updates a second of the learners alone: no environment, a rollout of made-up numbers.

    python -m benchmarks.learning.learner --algo sac --batch 1024 [--obs rgbd] [--set utd_ratio=64]
    python -m benchmarks.learning.learner --algo dagger --obs rgbd --pixels 128 --rows 80:128 --batch 512 \
        --capacity 200000 \
        --starts 16384 --set encoder=glimpses image_shift=0 actor_layers=160,160 object_memory=poses --kernels 40

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
from ig2mj.agents.base import HandReading
from ig2mj.envs.observations import Space
from ig2mj.learn.collect import Transition
from ig2mj.learn.dagger import PREDICTION, REMEMBERED, Dagger, DaggerConfig
from ig2mj.learn.occlusion import OcclusionConfig, glimpses
from ig2mj.learn.occlusion.object_memory import make_memory
from ig2mj.learn.occlusion.projection import CameraProjection, with_object_targets
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.settings import configure_all, configured

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
    ahead = CameraProjection((0.0, 0.0, 0.0), AHEAD, (1.0, 1.0), args.pixels, (first, below))
    perception = Perception(spaces("rgbd"), "rgbd", args.pixels, (first, below), names)
    return with_object_targets(perception, names, ahead)


def encoder_of(perception: Perception, config: SACConfig | DaggerConfig) -> glimpses.GlimpseEncoder | None:
    """The encoder that the algorithm does not make itself."""
    return glimpses.encoder_of(perception) if config.encoder == glimpses.NAME else None


def seen_by(perception: Perception, *count: int) -> Seen:
    """Random numbers and images."""
    rng, shape = np.random.default_rng(0), perception.image_shape
    size = 0 if shape is None else int(np.prod(shape))
    images = rng.integers(0, 256, (*count, size), np.uint8)
    return Seen(jnp.asarray(rng.standard_normal((*count, perception.vector_size)), jnp.float32), jnp.asarray(images))


def made_up(algorithm: SAC | PPO | Dagger, worlds: int) -> Transition:
    """A rollout of random numbers, in which one episode of two hundred ends at each step."""
    perception, length, rng = algorithm.perception, algorithm.length, np.random.default_rng(0)

    def normal(*tail: int) -> jax.Array:
        return jnp.asarray(rng.standard_normal((length, worlds, *tail)), jnp.float32)

    ends = rng.random((length, worlds)) < 0.005
    raw = normal(ACTIONS)
    extra: dict[str, Any] = {"raw": raw, "chance": normal()} if algorithm.name == "ppo" else {}
    if isinstance(algorithm, Dagger):
        extra = {"label": jnp.tanh(raw), **({REMEMBERED: normal(algorithm.memory.size)} if algorithm.memory else {})}
        extra |= {PREDICTION: normal(algorithm.kept_predictions)} if algorithm.kept_predictions else {}
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
    parser.add_argument("--pixels", type=int, default=32, help="height and width of images")
    parser.add_argument("--rows", help="of these the first that are seen and the first below those, such as 80:128")
    parser.add_argument("--starts", type=int, default=0, help="DAgger's images of start states")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE")
    parser.add_argument("--kernels", type=int, default=0, metavar="N", help="print the N longest kernels")
    parser.add_argument("--out", type=pathlib.Path)
    args = parser.parse_args()
    perception = perceived(args)
    changes = list(args.set)
    changes += [f"batch_size={args.batch}"] * bool(args.batch)
    changes += [f"buffer_size={args.capacity}"] * bool(args.capacity)
    if args.algo == "sac":
        config = configured(SACConfig(), changes)
        algorithm = SAC(perception, ACTIONS, config, encoder=encoder_of(perception, config))
    elif args.algo == "dagger":
        starts = seen_by(perception, args.starts) if args.starts else None
        config, occlusion = configure_all((DaggerConfig(), OcclusionConfig()), changes)
        memory = None
        if occlusion.object_memory != "none":
            memory = make_memory(perception, [HandReading(0)], full=occlusion.object_memory == "full")
        parts: dict[str, Any] = {"encoder": encoder_of(perception, config), "memory": memory}
        algorithm = Dagger(perception, ACTIONS, None, config, None, starts, **parts)
    else:
        algorithm = PPO(perception, ACTIONS, configured(PPOConfig(), changes))
    learner, memory = algorithm.init(jax.random.PRNGKey(0)), algorithm.buffer(args.worlds)
    rollout = made_up(algorithm, args.worlds)
    learn = jax.jit(algorithm.learn, donate_argnums=(0, 1))

    def iteration(learner, memory, key, ready):  # type: ignore[no-untyped-def]
        return learn(learner, memory, rollout, key, jnp.float32(0), jnp.bool_(ready))

    began = time.perf_counter()
    key = jax.random.PRNGKey(1)
    learner, memory, _ = jax.block_until_ready(iteration(learner, memory, key, False))
    compile_s = time.perf_counter() - began
    # the buffer is filled before the clock starts
    rows = max(getattr(algorithm.config, "buffer_size", 0) // (args.worlds * algorithm.length), 1)
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
    c: Any = algorithm.config
    batch = rollout.reward.size // c.minibatches if isinstance(algorithm, PPO) else c.batch_size
    weights = sum(a.size for a in jax.tree.leaves(learner.actor))
    row = {
        "algo": args.algo,
        "obs": args.obs,
        "pixels": args.pixels if args.obs == "rgbd" else None,
        "worlds": args.worlds,
        "batch": batch,
        "updates_per_iteration": algorithm.updates,
        "updates_per_second": round(algorithm.updates / seconds, 1),
        "iteration_ms": round(1e3 * seconds, 3),
        "compile_s": round(compile_s, 1),
        "actor_weights": weights,
        "device": jax.devices()[0].device_kind,
        "settings": changes,
    }  # fmt: skip
    if args.kernels:
        key, now = jax.random.split(key)
        _, row["kernels"] = profiled(
            lambda: iteration(learner, memory, now, True), algorithm.updates, args.kernels, "update"
        )
    results.keep_row(row, args.out)


if __name__ == "__main__":
    main()
