"""iGibson's HDF5 logs: written from recordings, one file per run, and read, also those of iGibson.

    frame_data [N, 4]                           frame; durations, which are not measured: -1
    physics_data/<id>/position [N, 3], orientation [N, 4] (x-y-z-w), joint_state [N, joints]
    goal_status/satisfied, unsatisfied [N, goals]
    agent_actions/vr_robot [N, 28]              actions of the humanoid; action/robot for other robots
    action/ig2mj                                actions of the environment
    attributes "/metadata/..."                  physics_timestep, render_timestep, atus_activity, scene_id, ...

All numbers are float64; missing ones are -1. A row is the world after a step, with the action of that step, as in
iGibson 2.0's `IGLogWriter`. Body ids are object indices, followed by the agents; positions are those of main
bodies' frames, where iGibson has centres of mass. `ig2mj demos replay` needs the recording itself.

Axis: N steps.
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from ig2mj.demos.observing import check_observations, made_again, refuse_differences
from ig2mj.demos.reader import Run
from ig2mj.demos.replay import Replayed, Replayer
from ig2mj.demos.selection import some_runs
from ig2mj.demos.whole_output import whole_output
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import InputError
from ig2mj.files.hdf5 import Hdf5File
from ig2mj.files.npz import refuse_nonfinite
from ig2mj.scene.scene import Scene

METADATA = "/metadata/"

HUMANOID_SIZE = 28
"""Numbers of the action that iGibson's logs have a place for."""

WIDTHS = {"position": 3, "orientation": 4}

LONGEST = 10_000_000
"""Frames of a log that is believed."""

_KINDS = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


@dataclasses.dataclass(frozen=True)
class IGibsonLog:
    """The content of a log.

    Attributes:
      metadata: without "/metadata/". names: of bodies, by their numbers; the number where the log has none.
      position, orientation, joints: [N, 3] m, [N, 4] w-x-y-z, [N, joints], by the body's name.
      satisfied: [N, goals], or None. actions: by their path in the file.
    """

    metadata: dict[str, Any]
    names: dict[str, str]
    position: dict[str, np.ndarray]
    orientation: dict[str, np.ndarray]
    joints: dict[str, np.ndarray]
    satisfied: np.ndarray | None
    actions: dict[str, np.ndarray]

    @property
    def frames(self) -> int:
        return min((len(rows) for rows in self.position.values()), default=0)


def export_igibson(
    replayer: Replayer, folder: str | os.PathLike, success_only: bool = False, incomplete: bool = False
) -> Replayed:
    """Writes the complete runs of a recording: `<run>.hdf5` in a folder, which appears when all are written.

    Args:
      success_only, incomplete: see `ig2mj.demos.selection.chosen_runs`.

    Returns:
      Result of the replay.

    Raises:
      InputError: as of `observe`; or the folder is there.
    """
    runs = some_runs(replayer.recording, success_only, incomplete)
    check_observations(replayer)
    with whole_output(folder, folder=True) as place:
        return _export(replayer, place, runs)


def _export(replayer: Replayer, place: pathlib.Path, runs: Sequence[Run]) -> Replayed:
    bodies, seen = _Bodies(replayer.env.scene), dict[str, list[tuple[np.ndarray, ...]]]()

    def watch(state: EnvState, now: dict[int, Run], frame: int) -> None:
        for world, run in now.items() if frame else ():
            seen.setdefault(run.name, []).append(bodies.of(state, world))
        for world, run in now.items():
            if frame == run.frames - 1:
                _write(place / f"{run.name}.hdf5", replayer, run, bodies, seen.pop(run.name), world)

    done = replayer(check=True, watch=watch, runs=runs)
    refuse_differences(replayer, done)
    return done


class _Bodies:
    """Objects and agents as iGibson counts bodies. Attributes: names: of them. joints: addresses in qpos of each."""

    def __init__(self, scene: Scene):
        model, tables = scene.model, scene.tables
        self.names = [*scene.object_names, *tables.agent_names]
        owner = np.where(tables.body_agent >= 0, tables.body_agent + len(scene.object_names), tables.body_object)
        self.joints: list[np.ndarray] = [np.zeros(0, int) for _ in self.names]
        for j in range(model.njnt):
            body = owner[model.jnt_bodyid[j]]
            if body >= 0 and mujoco.mjtJoint(int(model.jnt_type[j])) in _KINDS:
                self.joints[body] = np.append(self.joints[body], model.jnt_qposadr[j])

    def of(self, state: EnvState, world: int) -> tuple[np.ndarray, ...]:
        """Positions [bodies, 3] and orientations [bodies, 4] w-x-y-z."""
        view = state.batch.world.view
        pos = np.concatenate([np.asarray(view.object_pos)[world], np.asarray(view.agent.base_pos)[world]])
        quat = np.concatenate([np.asarray(view.object_quat)[world], np.asarray(view.agent.base_quat)[world]])
        return pos, quat


