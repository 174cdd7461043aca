"""Sizes that planning needs and that no speed decides: checkpoints, gradients, replay, start states, pictures.

    python benchmarks/scale_sizes.py [--out benchmarks/results/scaling/sizes.json]

The learner is SAC with its settings for a GPU, on observations of the size of CookingMeat's; the start states are a
pool of birch that is sampled here.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import tempfile

import jax
import numpy as np
from learner import ACTIONS, spaces

from ig2mj.learn.algorithms import config_of
from ig2mj.learn.checkpoints import Checkpoints
from ig2mj.learn.perception import Perception
from ig2mj.learn.sac import SAC
from ig2mj.sampling.settled import make_pool
from ig2mj.scene.scene import load_scene
from ig2mj.states.model import StateModel
from ig2mj.worlds.pool import save_pool

OUT = pathlib.Path(__file__).parent / "results" / "scaling" / "sizes.json"

ROWS = 32
"""Start states that are sampled."""


def learner(obs: str) -> dict[str, int]:
    """Of SAC from state or from pixels."""
    config = config_of("sac")
    sac = SAC(Perception(spaces(obs), obs), ACTIONS, config)
    state = sac.init(jax.random.PRNGKey(0))
    actor, critic = (sum(a.size for a in jax.tree.leaves(getattr(state, name))) for name in ("actor", "critic"))
    with tempfile.TemporaryDirectory() as folder:
        kept = Checkpoints(folder).save(1, {"learner": jax.device_get(state)}, {})
        checkpoint = sum(f.stat().st_size for f in kept.rglob("*") if f.is_file())
    shapes = jax.eval_shape(lambda: jax.tree.leaves(sac.memory(1)))
    steps = max(shape.shape[0] for shape in shapes if shape.ndim)
    replay = sum(int(np.prod(s.shape)) * s.dtype.itemsize for s in shapes if s.ndim and s.shape[0] == steps) // steps
    return {
        "actor_parameters": actor,
        "critic_parameters": critic,
        "gradient_bytes_per_update": round(4 * (critic + actor / config.every)),
        "checkpoint_bytes": checkpoint,
        "replay_bytes_per_step": replay,
    }


def pool(home: str) -> dict[str, float]:
    """Of start states, on disk and in a device's memory."""
    scene = load_scene(home)
    rows = make_pool(scene, StateModel.of_manifest(scene.tables, scene.manifest), ROWS, share=0.2)
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "pool.npz"
        save_pool(rows, file, scene)
        on_disk = file.stat().st_size
    held = sum(np.asarray(a).nbytes for a in jax.tree.leaves(rows))
    return {"rows": ROWS, "file_bytes_per_row": round(on_disk / ROWS), "memory_bytes_per_row": round(held / ROWS)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, default=OUT)
    args = parser.parse_args()
    found = {
        "learner": {obs: learner(obs) for obs in ("state", "rgbd")},
        "pool": {"home": "birch", **pool("birch")},
        "picture": {"rgb_and_depth_128_bytes": 128 * 128 * (3 + 4), "kept_32_bytes": 32 * 32 * 4},
    }
    args.out.parent.mkdir(parents=True, exist_ok=True)
    args.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
