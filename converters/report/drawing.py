"""Plain drawings of geoms, seen from a direction without perspective: pictures where nothing can render."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from ..hulls.fitting import primitive_hull
from ..hulls.mesh_parts import decimate

BACKGROUND = (244, 246, 248)
MOST_TRIANGLES = 20_000
TOWARD_LIGHT = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])


def geom_triangles(model: mujoco.MjModel, data: mujoco.MjData, geom: int, most: int = MOST_TRIANGLES) -> np.ndarray:
    """A geom's surface in the world frame, [m, 3, 3]; at most about `most` triangles. Planes have none."""
    kind = int(model.geom_type[geom])
    if kind == int(mujoco.mjtGeom.mjGEOM_MESH):
        mesh = model.geom_dataid[geom]
        v0, nv = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        f0, nf = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        vertices, faces = decimate(
            model.mesh_vert[v0 : v0 + nv].astype(np.float64), model.mesh_face[f0 : f0 + nf].astype(np.int64), most
        )
        local = vertices[faces]
    else:
        hull = _primitive(kind, model.geom_size[geom])
        if hull is None:
            return np.zeros((0, 3, 3))
        local = hull.vertices[hull.faces]
    return local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def _primitive(kind: int, size: np.ndarray):
    types = mujoco.mjtGeom
    x, y, z = (float(s) for s in size)
    if kind == int(types.mjGEOM_BOX):
        return primitive_hull("box", (2 * x, 2 * y, 2 * z), np.eye(4))
    if kind == int(types.mjGEOM_SPHERE):
        return primitive_hull("sphere", (x,), np.eye(4))
    if kind == int(types.mjGEOM_CYLINDER):
        return primitive_hull("cylinder", (x, 2 * y), np.eye(4))
    if kind == int(types.mjGEOM_CAPSULE):
        return primitive_hull("capsule", (x, 2 * y), np.eye(4))
    if kind == int(types.mjGEOM_ELLIPSOID):
        return primitive_hull("sphere", (1.0,), np.diag([x, y, z, 1.0]))
    return None


def geom_colour(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """rgb in 0..1, the material's where it has one."""
    material = model.geom_matid[geom]
    return (model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom])[:3]


def draw(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: Sequence[int],
    *,
    width: int,
    height: int,
    azimuth: float = 135.0,
    elevation: float = -30.0,
) -> np.ndarray:
    """The geoms, as large as fits, far ones first. Angles as in MuJoCo's free camera, degrees. uint8 [h, w, 3]."""
    # each triangle is drawn by itself: double size, then shrunk, hides the seams
    image = Image.new("RGB", (2 * width, 2 * height), BACKGROUND)
    triangles, colours = [], []
    for geom in geoms:
        some = geom_triangles(model, data, geom, max(200, MOST_TRIANGLES // max(len(geoms), 1)))
        triangles.append(some)
        colours.append(np.tile(geom_colour(model, geom), (len(some), 1)))
    if triangles and sum(map(len, triangles)):
        _paint(
            ImageDraw.Draw(image), image.size, np.concatenate(triangles), np.concatenate(colours), azimuth, elevation
        )
    return np.asarray(image.resize((width, height), Image.Resampling.LANCZOS))


def _paint(pen, size: tuple[int, int], triangles: np.ndarray, colours: np.ndarray, azimuth: float, elevation: float):
    a, e = np.radians([azimuth, elevation])
    forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    up = np.cross(right, forward)
    flat = np.stack([triangles @ right, triangles @ up], axis=-1)
    low, high = flat.reshape(-1, 2).min(axis=0), flat.reshape(-1, 2).max(axis=0)
    scale = 0.9 * float(np.min(np.array(size) / np.maximum(high - low, 1e-9)))
    on_paper = (flat - (low + high) / 2) * [scale, -scale] + np.array(size) / 2
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    normals *= -np.sign(normals @ forward)[:, None]  # both sides of a sheet are lit from the viewer's side
    light = 0.45 + 0.55 * np.clip(normals @ TOWARD_LIGHT, 0, 1)
    shades = np.clip(colours * light[:, None] * 255, 0, 255).astype(int)
    for i in np.argsort(-(triangles @ forward).mean(axis=1), kind="stable"):
        pen.polygon([tuple(p) for p in on_paper[i]], fill=tuple(shades[i].tolist()))
