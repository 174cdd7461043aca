"""Visual geoms of a MuJoCo model as GLB (glTF in one file), with their materials and textures.

Axes: V vertices, N corners of faces.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.geometry.poses import quat_to_matrix
from ig2mj.looks.light import Bulb, Light, shade

PLANE_SIZE = 20.0
"""Metres: what is drawn of a plane without end."""

_UNSET = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's default rgba: with it a geom has the colour of its material."""


_LIT = "_LIT"
"""Attribute of vertices: what falls on them."""


@dataclasses.dataclass(frozen=True)
class Look:
    """How an object's colour differs from its own: (1 - weight) x own + weight x `colour`, times `brightness`.

    Attributes: weight: 0..1. colour: rgb, 0..1.
    """

    weight: float = 0.0
    colour: tuple[float, float, float] = (0.0, 0.0, 0.0)
    brightness: float = 1.0


PLAIN = Look()


def glb_of_geoms(
    model: mujoco.MjModel,
    geoms: Iterable[int],
    look: Look = PLAIN,
    frames: dict[int, tuple[np.ndarray, np.ndarray]] | None = None,
    light: Light | None = None,
    turn: Float[np.ndarray, "3 3"] | None = None,
    place: Float[np.ndarray, "3"] | None = None,
    bulbs: Sequence[Bulb] = (),
) -> bytes:
    """Geoms as one GLB, those of the same material as one mesh.

    Args:
      frames: position [3] and quaternion [4] (w-x-y-z) of each geom; None: in the frame of its body.
      light: is computed here, for each corner, so that the page shows the same shade as other renderers; None: the
        page computes it. turn, place: from the frame of the vertices to the world, for `light`; None: they are the
        same. bulbs: further light from lamps that are on.
    """
    import trimesh
    from trimesh.visual.texture import TextureVisuals

    groups: dict[tuple[Any, ...], list[Any]] = {}
    for g in geoms:
        pos, quat = frames[g] if frames is not None else (model.geom_pos[g], model.geom_quat[g])
        vertices, normals, uv, faces = corners(model, g)
        rotation = np.asarray(quat_to_matrix(np.asarray(quat, float)))
        vertices, normals = vertices @ rotation.T + pos, normals @ rotation.T
        groups.setdefault(_appearance(model, g, uv is not None), []).append((vertices, normals, uv, faces))
    scene = trimesh.Scene()
    for k, (appearance, parts) in enumerate(groups.items()):
        starts = np.cumsum([0, *(len(p[0]) for p in parts[:-1])])
        uv = np.concatenate([p[2] for p in parts]) if parts[0][2] is not None else None
        mesh = trimesh.Trimesh(
            np.concatenate([p[0] for p in parts]),
            np.concatenate([p[3] + start for p, start in zip(parts, starts, strict=True)]),
            vertex_normals=np.concatenate([p[1] for p in parts]),
            process=False,
            validate=False,
        )
        material = _material(model, appearance, look)
        mesh.visual = TextureVisuals(uv=uv, material=material)
        if light is not None:
            turned, origin = np.eye(3) if turn is None else turn, 0.0 if place is None else place
            vertices, normals = (np.concatenate([p[k] for p in parts]) @ turned.T for k in (0, 1))
            lit = shade(normals, light, appearance[3], vertices + origin, bulbs)
            mesh.vertex_attributes[_LIT] = linear(lit).astype(np.float32)
        scene.add_geometry(mesh, geom_name=f"m{k}")
    written = scene.export(file_type="glb", include_normals=True, tree_postprocessor=_show_light if light else None)
    assert isinstance(written, bytes)
    return written


def _show_light(tree: dict[str, Any]) -> None:
    """Lets a page show light that is computed already, and compute none."""
    for primitive in (p for mesh in tree["meshes"] for p in mesh["primitives"]):
        primitive["attributes"]["COLOR_0"] = primitive["attributes"].pop(_LIT)
    for material in tree["materials"]:
        material["extensions"] = {"KHR_materials_unlit": {}}
    tree["extensionsUsed"] = ["KHR_materials_unlit"]


def corners(
    model: mujoco.MjModel, geom: int
) -> tuple[Float[np.ndarray, "V 3"], Float[np.ndarray, "V 3"], Float[np.ndarray, "V 2"] | None, Int[np.ndarray, "F 3"]]:
    """Vertices, their normals and texture coordinates, and triangles of a geom, in its own frame."""
    kind = int(model.geom_type[geom])
    if kind != int(mujoco.mjtGeom.mjGEOM_MESH):
        return _primitive(kind, model.geom_size[geom])
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    rows = slice(first, first + count)
    of_vertices = model.mesh_face[rows].reshape(-1)
    of_normals = model.mesh_facenormal[rows].reshape(-1)
    textured = int(model.mesh_texcoordnum[mesh]) > 0
    of_uv = model.mesh_facetexcoord[rows].reshape(-1) if textured else np.zeros_like(of_vertices)
    unique, place = np.unique(np.stack([of_vertices, of_normals, of_uv], 1), axis=0, return_inverse=True)
    vertices = model.mesh_vert[int(model.mesh_vertadr[mesh]) + unique[:, 0]].astype(np.float32)
    normals = model.mesh_normal[int(model.mesh_normaladr[mesh]) + unique[:, 1]].astype(np.float32)
    uv = model.mesh_texcoord[int(model.mesh_texcoordadr[mesh]) + unique[:, 2]] if textured else None
    if uv is not None and model.geom_matid[geom] >= 0:
        uv = uv * model.mat_texrepeat[model.geom_matid[geom]]
    return vertices, normals, None if uv is None else uv.astype(np.float32), place.reshape(-1, 3)


