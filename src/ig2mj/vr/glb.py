"""`scene_glb`: the visual geometry of a compiled scene as one GLB file, for pages that draw with WebGL.

One node for each body, named `body_<number>`, which the page poses; below it one for each visual geom, with the numbers
of its object and of itself in `extras`. Geoms of the same mesh and material share buffers. z is up, metres.

Meshes keep their textures where they have texture coordinates. Everything else has the mean colour of its texture.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.looks.visual import DECOR, visual_of
from ig2mj.scene.geom_groups import VISIBLE_GROUPS
from ig2mj.scene.scene import Scene
from ig2mj.sensors.render_model import mean_colours

SEGMENTS = 20
"""Of round shapes, around."""

_FLOAT, _ARRAY_BUFFER = 5126, 34962
_GEOM = mujoco.mjtGeom


class _Glb:
    """A glTF document in the making."""

    def __init__(self) -> None:
        self.binary = io.BytesIO()
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "ig2mj"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            **{name: [] for name in ("nodes", "meshes", "materials", "accessors", "bufferViews")},
            **{name: [] for name in ("textures", "images", "samplers")},
        }

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        self.json[kind].append(entry)
        return len(self.json[kind]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        start = self.binary.tell()
        self.binary.write(data + b"\0" * (-len(data) % 4))
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data), **more})

    def accessor(self, array: np.ndarray) -> int:
        array = np.ascontiguousarray(array, np.float32)
        entry = {
            "bufferView": self.view(array.tobytes(), target=_ARRAY_BUFFER),
            "componentType": _FLOAT,
            "count": len(array),
            "type": f"VEC{array.shape[1]}",
            "min": array.min(0).tolist(),
            "max": array.max(0).tolist(),
        }
        return self.add("accessors", entry)

    def bytes(self) -> bytes:
        body = self.binary.getvalue()
        document = {name: value for name, value in self.json.items() if value != []}
        document["buffers"] = [{"byteLength": len(body)}]
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        parts = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
        return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def decorated_glb(scene: Scene) -> bytes:
    """`scene_glb` of a scene as its looks show it, but for arms of costumes, which follow no single body."""
    visual = visual_of(scene)
    return scene_glb(visual.model, visual.owner, scene.model.nbody, visual.followers.riders)


def scene_glb(
    model: mujoco.MjModel, owner: np.ndarray, bodies: int | None = None, riders: Mapping[int, int] | None = None
) -> bytes:
    """The file.

    Args:
      owner: [ngeom] object of each geom, -1 for those of none (`SceneTables.geom_object`).
      bodies: that the page knows; None: all. riders: geoms of other bodies that are fixed to one of those; of the rest,
        decoration stands still, and costumes are left out.
    """
    known = model.nbody if bodies is None else bodies
    of_geoms = {geom: int(body) for geom, body in enumerate(model.geom_bodyid)}
    of_geoms |= {geom: 0 for geom, body in of_geoms.items() if body >= known and model.body(body).name == DECOR}
    of_geoms |= riders or {}
    glb = _Glb()
    shapes: dict[tuple, dict[str, int]] = {}
    materials: dict[tuple, int] = {}
    meshes: dict[tuple, int] = {}
    nodes = [glb.add("nodes", {"name": f"body_{b}"}) for b in range(known)]
    glb.json["scenes"][0]["nodes"] = nodes
    visible = np.flatnonzero(np.isin(model.geom_group, VISIBLE_GROUPS) & (model.geom_rgba[:, 3] > 0))
    visible = np.array([geom for geom in visible.tolist() if of_geoms[geom] < known], int)
    colours = mean_colours(model, visible)
    for geom, colour in zip(visible.tolist(), colours, strict=True):
        kind = int(model.geom_type[geom])
        data = int(model.geom_dataid[geom]) if kind == _GEOM.mjGEOM_MESH else -1
        size = tuple(np.round(model.geom_size[geom], 6).tolist()) if data < 0 else ()
        shape = (kind, data, size)
        if shape not in shapes:
            attributes = _attributes(model, kind, data, model.geom_size[geom])
            if attributes is None:
                continue
            shapes[shape] = {name: glb.accessor(array) for name, array in attributes.items()}
        texture = _texture_of(model, geom) if "TEXCOORD_0" in shapes[shape] else -1
        look = (int(model.geom_matid[geom]) if texture >= 0 else -1, texture, tuple(np.round(colour, 4).tolist()))
        if look not in materials:
            materials[look] = _material(glb, model, geom, texture, colour)
        if (shape, look) not in meshes:
            primitive = {"attributes": shapes[shape], "material": materials[look]}
            meshes[shape, look] = glb.add("meshes", {"primitives": [primitive]})
        w, x, y, z = (float(v) for v in model.geom_quat[geom])
        node = glb.add(
            "nodes",
            {
                "mesh": meshes[shape, look],
                "translation": model.geom_pos[geom].tolist(),
                "rotation": [x, y, z, w],
                "extras": {"object": int(owner[geom]), "geom": geom},
            },
        )
        glb.json["nodes"][of_geoms[geom]].setdefault("children", []).append(node)
    return glb.bytes()


def _texture_of(model: mujoco.MjModel, geom: int) -> int:
    """Number of the flat texture that a geom's material shows, or -1."""
    material = int(model.geom_matid[geom])
    texture = int(model.mat_texid[material, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)]) if material >= 0 else -1
    flat = texture >= 0 and model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
    return texture if flat and model.tex_nchannel[texture] in (3, 4) else -1


