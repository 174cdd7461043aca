"""iGibson's metrics of recordings: goal, disarrangement, distance travelled, grasping, gaze.

    goal                score (share of the goal's literals) at the start, at the end, the best; and at every frame
    kinematic           metres by which bodies of objects moved between start and end, both settled; by object
    logical             predicates whose values at start and end differ
    path length         metres that base and hands travelled, and the box in the base's frame that hands reached
    grasping            share of frames in which each hand holds something
    gaze                gazed-at objects: share of frames by object, fixations, mean turn (rad/s)

The gaze is that of an eye tracker (`devices/gaze`; `measured` is true), else the axis of the robot's camera. Source:
iGibson 2.0's `igibson/metrics`, which lets the world settle before it compares: here, `SETTLE` control steps without
action.

The frames that a compact recording (`ig2mj.demos.compact`) omits are computed by a replay by action.

Axes: T steps of a run, H hands.
"""

from __future__ import annotations

import dataclasses
import json
import os
from typing import Any

import mujoco
import numpy as np

from ig2mj.demos.gaze import Rays, measured_rays, statistics
from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.replay import Replayer
from ig2mj.demos.selection import chosen_runs
from ig2mj.demos.shipped import find_recording
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.registry import OWN, find
from ig2mj.process import entry_point
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel

SETTLE = 150
"""Control steps (iGibson's figure), 5 s."""

MOVED = 1e-3
"""Metres below which an object is not listed as moved."""

Fact = tuple[str, tuple[str, ...]]


@entry_point
def metrics_of(
    file: str | os.PathLike,
    settle: int = SETTLE,
    env: Environment | None = None,
    success_only: bool = False,
    incomplete: bool = False,
) -> list[dict[str, Any]]:
    """Metrics of the complete runs of a recording, in their order; numbers and text only.

    Args:
      settle: control steps before start and end are compared; 0: as they are.
      env: that the file was recorded in, where it is at hand or `ig2mj.make` cannot make it.
      success_only, incomplete: see `ig2mj.demos.selection.chosen_runs`.

    Raises:
      InputError: the recording is broken, or of something that is not there.
    """
    with Recording(find_recording(file)) as recording:
        runs = chosen_runs(recording, success_only, incomplete)
        if not runs:
            return []
        whole = all(run.kept(1, min(3, run.frames)).all() for run in runs)
        replayer = Replayer(recording, "state" if whole else "action", env=env)
        measured = _Measuring(replayer.env, settle)
        watched = {run.name: _Watched(measured_rays(run)) for run in runs}

        def watch(state: EnvState, now: dict[int, Run], frame: int) -> None:
            for world, run in now.items():
                watched[run.name].see(measured, state, world, frame)

        replayer(watch=watch, runs=runs)
        found: dict[str, dict[str, Any]] = {}
        for now in replayer.rounds(runs):
            start, end = (measured.settled(replayer.all_at(now, place)) for place in ("first", "last"))
            for world, run in now.items():
                about = {"file": str(file), "run": run.name, "frames": run.frames, "success": run.success}
                about["complete"] = run.complete
                own = watched[run.name].result(measured)
                found[run.name] = about | own | _disarrangement(measured, start, end, world)
        return [found[run.name] for run in runs]


def metrics_job(file: str, settle: int, success_only: bool, incomplete: bool) -> bytes:
    """The result of `metrics_of` as JSON, for a job."""
    return json.dumps(metrics_of(file, settle, None, success_only, incomplete)).encode()


@dataclasses.dataclass
class _Watched:
    """What is noted of every frame of a run; with the gaze that was measured in it."""

    rays: Rays | None
    score: list[float] = dataclasses.field(default_factory=list)
    base: list[np.ndarray] = dataclasses.field(default_factory=list)
    hands: list[np.ndarray] = dataclasses.field(default_factory=list)
    reached: list[np.ndarray] = dataclasses.field(default_factory=list)
    holds: list[np.ndarray] = dataclasses.field(default_factory=list)
    gaze: list[str | None] = dataclasses.field(default_factory=list)
    axis: list[np.ndarray] = dataclasses.field(default_factory=list)

    def see(self, measuring: _Measuring, state: EnvState, world: int, frame: int) -> None:
        view = state.batch.world.view
        agent, turn = view.agent, _matrix(np.asarray(view.agent.base_quat)[world, 0])
        base, hands = np.array(agent.base_pos)[world, 0], np.array(agent.hand_pos)[world]
        self.score.append(float(np.asarray(state.status.fraction)[world]))
        self.base.append(base)
        self.hands.append(hands)
        self.reached.append((hands - base) @ turn)
        self.holds.append(np.asarray(view.held)[world].any(1))
        if self.rays is None:
            ray = np.asarray(agent.eye_pos)[world, 0], -_matrix(np.asarray(agent.eye_quat)[world, 0])[:, 2]
        else:
            ray = self.rays.at(frame)
        self.axis.append(np.zeros(3) if ray is None else ray[1])
        self.gaze.append(None if ray is None else measuring.met(state, world, *ray))

    def result(self, measuring: _Measuring) -> dict[str, Any]:
        scene = measuring.scene
        hands = [scene.model.body(int(b)).name for b in scene.tables.hand_body]
        reached, holds = np.stack(self.reached), np.stack(self.holds)
        box = {h: [reached[:, k].min(0).tolist(), reached[:, k].max(0).tolist()] for k, h in enumerate(hands)}
        return {
            "goal": {
                "start": self.score[0],
                "end": self.score[-1],
                "best": max(self.score),
                "delta": self.score[-1] - self.score[0],
                "each_frame": self.score,
            },
            "path_length": {
                "base": _length(np.stack(self.base)),
                **{name: _length(np.stack(self.hands)[:, k]) for k, name in enumerate(hands)},
            },
            "workspace": box,
            "grasping": {name: float(holds[:, k].mean()) for k, name in enumerate(hands)},
            "gaze": statistics(self.gaze, self.axis, measuring.env.period, self.rays is not None),
        }