def _write(
    file: pathlib.Path, replayer: Replayer, run: Run, bodies: _Bodies, seen: list[tuple[np.ndarray, ...]], world: int
) -> None:
    import h5py

    env, count = replayer.env, run.frames - 1
    pos, quat = (np.stack([row[k] for row in seen]).astype(np.float64) for k in (0, 1))
    parts = [run.all_rows(f"frames/physics/{part}/qpos")[1:] for part in ("scene", "agents")]
    qpos, goal = np.concatenate(parts, axis=1), run.all_rows("frames/goal")[1:]
    action = run.all_rows("steps/action").astype(np.float64)
    robots = np.asarray(env.action_map(action.astype(np.float32)), np.float64)
    with h5py.File(file, "w") as out:
        out["frame_data"] = np.column_stack([np.arange(count, dtype=np.float64), np.full((count, 3), -1.0)])
        for body in range(len(bodies.names)):
            group = out.create_group(f"physics_data/{body}")
            group.create_dataset("position", data=pos[:, body], compression="gzip")
            group.create_dataset("orientation", data=quat[:, body, [1, 2, 3, 0]], compression="gzip")
            group.create_dataset("joint_state", data=qpos[:, bodies.joints[body]])
        out["goal_status/satisfied"], out["goal_status/unsatisfied"] = goal.astype(float), (~goal).astype(float)
        if robots.shape[1] == HUMANOID_SIZE:
            out["agent_actions/vr_robot"] = robots
        else:
            out["agent_actions/vr_robot"] = np.full((count, HUMANOID_SIZE), -1.0)
            out["action/robot"] = robots
        out["action/ig2mj"] = action
        for name, value in _metadata(env, replayer, run, bodies).items():
            out.attrs[METADATA + name] = value
        out.attrs["instance_id"] = run.row


def _metadata(env: Environment, replayer: Replayer, run: Run, bodies: _Bodies) -> dict[str, Any]:
    names = {str(k): name for k, name in enumerate(bodies.names)}
    return {
        "physics_timestep": float(env.core.engine.timestep),
        "render_timestep": float(env.period),
        "git_info": json.dumps({"ig2mj": {"version": replayer.recording.header.get("ig2mj")}}),
        "atus_activity": env.task.name,
        "activity_definition": 0,
        "filter_objects": False,
        "scene_id": env.scene.name,
        "obj_body_id_to_name": json.dumps(names),  # YAML as well
        "urdf_file": "",
        "ig2mj": json.dumps({"make": made_again(env), "horizon": env.task.horizon}),
        "run": run.name,
        "robot": env.robot,
    }


def read_igibson(file: str | os.PathLike) -> IGibsonLog:
    """Reads a log of iGibson's or of `export_igibson`.

    Raises:
      InputError: it is missing, broken, or no such log; the message names the field.
    """
    with Hdf5File(file, fix="it is not an iGibson log") as opened:
        return _log(opened)


def _log(opened: Hdf5File) -> IGibsonLog:
    metadata = {name.removeprefix(METADATA): value for name, value in opened.attributes().items()}
    known = _names(str(metadata.get("obj_body_id_to_name", "")))
    found: dict[str, dict[str, np.ndarray]] = {kind: {} for kind in ("position", "orientation", "joint_state")}
    names = {body: known.get(body, body) for body in opened.names("physics_data")}
    for body, name in names.items():
        for kind, rows in found.items():
            rows[name] = _array(opened, f"physics_data/{body}/{kind}", WIDTHS.get(kind))
    lengths = {len(rows) for of in found.values() for rows in of.values()}
    if len(lengths) > 1:
        raise InputError(opened.file, f"have {sorted(lengths)} frames", element="physics_data", fix="it is cut off")
    folders = [folder for folder in ("agent_actions", "action") if opened.has(folder)]
    actions = {name: _array(opened, name, None) for folder in folders for name in opened.arrays_below(folder)}
    goal = "goal_status/satisfied"
    return IGibsonLog(
        metadata,
        names,
        found["position"],
        {name: rows[:, [3, 0, 1, 2]] for name, rows in found["orientation"].items()},
        found["joint_state"],
        _array(opened, goal, None) if opened.has(goal) else None,
        actions,
    )


def _array(opened: Hdf5File, name: str, width: int | None) -> np.ndarray:
    """[N, width] numbers that are in this file. Raises InputError."""
    array = opened.array(name, kinds="fiu", ndim=2)
    if width is not None and array.shape[1] != width:
        raise opened.broken(name, f"has {array.shape[1]} numbers a frame, and must have {width}")
    if array.shape[0] > LONGEST or array.shape[1] > 4096:
        raise opened.broken(name, f"has shape {array.shape}: no log is as large")
    values = opened.read(name, kinds="fiu", ndim=2).astype(np.float64)
    refuse_nonfinite(values, opened.file, name)
    return values


def _names(text: str) -> dict[str, str]:
    """Of bodies, from JSON or from YAML's lines "12: name"."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        pairs = (line.partition(":") for line in text.splitlines())
        found = {key.strip(" '\""): name.strip(" '\"") for key, colon, name in pairs if colon}
    return {str(k): str(v) for k, v in found.items()} if isinstance(found, dict) else {}