def _material(glb: _Glb, model: mujoco.MjModel, geom: int, texture: int, colour: np.ndarray) -> int:
    """A material of glTF, whose colours are linear; MuJoCo's are as they are shown."""
    number = int(model.geom_matid[geom])
    shine = float(model.mat_shininess[number]) if number >= 0 else 0.3
    rgba = np.array(model.mat_rgba[number] if texture >= 0 else colour, np.float64)
    rgba[:3] = np.clip(rgba[:3], 0, 1) ** 2.2
    look: dict[str, Any] = {
        "baseColorFactor": rgba.tolist(),
        "metallicFactor": 0.0,
        "roughnessFactor": round(1.0 - 0.6 * shine, 3),
    }
    if texture >= 0:
        look["baseColorTexture"] = {"index": _texture(glb, model, texture)}
    entry: dict[str, Any] = {"pbrMetallicRoughness": look, "doubleSided": True}
    if rgba[3] < 1:
        entry["alphaMode"] = "BLEND"
    return glb.add("materials", entry)


def _texture(glb: _Glb, model: mujoco.MjModel, texture: int) -> int:
    """The texture as PNG; once for each."""
    from PIL import Image

    for number, entry in enumerate(glb.json["textures"]):
        if entry["extras"]["texture"] == texture:
            return number
    height, width = int(model.tex_height[texture]), int(model.tex_width[texture])
    channels, start = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    pixels = model.tex_data[start : start + height * width * channels].reshape(height, width, channels)
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(file, "PNG")
    image = glb.add("images", {"mimeType": "image/png", "bufferView": glb.view(file.getvalue())})
    if not glb.json["samplers"]:
        glb.add("samplers", {"wrapS": 10497, "wrapT": 10497, "magFilter": 9729, "minFilter": 9987})
    return glb.add("textures", {"source": image, "sampler": 0, "extras": {"texture": texture}})


