"""Colours and textures of an MJCF robot's geoms, from its compiled model."""

from __future__ import annotations

import io

import mujoco
import numpy as np
from PIL import Image

from ..base.description import PackedImage
from ..bodies.mjcf_robot import MjcfRobot

GREY = (0.5, 0.5, 0.5, 1.0)
"""Colour that MuJoCo gives a geom which has none."""


def colour_of(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """RGBA of a geom: its own, else its material's."""
    material = int(model.geom_matid[geom])
    own = np.array(model.geom_rgba[geom])
    return np.array(model.mat_rgba[material]) if material >= 0 and np.allclose(own, GREY) else own


def image_of(robot: MjcfRobot, geom: int) -> PackedImage | None:
    """The image on a mesh; None: it has none. One that its coordinates do not place is left out with a warning."""
    model, material = robot.model, int(robot.model.geom_matid[geom])
    texture = -1 if material < 0 else int(model.mat_texid[material, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
    if texture < 0:
        return None
    name, mesh = model.texture(texture).name or f"texture_{texture}", int(model.geom_dataid[geom])
    flat = mujoco.mjtTexture(int(model.tex_type[texture])) == mujoco.mjtTexture.mjTEXTURE_2D
    if not flat or mesh < 0 or model.mesh_texcoordadr[mesh] < 0:
        line = f"texture '{name}' is left out: it is not laid on a mesh by coordinates"
        if line not in robot.warnings:
            robot.warnings.append(line)
        return None
    width, height = int(model.tex_width[texture]), int(model.tex_height[texture])
    channels, first = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    pixels = np.array(model.tex_data[first : first + width * height * channels]).reshape(height, width, channels)
    buffer = io.BytesIO()
    Image.fromarray(pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, 2)).save(buffer, format="PNG")
    return PackedImage(name, buffer.getvalue())


def textured_mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices [n, 3] (m), faces [m, 3] and texture coordinates [n, 2] (of OBJ: v upwards) of a mesh that has some."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    begin, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    start, length = int(model.mesh_texcoordadr[mesh]), int(model.mesh_texcoordnum[mesh])
    corners = np.stack(
        [model.mesh_face[begin : begin + number].ravel(), model.mesh_facetexcoord[begin : begin + number].ravel()], 1
    )
    pairs, faces = np.unique(corners, axis=0, return_inverse=True)
    vertices = np.array(model.mesh_vert[first : first + count], float)[pairs[:, 0]]
    coordinates = np.array(model.mesh_texcoord[start : start + length], float)[pairs[:, 1]]
    coordinates[:, 1] = 1 - coordinates[:, 1]
    return vertices, faces.reshape(-1, 3), coordinates
