"""Origin of a recording: hashes of physics, task and pool, settings of observations, versions, the machine.

A recording is bound to what determines physics (`model_hash`, `scene_hash`) and to the values that define the task
(`task_hash`). Looks, names and the package's version do not count; the version of the format covers changes of a step.
Recordings of format 2 have hashes of every byte instead, which are compared as such.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import os
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import mujoco
import numpy as np

from ig2mj.agents.wrist_cameras import is_wrist_camera
from ig2mj.demos.model_hash import appearance_hash, physics_hash, whole_hash
from ig2mj.demos.task_hash import task_hash, whole_task_hash
from ig2mj.demos.writer import FORMAT_VERSION
from ig2mj.envs.environment import Environment
from ig2mj.process.own_version import own_version
from ig2mj.scene.found_again import entries_of
from ig2mj.scene.scene import Scene
from ig2mj.states.added import STATES
from ig2mj.states.added_checks import AddedUpdates
from ig2mj.states.model import StateModel
from ig2mj.tasks.task import TaskLike
from ig2mj.worlds.plugin_states import KEY
from ig2mj.worlds.pool import Pool

BINDING = (
    *("mujoco", "scene_hash", "model_hash", "task_hash", "robot", "grasping", "engine"),
    *("horizon", "period", "substeps", "timestep", "acting_states"),
)
"""If one of these differs, a replay by action cannot give the same result."""

LOOSE = ("jax", "architecture", "processor", "processor_features", "plugin_states_hash")
"""If one of these differs, it mostly does: mathematical functions choose their instructions by processor, and plug-ins
have versions."""

WITHOUT_PLUGINS = {"acting_states": "none"}
"""Attributes that files lack where no plug-in adds states."""

OBSERVED = ("scene_hash", "model_hash", "task_hash", "robot", "grasping", "horizon", "period")
"""If one of these differs, observations of the same state can differ."""

WHOLE_HASHES = 2
"""Version of the format with hashes of every byte."""


def origin_of(env: Environment, version: int = FORMAT_VERSION) -> dict[str, Any]:
    """Origin of an environment, for the attributes of a file. `version`: of the format, which determines the hashes."""
    engine, made = env.core.engine, env.made_with
    own = {
        "task": env.task.name,
        "task_hash": whole_task_hash(env.task) if version == WHOLE_HASHES else task_hash(*_task_of(env)),
        "pool_hash": pool_hash(env.core.starts.pool),
        "robot": env.robot,
        "grasping": env.grasping,
        "engine": engine.name,
        "worlds": engine.num_worlds,
        "horizon": env.task.horizon,
        "period": env.period,
        "observations": json.dumps(list(env.observation_spaces)),
        "sensors": json.dumps(dataclasses.asdict(env.sensor_options)),
        "spaces": json.dumps({n: [list(s.shape), np.dtype(s.dtype).name] for n, s in env.observation_spaces.items()}),
        "privileged_names": json.dumps(list(env.privileged_names)),
        "action_names": json.dumps(list(env.action_names)),
        "made_with": json.dumps({k: v for k, v in made.items() if is_plain(v)}),
        "not_made_with": json.dumps([k for k, v in made.items() if not is_plain(v)]),
        "substeps": engine.substeps,
        "timestep": engine.timestep,
    }
    code = env.task.code
    if code is not None:
        own |= code.in_files
    model = None if env.core.rules is None else env.core.rules.model
    return own | origin_of_states(model) | origin_of_scene(env.scene, version) | origin_of_machine()


def origin_of_states(model: StateModel | None) -> dict[str, Any]:
    """Origin of the states of plug-ins: their fields and where they come from, those that change other states or move
    objects, and a hash of what they compute. Empty where there are none."""
    if model is None or not model.added:
        return {}
    updates, known = AddedUpdates.of(model), STATES.sources()
    return {
        KEY: json.dumps({field: known.get(spec.name, "") for spec in model.added for field in spec.fields}),
        "acting_states": ", ".join(sorted(updates.acts)) or WITHOUT_PLUGINS["acting_states"],
        "plugin_states_hash": updates.digest,
    }


def _task_of(env: Environment) -> tuple[TaskLike, str, tuple[str, ...]]:
    return env.task, env.robot, env.scene.object_names


def origin_of_scene(scene: Scene, version: int = FORMAT_VERSION) -> dict[str, Any]:
    """Origin of a scene with its robots. `version`: see `origin_of`."""
    whole = version == WHOLE_HASHES
    return {
        "scene": scene.name,
        "scene_hash": scene.files_digest if whole else scene.digest,
        "model_hash": whole_hash(_without_wrist_cameras(scene)) if whole else physics_hash(scene.model),
        "appearance_hash": appearance_hash(scene.model),
        "objects": json.dumps(list(scene.object_names)),
        "additions": json.dumps(scene.requested),
        "additions_found_by": json.dumps(entries_of(scene.additions)),
        **({"replacements_found_by": json.dumps(entries_of(scene.replacements))} if scene.replacements else {}),
    }


def _without_wrist_cameras(scene: Scene) -> mujoco.MjModel:
    """The model as it was when recordings had this hash: robots had no cameras on their hands."""
    spec = scene.spec()
    for camera in [camera for camera in spec.cameras if is_wrist_camera(camera.name)]:
        spec.delete(camera)
    return spec.compile()


def origin_of_machine() -> dict[str, Any]:
    """Versions of programs, and the processor."""
    model, features = _processor()
    return {
        "mujoco": mujoco.__version__,
        "ig2mj": own_version(),
        "jax": jax.__version__,
        "architecture": f"{platform.system()} {platform.machine()}",
        "processor": model,
        "processor_features": features,
    }


def pool_hash(pool: Pool) -> str:
    """Hash of start states."""
    hashed = hashlib.blake2b(digest_size=16)
    for leaf in jax.tree.leaves(pool):
        hashed.update(np.ascontiguousarray(leaf).data)
    return hashed.hexdigest()


def differences(recorded: Mapping[str, Any], here: Mapping[str, Any], names: tuple[str, ...]) -> list[str]:
    """Attributes that differ, as text with both values. Attributes that the recording lacks are not compared."""
    recorded, here = {**WITHOUT_PLUGINS, **recorded}, {**WITHOUT_PLUGINS, **here}
    return [
        _difference(name, recorded, here)
        for name in names
        if name in here and name in recorded and not _equal(recorded[name], here[name])
    ]


def _difference(name: str, recorded: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    if name == "task_hash" and "task_file" in recorded:
        return f"what determines {recorded.get('task')!s} in {recorded['task_file']!s} has changed since"
    return f"{name} was {recorded.get(name)!s}, and is {here.get(name)!s} here"


def missing_objects(recorded: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """Objects that were added to the recorded home and are not in this one, as text; others that are, too."""
    known = [_entries(header) for header in (recorded, here)]
    if known[0] is None or known[1] is None:
        return []
    lacking = [e for e in known[0] if e not in known[1]]
    extra = [e for e in known[1] if e not in known[0]]
    found = [f"it needs '{name}' ({model}, hash {sha[:12]}, from {folder})" for name, model, sha, folder in lacking]
    return [*found, *(f"'{name}' ({model}, hash {sha[:12]}) was not there" for name, model, sha, _ in extra)]


def _entries(header: Mapping[str, Any]) -> list[tuple[str, str, str, str]] | None:
    """Name, model, hash and folder of added objects; None: the file does not say."""
    try:
        entries = json.loads(str(header["additions_found_by"]))
        return [
            (str(e["name"]), f"{e['category']}/{e['model']}", str(e["sha256"]), str(e["folder"] or "the library"))
            for e in entries
        ]
    except (KeyError, TypeError, ValueError):
        return None


def is_plain(value: object) -> bool:
    """Whether JSON can represent the value."""
    if isinstance(value, Mapping):
        return all(isinstance(key, str) and is_plain(inner) for key, inner in value.items())
    return isinstance(value, str | int | float | bool | None) or (
        isinstance(value, list | tuple) and all(map(is_plain, value))
    )


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, float | int) and isinstance(b, float | int):
        return math.isclose(a, b, rel_tol=1e-9)
    return str(a) == str(b)


def _hash(content: Any) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _processor() -> tuple[str, str]:
    """Model name of the processor, and a hash of its instruction sets."""
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
