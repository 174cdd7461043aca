"""A scene made ready for a batch: where the hand starts, buffer sizes, a pool of initial states, a goal."""

from __future__ import annotations

import contextlib
import copy
import functools
import pathlib
import time
from typing import Any

import mujoco
import numpy as np

import ig2mj
from ig2mj.agents import Fetch, Humanoid
from ig2mj.agents.floating_hand import add_floating_hand
from ig2mj.calibration.measuring import calibrate
from ig2mj.calibration.reach import find_reach
from ig2mj.engine.warp.profile import EngineProfile, load_profile, profile_file
from ig2mj.predicates.compile import compile_expression
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.sampling.settled import make_pool
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.worlds.pool import Pool

ROBOTS: dict[str, Any] = {"humanoid": Humanoid, "fetch": Fetch}
"""What may take the hand's place, by name."""

Place = tuple[float, float, float]


def add_eye(spec: mujoco.MjSpec, pos: Place) -> AgentEntry:
    """A camera that hangs in the room, where there is no hand to carry it."""
    eye = spec.worldbody.add_body(name="eye", pos=list(pos))
    eye.add_camera(name="eye/eye", fovy=60.0)
    return AgentEntry(name="eye", body="eye", camera="eye/eye")


def ten_literals(model: StateModel) -> str:
    """A goal of ten literals over the first loose objects: where they are, and what they have become."""
    tables = model.tables
    loose = [tables.object_names[i] for i in loose_objects(tables)]
    fixed = [
        n
        for n, f, c in zip(tables.object_names, tables.object_fixed, tables.object_categories, strict=True)
        if f and c not in ("walls", "floors", "ceilings")
    ]
    pairs = [(loose[i % len(loose)], fixed[(3 * i) % len(fixed)]) for i in range(7)]
    words = ["on_top", "inside", "next_to", "under", "on_top", "inside", "touching"]
    atoms = [f"({w} {a} {b})" for w, (a, b) in zip(words, pairs, strict=True)]
    atoms.append(f"(in_contact_with {loose[0]} {loose[-1]})")
    able = model.parameters
    for word, has in (("frozen", np.isfinite(able.freeze_temperature)), ("burnt", np.isfinite(able.burn_temperature))):
        atoms += [f"(not ({word} {tables.object_names[int(i)]}))" for i in np.flatnonzero(has)[:1]]
    return "(and " + " ".join(atoms) + ")"


def robot_scene(home: str, robot: Any, near: Place) -> Scene:
    """The home with a robot on the place nearest to a hand's start at which it overlaps with nothing, within 3 m.

    Raises:
      SystemExit: there is none.
    """
    height = robot().pos[2]
    scene = ig2mj.load_scene(home, [robot(pos=(near[0], near[1], height))])
    model, data, tables = copy.copy(scene.model), scene.start_data(), scene.tables
    agent = np.asarray(tables.body_agent) >= 0
    roots = np.flatnonzero(agent & (model.body_parentid == 0))
    free = model.jnt_qposadr[(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE) & agent[model.jnt_bodyid]]
    floor = np.append(tables.object_is_floor, False)[tables.geom_object]  # -1 takes the last: no object
    places, qpos = model.body_pos[roots, :2].copy(), data.qpos.copy()
    steps = np.arange(-3.0, 3.01, 0.1)
    offsets = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    for offset in offsets[np.argsort(np.linalg.norm(offsets, axis=1), kind="stable")]:
        model.body_pos[roots, :2] = places + offset
        data.qpos[:] = qpos
        for address in free:
            data.qpos[address : address + 2] += offset
        mujoco.mj_fwdPosition(model, data)
        pairs = data.contact.geom[data.contact.dist < 0.0]
        own = agent[model.geom_bodyid[pairs]]
        if not (own.any(1) & ~own.all(1) & ~floor[pairs].any(1)).any():
            return ig2mj.load_scene(home, [robot(pos=(near[0] + offset[0], near[1] + offset[1], height))])
    raise SystemExit(f"there is no free place for the robot in {scene.name}")


class Case:
    """One scene, made ready.

    Attributes:
      scene: with the hand or robot, or with a camera where it would be. eye: the camera's name. reach: what a hand
        reaches. robot: its class; None: the hand, or nobody.
      model, pool, goal, profile: of the scene. seconds: what each part of making it ready took.
    """

    def __init__(
        self,
        home: str,
        hand: bool,
        pool_rows: int = 16,
        profiles: pathlib.Path | None = None,
        alone: contextlib.AbstractContextManager[None] | None = None,
        robot: str = "hand",
    ):
        """Makes a case.

        Args:
          home: folder, or name of a shipped home.
          hand: with a hand that can push, or with `robot`; else nothing moves.
          profiles: folder with `<home>/engine_profile.json`; then the one next to the manifest; then it is measured.
          alone: held while buffer sizes are measured, where nobody else's timing may be disturbed.
          robot: one of `ROBOTS` instead of the hand.
        """
        self.seconds: dict[str, float] = {}
        bare = ig2mj.load_scene(home)
        self.reach = self._timed("reach", lambda: find_reach(bare))
        self.robot = ROBOTS[robot] if hand and robot != "hand" else None
        if self.robot is not None:
            self.scene, settled = robot_scene(home, self.robot, tuple(self.reach.start)), bare
        else:
            add = functools.partial(add_floating_hand if hand else add_eye, pos=tuple(self.reach.start))
            self.scene = settled = ig2mj.load_scene(home, [add])
        self.eye = self.scene.model.camera(int(self.scene.tables.agent_camera[0])).name
        self.model = StateModel.of_manifest(self.scene.tables, self.scene.manifest)
        self.pool: Pool = self._timed("pool", lambda: make_pool(settled, self.model, pool_rows, share=0.2))
        self.profile: EngineProfile = self._timed("profile", lambda: self._profile(hand, profiles, alone))
        self.goal = compile_expression(self.model, ten_literals(self.model))

    def _profile(
        self, hand: bool, profiles: pathlib.Path | None, alone: contextlib.AbstractContextManager[None] | None
    ) -> EngineProfile:
        folder, file = self.scene.folder, profile_file(self.scene.agents)
        for place in (profiles / folder.name if profiles else None, folder):
            if place and (place / file).exists():
                return load_profile(place, self.scene.model, file)
        with alone or contextlib.nullcontext():
            return calibrate(self.scene, self.reach if hand and self.robot is None else None)

    def _timed(self, name: str, act):
        start = time.time()
        result = act()
        self.seconds[name] = round(time.time() - start, 1)
        return result
