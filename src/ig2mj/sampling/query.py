"""`SceneQuery`: questions about one scene that need physics or collision geometry, answered by the native engine.

Where are surfaces (`level`), what does a ray meet (`rays`), how deep do objects penetrate others (`penetrations`),
where does everything come to rest (`settle`)? Samplers and calibration ask; nothing above this package touches
MuJoCo's data for them.

Axes: W worlds, N candidates or rays, O objects.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine, NativePhysics
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import PhysicsView
from ig2mj.engine.writes import teleports
from ig2mj.process import entry_point
from ig2mj.sampling.columns import ColumnMap, ColumnWindow, Level
from ig2mj.sampling.footprint import Footprint, footprint
from ig2mj.sampling.overlap import Overlaps
from ig2mj.sampling.probe import Probe, cast_rays
from ig2mj.scene.scene import Scene

SETTLE_SECONDS = 3.0
"""Simulated seconds within which what was placed must come to rest."""


@entry_point
class SceneQuery:
    """One world of a scene on the native engine, for samplers.

    Attributes:
      scene: what is sampled in. engine, physics: the world, in which everything that is not being placed may sleep.
    """

    def __init__(self, scene: Scene, engine: NativeEngine | None = None, physics: NativePhysics | None = None):
        """Makes a world at the scene's start, or takes over world 0 of an engine."""
        self.scene = scene
        self.engine = engine if engine is not None else NativeEngine(scene)
        self.physics = physics if physics is not None else self.engine.reset()
        tables = scene.tables
        self._map = ColumnMap(tables)
        self._geom_object = np.asarray(tables.geom_object)
        self._mass = _object_masses(scene)
        self._overlaps = Overlaps(scene)

    @property
    def view(self) -> PhysicsView:
        """The view of the present state; world axis of length 1."""
        return self.engine.view(self.physics)

    @property
    def _data(self) -> mujoco.MjData:
        return self.engine.to_mujoco(self.physics, 0)[1]

    def save(self) -> Snapshot:
        """The present state."""
        return self.engine.export(self.physics, 0)

    def load(self, snapshot: Snapshot) -> None:
        """Goes back to a state that `save` gave, also after a step in which the world was lost."""
        self.physics = self.engine.load(self.engine.current(self.physics), snapshot)

    def level(self, window: ColumnWindow, height: float, without: Collection[int] = ()) -> Level:
        """What a window of vertical columns looks like from a height; see `ColumnMap.level`."""
        self._update_map()
        return self._map.level(window, height, without)

    def covered(self, object_index: int, window: ColumnWindow) -> Bool[np.ndarray, "R C"]:
        """Cells of a window that an object is above or below."""
        self._update_map()
        return self._map.covered(object_index, window)

    def box(self, object_index: int) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """World box of an object's collision geometry, low and high corner, metres."""
        self._update_map()
        return self._map.box(object_index)

    def _update_map(self) -> None:
        data = self._data
        self._map.update(np.array(data.xpos), np.array(data.xmat).reshape(-1, 3, 3))

    def footprint(self, object_index: int, quat: Float[np.ndarray, "4"], shift: Float[np.ndarray, "2"]) -> Footprint:
        """An object's footprint with its main body turned to `quat` (w-x-y-z), and its joints as they are."""
        tables, data = self.scene.tables, self._data
        root = int(tables.object_root[object_index])
        pieces = np.flatnonzero(tables.piece_object == object_index)
        geoms = tables.piece_geom[pieces]
        back = np.array(data.xmat[root]).reshape(3, 3)
        pos = (np.array(data.geom_xpos[geoms]) - data.xpos[root]) @ back
        turn = back.T @ np.array(data.geom_xmat[geoms]).reshape(-1, 3, 3)
        bodies, mass = self._mass[object_index]
        centre = (mass @ np.array(data.xipos[bodies]) / mass.sum() - data.xpos[root]) @ back
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, np.asarray(quat, float))
        return footprint(tables, object_index, pos, turn, centre, rotation.reshape(3, 3), shift)

    def place(self, object_index: int, pos: Float[np.ndarray, "3"], quat: Float[np.ndarray, "4"]) -> None:
        """Puts an object's main body somewhere (world frame, w-x-y-z), at rest and awake."""
        self.write(teleports(self.scene.tables.num_objects, object_index, pos, quat))

    def write(self, write: Write) -> None:
        """Changes the world; see `ig2mj.engine.base.Write`."""
        self.physics = self.engine.write(self.physics, write)

    def penetration(self, *objects: int) -> float:
        """How deep awake objects stand in anything that is no part of any of them, metres; 0 where they do not."""
        contact = self._data.contact
        if not len(contact.dist):
            return 0.0
        own = np.isin(self._geom_object[contact.geom], objects)
        mine = own[:, 0] != own[:, 1]
        return float(max(0.0, -contact.dist[mine].min(initial=0.0)))

    def penetrations(self) -> Float[np.ndarray, "O"]:
        """How deep each object stands in anything that is no part of it, metres, whether it sleeps or not."""
        return self._overlaps.deepest(np.array(self._data.qpos))

    def carried(
        self, mask: Bool[np.ndarray, "nq"], target: Float[np.ndarray, "nq"]
    ) -> tuple[Int[np.ndarray, "K"], Float[np.ndarray, "K 3"], Float[np.ndarray, "K 4"]]:
        """What goes along when joints move; see `Overlaps.carried`."""
        return self._overlaps.carried(np.array(self._data.qpos), mask, target)

    def rays(
        self, origin: Float[np.ndarray, "3"], directions: Float[np.ndarray, "N 3"]
    ) -> tuple[Float[np.ndarray, "N"], Int[np.ndarray, "N"]]:
        """Distances (metres, inf: none) at which rays from a point meet collision geometry, and the objects hit."""
        model, data = self.engine.to_mujoco(self.physics, 0)
        return cast_rays(model, data, self._geom_object, origin, directions)

    def probe(self, half: Float[np.ndarray, "3"]) -> Probe:
        """A box with these half edges that can be put anywhere in the present state."""
        return Probe(self.scene, np.array(self._data.qpos), half)

    def clearance(self, object_index: int, other: int, farthest: float = 1.0) -> tuple[float, Float[np.ndarray, "3"]]:
        """Distance of two objects' collision geometry, metres, and the vector from the first to the second.

        Args:
          farthest: what is farther apart is not measured: this distance and a zero vector are the answer.
        """
        model, data = self.engine.to_mujoco(self.physics, 0)
        tables = self.scene.tables
        best, vector = farthest, np.zeros(3)
        between = np.zeros(6)
        for one in tables.piece_geom[tables.piece_object == object_index]:
            for two in tables.piece_geom[tables.piece_object == other]:
                distance = mujoco.mj_geomDistance(model, data, int(one), int(two), best, between)
                if distance < best:
                    best, vector = float(distance), between[3:] - between[:3]
        return best, vector

    def settle(self, seconds: float = SETTLE_SECONDS, stop: Callable[[PhysicsView], bool] = lambda view: False) -> bool:
        """Steps until everything sleeps, or for some simulated time; whether everything sleeps.

        `stop`: asked after every control step; True ends it at once, where going on is pointless.
        """

        def keep(physics: NativePhysics) -> None:
            self.physics = physics  # `stop` may ask this query, too

        _, asleep = settle_worlds(self.engine, self.physics, seconds, stop, keep)
        return bool(asleep.all())


