"""Pictures for benchmarks: MuJoCo's OpenGL renderer kept open, colour and depth read in one go.

Shadows, reflections and anti-aliasing are off, as in iGibson's benchmarks.
"""

from __future__ import annotations

import importlib

import mujoco
import numpy as np

from ig2mj.viewer import offscreen


def gl_backend() -> str | None:
    """ "egl" or "osmesa", whichever draws here; None where no OpenGL does."""
    for name in ("egl", "osmesa"):
        if offscreen.probe(name) is None:
            return name
    return None


class Camera:
    """One camera of a model, `size` pixels square. Close it when done."""

    def __init__(self, model: mujoco.MjModel, camera: str, size: int, backend: str):
        self.model, self.size = model, size
        self._gl = importlib.import_module(f"mujoco.{backend}").GLContext(size, size)
        self._gl.make_current()
        keep = (model.vis.global_.offwidth, model.vis.global_.offheight, model.vis.quality.offsamples)
        model.vis.global_.offwidth = model.vis.global_.offheight = size
        model.vis.quality.offsamples = 0
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        model.vis.global_.offwidth, model.vis.global_.offheight, model.vis.quality.offsamples = keep
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=2 * model.ngeom + 100)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._scene.flags[flag] = 0
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[:3] = 1
        self._option.sitegroup[:] = 0
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = model.camera(camera).id
        self._rect = mujoco.MjrRect(0, 0, size, size)
        self.rgb = np.zeros((size, size, 3), np.uint8)
        self.depth = np.zeros((size, size), np.float32)

    def take(self, data: mujoco.MjData, depth: bool = False) -> np.ndarray:
        """Draws the state in `data`: `rgb` [size, size, 3] uint8, lowest row first; with `depth` `self.depth` too.

        Depth is OpenGL's, 0 near and 1 far.
        """
        self._gl.make_current()
        mujoco.mjv_updateScene(
            self.model, data, self._option, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL.value, self._scene
        )
        mujoco.mjr_render(self._rect, self._scene, self._context)
        mujoco.mjr_readPixels(self.rgb, self.depth if depth else None, self._rect, self._context)
        return self.rgb

    def close(self) -> None:
        """Frees the OpenGL context."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