def _attributes(model: mujoco.MjModel, kind: int, data: int, size: np.ndarray) -> dict[str, np.ndarray] | None:
    """Corners of all triangles: POSITION, NORMAL and, where there are such, TEXCOORD_0; None for what is not drawn."""
    if kind == _GEOM.mjGEOM_MESH:
        return _mesh(model, data)
    if kind in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_ELLIPSOID):
        radii = np.full(3, size[0]) if kind == _GEOM.mjGEOM_SPHERE else size
        return _around(_arc(-1.0, 1.0, 0.0, 1.0), radii)
    if kind == _GEOM.mjGEOM_CAPSULE:
        radius, half = float(size[0]), float(size[1])
        return _around(_arc(-1.0, 1.0, half / radius, 1.0), np.full(3, radius))
    if kind == _GEOM.mjGEOM_CYLINDER:
        radius, half = float(size[0]), float(size[1])
        rings = np.array([[0, -1, 0, -1], [1, -1, 0, -1], [1, -1, 1, 0], [1, 1, 1, 0], [1, 1, 0, 1], [0, 1, 0, 1.0]])
        return _around(rings, np.array([radius, radius, half]))
    if kind in (_GEOM.mjGEOM_BOX, _GEOM.mjGEOM_PLANE):
        if kind == _GEOM.mjGEOM_PLANE:
            size = np.array([size[0] or 50.0, size[1] or 50.0, 0.0005])
        return _box(size)
    return None


def _mesh(model: mujoco.MjModel, mesh: int) -> dict[str, np.ndarray]:
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    corners = model.mesh_face[faces].ravel() + model.mesh_vertadr[mesh]
    normals = model.mesh_facenormal[faces].ravel() + model.mesh_normaladr[mesh]
    found = {"POSITION": model.mesh_vert[corners], "NORMAL": model.mesh_normal[normals]}
    if model.mesh_texcoordnum[mesh] > 0:
        at = model.mesh_facetexcoord[faces].ravel() + model.mesh_texcoordadr[mesh]
        found["TEXCOORD_0"] = model.mesh_texcoord[at]
    return found


def _arc(low: float, high: float, half: float, radius: float) -> Float[np.ndarray, "n 4"]:
    """Rings of a ball that is pulled apart by `half` up and down: radius, height, and both of the normal."""
    angles = np.linspace(low, high, SEGMENTS + 1) * np.pi / 2
    angles = np.sort(np.append(np.round(angles, 9), 0.0))
    shift = np.sign(angles) * half
    shift[np.flatnonzero(angles == 0.0)] = [-half, half] if (angles == 0.0).sum() == 2 else half
    return np.stack([np.cos(angles) * radius, np.sin(angles) * radius + shift, np.cos(angles), np.sin(angles)], axis=1)


def _around(rings: Float[np.ndarray, "n 4"], scale: Float[np.ndarray, "3"]) -> dict[str, np.ndarray]:
    """A surface of revolution about z, scaled."""
    turns = np.linspace(0, 2 * np.pi, SEGMENTS + 1)
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)

    def grid(radius: np.ndarray, height: np.ndarray) -> np.ndarray:
        flat = radius[:, None, None] * circle[None]
        return np.concatenate([flat, np.broadcast_to(height[:, None, None], (*flat.shape[:2], 1))], axis=2)

    points = grid(rings[:, 0], rings[:, 1]) * scale
    normals = grid(rings[:, 2], rings[:, 3]) / scale
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-9)
    corners = ((0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0))
    rows, columns = len(rings) - 1, SEGMENTS

    def triangles(values: np.ndarray) -> np.ndarray:
        return np.stack([values[i : i + rows, j : j + columns] for i, j in corners], axis=2).reshape(-1, 3)

    return {"POSITION": triangles(points), "NORMAL": triangles(normals)}


def _box(half: Float[np.ndarray, "3"]) -> dict[str, np.ndarray]:
    points, normals = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            normal = sign * np.eye(3)[axis]
            u = u * sign  # counter-clockwise, seen from outside
            square = [normal - u - v, normal + u - v, normal + u + v, normal - u + v]
            points += [square[k] for k in (0, 1, 2, 0, 2, 3)]
            normals += [normal] * 6
    return {"POSITION": np.array(points) * half, "NORMAL": np.array(normals)}
