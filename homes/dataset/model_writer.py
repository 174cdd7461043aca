"""Writes one model folder of the iGibson dataset: URDF, meshes, textures, metadata.

Numbers are rounded (collision 1 micrometre, visual 10 micrometres, or 100 in a mesh wider than 0.3 m), so that the same
model gives the same bytes.
"""

from __future__ import annotations

import io
import json
import pathlib
from collections.abc import Iterable
from xml.sax.saxutils import quoteattr

import numpy as np
import trimesh

from ..objects.model import HouseholdObject, LinkBuilder, hull_mesh
from ..objects.stable_poses import stable_orientations
from ..shapes.bricks import Mesh
from ..shapes.materials import Material
from .height_maps import write_height_maps


def write_model(model: HouseholdObject, objects: pathlib.Path) -> pathlib.Path:
    """Writes `objects/<category>/<model>/` and, next to it, the halves of a sliceable. Returns the model's folder."""
    folder = objects / model.category / model.model
    for part in ("shape/visual", "shape/collision", "material", "misc"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    names = _MaterialNames()
    visuals = {link.name: _write_visuals(link, names, folder) for link in model.links}
    for link in model.links:
        _text(folder / "shape/collision" / f"{link.name}_cm.obj", collision_obj(link))
    _write_materials(names, folder)
    _text(folder / f"{model.model}.urdf", urdf(model, {name: list(files) for name, files in visuals.items()}))
    _text(folder / "misc/metadata.json", json.dumps(metadata(model), indent=1) + "\n")
    groups = {file: kind for files in visuals.values() for file, kind in files.items()}
    kinds = sorted(set(groups.values()))
    numbered = [
        {str(k + 1): [kind] for k, kind in enumerate(kinds)},
        {f: kinds.index(k) + 1 for f, k in groups.items()},
    ]
    _text(folder / "misc/material_groups.json", json.dumps(numbered) + "\n")
    if model.furniture:
        write_height_maps(model, folder / "misc")
    for part in model.parts:
        write_model(part.model, objects)
    return folder


def urdf(model: HouseholdObject, visuals: dict[str, list[str]]) -> str:
    """The model's URDF; visuals: file names of each link's visual meshes."""
    lines = ['<?xml version="1.0" ?>', f"<robot name={quoteattr(model.model)}>"]
    for link in model.links:
        lines.append(f'  <link name="{link.name}">')
        if model.mass is not None:
            lines.append(f"    {_inertial(link, model.mass)}")
        for file in visuals[link.name]:
            lines.append(_mesh_element("visual", f"shape/visual/{file}"))
        lines.append(_mesh_element("collision", f"shape/collision/{link.name}_cm.obj"))
        lines.append("  </link>")
    for joint in model.joints:
        lines.append(f'  <joint name="{joint.name}" type="{joint.kind}">')
        lines.append(f'    <origin rpy="0 0 0" xyz="{numbers(joint.origin)}"/>')
        lines.append(f'    <parent link="{joint.parent}"/><child link="{joint.child}"/>')
        if joint.kind != "fixed":
            lines.append(f'    <axis xyz="{numbers(joint.axis)}"/>')
        if joint.kind in ("revolute", "prismatic"):
            low, high = joint.limits
            lines.append(f'    <limit lower="{number(low)}" upper="{number(high)}"/>')
        if joint.kind != "fixed":
            lines.append(f'    <dynamics damping="0" friction="{number(joint.friction, 3)}"/>')
        lines.append("  </joint>")
    return "\n".join([*lines, "</robot>", ""])


def _inertial(link: LinkBuilder, mass: float) -> str:
    """The inertia of a link that weighs `mass` kg, filled evenly."""
    solid = trimesh.Trimesh()
    for points in link.hulls:
        solid += hull_mesh(points)
    solid.density = mass / solid.volume
    ((xx, xy, xz), (_, yy, yz), (_, _, zz)) = solid.moment_inertia
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    inertia = " ".join(
        f'{name}="{number(value, 9)}"' for name, value in zip(names, (xx, xy, xz, yy, yz, zz), strict=True)
    )
    centre, kilograms = numbers(solid.center_mass), number(mass)
    return f'<inertial><origin xyz="{centre}"/><mass value="{kilograms}"/><inertia {inertia}/></inertial>'


def metadata(model: HouseholdObject) -> dict:
    """misc/metadata.json (iGibson's dataset format). Lists of numbers are rounded; quaternions x, y, z, w."""
    low, high = model.bounds()
    boxes = {}
    for link in model.links:
        cloud = np.concatenate(link.hulls)
        box = _box_entry(cloud.min(0), cloud.max(0))
        boxes[link.name] = {"collision": {"axis_aligned": box, "oriented": box}, "visual": None}
        if link.visuals:
            points = np.concatenate([mesh.vertices for _, mesh in link.visuals])
            visual_box = _box_entry(points.min(0), points.max(0))
            boxes[link.name]["visual"] = {"axis_aligned": visual_box, "oriented": visual_box}
    data: dict = {
        "bbox_size": rounded(high - low),
        "base_link_offset": rounded((high + low) / 2),
        "orientations": [
            {"rotation": rounded(o.quat), "prob": round(o.prob, 4), "variation": 0.0, "size": rounded(o.size)}
            for o in stable_orientations(model)
        ],
        "links": {
            kind: {
                "geometry": "box" if area.size else None,
                "size": rounded(area.size) if area.size else None,
                "xyz": rounded(area.xyz),
                "rpy": rounded(area.rpy),
            }
            for kind, area in sorted(model.areas.items())
        },
        "link_bounding_boxes": boxes,
    }
    if model.mass is not None:
        data["keep_inertials"] = True  # of the URDF; iGibson ignores them and this
    openable = [[k, joint.name, joint.openable] for k, joint in enumerate(model.joints) if joint.openable]
    if openable:
        data["openable_joint_ids"] = openable
    if model.both_sides:
        data["openable_both_sides"] = True
    if model.parts:
        data["object_parts"] = [
            {
                "category": part.model.category,
                "model": part.model.model,
                "pos": rounded(part.position),
                "orn": [0, 0, 0, 1],
            }
            for part in model.parts
        ]
    return data


def collision_obj(link: LinkBuilder) -> str:
    """One OBJ, one `o convex_<i>` group per hull."""
    lines: list[str] = []
    first = 1
    for k, points in enumerate(link.hulls):
        mesh = hull_mesh(np.asarray(points).round(6))
        lines.append(f"o convex_{k}")
        lines += [f"v {numbers(v)}" for v in np.asarray(mesh.vertices)]
        lines += [f"f {a} {b} {c}" for a, b, c in np.asarray(mesh.faces) + first]
        first += len(mesh.vertices)
    return "\n".join([*lines, ""])


def visual_obj(meshes: Iterable[Mesh], material: Material, name: str) -> str:
    """One OBJ of one material, with texture coordinates where the material has a texture."""
    meshes = list(meshes)
    reach = max(float(np.ptp(mesh.vertices, axis=0).max()) for mesh in meshes)
    digits = 4 if reach > 0.3 else 5
    lines = ["mtllib default.mtl", f"usemtl {name}"]
    faces: list[str] = []
    places: dict[str, int] = {}
    corners: dict[str, int] = {}
    for mesh in meshes:
        spots = [places.setdefault(numbers(v, digits), len(places) + 1) for v in mesh.vertices]
        uv = None
        if material.texture is not None:
            uv = mesh.uv if mesh.uv is not None else box_mapping(mesh, material.tile)
        for k, face in enumerate(mesh.faces):
            ids = [spots[i] for i in face]
            if len(set(ids)) < 3:
                continue
            if uv is None:
                faces.append("f " + " ".join(map(str, ids)))
            else:
                texels = [corners.setdefault(numbers(t, 3), len(corners) + 1) for t in uv[k]]
                faces.append("f " + " ".join(f"{i}/{t}" for i, t in zip(ids, texels, strict=True)))
    lines += [f"v {v}" for v in places]
    lines += [f"vt {t}" for t in corners]
    return "\n".join([*lines, *faces, ""])


def box_mapping(mesh: Mesh, tile: float) -> np.ndarray:
    """[m, 3, 2] texture coordinates: each face is seen along the axis it faces most; u follows the longest edge."""
    order = np.argsort(-np.ptp(mesh.vertices, axis=0).round(6), kind="stable")
    corners = mesh.vertices[mesh.faces]
    normals = np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    facing = normals.round(12).argmax(1)
    uv = np.empty((len(mesh.faces), 3, 2))
    for axis in range(3):
        u, v = (a for a in order if a != axis)
        chosen = facing == axis
        uv[chosen] = corners[chosen][:, :, [u, v]] / tile
    return uv


class _MaterialNames:
    """Gives every distinct material of a model one file-safe name."""

    def __init__(self) -> None:
        self.known: list[tuple[str, Material]] = []

    def name(self, material: Material) -> str:
        for name, other in self.known:
            if other is material or (other.texture is None and other == material):
                return name
        taken = {name for name, _ in self.known}
        name, k = material.name, 2
        while name in taken:
            name, k = f"{material.name}_{k}", k + 1
        self.known.append((name, material))
        return name


def _write_visuals(link: LinkBuilder, names: _MaterialNames, folder: pathlib.Path) -> dict[str, str]:
    """Writes one OBJ per material of a link; returns {file name: material class}."""
    by_material: dict[str, tuple[Material, list[Mesh]]] = {}
    for material, mesh in link.visuals:
        by_material.setdefault(names.name(material), (material, []))[1].append(mesh)
    written = {}
    for k, (name, (material, meshes)) in enumerate(by_material.items()):
        file = f"{link.name}_m{k}_vm.obj"
        _text(folder / "shape/visual" / file, visual_obj(meshes, material, name))
        written[file] = material.kind
    return written


def _write_materials(names: _MaterialNames, folder: pathlib.Path) -> None:
    lines = []
    for name, material in names.known:
        lines += [f"newmtl {name}"]
        shine = number(material.shine, 3)
        colour = (1.0, 1.0, 1.0) if material.texture is not None else material.rgb
        lines += [f"Kd {numbers(colour, 4)}", f"Ks {shine} {shine} {shine}", f"d {number(material.alpha, 3)}"]
        if material.texture is not None:
            buffer = io.BytesIO()
            material.texture.save(buffer, "PNG", optimize=True)
            (folder / "material" / f"{name}.png").write_bytes(buffer.getvalue())
            lines.append(f"map_Kd ../../material/{name}.png")
    _text(folder / "shape/visual/default.mtl", "\n".join([*lines, ""]))


def _mesh_element(kind: str, file: str) -> str:
    return (
        f'    <{kind}><origin rpy="0 0 0" xyz="0 0 0"/>'
        f'<geometry><mesh filename="{file}" scale="1 1 1"/></geometry></{kind}>'
    )


def _box_entry(low: np.ndarray, high: np.ndarray) -> dict:
    matrix = np.eye(4)
    matrix[:3, 3] = (low + high) / 2
    return {"extent": rounded(high - low), "transform": [rounded(row) for row in matrix]}


def rounded(values: Iterable[float], digits: int = 6) -> list[float]:
    return [round(float(v), digits) + 0.0 for v in values]


def number(value: float, digits: int = 6) -> str:
    """Shortest decimal with at most `digits` places, without '-0'."""
    text = f"{float(value):.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def numbers(values: Iterable[float], digits: int = 6) -> str:
    return " ".join(number(v, digits) for v in values)


def _text(path: pathlib.Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
