"""Cuts a model in two upright halves: the parts of a sliceable object (iGibson's dataset format `object_parts`).

Whole and halves must share one category (iGibson's sliced.py), so the halves of `apple/apple_00` are written as
`apple/apple_00_part_0` and `_part_1`.
"""

from __future__ import annotations

import numpy as np
import trimesh

from ..shapes.bricks import Mesh
from ..shapes.materials import Material
from .model import HouseholdObject, LinkBuilder, Part, hull_mesh

GAP = 0.0005  # m, half the space left between two halves where they appear


def add_halves(whole: HouseholdObject, flesh: Material) -> HouseholdObject:
    """Gives a rigid one-link model its two halves, cut by the plane x = middle; `flesh`: material of the cut faces."""
    for k, side in enumerate((1.0, -1.0)):
        half, shift = cut_half(whole, side, flesh, whole.category, f"{whole.model}_part_{k}")
        whole.parts.append(Part(half, (shift + side * GAP, 0.0, 0.0)))
    return whole


def cut_half(
    whole: HouseholdObject, side: float, flesh: Material, category: str, name: str
) -> tuple[HouseholdObject, float]:
    """The half on the +x (side 1) or -x (side -1) side and the x of its own frame's origin in the whole's frame."""
    assert len(whole.links) == 1, f"{whole.model}: only one-link objects are cut"
    low, high = whole.bounds()
    middle = float(low[0] + high[0]) / 2
    plane = (np.array([middle, 0.0, 0.0]), np.array([side, 0.0, 0.0]))
    shift = middle + side * float(high[0] - low[0]) / 4
    offset = np.array([shift, 0.0, 0.0])
    link = LinkBuilder("base_link")
    for points in whole.base.hulls:
        kept = _slice(hull_mesh(points), plane, cap=False)
        if kept is not None:
            link.hulls.append(np.asarray(kept.vertices) - offset)
    for material, mesh in whole.base.visuals:
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        kept = _slice(solid, plane, cap=solid.is_watertight)
        if kept is None:
            continue
        vertices, faces = np.asarray(kept.vertices), np.asarray(kept.faces)
        flat = np.abs(vertices[faces][:, :, 0] - middle).max(1) < 1e-9
        for chosen, look in ((~flat, material), (flat, flesh)):
            if chosen.any():
                link.visuals.append((look, Mesh(vertices - offset, faces[chosen])))
    return HouseholdObject(category, name, [link], [], {}, "any"), shift


def _slice(mesh: trimesh.Trimesh, plane: tuple[np.ndarray, np.ndarray], cap: bool) -> trimesh.Trimesh | None:
    origin, normal = plane
    reach = (np.asarray(mesh.vertices) - origin) @ normal
    if reach.max() <= 1e-9:
        return None
    if reach.min() >= -1e-9:
        return mesh
    return mesh.slice_plane(origin, normal, cap=cap, engine="earcut") if cap else mesh.slice_plane(origin, normal)
