"""A chest of drawers as PartNet-Mobility has them: five links, 97 mesh files, hardly one of them a closed surface."""

from __future__ import annotations

import pathlib

import numpy as np
import trimesh
from ig2mj_converters.base.description import Mesh
from tiny_geometry import write_obj


def board(size: tuple[float, float, float], at: tuple[float, float, float], how: int) -> trimesh.Trimesh:
    """A board as modelling programs leave it: closed, with doubled faces, or without a side."""
    mesh = trimesh.creation.box(size).subdivide()
    if how % 3 == 1:
        faces = np.concatenate([mesh.faces, mesh.faces[:, ::-1]])
        mesh = trimesh.Trimesh(mesh.vertices, faces, process=False)
    elif how % 3 == 2:
        mesh.update_faces(mesh.face_normals[:, 0] < 0.5)
    return mesh.apply_translation(at)


def handle(at: tuple[float, float, float]) -> trimesh.Trimesh:
    """A bow of 10 cm, open at both ends."""
    ring = trimesh.creation.torus(0.05, 0.006, major_sections=20, minor_sections=8)
    return ring.slice_plane([0, 0, 0], [0, -1, 0]).apply_translation(at)


def write_chest(folder: pathlib.Path) -> pathlib.Path:
    """The chest's URDF; a body and four drawers, 97 collision meshes in all."""
    body = [board((0.02, 0.5, 1.0), (side * 0.4, 0, 0.5), 0) for side in (-1, 1)]
    body += [board((0.8, 0.5, 0.02), (0, 0, 0.25 * i + 0.01), i) for i in range(5)]
    body += [board((0.8, 0.01, 1.0), (0, 0.25, 0.5), 1)]
    body += [board((0.03, 0.03, 0.02), (0.35 * x, 0.2 * y, -0.01), i) for i, (x, y) in enumerate(
        [(-1, -1), (-1, 1), (1, -1), (1, 1), (0, 0)])]  # fmt: skip
    links = {"body": body}
    for drawer in range(4):
        z = 0.25 * drawer + 0.03
        parts = [board((0.75, 0.45, 0.01), (0, 0, z), drawer)]
        parts += [board((0.01, 0.45, 0.18), (side * 0.37, 0, z + 0.09), drawer + 1) for side in (-1, 1)]
        parts += [board((0.75, 0.02, 0.2), (0, side * 0.23, z + 0.1), drawer + 2) for side in (-1, 1)]
        parts += [board((0.7, 0.004, 0.01), (0, -0.245, z + 0.02 * k), k) for k in range(10)]  # a carved front
        parts += [trimesh.creation.icosphere(1, 0.012).apply_translation((0.05 * k, -0.26, z + 0.1)) for k in (-6, 6)]
        parts += [handle((side * 0.2, -0.25, z + 0.1)) for side in (-1, 1)]
        parts += [board((0.02, 0.4, 0.01), (side * 0.36, 0, z - 0.01), side) for side in (-1, 1)]
        links[f"drawer_{drawer}"] = parts
    text = ""
    for link, parts in links.items():
        text += f'<link name="{link}">'
        for number, part in enumerate(parts):
            name = f"{link}_{number}.obj"
            write_obj(folder / name, [("", Mesh(np.asarray(part.vertices), np.asarray(part.faces)))])
            text += f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'
        text += "</link>"
        if link != "body":
            text += (
                f'<joint name="{link}_joint" type="prismatic"><parent link="body"/><child link="{link}"/>'
                '<axis xyz="0 -1 0"/><limit lower="0" upper="0.35"/></joint>'
            )
    file = folder / "chest.urdf"
    file.write_text(f'<robot name="chest">{text}</robot>')
    assert sum(len(parts) for parts in links.values()) == 13 + 4 * 21 == 97
    return file
