"""An image without OpenGL: the present state, rebuilt as a model of static geoms, seen by Warp's ray caster.

The ray caster sees only cameras that are compiled into a model, hence the rebuilding. Textures are replaced by their
mean colour. The first image on a machine compiles the kernels (about 10 s); later ones take about 0.5 s on a CPU.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.process import quiet_warp
from ig2mj.sensors.render_model import BACKGROUND, mean_colours

if TYPE_CHECKING:
    from ig2mj.viewer.offscreen import FreeView


def render(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    camera: int | FreeView,
    *,
    width: int,
    height: int,
    groups: Sequence[int],
    segmentation: bool = False,
) -> np.ndarray:
    """As `offscreen.render`, with the camera already resolved to a number or a FreeView."""
    with quiet_warp():
        return _cast(model, data, camera, width, height, groups, segmentation)


def _cast(model, data, camera, width: int, height: int, groups: Sequence[int], segmentation: bool) -> np.ndarray:
    import warp as wp
    from mujoco.mjx.third_party import mujoco_warp as mjw

    geoms = np.flatnonzero(np.isin(model.geom_group, groups))
    colours = mean_colours(model, geoms)
    shown = colours[:, 3] > 0
    geoms = geoms[shown]
    static = _snapshot(model, data, geoms, colours[shown], camera)
    state = mujoco.MjData(static)
    mujoco.mj_forward(static, state)
    context = mjw.create_render_context(
        static,
        nworld=1,
        cam_res=(width, height),
        render_rgb=not segmentation,
        render_depth=False,
        render_seg=segmentation,
        enabled_geom_groups=[0],
        background_color=BACKGROUND,
        samples_per_pixel=1 if segmentation else 2,
    )
    on_device, moving = mjw.put_model(static), mjw.put_data(static, state)
    mjw.refit_bvh(on_device, moving, context)
    mjw.render(on_device, moving, context)
    if segmentation:
        found: Any = wp.empty((1, height, width), dtype=cast(Any, wp.vec2i))
        mjw.get_segmentation(context, 0, found)
        number, kind = found.numpy()[0, ..., 0], found.numpy()[0, ..., 1]
        of = np.array([*geoms, -1], np.int32)
        return of[np.where(kind == int(mujoco.mjtObj.mjOBJ_GEOM), number, -1)]
    seen: Any = wp.empty((1, height, width), dtype=cast(Any, wp.vec3))
    mjw.get_rgb(context, 0, seen)
    return np.clip(seen.numpy()[0] * 255 + 0.5, 0, 255).astype(np.uint8)


def _snapshot(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: Int[np.ndarray, "G"],
    colours: Float[np.ndarray, "G 4"],
    camera: int | FreeView,
) -> mujoco.MjModel:
    """A model of these geoms where they are now, in this order, with one camera and the headlight."""
    spec = mujoco.MjSpec()
    spec.visual.headlight.ambient = np.full(3, 0.4)
    spec.visual.headlight.diffuse = np.full(3, 0.6)
    spec.visual.headlight.specular = np.zeros(3)
    spec.stat.extent, spec.stat.center = model.stat.extent, model.stat.center
    meshes: dict[int, str] = {}
    for g, rgba in zip(geoms, colours, strict=True):
        geom = spec.worldbody.add_geom()
        geom.type = mujoco.mjtGeom(int(model.geom_type[g]))
        geom.pos, geom.quat = data.geom_xpos[g], _quaternion(data.geom_xmat[g])
        geom.rgba, geom.contype, geom.conaffinity, geom.group = rgba, 0, 0, 0
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            number = int(model.geom_dataid[g])
            if number not in meshes:
                meshes[number] = _add_mesh(spec, model, number)
            geom.meshname = meshes[number]
        else:
            geom.size = model.geom_size[g]
    eye = spec.worldbody.add_camera()
    if isinstance(camera, int):
        eye.pos, eye.quat = data.cam_xpos[camera], _quaternion(data.cam_xmat[camera])
        eye.fovy = float(model.cam_fovy[camera])
    else:
        _place(eye, camera)
    return spec.compile()


def _place(eye, view: FreeView) -> None:
    """The camera of a free view: it looks along its -z, y is up in the image."""
    azimuth, elevation = np.radians([view.azimuth, view.elevation])
    ahead = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    frame = np.stack([right, np.cross(right, ahead), -ahead], axis=1)
    eye.pos, eye.quat = np.array(view.lookat) - view.distance * ahead, _quaternion(frame.ravel())
    if view.height is None:
        eye.fovy = 45.0  # as of MuJoCo's free camera
    else:
        eye.proj = mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC
        eye.fovy = view.height


def _quaternion(matrix: np.ndarray) -> np.ndarray:
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(matrix, np.float64).ravel())
    return quat


def _add_mesh(spec: mujoco.MjSpec, model: mujoco.MjModel, number: int) -> str:
    v, nv = int(model.mesh_vertadr[number]), int(model.mesh_vertnum[number])
    f, nf = int(model.mesh_faceadr[number]), int(model.mesh_facenum[number])
    mesh = spec.add_mesh()
    mesh.name = f"mesh_{number}"
    mesh.uservert = model.mesh_vert[v : v + nv].ravel()
    mesh.userface = model.mesh_face[f : f + nf].ravel()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # sheets enclose no volume
    return mesh.name
