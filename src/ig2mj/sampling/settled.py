"""Settled initial states in numbers: a scene is disturbed at random and stepped until it rests, many times over.

Native engine only: it puts to sleep what rests, and what sleeps costs nothing in a batch.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine, NativePhysics
from ig2mj.engine.snapshot import Snapshot
from ig2mj.errors import EngineError
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
"""Metres deeper than at the start that a disturbed object may stand in something: as it is let go, and at rest. What
stands deeper and is asleep flies off as soon as something wakes it."""

TAKEN_BACK = 3
"""Times that disturbed objects are looked through; each time those that overlap go back to where they were."""

Progress = Callable[[int], None]


def make_pool(
    scene: Scene,
    model: StateModel,
    count: int,
    *,
    seed: int = 0,
    share: float = 0.3,
    threads: int | None = None,
    progress: Progress = lambda done: None,
) -> Pool:
    """A pool of `count` rows.

    Args:
      scene, model: the household and its states' constants.
      count: P.
      seed: the same seed gives the same pool, whatever the number of threads.
      share: probability that an object is disturbed, per object and row.
      threads: of the native engine; None: one per processor.
      progress: called with the number of rows done so far.

    Raises:
      EngineError: too few rows come to rest with everything still in the house and nothing stuck in something.
    """
    width = min(count, 16)
    engine = NativeEngine(scene, width, threads=threads)
    physics = engine.reset()
    physics, _ = settle_worlds(engine, physics, SECONDS)
    view = engine.view(physics)
    start = engine.export(physics, 0)
    floor = lowest_support(view, scene.tables.object_fixed)
    loose = loose_objects(scene.tables)
    overlaps = Overlaps(scene)
    usual = overlaps.deepest(np.asarray(start.qpos))
    bodies = {scene.model.body(b).name: b for b in range(scene.model.nbody)}
    states = states_of_manifest(model, scene.manifest, bodies)
    rows: list[Snapshot] = []
    tried = 0
    while len(rows) < count:
        if tried >= TRIES * count + width:
            raise EngineError(
                f"of {tried} disturbed states of '{scene.name}' only {len(rows)} came to rest with everything in the "
                f"house and apart (convert the scene with its checks and fix what does not settle)"
            )
        physics = engine.load(physics, start)
        world = jnp.arange(tried, tried + width)
        key = episode_keys(seed, world, jnp.zeros_like(world))
        write = jax.device_get(perturb(scene.tables, loose, engine.view(physics), key, share))
        physics = _disturbed(engine, physics, write, overlaps, usual)
        physics, asleep = settle_worlds(engine, physics, SECONDS)
        view = engine.view(physics)
        inside = (np.asarray(view.object_com)[..., 2] >= floor).all(1)
        for w in np.flatnonzero(asleep & inside):
            row = engine.export(physics, int(w))
            apart = (overlaps.deepest(np.asarray(row.qpos)) <= usual + RESTING_OVERLAP).all()
            if apart and len(rows) < count:
                rows.append(row)
        tried += width
        progress(len(rows))
    one = [Pool(physics=jax.tree.map(lambda a: np.asarray(a)[None], row), states=states) for row in rows]
    return stack(one)


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
