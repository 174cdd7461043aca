"""Images of a model without a display: EGL, else OSMesa, else Warp's ray caster.

    image = render(model, data, "kitchen_camera", width=640, height=480)
    image = render(model, data, FreeView.around(model, azimuth=120))

A backend is used only after it has rendered an image in a process of its own (`probe`), because a
broken OpenGL driver may abort the process that tries it. OpenGL images take about 10 ms; the ray caster needs no
OpenGL at all and takes seconds. One process can use only one of EGL and OSMesa: the first that was used stays.
"""

from __future__ import annotations

import atexit
import collections
import dataclasses
import functools
import os
import sys
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from ig2mj.engine.base import whole_number
from ig2mj.errors import MissingDependencyError, UnknownNameError
from ig2mj.process.opengl import GL_BACKENDS, PROBE_XML, fault_of_probe, images_of, probe_gl, run_probe
from ig2mj.process.settings import GL_INSTALL_HINT, use_gl, used_gl
from ig2mj.scene.geom_groups import VISIBLE_GROUPS

BACKENDS = (*GL_BACKENDS, "warp")
"""In the order in which they are tried."""

_WARP_PROBE = "from ig2mj.viewer import offscreen; offscreen.draw_warp_probe()"


@dataclasses.dataclass(frozen=True)
class FreeView:
    """A camera that stands anywhere.

    Attributes:
      lookat: the point in the middle of the image, world frame, metres.
      distance: from the camera to that point, metres.
      azimuth: direction of view about +z, degrees; 0 looks along +x, 90 along +y.
      elevation: of the direction of view above the horizon, degrees; -90 looks straight down.
      height: None for a perspective image; metres of world from the lower to the upper edge for an orthographic one.
      fovy: vertical field of view of a perspective image, degrees; None: the model's.
    """

    lookat: Sequence[float | int]
    distance: float | int
    azimuth: float | int = 90.0
    elevation: float | int = -45.0
    height: float | int | None = None
    fovy: float | int | None = None

    @classmethod
    def around(cls, model: mujoco.MjModel, azimuth: float = 90.0, elevation: float = -45.0) -> FreeView:
        """Sees the whole model, by its `statistic` centre and extent."""
        x, y, z = (float(c) for c in model.stat.center)
        return cls((x, y, z), 1.5 * float(model.stat.extent), azimuth, elevation)


def render(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    camera: int | str | FreeView | None = None,
    *,
    width: int = 640,
    height: int = 480,
    groups: Sequence[int] = VISIBLE_GROUPS,
    segmentation: bool = False,
    backend: str | None = None,
    decorate: Callable[[mujoco.MjvScene], None] | None = None,
) -> np.ndarray:
    """Draws one image of the state in `data` (positions must be up to date: mj_forward or mj_kinematics was called).

    Args:
      camera: name or number of a camera of the model, a FreeView, or None for the model's default free view.
      width, height: pixels.
      groups: geom groups that are drawn. Sites follow group 0.
      segmentation: return which geom is seen at each pixel, not its colour.
      backend: one of BACKENDS; None takes `default_backend()`.
      decorate: adds geoms to the scene before it is drawn; Warp's ray caster leaves them out.

    Returns:
      uint8 [height, width, 3], row 0 on top; with `segmentation` int32 [height, width] of geom ids, -1 for none.

    Raises:
      UnknownNameError: no camera has that name. MissingDependencyError: nothing here can draw. EngineError: an image of
      this size cannot be drawn.
    """
    width, height = whole_number("width", width), whole_number("height", height)
    view = _resolve_camera(model, camera)
    name = backend or default_backend()
    if name == "warp":
        from ig2mj.viewer import warp_snapshot

        return warp_snapshot.render(
            model, data, view, width=width, height=height, groups=groups, segmentation=segmentation
        )
    return _render_gl(model, data, view, width, height, groups, segmentation, name, decorate)


def default_backend() -> str:
    """The backend that `render` uses: the one that MUJOCO_GL names where it works, else the first that does."""
    order = list(BACKENDS)
    wished = os.environ.get("MUJOCO_GL", "").strip().lower()
    if (used := used_gl()) is not None:
        return used
    if wished in order:
        order.sort(key=lambda b: b != wished)
    for name in order:
        if probe(name) is None:
            return name
    raise MissingDependencyError(f"no renderer works here; for OpenGL without a display: {GL_INSTALL_HINT}")


@functools.cache
def probe(backend: str, timeout_s: float = 120.0) -> str | None:
    """None if `backend` draws a small image in a fresh process; else the reason. Remembered for this process."""
    if backend not in BACKENDS:
        raise UnknownNameError("rendering backend", backend, BACKENDS)
    return probe_gl(backend, timeout_s) if backend in GL_BACKENDS else run_probe(_WARP_PROBE, backend, timeout_s)