def settle_worlds(
    engine: NativeEngine,
    physics: NativePhysics,
    seconds: float = SETTLE_SECONDS,
    stop: Callable[[PhysicsView], bool] = lambda view: False,
    keep: Callable[[NativePhysics], None] = lambda physics: None,
) -> tuple[NativePhysics, Bool[np.ndarray, "W"]]:
    """Steps all worlds of an engine until every object of each sleeps, or for some simulated time.

    Args:
      stop: asked after every control step; True ends it at once. keep: given physics after every control step, before
        `stop` is asked.

    Returns:
      Physics, and in which worlds everything sleeps.
    """
    view = engine.view(physics)
    for _ in range(round(seconds / (engine.substeps * engine.timestep))):
        physics, view = engine.step(physics)
        keep(physics)
        if not np.asarray(view.awake).any() or stop(view):
            break
    return physics, np.logical_not(np.asarray(view.awake).any(1))


def _object_masses(scene: Scene) -> list[tuple[np.ndarray, np.ndarray]]:
    """Bodies of each object, and their masses."""
    body_object, mass = scene.tables.body_object, np.asarray(scene.model.body_mass)
    found = []
    for o in range(scene.tables.num_objects):
        bodies = np.flatnonzero(body_object == o)
        found.append((bodies, np.maximum(mass[bodies], 1e-9)))
    return found