class _Measuring:
    """Measurements in an environment: settled worlds, predicates, objects on a ray."""

    def __init__(self, env: Environment, settle: int):
        rules = env.core.rules
        assert rules is not None
        self.env, self.scene, self.model = env, env.scene, rules.model
        steps = env.period / (env.core.engine.substeps * env.core.engine.timestep)
        self._settle = round(settle / steps)
        self._questions = HostQueries(rules.model, env.num_worlds)
        tables = env.scene.tables
        self.bodies = np.flatnonzero(tables.body_object >= 0)
        self._groups = np.array([1, 0, 0, 0, 0, 0], np.uint8)  # what is seen

    def settled(self, state: EnvState) -> EnvState:
        """The worlds after `settle` control steps without action."""
        zero = np.zeros((self.env.num_worlds, *self.env.action_space.shape), np.float32)
        for _ in range(self._settle):
            state = self.env.step(state, zero)
        return state

    def facts(self, state: EnvState, asked: dict[str, list[tuple[int, ...]]]) -> dict[Fact, np.ndarray]:
        """Truth in each world, by predicate and objects."""
        names, world, found = self.scene.object_names, state.batch.world, {}
        for name, rows in asked.items():
            truth = self._questions.holds(find(name), rows, world.states, world.view)
            for k, row in enumerate(rows):
                found[name, tuple(names[o] for o in row)] = truth[:, k]
        return found

    def met(self, state: EnvState, world: int, start: np.ndarray, axis: np.ndarray) -> str:
        """The object that a ray meets first; "" where it meets none, as walls and floors are objects too."""
        if not hasattr(self.env.core.engine, "to_mujoco"):
            return ""
        model, data = self.env.core.engine.to_mujoco(state.batch.world.physics, world)
        geom = np.zeros(1, np.int32)
        eye = int(self.scene.tables.agent_body[0])
        mujoco.mj_ray(model, data, start.astype(float), axis.astype(float), self._groups, 1, eye, geom)
        if geom[0] < 0:
            return ""
        owner = int(self.scene.tables.geom_object[geom[0]])
        return self.scene.object_names[owner] if owner >= 0 else "own body"


def _disarrangement(measuring: _Measuring, start: EnvState, end: EnvState, world: int) -> dict[str, Any]:
    """Kinematic and logical, of two settled states."""
    tables, names = measuring.scene.tables, measuring.scene.object_names
    before, after = (np.asarray(s.batch.world.view.body_pos)[world, measuring.bodies] for s in (start, end))
    moved = np.linalg.norm(after - before, axis=1)
    of_object = np.bincount(tables.body_object[measuring.bodies], moved, len(names))
    listed = {names[o]: float(of_object[o]) for o in np.argsort(-of_object) if of_object[o] > MOVED}
    asked: dict[str, list[tuple[int, ...]]] = {}
    for state in (start, end):
        for name, rows in _candidates(measuring.model, measuring.scene, state, world).items():
            asked[name] = list(dict.fromkeys([*asked.get(name, []), *rows]))
    facts = [measuring.facts(state, asked) for state in (start, end)]
    changed = [fact for fact in facts[0] if facts[0][fact][world] != facts[1][fact][world]]
    gone, new = ([_text(f) for f in changed if facts[k][f][world]] for k in (0, 1))
    return {
        "kinematic_disarrangement": {"total": float(moved.sum()), "objects": listed},
        "logical_disarrangement": {"total": len(changed), "no_longer": gone, "now": new},
    }


def _text(fact: Fact) -> str:
    return f"({' '.join((fact[0], *fact[1]))})"


def _candidates(model: StateModel, scene: Scene, state: EnvState, world: int) -> dict[str, list[tuple[int, ...]]]:
    """States of all objects that can have them; contacts and what lies on or in another of what is near it.

    Predicates of plug-ins do not count: metrics of a recording are the same everywhere.
    """
    tables, view = scene.tables, state.batch.world.view
    there = ~tables.object_parked
    asked: dict[str, list[tuple[int, ...]]] = {}
    for p in OWN.values():
        if p.arity == 1 and p.ability:
            asked[p.name] = [(int(o),) for o in np.flatnonzero(model.parameters.has(p.ability) & there)]
    loose = ~tables.object_fixed & there
    touching = [(int(a), int(b)) for a, b in np.argwhere(np.asarray(view.touching)[world]) if loose[a]]
    com = np.asarray(view.object_com)[world][:, None]
    low, high = np.asarray(view.aabb_low)[world], np.asarray(view.aabb_high)[world]
    within = ((com >= low) & (com <= high)).all(-1) & ~np.eye(len(com), dtype=bool)
    inside = [(int(a), int(b)) for a, b in np.argwhere(within) if loose[a] and there[b]]
    pairs = {"on_top": touching, "in_contact_with": touching, "inside": inside}
    return {name: rows for name, rows in (asked | pairs).items() if rows}


def _length(path: np.ndarray) -> float:
    """Metres along positions [T + 1, 3]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _matrix(quat: np.ndarray) -> np.ndarray:
    """[3, 3] of w-x-y-z."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(quat, np.float64))
    return matrix.reshape(3, 3)
