"""An OpenGL context of a model for small images in quick succession: colour, depth and geom ids of one camera."""

from __future__ import annotations

import atexit
import weakref
from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Int

from ig2mj.process.opengl import images_of, use_opengl
from ig2mj.sensors.images import NOTHING
from ig2mj.sensors.render_model import BACKGROUND, NEAR, SPARE_DIRECTIONS, SPARE_LIGHT
from ig2mj.sensors.slots import Slots
from ig2mj.worlds.draw import SPARE_LIGHTS

FAR = 100.0
"""m: far plane of the view's frustum."""

_FLAGS_OFF = (
    mujoco.mjtRndFlag.mjRND_REFLECTION,
    mujoco.mjtRndFlag.mjRND_SKYBOX,
    mujoco.mjtRndFlag.mjRND_FOG,
    mujoco.mjtRndFlag.mjRND_HAZE,
)


class Canvas:
    """See the module's text. `update` takes a state, `draw` draws it."""

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int,
        height: int,
        groups: np.ndarray,
        slots: Sequence[mujoco.mjtGeom],
        draw_of_light: Int[np.ndarray, "L"],
        shadows: bool = False,
    ):
        """Starts OpenGL.

        Args:
          model: to draw; its `vis` is changed. groups: [6] which geom groups are drawn. slots: types of shapes.
          draw_of_light: `ig2mj.sensors.render_model.drawn_lights` of the model.

        Raises:
          MissingDependencyError: no OpenGL without a display works here.
          EngineError: images of this size cannot be made.
        """
        use_opengl()
        from mujoco.rendering.classic import gl_context

        self._model, self._size, self._kinds = model, (height, width), tuple(slots)
        self._draw_of_light = draw_of_light
        size = model.vis.global_
        size.offwidth, size.offheight = max(width, size.offwidth), max(height, size.offheight)
        model.vis.quality.offsamples = 0  # a pixel sees one geom, at its centre
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + model.nsite + len(slots) + 100)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        self._scene.flags[list(map(int, _FLAGS_OFF))] = 0
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = groups
        for others in (self._option.sitegroup, self._option.jointgroup, self._option.tendongroup):
            others[:] = 0
        self._gl = gl_context.GLContext(width, height)
        self._gl.make_current()
        with images_of(width, height):
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        _close_at_exit(self)

    def update(
        self,
        data: mujoco.MjData,
        camera: int,
        slots: Slots,
        world: int,
        lights: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Takes geoms, lights and a camera from `data`, and shapes from the slots of a world.

        `lights`: colours and turns of the world's lights (`ig2mj.worlds.draw.Draw`); None: as the model has them.
        """
        self._camera.fixedcamid = camera
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, data, self._option, None, self._camera, everything, self._scene)
        if lights is not None:
            self._vary(*lights)
        slope = np.tan(np.deg2rad(float(self._model.cam_fovy[camera])) / 2)
        for eye in self._scene.camera:
            eye.frustum_near, eye.frustum_far = NEAR, FAR
            eye.frustum_top, eye.frustum_bottom = NEAR * slope, -NEAR * slope
            eye.frustum_center = eye.frustum_width = 0  # as wide as height and aspect tell
        for slot in np.flatnonzero(slots.kind[world] >= 0):
            self._add(slots, world, int(slot))

    def _vary(self, colour: np.ndarray, quat: np.ndarray) -> None:
        """Colours and turns the scene's lights, and adds the spare ones that are on."""
        scene = self._scene
        for light in scene.lights[: scene.nlight]:
            at = 0 if light.headlight else int(self._draw_of_light[light.id])
            if not light.headlight:
                light.dir = _turned(quat[at], light.dir)
            for name in ("ambient", "diffuse", "specular"):
                setattr(light, name, getattr(light, name) * colour[at])
        for k, direction in enumerate(SPARE_DIRECTIONS):
            at = len(colour) - SPARE_LIGHTS + k
            if not colour[at].any():
                continue
            scene.nlight += 1
            light = scene.lights[scene.nlight - 1]
            light.headlight, light.castshadow, light.type = 0, 0, int(mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
            light.dir, light.pos = _turned(quat[at], np.array(direction)), np.zeros(3)
            light.ambient, light.specular = np.zeros(3), 0.1 * colour[at]
            light.diffuse, light.attenuation = np.array(SPARE_LIGHT) * colour[at], np.array([1.0, 0.0, 0.0])

    def _add(self, slots: Slots, world: int, slot: int) -> None:
        scene = self._scene
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(
            geom,
            self._kinds[slot],
            slots.size[world, slot].astype(np.float64),
            slots.pos[world, slot].astype(np.float64),
            slots.rotation[world, slot].astype(np.float64).ravel(),
            np.array([*slots.colour[world, slot], 1.0], np.float32),
        )
        geom.segid, geom.objid, geom.objtype = scene.ngeom, self._model.ngeom + slot, mujoco.mjtObj.mjOBJ_GEOM
        scene.ngeom += 1

    def draw(
        self, rgb: bool, depth: bool, segmentation: bool
    ) -> tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]:
        """Colour [Y, X, 3], depth [Y, X] (m along the axis, 0 where nothing is) and geom ids [Y, X]; else None."""
        assert self._gl is not None, "closed"
        self._gl.make_current()
        far = np.empty(self._size, np.float32) if depth or rgb else None  # rgb: tells where the background is
        colour = np.empty((*self._size, 3), np.uint8) if rgb else None
        geom = None
        if segmentation or not rgb:
            ids = np.empty((*self._size, 3), np.uint8)
            self._render(ids, None if rgb else far, identify=True)
            geom = self._geoms(ids) if segmentation else None
        if colour is not None and far is not None:
            self._render(colour, far, identify=False)
            colour[far == 0] = np.round(np.array(BACKGROUND[:3]) * 255).astype(np.uint8)
        if far is not None:
            far = np.where(far > 0, FAR * NEAR / (far * (FAR - NEAR) + NEAR), 0.0).astype(np.float32)
        return _upright(colour), _upright(far) if depth else None, _upright(geom)

    def _render(self, colour: np.ndarray, depth: np.ndarray | None, identify: bool) -> None:
        for flag in (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR):
            self._scene.flags[flag] = identify
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(colour, depth, self._rect, self._context)

    def _geoms(self, ids: np.ndarray) -> np.ndarray:
        """Geom ids of an image of segmentation colours, 1 + the place in the scene in three bytes."""
        place = ids.astype(np.int32) @ np.array([1, 1 << 8, 1 << 16], np.int32)
        of_places = np.full(self._scene.ngeom + 1, NOTHING, np.int32)
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.segid >= 0 and geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                of_places[geom.segid + 1] = geom.objid
        return of_places[place]

    def close(self) -> None:
        """Frees the context."""
        if self._gl is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None


def _turned(quat: np.ndarray, direction: np.ndarray) -> np.ndarray:
    found = np.zeros(3)
    mujoco.mju_rotVecQuat(found, np.asarray(direction, np.float64), quat.astype(np.float64))
    return found


def _upright(image: np.ndarray | None) -> np.ndarray | None:
    """OpenGL's rows begin at the bottom."""
    return None if image is None else image[::-1]


def _close_at_exit(canvas: Canvas) -> None:
    """After the first context was made, so that it runs before EGL's own exit hook."""
    mine = weakref.ref(canvas)

    def close() -> None:
        if (alive := mine()) is not None:
            alive.close()

    atexit.register(close)
