"""What a recording belongs to: versions, hashes of scene, pool and task, and the machine."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import mujoco
import numpy as np

from ig2mj.envs.environment import Environment
from ig2mj.scene.scene import Scene
from ig2mj.tasks.task import TaskLike
from ig2mj.worlds.pool import Pool

BINDING = ("mujoco", "ig2mj", "scene", "scene_hash", "model_hash", "task", "task_hash", "robot", "grasping", "engine")
"""With another one of these nothing can be expected to come out the same."""

LOOSE = ("jax", "architecture", "processor", "processor_features")
"""With another one of these it mostly does; mathematical functions choose their instructions by processor."""


def origin_of(env: Environment) -> dict[str, Any]:
    """Of an environment, for the attributes of a file."""
    engine, made = env.core.engine, env.made_with
    own = {
        "task": env.task.name,
        "task_hash": task_hash(env.task),
        "pool_hash": pool_hash(env.core.starts.pool),
        "robot": env.robot,
        "grasping": env.grasping,
        "engine": engine.name,
        "worlds": engine.num_worlds,
        "horizon": env.task.horizon,
        "action_names": json.dumps(list(env.action_names)),
        "made_with": json.dumps({k: v for k, v in made.items() if _plain(v)}),
        "substeps": engine.substeps,
        "timestep": engine.timestep,
    }
    return own | origin_of_scene(env.scene) | origin_of_machine()


def task_hash(task: TaskLike) -> str:
    """Of all that a task says of itself, so that another number anywhere in it gives another hash."""
    return _hash(repr(task).encode())


def origin_of_scene(scene: Scene) -> dict[str, Any]:
    """Of a household with its robots."""
    additions = [a.wanted for a in scene.additions]
    return {
        "scene": scene.name,
        "scene_hash": scene.digest,
        "model_hash": model_hash(scene.model),
        "objects": json.dumps(list(scene.object_names)),
        "additions": json.dumps(additions),
    }


def model_hash(model: mujoco.MjModel) -> str:
    """Of all that a compiled model is but the places of its files, which are others in another folder."""
    hashed = hashlib.blake2b(digest_size=16)
    for part in (model, model.opt, model.stat):
        for name in sorted(n for n in dir(part) if not n.startswith("_") and not n.endswith("_pathadr")):
            value = getattr(part, name)
            if isinstance(value, np.ndarray):
                hashed.update(f"{name} {value.dtype} {value.shape}".encode())
                hashed.update(np.ascontiguousarray(value).data)
            elif part is not model and isinstance(value, int | float):
                hashed.update(f"{name} {value!r}".encode())
    hashed.update(model.names)
    return hashed.hexdigest()


def origin_of_machine() -> dict[str, Any]:
    """Of programs and processor."""
    model, features = _processor()
    return {
        "mujoco": mujoco.__version__,
        "ig2mj": version("ig2mj"),
        "jax": jax.__version__,
        "architecture": f"{platform.system()} {platform.machine()}",
        "processor": model,
        "processor_features": features,
    }


def pool_hash(pool: Pool) -> str:
    """Of start states."""
    hashed = hashlib.blake2b(digest_size=16)
    for leaf in jax.tree.leaves(pool):
        hashed.update(np.ascontiguousarray(leaf).data)
    return hashed.hexdigest()


def differences(recorded: Mapping[str, Any], here: Mapping[str, Any], names: tuple[str, ...]) -> list[str]:
    """What is another here, each with the exact pair, for people."""
    return [
        f"{name} was {recorded.get(name)!s}, and is {here.get(name)!s} here"
        for name in names
        if name in here and str(recorded.get(name)) != str(here.get(name))
    ]


def _plain(value: object) -> bool:
    return isinstance(value, str | int | float | bool | None) or (
        isinstance(value, list | tuple) and all(map(_plain, value))
    )


def _hash(content: Any) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _processor() -> tuple[str, str]:
    """Model name, and a hash of what the processor can do."""
    found: dict[str, str] = {}
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            found.setdefault(name.strip(), value.strip())
    except OSError:
        pass
    model = found.get("model name") or platform.processor() or "unknown"
    features = found.get("flags") or found.get("Features") or f"{os.cpu_count()}"
    return model, _hash(" ".join(sorted(features.split())).encode())
