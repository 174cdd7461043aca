"""How states look: tints of objects, and marks for dust, stains and water drops.

Tints are iGibson's (spec/robots_tasks_sensors.md 3.7): out = (1 - a) own + a colour, for the state of highest priority;
a switched-on object is half as bright again. MuJoCo multiplies a geom's colour into its texture, so a tinted geom loses
its texture and shows its material's colour, tinted.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.predicates.registry import PREDICATES
from ig2mj.scene.tables import SceneTables
from ig2mj.states import particles
from ig2mj.states.model import StateModel
from ig2mj.states.water import DROP_RADIUS
from ig2mj.states.world import ExtendedStates


@dataclasses.dataclass(frozen=True)
class Tint:
    """A colour, 0..1, and its share; or a brightness."""

    state: str
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    share: float = 0.0
    brightness: float = 1.0


TINTS = (
    Tint("frozen", (1.0, 1.0, 1.0), 0.8),
    Tint("burnt", (0.0, 0.0, 0.0), 0.8),
    Tint("cooked", (139 / 255, 69 / 255, 19 / 255), 0.5),
    Tint("soaked", (0.0, 0.0, 200 / 255), 0.5),
    Tint("toggled_on", brightness=1.5),
)
"""By priority, the highest first (iGibson's procedural materials)."""

DUST_RGBA = (0.48, 0.44, 0.4, 1.0)
STAIN_RGBA = (0.32, 0.2, 0.1, 1.0)
WATER_RGBA = (0.35, 0.55, 1.0, 0.7)


@dataclasses.dataclass(frozen=True)
class Mark:
    """A small shape that is drawn and collides with nothing: MuJoCo geom type, half sizes (metres), world pose."""

    kind: mujoco.mjtGeom
    size: tuple[float, float, float]
    pos: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    rgba: tuple[float, float, float, float]

    def draw(self, scene: mujoco.MjvScene) -> bool:
        """Adds the mark to a scene; False where the scene is full."""
        if scene.ngeom >= scene.maxgeom:
            return False
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(
            geom, self.kind, np.array(self.size), self.pos, self.axes.ravel(), np.array(self.rgba, np.float32)
        )
        scene.ngeom += 1
        return True


def tint_of_objects(model: StateModel, states: ExtendedStates, world: int = 0) -> Int[np.ndarray, "O"]:
    """Index into `TINTS` of the state that colours each object, or -1."""
    found = np.full(model.tables.num_objects, -1)
    for index in reversed(range(len(TINTS))):
        predicate = PREDICATES[TINTS[index].state]
        assert predicate.per_object is not None and predicate.ability is not None
        true = np.asarray(predicate.per_object(model, states))[world] & model.parameters.has(predicate.ability)
        found[true] = index
    return found


def marks(model: StateModel, states: ExtendedStates, view: PhysicsView, world: int = 0) -> list[Mark]:
    """Dust, stains and drops of one world."""
    found: list[Mark] = []
    p = model.parameters
    sizes = particles.stain_sizes(model.tables.object_bbox[p.stain_rows])
    for rows, is_dust in ((states.dust, True), (states.stain, False)):
        alive = np.asarray(rows.alive)[world]
        if not alive.any():
            continue
        pos = np.asarray(particles.world_positions(rows, view))[world]
        normal = np.asarray(particles.world_normals(rows, view))[world]
        for row, n in np.argwhere(alive):
            at, axes = pos[row, n].astype(float), _frame(normal[row, n])
            if is_dust:
                found.append(Mark(mujoco.mjtGeom.mjGEOM_SPHERE, _ball(particles.DUST_RADIUS), at, axes, DUST_RGBA))
            else:
                half, thick = float(sizes[row, n]) / 2, particles.STAIN_THICKNESS / 2
                found.append(Mark(mujoco.mjtGeom.mjGEOM_BOX, (half, half, thick), at, axes, STAIN_RGBA))
    drops = np.asarray(states.water.pos)[world][np.asarray(states.water.active)[world]]
    found += [
        Mark(mujoco.mjtGeom.mjGEOM_SPHERE, _ball(DROP_RADIUS), d.astype(float), np.eye(3), WATER_RGBA) for d in drops
    ]
    return found


def _ball(radius: float) -> tuple[float, float, float]:
    return radius, radius, radius


def _frame(normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix whose third column is the normal."""
    z = normal / max(float(np.linalg.norm(normal)), 1e-9)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


class Tinter:
    """Colours the visual geoms of a model by state, and gives them their own colours back."""

    def __init__(self, model: mujoco.MjModel, tables: SceneTables):
        """Remembers the model's own colours."""
        self._model, self._owner = model, np.asarray(tables.geom_object)
        self._rgba, self._material = model.geom_rgba.copy(), model.geom_matid.copy()
        textured = self._material >= 0
        own = self._rgba.copy()
        own[textured] = model.mat_rgba[self._material[textured]]
        self._own = own

    def apply(self, tint: Int[np.ndarray, "O"]) -> None:
        """Shows `tint_of_objects`."""
        of_geom = np.where(self._owner >= 0, tint[np.maximum(self._owner, 0)], -1)
        rgba, material = self._rgba.copy(), self._material.copy()
        for index, look in enumerate(TINTS):
            geoms = of_geom == index
            mixed = (1 - look.share) * self._own[geoms, :3] + look.share * np.array(look.colour)
            rgba[geoms, :3] = np.clip(mixed * look.brightness, 0.0, 1.0)
            rgba[geoms, 3] = self._own[geoms, 3]
            material[geoms] = -1
        self._model.geom_rgba[:], self._model.geom_matid[:] = rgba, material

    def restore(self) -> None:
        """Gives the geoms their own colours back."""
        self._model.geom_rgba[:], self._model.geom_matid[:] = self._rgba, self._material

    @contextlib.contextmanager
    def shown(self, tint: Int[np.ndarray, "O"]) -> Iterator[None]:
        """Tinted inside the `with`, plain afterwards."""
        self.apply(tint)
        try:
            yield
        finally:
            self.restore()


def draw_marks(scene: mujoco.MjvScene, found: Sequence[Mark]) -> None:
    """Adds marks to a scene until it is full."""
    for mark in found:
        if not mark.draw(scene):
            return