def _primitive(kind: int, size: np.ndarray) -> tuple[np.ndarray, np.ndarray, None, np.ndarray]:
    from trimesh import creation

    types = mujoco.mjtGeom
    if kind == types.mjGEOM_PLANE:
        half = [s if s > 0 else PLANE_SIZE / 2 for s in size[:2]]
        corner = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float) * [*half, 0]
        return corner, np.tile([0.0, 0.0, 1.0], (4, 1)), None, np.array([[0, 1, 2], [0, 2, 3]])
    if kind == types.mjGEOM_BOX:
        mesh = creation.box(extents=2 * size)
        faces = mesh.faces.reshape(-1)  # sharp edges: every triangle has corners of its own
        return mesh.vertices[faces], np.repeat(mesh.face_normals, 3, 0), None, np.arange(len(faces)).reshape(-1, 3)
    if kind in (types.mjGEOM_SPHERE, types.mjGEOM_ELLIPSOID):
        radii = np.full(3, size[0]) if kind == types.mjGEOM_SPHERE else size
        ball = creation.icosphere(subdivisions=2)
        normals = ball.vertices / radii
        return ball.vertices * radii, normals / np.linalg.norm(normals, axis=1, keepdims=True), None, ball.faces
    if kind == types.mjGEOM_CAPSULE:
        mesh = creation.capsule(height=2 * size[1], radius=size[0], count=[16, 12])
        mesh.apply_translation(-mesh.bounds.mean(0))
        return mesh.vertices, mesh.vertex_normals, None, mesh.faces
    if kind == types.mjGEOM_CYLINDER:
        mesh = creation.cylinder(radius=size[0], height=2 * size[1], sections=24)
        faces = mesh.faces.reshape(-1)
        points, flat = mesh.vertices[faces], np.repeat(mesh.face_normals, 3, 0)
        round_ = np.abs(flat[:, 2]) < 0.5
        flat[round_, :2] = points[round_, :2] / size[0]
        return points, flat, None, np.arange(len(faces)).reshape(-1, 3)
    mesh = creation.icosphere(subdivisions=1, radius=0.02)  # fields of heights and the like: none in our homes
    return mesh.vertices, mesh.vertex_normals, None, mesh.faces


def _appearance(model: mujoco.MjModel, geom: int, textured: bool) -> tuple[Any, ...]:
    """What decides how a geom looks: texture (-1: none), rgba, shininess, emission, whether it has coordinates."""
    material = int(model.geom_matid[geom])
    rgba = tuple(float(c) for c in model.geom_rgba[geom])
    if material < 0:
        return -1, rgba, 0.3, 0.0, textured
    if rgba == _UNSET:
        rgba = tuple(float(c) for c in model.mat_rgba[material])
    texture = int(model.mat_texid[material, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
    flat = texture >= 0 and int(model.tex_type[texture]) == int(mujoco.mjtTexture.mjTEXTURE_2D)
    shine, glow = float(model.mat_shininess[material]), float(model.mat_emission[material])
    return texture if flat and textured else -1, rgba, shine, glow, textured


def _material(model: mujoco.MjModel, appearance: tuple[Any, ...], look: Look) -> Any:
    from trimesh.visual.material import PBRMaterial

    texture, rgba, shine, glow, _ = appearance
    image, factor = None, np.array(rgba)
    if texture >= 0:
        image = _image(model, texture, look)
        factor[:3] = np.clip(factor[:3] if look == PLAIN else np.ones(3), 0, 1)
    else:
        factor[:3] = looked(factor[None, :3], look)[0]
    return PBRMaterial(
        baseColorFactor=linear(factor),
        baseColorTexture=image,
        metallicFactor=0.0,
        roughnessFactor=float(np.clip(1.0 - 0.7 * shine, 0.25, 1.0)),
        emissiveFactor=[float(c) for c in np.clip(linear(factor)[:3] * glow, 0, 1)] if glow > 0 else None,
        alphaMode="BLEND" if rgba[3] < 1 else "OPAQUE",
        doubleSided=rgba[3] < 1,
    )


def linear(rgba: np.ndarray) -> np.ndarray:
    """Colours of glTF are linear, MuJoCo's are as a screen shows them (sRGB); alpha stays."""
    out = np.array(rgba, float)
    low = out[..., :3] <= 0.04045
    out[..., :3] = np.where(low, out[..., :3] / 12.92, ((out[..., :3] + 0.055) / 1.055) ** 2.4)
    return out


def looked(rgb: Float[np.ndarray, "N 3"], look: Look) -> Float[np.ndarray, "N 3"]:
    """Colours (0..1) as a look changes them."""
    mixed = (1 - look.weight) * rgb + look.weight * np.asarray(look.colour)
    return np.clip(mixed * look.brightness, 0, 1)


def _image(model: mujoco.MjModel, texture: int, look: Look) -> Any:
    from PIL import Image

    width, height = int(model.tex_width[texture]), int(model.tex_height[texture])
    channels, start = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    pixels = model.tex_data[start : start + width * height * channels].reshape(height, width, channels)
    pixels = np.flipud(pixels)  # MuJoCo's first row is the lowest
    if look != PLAIN:
        rgb = looked(pixels[..., :3].reshape(-1, 3) / 255, look).reshape(height, width, 3)
        pixels = np.concatenate([np.round(rgb * 255).astype(np.uint8), pixels[..., 3:]], 2)
    return Image.fromarray(np.ascontiguousarray(pixels[..., 0] if channels == 1 else pixels))


def visual_geoms(model: mujoco.MjModel, groups: Sequence[int] = (0, 1, 2)) -> Int[np.ndarray, "G"]:
    """Ids of the geoms of these groups that can be seen."""
    return np.flatnonzero(np.isin(model.geom_group, groups) & (model.geom_rgba[:, 3] > 0))