def draw_warp_probe() -> None:
    """What the process of `probe("warp")` does; exits with 0 only if the box is in the image."""
    model = mujoco.MjModel.from_xml_string(PROBE_XML)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    image = render(model, data, FreeView((0, 0, 0), 3.0), width=32, height=32, backend="warp")
    if (fault := fault_of_probe(image[16, 16].tolist())) is not None:
        sys.exit(fault)


def _resolve_camera(model: mujoco.MjModel, camera: int | str | FreeView | None) -> int | FreeView:
    if camera is None:
        free = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, free)
        x, y, z = (float(c) for c in free.lookat)
        return FreeView((x, y, z), free.distance, free.azimuth, free.elevation)
    if isinstance(camera, FreeView):
        return camera
    if isinstance(camera, str):
        number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, camera)
        if number < 0:
            raise UnknownNameError("camera", camera, [model.camera(i).name for i in range(model.ncam)])
        return number
    if not 0 <= camera < model.ncam:
        raise UnknownNameError("camera", str(camera), [str(i) for i in range(model.ncam)])
    return camera


# ---------------------------------------------------------------------------------------------------- OpenGL

_renderers: collections.OrderedDict[tuple[int, int, int, bool], mujoco.Renderer] = collections.OrderedDict()
_MAX_RENDERERS = 3  # each holds its model's meshes and textures on the GL side


def _render_gl(model, data, view, width, height, groups, segmentation, backend, decorate) -> np.ndarray:
    use_gl(backend)
    renderer = _renderer_for(model, width, height, segmentation)
    option = mujoco.MjvOption()
    option.geomgroup[:] = [g in groups for g in range(len(option.geomgroup))]
    option.sitegroup[:] = 0
    option.sitegroup[0] = 0 in groups
    keep = (model.vis.global_.fovy, model.vis.global_.orthographic)
    try:
        if isinstance(view, FreeView):
            camera = mujoco.MjvCamera()
            camera.lookat[:] = view.lookat
            camera.distance, camera.azimuth, camera.elevation = view.distance, view.azimuth, view.elevation
            if view.height is not None:
                camera.orthographic = 1
                model.vis.global_.orthographic = 1
                model.vis.global_.fovy = view.height
            elif view.fovy is not None:
                model.vis.global_.fovy = view.fovy
        else:
            camera = view
        if segmentation:
            renderer.enable_segmentation_rendering()
        renderer.update_scene(data, camera, option)
        if decorate is not None:
            decorate(renderer.scene)
        image = renderer.render()
    finally:
        model.vis.global_.fovy, model.vis.global_.orthographic = keep
        renderer.disable_segmentation_rendering()
    if segmentation:
        return np.where(image[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM), image[..., 0], -1).astype(np.int32)
    return image.copy()


def _renderer_for(model: mujoco.MjModel, width: int, height: int, segmentation: bool) -> mujoco.Renderer:
    """A renderer of a model and size; for segmentation without multisampling, which blends numbers of geoms where they
    meet into numbers of others, or of none: MuJoCo ends with an IndexError then."""
    key = (id(model), width, height, segmentation)
    known = _renderers.get(key)
    if known is not None and known.model is model:
        _renderers.move_to_end(key)
        return known
    while len(_renderers) >= _MAX_RENDERERS:
        _free(_renderers.popitem(last=False)[1])
    size, quality = model.vis.global_, model.vis.quality
    keep, samples = (size.offwidth, size.offheight), quality.offsamples
    quality.offsamples = 0 if segmentation else samples
    size.offwidth, size.offheight = max(width, keep[0]), max(height, keep[1])
    try:
        with images_of(width, height):
            renderer = mujoco.Renderer(model, height, width, max_geom=2 * model.ngeom + model.nsite + 1000)
    finally:
        size.offwidth, size.offheight = keep
        quality.offsamples = samples
    _renderers[key] = renderer
    _close_at_exit()
    return renderer


@functools.cache
def _close_at_exit() -> None:
    """Once, after the first context: EGL's own exit hook exists then, and hooks run last in, first out."""
    atexit.register(close)


def close() -> None:
    """Frees all OpenGL contexts; the next image makes new ones."""
    while _renderers:
        _free(_renderers.popitem()[1])


def _free(renderer: mujoco.Renderer) -> None:
    """Closes a renderer in its own context: in another's, OpenGL would free that one's buffers of the same numbers."""
    context = getattr(renderer, "_gl_context", None)
    if context is not None:
        context.make_current()
    renderer.close()
