"""How states look: tints of objects, and marks for dust, stains and water drops.

MuJoCo multiplies a geom's colour into its texture, so a tinted geom of a home without looks shows its mean colour,
tinted (`ig2mj.sensors.tints`). In a decorated home it shows its texture, tinted (`ig2mj.looks.state_looks`).
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.looks.state_looks import OF_MATERIAL, lamp_geoms, tinted_materials
from ig2mj.sensors.render_model import mean_colours
from ig2mj.sensors.tints import (
    DUST_COLOUR,
    STAIN_COLOUR,
    STATES,
    SWITCHED_ON,
    UNTINTED,
    WATER_ALPHA,
    WATER_COLOUR,
    tinted,
    tints,
    tints_of_geoms,
)
from ig2mj.states import particles
from ig2mj.states.definitions.water import DROP_RADIUS
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates


@dataclasses.dataclass(frozen=True)
class Mark:
    """A small shape that is drawn and collides with nothing: MuJoCo geom type, half sizes (metres), world pose."""

    kind: mujoco.mjtGeom
    size: tuple[float, ...]
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
    """Which of `ig2mj.sensors.tints.TINTS` each object of a world has, or `UNTINTED`."""
    return np.asarray(tints(model, states))[world]


def marks(model: StateModel, states: ExtendedStates, view: PhysicsView, world: int = 0) -> list[Mark]:
    """Dust, stains and drops of one world."""
    found: list[Mark] = []
    p = model.parameters
    patches = particles.stain_sizes(model.tables.object_bbox[p.stain_rows]) / 2
    for rows, kind, sizes, rgb in (
        (states.dust, mujoco.mjtGeom.mjGEOM_SPHERE, None, DUST_COLOUR),
        (states.stain, mujoco.mjtGeom.mjGEOM_BOX, patches, STAIN_COLOUR),
    ):
        alive = np.asarray(rows.alive)[world]
        if not alive.any():
            continue
        pos = np.asarray(particles.world_positions(rows, view))[world]
        normal = np.asarray(particles.world_normals(rows, view))[world]
        for row, n in np.argwhere(alive):
            if sizes is None:
                size = (particles.DUST_RADIUS,) * 3
            else:
                size = (float(sizes[row, n]), float(sizes[row, n]), particles.STAIN_THICKNESS / 2)
            found.append(Mark(kind, size, pos[row, n].astype(float), _frame(normal[row, n]), (*rgb, 1.0)))
    for drop in np.asarray(states.water.pos)[world][np.asarray(states.water.active)[world]]:
        at, rgba = drop.astype(float), (*WATER_COLOUR, WATER_ALPHA)
        found.append(Mark(mujoco.mjtGeom.mjGEOM_SPHERE, (DROP_RADIUS,) * 3, at, np.eye(3), rgba))
    return found


def _frame(normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix whose third column is the normal."""
    z = normal / max(float(np.linalg.norm(normal)), 1e-9)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


class Tinter:
    """Colours the visual geoms of a model by state, and gives them their own colours back."""

    def __init__(self, model: mujoco.MjModel, owner: Int[np.ndarray, "G"]):
        """Remembers the model's own colours. owner: object of each geom (`SceneTables.geom_object`)."""
        self._model, self._owner = model, np.asarray(owner)
        self._rgba, self._material = model.geom_rgba.copy(), model.geom_matid.copy()
        self._mean = np.full((model.ngeom, 4), np.nan, np.float32)  # taken when first asked for: textures are large
        self._in_tint = tinted_materials(model, STATES)
        self._lamps = lamp_geoms(model)

    def apply(self, tint: Int[np.ndarray, "O"]) -> None:
        """Shows `tint_of_objects`."""
        self.restore()
        of_geoms = np.asarray(tints_of_geoms(tint[None], self._owner))[0]
        geoms = np.flatnonzero(of_geoms != UNTINTED)
        unknown = geoms[np.isnan(self._mean[geoms, 0])]
        self._mean[unknown] = mean_colours(self._model, unknown)
        rgba = self._mean[geoms]
        rgba[:, :3] = np.asarray(tinted(rgba[:, :3], of_geoms[None, geoms]))[0]
        self._model.geom_rgba[geoms], self._model.geom_matid[geoms] = rgba, -1
        material = self._in_tint[of_geoms[geoms], geoms]
        textured = material >= 0
        self._model.geom_matid[geoms[textured]] = material[textured]
        self._model.geom_rgba[geoms[textured]] = OF_MATERIAL
        for light, geom in self._lamps:
            self._model.light_active[light] = of_geoms[geom] == SWITCHED_ON

    def restore(self) -> None:
        """Gives the geoms their own colours back."""
        self._model.geom_rgba[:], self._model.geom_matid[:] = self._rgba, self._material
        for light, _ in self._lamps:
            self._model.light_active[light] = False

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
