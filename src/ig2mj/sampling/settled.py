"""Settled initial states in bulk: a scene is disturbed at random and stepped until it is at rest, many times.

Native engine only: it puts resting objects to sleep, and sleeping objects cost nothing in a batch.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine, NativePhysics
from ig2mj.errors import EngineError
from ig2mj.process import entry_point
from ig2mj.sampling.overlap import Overlaps
from ig2mj.sampling.perturbation import loose_objects, perturb
from ig2mj.sampling.query import settle_worlds
from ig2mj.scene.scene import Scene
from ig2mj.states.initial import states_of_manifest
from ig2mj.states.model import StateModel
from ig2mj.worlds.guards import lowest_support
from ig2mj.worlds.pool import Pool, stack
from ig2mj.worlds.random_streams import episode_keys

SECONDS = 6.0
"""Simulated seconds within which a row must come to rest, or be thrown away."""

TRIES = 4
"""Times as many rows as asked for may be tried before giving up."""

OVERLAP, RESTING_OVERLAP = 0.002, 0.004
"""Metres by which a disturbed object may penetrate something more than at the start: when it is released, and at rest.
A sleeping object that penetrates more is thrown off when it wakes."""

TAKEN_BACK = 3
"""Times that disturbed objects are looked through; each time those that overlap go back to where they were."""


@entry_point
def make_pool(
    scene: Scene,
    model: StateModel,
    count: int,
    *,
    seed: int = 0,
    share: float = 0.3,
    threads: int | None = None,
    progress: ProgressCallback = no_progress,
) -> Pool:
    """A pool of `count` rows.

    Args:
      scene, model: the household and its states' constants.
      count: P.
      seed: the same seed gives the same pool, whatever the number of threads; `sample_settled` gives the same.
      share: probability that an object is disturbed, per object and row.
      threads: of the native engine; None: one per processor.
      progress: called with the finished rows and `count`.

    Raises:
      EngineError: too few rows come to rest with everything still in the house and nothing stuck in something.
    """
    disturber = Disturber(scene, model, width_of(count), threads)
    rows: list[Pool] = []
    for turn in range(most_turns(count)):
        rows += disturber.rows(turn, seed, share)
        progress(min(len(rows), count), count)
        if len(rows) >= count:
            return dataclasses.replace(stack(rows[:count]), digest=scene.digest)
    raise too_few(scene, count, len(rows))


def width_of(count: int) -> int:
    """Worlds that are disturbed side by side, in one turn, for a pool of so many rows."""
    return min(count, 16)


def most_turns(count: int) -> int:
    """Turns after which a pool of so many rows is given up."""
    return -(-(TRIES * count) // width_of(count)) + 1


def too_few(scene: Scene, count: int, made: int) -> EngineError:
    """The error of a pool that was given up."""
    return EngineError(
        f"of {most_turns(count) * width_of(count)} disturbed states of '{scene.name}' only {made} came to rest with "
        f"everything in the house and apart (convert the scene with its checks and fix what does not settle)"
    )


class Disturber:
    """A scene at rest, in some worlds, from which every turn begins."""

    def __init__(self, scene: Scene, model: StateModel, width: int, threads: int | None = None):
        """`width`: worlds. `threads`: of the native engine; None: one per processor."""
        self._scene, self._width = scene, width
        self._engine = engine = NativeEngine(scene, width, threads=threads)
        self._physics, _ = settle_worlds(engine, engine.reset(), SECONDS)
        self._start = engine.export(self._physics, 0)
        self._floor = lowest_support(engine.view(self._physics), scene.tables.object_fixed)
        self._loose = loose_objects(scene.tables)
        self._overlaps = Overlaps(scene)
        self._usual = self._overlaps.deepest(np.asarray(self._start.qpos))
        bodies = {scene.model.body(b).name: b for b in range(scene.model.nbody)}
        self._states = states_of_manifest(model, scene.manifest, bodies)

    def rows(self, turn: int, seed: int, share: float) -> list[Pool]:
        """Those of a turn's worlds that came to rest with everything in the house and apart, as pools of one row.

        What a turn gives depends on its number, the seed, the share and the number of worlds, not on turns before it.
        """
        engine, first = self._engine, turn * self._width
        physics = engine.load(engine.current(self._physics), self._start)  # a turn may have ended with an error
        world = jnp.arange(first, first + self._width)
        key = episode_keys(seed, world, jnp.zeros_like(world))
        write = jax.device_get(perturb(self._scene.tables, self._loose, engine.view(physics), key, share))
        physics = _disturbed(engine, physics, write, self._overlaps, self._usual)
        self._physics, asleep = settle_worlds(engine, physics, SECONDS)
        inside = (np.asarray(engine.view(self._physics).object_com)[..., 2] >= self._floor).all(1)
        found = []
        for w in np.flatnonzero(asleep & inside):
            row = engine.export(self._physics, int(w))
            if (self._overlaps.deepest(np.asarray(row.qpos)) <= self._usual + RESTING_OVERLAP).all():
                found.append(Pool(physics=jax.tree.map(lambda a: np.asarray(a)[None], row), states=self._states))
        return found


def _disturbed(
    engine: NativeEngine, physics: NativePhysics, write: Write, overlaps: Overlaps, usual: Float[np.ndarray, "O"]
) -> NativePhysics:
    """Physics after a write of objects, but for those that it put into something: they stay where they were."""
    view = engine.view(physics)
    place, turn = np.array(view.object_pos), np.array(view.object_quat)
    moved = np.array(write.object_mask)
    physics = engine.write(physics, write)
    for _ in range(TAKEN_BACK):
        qpos = np.asarray(engine.snapshot(physics).qpos)
        deep = np.array([overlaps.deepest(row) > usual + OVERLAP for row in qpos]) & moved
        if not deep.any():
            break
        physics = engine.write(physics, Write(object_mask=deep, object_pos=place, object_quat=turn))
        moved &= ~deep
    return physics
