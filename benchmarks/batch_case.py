"""A scene made ready for a batch: where the hand starts, buffer sizes, a pool of initial states, a goal."""

from __future__ import annotations

import contextlib
import functools
import pathlib
import time

import mujoco
import numpy as np

import ig2mj
from ig2mj.agents.floating_hand import add_floating_hand
from ig2mj.calibration.measuring import calibrate
from ig2mj.calibration.reach import find_reach
from ig2mj.engine.warp.profile import PROFILE_FILE, EngineProfile, load_profile
from ig2mj.predicates.compile import compile_expression
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.sampling.settled import make_pool
from ig2mj.scene.manifest import AgentEntry
from ig2mj.states.model import StateModel
from ig2mj.worlds.pool import Pool

HAND_DOFS = 16

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


class Case:
    """One scene, made ready.

    Attributes:
      scene: with the hand, or with a camera where it would be. eye: the camera's name. reach: what the hand reaches.
      model, pool, goal, profile: of the scene. seconds: what each part of making it ready took.
    """

    def __init__(
        self,
        home: str,
        hand: bool,
        pool_rows: int = 16,
        profiles: pathlib.Path | None = None,
        alone: contextlib.AbstractContextManager[None] | None = None,
    ):
        """Makes a case.

        Args:
          home: folder, or name of a shipped home.
          hand: with a hand that can push; else nothing moves.
          profiles: folder with `<home>/engine_profile.json`; then the one beside the manifest; then it is measured.
          alone: held while buffer sizes are measured, where nobody else's timing may be disturbed.
        """
        self.seconds: dict[str, float] = {}
        bare = ig2mj.load_scene(home)
        self.reach = self._timed("reach", lambda: find_reach(bare))
        add = functools.partial(add_floating_hand if hand else add_eye, pos=tuple(self.reach.start))
        self.eye = "hand/eye" if hand else "eye/eye"
        self.scene = ig2mj.load_scene(home, [add])
        self.model = StateModel.of_manifest(self.scene.tables, self.scene.manifest)
        self.pool: Pool = self._timed("pool", lambda: make_pool(self.scene, self.model, pool_rows, share=0.2))
        self.profile: EngineProfile = self._timed("profile", lambda: self._profile(hand, profiles, alone))
        self.goal = compile_expression(self.model, ten_literals(self.model))

    def _profile(
        self, hand: bool, profiles: pathlib.Path | None, alone: contextlib.AbstractContextManager[None] | None
    ) -> EngineProfile:
        folder = self.scene.folder
        for place in (profiles / folder.name if profiles else None, folder):
            if place and (place / PROFILE_FILE).exists():
                return load_profile(place, self.scene.model)
        with alone or contextlib.nullcontext():
            return calibrate(self.scene, self.reach if hand else None)

    def _timed(self, name: str, act):
        start = time.time()
        result = act()
        self.seconds[name] = round(time.time() - start, 1)
        return result
