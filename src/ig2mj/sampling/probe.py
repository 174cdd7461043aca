"""`Probe`: a settled scene with a movable box, for contact and visibility queries at arbitrary positions.

The box is compiled in after everything else, so that ids of bodies and geoms are the scene's. Nothing sleeps, and
nothing is ever stepped.

Axes: N places or rays.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.scene.geom_groups import COLLISION_GROUP
from ig2mj.scene.scene import Scene


class Probe:
    """A box, and the scene as it was in one state."""

    def __init__(self, scene: Scene, qpos: Float[np.ndarray, "nq"], half: Float[np.ndarray, "3"]):
        """Compiles the scene with the box.

        Args:
          qpos: of the scene without the box. half: half edges of the box, metres; it keeps the world's axes.
        """
        spec = scene.spec()
        for key in list(spec.keys):
            spec.delete(key)  # they would be too short for the box's joint
        body = spec.worldbody.add_body(name="probe")  # moved by a joint: what is welded to the world never hits walls
        body.add_freejoint()
        body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0, 1.0, 1.0]
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=np.asarray(half, float).tolist())
        self._model = spec.compile()
        self._model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        self._body = int(self._model.body("probe").id)
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:-7] = qpos
        mujoco.mj_forward(self._model, self._data)
        self._owner = np.append(scene.tables.body_object, -1)[self._model.geom_bodyid]
        self._contype, self._conaffinity = self._model.geom_contype.copy(), self._model.geom_conaffinity.copy()

    def touches(self, place: Float[np.ndarray, "3"], ignored: Bool[np.ndarray, "O"] | None = None) -> bool:
        """Whether the box, its middle at `place`, touches anything but the `ignored` objects."""
        model, data = self._model, self._data
        stays = np.ones(model.ngeom, bool)
        if ignored is not None:
            stays = ~np.append(ignored, False)[self._owner]
        model.geom_contype[:], model.geom_conaffinity[:] = self._contype * stays, self._conaffinity * stays
        data.qpos[-7:-4] = place
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        return bool((model.geom_bodyid[data.contact.geom] == self._body).any())

    def rays(
        self, origin: Float[np.ndarray, "3"], directions: Float[np.ndarray, "N 3"]
    ) -> tuple[Float[np.ndarray, "N"], Int[np.ndarray, "N"]]:
        """See `cast_rays`; the box is not seen."""
        return cast_rays(self._model, self._data, self._owner, origin, directions, self._body)


def cast_rays(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom_object: Int[np.ndarray, "G"],
    origin: Float[np.ndarray, "3"],
    directions: Float[np.ndarray, "N 3"],
    without_body: int = -1,
) -> tuple[Float[np.ndarray, "N"], Int[np.ndarray, "N"]]:
    """Rays from one point against collision geometry.

    Args:
      origin: world frame, metres. directions: of any length but 0. without_body: whose geoms the rays pass through.

    Returns:
      Distances in metres, inf where a ray hits nothing; and the object hit, -1 for none (a hit part of an agent, too).
    """
    unit = np.ascontiguousarray(directions / np.linalg.norm(directions, axis=1, keepdims=True), float)
    geom, distance = np.zeros(len(unit), np.int32), np.zeros(len(unit))
    groups = np.zeros(6, np.uint8)
    groups[COLLISION_GROUP] = 1
    place = np.asarray(origin, float)
    mujoco.mj_multiRay(
        model, data, place, unit.ravel(), groups, 1, without_body, geom, distance, None, len(unit), mujoco.mjMAXVAL
    )
    hit = (geom >= 0) & (distance >= 0)
    return np.where(hit, distance, np.inf), np.where(hit, np.asarray(geom_object)[np.maximum(geom, 0)], -1)
