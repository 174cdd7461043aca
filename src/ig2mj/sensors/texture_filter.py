"""Textures as coarse as the pixels that show them: each is averaged over what one pixel covers of a surface.

MuJoCo's OpenGL takes the colour of a pixel from a texture that was averaged down as far as the pixel is wide there. The
ray caster takes the colour of one point, so that a fine pattern flickers from pixel to pixel. Here every texture of a
render model is averaged once, for surfaces at `DISTANCE`, and the ray caster's points are of that.

Axes: R rows, X columns, C channels, F triangles.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

DISTANCE = 0.9
"""m from the camera at which a surface's texture is as coarse as its pixels: of a table from a robot's eye."""

MESH, FLAT = int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtTexture.mjTEXTURE_2D)
RGB = int(mujoco.mjtTextureRole.mjTEXROLE_RGB)


def fit_textures(model: mujoco.MjModel, pixel: float) -> None:
    """Averages the textures of a model's meshes, in place; those that no mesh lays out stay as they are.

    Args:
      pixel: what one covers, rad.
    """
    for texture, density in texels_per_metre(model).items():
        rows, columns, channels = (int(a[texture]) for a in (model.tex_height, model.tex_width, model.tex_nchannel))
        at = int(model.tex_adr[texture])
        if at < 0:  # read from a file when it is drawn
            continue
        texels = model.tex_data[at : at + rows * columns * channels].reshape(rows, columns, channels)
        texels[:] = np.round(averaged(texels.astype(np.float32), density * pixel * DISTANCE)).astype(np.uint8)


def texels_per_metre(model: mujoco.MjModel) -> dict[int, float]:
    """How fine each texture is on the meshes that show it, by its number; the mean over their surfaces."""
    areas: dict[int, list[float]] = {}
    for geom in np.flatnonzero((model.geom_type == MESH) & (model.geom_matid >= 0)):
        mesh, material = int(model.geom_dataid[geom]), int(model.geom_matid[geom])
        texture = int(model.mat_texid[material, RGB])
        if texture < 0 or model.tex_type[texture] != FLAT or model.mesh_texcoordadr[mesh] < 0:
            continue
        total = areas.setdefault(texture, [0.0, 0.0])
        size = float(model.tex_height[texture] * model.tex_width[texture] * model.mat_texrepeat[material].prod())
        on_texture, on_surface = _areas(model, mesh)
        total[0] += size * on_texture
        total[1] += on_surface
    return {texture: float(np.sqrt(t / s)) for texture, (t, s) in areas.items() if s > 0}


def _areas(model: mujoco.MjModel, mesh: int) -> tuple[float, float]:
    """Of a mesh's triangles: as parts of the texture, and m2."""
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    corners = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[faces]]
    places = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + model.mesh_facetexcoord[faces]]
    (a, b), (u, v) = (np.moveaxis(p[:, 1:] - p[:, :1], 1, 0) for p in (corners, places))
    on_texture = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    return 0.5 * float(on_texture.sum()), 0.5 * float(np.linalg.norm(np.cross(a, b), axis=1).sum())


def averaged(texels: Float[np.ndarray, "R X C"], width: float) -> Float[np.ndarray, "R X C"]:
    """Each texel's mean over the square of that width around it, which goes on at the other side; up to 1: as it is."""
    for axis in (0, 1):
        reach = 0.5 * (min(width, texels.shape[axis]) - 1.0)
        if reach <= 0:
            continue
        whole = int(reach)
        total = (reach - whole) * (np.roll(texels, whole + 1, axis) + np.roll(texels, -whole - 1, axis))
        for k in range(-whole, whole + 1):
            total = total + np.roll(texels, k, axis)
        texels = total / (2 * reach + 1)
    return texels
