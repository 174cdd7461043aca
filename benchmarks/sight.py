"""What an encoder tells of start states that it has never seen: where each object is, and how it is turned.

    python benchmarks/sight.py SlicingFruit --rows 80:128 --mixed 200000 --starts 16384 --updates 4000
    python benchmarks/sight.py SlicingFruit --robot fetch --rows 60:108 --net places

The guess of the privileged state learns from pictures of start states alone, as `ig2mj train --set look=...` has it
before the first step; nobody acts. Every so many updates it is tried on held-out start states. A line for each object:
the median error of its place, how far from it the glimpse looks, the median error of its x axis' direction, and the
share of the states in which its y axis points to the wrong side; of things that look alike from all sides nobody can
tell that.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import jax
import numpy as np

import ig2mj
from ig2mj.cli.train import rows_of
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.looking import look, start_pictures
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.projection import FRAME, lens_of

NAMES = ("proprioception", "privileged_state", "rgb", "depth")


def errors(algorithm: Dagger, learner: Any, seen: Seen) -> dict[str, dict[str, float]]:
    """Of each object over the start states that are seen, by name of the error."""
    perception, hidden = algorithm.perception, algorithm.perception.hidden
    assert hidden is not None and perception.picture_shape is not None
    size, step = perception.actor_size, 250

    @jax.jit
    def guess(vector: Any, picture: Any) -> tuple[Any, Any]:
        normal = learner.moments.normal(vector)
        looked: Any = algorithm.actor.apply({"params": learner.actor}, normal[:, :size], picture)
        return looked[2], hidden(vector, normal, looked[2].shape[-1])

    parts = [guess(seen.vector[k : k + step], seen.picture[k : k + step]) for k in range(0, len(seen.vector), step)]
    found, wanted = (np.concatenate([np.asarray(p[k]) for p in parts]) for k in range(2))
    unit = np.sqrt(np.asarray(learner.moments.var) + 1e-4)[hidden.plain]
    half = (np.array(perception.picture_shape[:2]) - 1) / 2
    rows = {}
    for k, (name, (place, turn)) in enumerate(hidden.poses.items()):
        away = (found - wanted)[:, place] * unit[place]
        rows[name] = row = {"place_cm": 100 * float(np.median(np.linalg.norm(away, axis=1)))}
        if found.shape[1] > hidden.size:
            point = (found - wanted)[:, hidden.size + 2 * k :][:, :2] / FRAME
            row["pixels"] = float(np.median(np.linalg.norm(point * half, axis=1)))
        for axis, columns in (("x", turn[:3]), ("y", turn[3:])):
            one, other = found[:, columns], wanted[:, columns]
            cosine = (one * other).sum(1) / np.maximum(
                np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1), 1e-9
            )
            row[f"{axis}_degrees"] = float(np.median(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
            row[f"{axis}_wrong"] = float((cosine < 0).mean())
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("env")
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--net", default="glimpses")
    parser.add_argument("--engine", default="native")
    parser.add_argument("--worlds", type=int, default=32)
    parser.add_argument("--pool-size", type=int, default=4096)
    parser.add_argument("--rows", default=None)
    for name, value in (
        ("mixed", 0),
        ("starts", 4096),
        ("tests", 1000),
        ("updates", 3000),
        ("batch", 32),
        ("every", 500),
    ):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--lr", type=float, default=2e-3)
    args = parser.parse_args()
    made = {"robot": args.robot, "worlds": args.worlds, "engine": args.engine, "observations": NAMES}
    env = ig2mj.make(args.env, **made, pool_size=args.pool_size, mixed=args.mixed)
    apart = ig2mj.make(args.env, **made, split="held_out", pool_size=args.tests)
    rows = rows_of(args.rows, 128)
    lens = lens_of(env, 128, rows)
    perception = Perception(env.observation_spaces, "rgbd", 128, rows, env.privileged_names, lens)
    began = time.monotonic()
    starts = start_pictures(env, perception, args.starts)
    unseen = start_pictures(apart, perception, args.tests)
    print(f"{args.starts + args.tests} pictures in {time.monotonic() - began:.0f} s", flush=True)
    config = DaggerConfig(batch=args.batch, look=args.updates, shift=0, net=args.net, actor=(8,), lr=args.lr)
    algorithm = Dagger(perception, env.action_space.shape[0], None, config, starts=starts)
    began = time.monotonic()

    def report(done: int, learner: Any, loss: float) -> None:
        if done % args.every and done < args.updates:
            return
        spent = {"updates": done, "seconds": round(time.monotonic() - began), "loss": round(loss, 3)}
        for name, row in errors(algorithm, learner, unseen).items():
            print(json.dumps({**spent, "object": name, **{k: round(v, 3) for k, v in row.items()}}), flush=True)

    look(algorithm, 0, report)


if __name__ == "__main__":
    main()
