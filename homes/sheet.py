"""A contact sheet: pictures of models side by side, to see what was built. Uses MuJoCo's C renderer.

Models are drawn straight from the builder (no converter), each in a tile of its own, from the front right above; with
`opened` every joint stands at its limit; with `collision` the collision hulls are shown instead of the visuals.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from .dataset.model_writer import box_mapping
from .objects.model import HouseholdObject, hull_mesh

TILE = 200  # pixels
PALETTE = ((0.9, 0.4, 0.3), (0.3, 0.6, 0.9), (0.4, 0.8, 0.4), (0.9, 0.8, 0.3), (0.7, 0.5, 0.9), (0.4, 0.8, 0.8))


def contact_sheet(
    models: Iterable[HouseholdObject],
    columns: int = 6,
    *,
    opened: bool = False,
    collision: bool = False,
    turn: float = 35.0,
) -> Image.Image:
    """One RGB image with a labelled tile per model. turn: azimuth of the viewer from the front, degrees."""
    tiles = [_tile(model, opened, collision, turn) for model in models]
    rows = math.ceil(len(tiles) / columns)
    sheet = Image.new("RGB", (columns * TILE, rows * TILE), (255, 255, 255))
    for k, tile in enumerate(tiles):
        sheet.paste(tile, (k % columns * TILE, k // columns * TILE))
    return sheet


def _tile(model: HouseholdObject, opened: bool, collision: bool, turn: float) -> Image.Image:
    low, high = model.bounds()
    reach = float(np.linalg.norm(high - low))
    spec = mujoco.MjSpec()
    spec.visual.headlight.ambient = [0.45, 0.45, 0.45]
    spec.visual.headlight.diffuse = [0.6, 0.6, 0.6]
    spec.visual.global_.offwidth = spec.visual.global_.offheight = TILE
    spec.visual.map.znear, spec.visual.map.zfar = 0.01, 50
    spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
                     rgb1=[0.93, 0.93, 0.95], rgb2=[0.93, 0.93, 0.95], width=8, height=8)  # fmt: skip
    scale = 1.0 / reach  # every model is drawn one metre big, so that the camera and lights fit all
    bodies = {}
    parents = {joint.child: joint for joint in model.joints}
    for link in model.links:
        joint = parents.get(link.name)
        parent = bodies[joint.parent] if joint else spec.worldbody
        body = parent.add_body(name=link.name, pos=(joint.origin if joint else np.zeros(3)) * scale)
        bodies[link.name] = body
        if joint and joint.kind != "fixed":
            kind = mujoco.mjtJoint.mjJNT_SLIDE if joint.kind == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=joint.name, type=kind, axis=list(joint.axis))
        _draw(spec, body, link, scale, collision)
    model_c = spec.compile()
    data = mujoco.MjData(model_c)
    for joint in model.joints:
        if opened and joint.kind in ("revolute", "prismatic"):
            q = joint.limits[1] * (scale if joint.kind == "prismatic" else 1.0)
            data.qpos[model_c.jnt_qposadr[model_c.joint(joint.name).id]] = q
    mujoco.mj_forward(model_c, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = (low + high) / 2 * scale
    camera.distance = 1.6 if opened else 1.35
    camera.azimuth, camera.elevation = 180 + turn, -25
    with mujoco.Renderer(model_c, TILE, TILE) as renderer:
        renderer.update_scene(data, camera)
        image = Image.fromarray(renderer.render())
    text = f"{model.model} {reach * 100:.0f}cm" if reach < 1 else f"{model.model} {reach:.1f}m"
    ImageDraw.Draw(image).text((4, TILE - 13), text, fill=(20, 20, 20))
    return image


def _draw(spec: mujoco.MjSpec, body, link, scale: float, collision: bool) -> None:
    if collision:
        for k, points in enumerate(link.hulls):
            mesh = hull_mesh(points)
            name = f"{link.name}_h{k}"
            _mesh_geom(spec, body, name, np.asarray(mesh.vertices) * scale, np.asarray(mesh.faces), None, None)
            body.geoms[-1].rgba = [*PALETTE[k % len(PALETTE)], 1]
        return
    for k, (material, mesh) in enumerate(link.visuals):
        name = f"{link.name}_{k}"
        look = spec.add_material(name=name, rgba=[*material.rgb, material.alpha], specular=material.shine * 0.5)
        uv = None
        if material.texture is not None:
            picture = np.asarray(material.texture.convert("RGB"))
            texture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, nchannel=3,
                                       width=picture.shape[1], height=picture.shape[0])  # fmt: skip
            texture.data = np.ascontiguousarray(picture).tobytes()
            look.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
            look.rgba = [1, 1, 1, material.alpha]
            uv = mesh.uv if mesh.uv is not None else box_mapping(mesh, material.tile)
        _mesh_geom(spec, body, name, mesh.vertices * scale, mesh.faces, uv, name)


def _mesh_geom(spec, body, name, vertices, faces, uv, material) -> None:
    asset = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    asset.uservert = vertices.ravel().tolist()
    asset.userface = faces.ravel().tolist()
    if uv is not None:
        asset.userfacetexcoord = list(range(3 * len(faces)))
        flat = uv.reshape(-1, 2) * [1, -1] + [0, 1]
        asset.usertexcoord = flat.ravel().tolist()
    geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0)
    if material:
        geom.material = material
