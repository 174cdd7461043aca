"""Debug mode: every step is checked on the host; the first flagged world is dumped, and raises an error."""

from __future__ import annotations

import os
import pathlib
import weakref
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.base import Write
from ig2mj.engine.health import Usage
from ig2mj.engine.saved import copied
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array
from ig2mj.engine.warp.profile import EngineProfile
from ig2mj.errors import EngineError
from ig2mj.files.shell import command
from ig2mj.predicates.compile import GoalStatus
from ig2mj.process import entry_point
from ig2mj.scene.scene import Scene
from ig2mj.worlds import guards
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.core import Core, Policy
from ig2mj.worlds.face import Face
from ig2mj.worlds.random_streams import Seeds
from ig2mj.worlds.recorder import LENGTH, RecentSteps, frames_of, record, save_dump, start_recording


@entry_point
class DebugWorlds(Face):
    """A core whose every step is checked. Slower: each step waits for the device and copies every world's state.

    Attributes:
      core: what is watched. batch: as the last step left it, also one that raised.
    """

    def __init__(self, core: Core, scene: Scene, folder: str | os.PathLike = "dumps", length: int = LENGTH):
        """Binds the worlds of a scene to a folder for dumps; `length`: control steps kept."""
        self.core, self.scene, self.folder, self.length = core, scene, pathlib.Path(folder), length
        self.batch: Batch | None = None
        # Of each branch its last batch and its recording; the one that was stepped last comes first.
        self._branches: list[tuple[weakref.ref[Batch], RecentSteps]] = []

    def start(self, seed: Seeds = 0) -> Batch:
        """All worlds at the start of their first episode, and an empty recording."""
        return self._begin(self.core.start(seed))

    def load(self, file: str | os.PathLike) -> Batch:
        """The batch that `save` wrote, and an empty recording; see `Face.load`."""
        return self._begin(super().load(file))

    def _begin(self, batch: Batch) -> Batch:
        self._branches = [(weakref.ref(batch), start_recording(self.core.engine, batch, self.length))]
        return batch

    def step(self, batch: Batch, action: Float[Array, "W n"] | None = None) -> tuple[Batch, GoalStatus]:
        """One control step; see `Core.step`.

        Raises:
          EngineError: a world is flagged; names world, flag, values, the setting to raise, and the dump.
        """
        assert self._branches, "start first"
        branch = self._branch_of(batch)
        batch, status = self.core.step(batch, action)
        self.batch = batch
        recording = record(self.core.engine, self._branches.pop(branch)[1], batch)
        self._branches.insert(0, (weakref.ref(batch), recording))
        flagged = np.flatnonzero(np.asarray(batch.flags))
        if len(flagged):
            raise EngineError(self._report(batch, int(flagged[0]), recording))
        return batch, status

    def rollout(self, batch: Batch, carry: Any, policy: Policy, length: int) -> tuple[Batch, Any]:
        """See `Face.rollout`; each step is checked as `step` does. Raises EngineError."""
        for _ in range(length):
            action, carry = policy(batch, carry)
            batch, _ = self.step(batch, action)
        return batch, carry

    def reset(self, batch: Batch, mask: Bool[Array, "W"]) -> Batch:
        """See `Face.reset`."""
        return self._changed(batch, lambda: self.core.reset(batch, mask))

    def write(self, batch: Batch, write: Write) -> Batch:
        """See `Face.write`."""
        return self._changed(batch, lambda: self.core.write(batch, write))

    def _changed(self, batch: Batch, change: Callable[[], Batch]) -> Batch:
        """The batch after a change; its branch goes on."""
        branch = self._branch_of(batch)
        after = change()
        self._branches[branch] = weakref.ref(after), self._branches[branch][1]
        return after

    def fork(self, batch: Batch) -> Batch:
        """An independent copy, with a recording of its own; see `Core.fork`."""
        copy = self.core.fork(batch)
        recording = copied(self._branches[self._branch_of(batch)][1])
        first, *others = self._branches
        self._branches = [first, *(known for known in others if known[0]() is not None)]
        self._branches.append((weakref.ref(copy), recording))
        return copy

    def _branch_of(self, batch: Batch) -> int:
        """Number of a batch's branch. One that was changed by `core` itself counts as of the last one stepped."""
        return next((k for k, (last, _) in enumerate(self._branches) if last() is batch), 0)

    def _report(self, batch: Batch, world: int, recording: RecentSteps) -> str:
        scene = self.scene
        overflow = int(np.asarray(self.core.engine.health(batch.world.physics).overflow)[world])
        flags = int(np.asarray(batch.flags)[world])
        step = int(np.asarray(batch.world.step)[world])
        self.folder.mkdir(parents=True, exist_ok=True)
        file = self.folder / f"world{world}_step{step}.npz"
        values = "; ".join(self._values(batch, world, flags))
        text = f"{guards.explain(world, flags, overflow)}: {values}; step {step}"
        note = {"world": world, "step": step, "flags": flags, "overflow": overflow, "text": text}
        save_dump(frames_of(recording, world), file, scene.name, note, scene.model)
        return f"{text}; the last {self.length} steps: {command('view', scene.folder, '--dump', file)}"

    def _values(self, batch: Batch, world: int, flags: int) -> list[str]:
        """For every flag, the number that is beyond its limit."""
        engine, physics, scene = self.core.engine, batch.world.physics, self.scene
        row = engine.export(physics, world)
        finite = _finite(np.asarray(row.qpos)) and _finite(np.asarray(row.qvel))
        said = []
        if flags & guards.Flag.OVERFLOW and isinstance(engine, HasBuffers):
            usage, profile, worlds = engine.usage(physics), engine.profile, engine.num_worlds
            used = {
                "awake_dofs": (np.asarray(usage.awake_dofs)[world], profile.awake_dofs),
                "constraints": (np.asarray(usage.constraints)[world], profile.constraints),
                "contacts of all worlds": (usage.contacts, worlds * profile.contacts),
                "convex_contacts of all worlds": (usage.convex_contacts, worlds * profile.convex_contacts),
            }
            said.append("last physics step: " + ", ".join(f"{int(n)} of {m} {what}" for what, (n, m) in used.items()))
        if flags & guards.Flag.NOT_FINITE and not finite:
            said.append(f"body '{self._first_lost(row)}' has no finite position or velocity")
        if flags & guards.Flag.FELL:
            height = np.asarray(batch.world.view.object_com)[world, :, 2]
            below = height - self.core.starts.floor
            lowest = int(np.nanargmin(below))
            name = scene.object_names[lowest]
            said.append(f"'{name}' at z = {height[lowest]:.3g} m, limit {self.core.starts.floor[lowest]:.3g} m")
        if flags & guards.Flag.TOO_FAST:
            speed = float(np.asarray(engine.health(physics).top_speed)[world])
            said.append(f"{speed:.3g} m/s, limit {guards.TOP_SPEED:g} m/s")
        return said or ["right again by now"]

    def _first_lost(self, row: Snapshot) -> str:
        """The first body whose position or velocity is not a number."""
        model = self.scene.model
        lost = [int(model.jnt_bodyid[j]) for j in range(model.njnt) if not _finite(_coordinates(model, row, j))]
        return model.body(lost[0]).name


def _finite(numbers: np.ndarray) -> bool:
    """All are numbers, and none is so large that MuJoCo takes it for none."""
    return bool((np.abs(numbers) < mujoco.mjMAXVAL).all())


def _coordinates(model: mujoco.MjModel, row: Snapshot, joint: int) -> np.ndarray:
    """Positions and velocities of a joint."""
    q, v = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    counts = {int(mujoco.mjtJoint.mjJNT_FREE): (7, 6), int(mujoco.mjtJoint.mjJNT_BALL): (4, 3)}
    nq, nv = counts.get(int(model.jnt_type[joint]), (1, 1))
    return np.concatenate([row.qpos[q : q + nq], row.qvel[v : v + nv]])


@runtime_checkable
class HasBuffers(Protocol):
    """An engine whose buffers can overflow (Warp's)."""

    num_worlds: int
    profile: EngineProfile

    def usage(self, physics: Any) -> Usage: ...
