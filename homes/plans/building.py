"""Walls, floors and ceilings of a plan: boxes, and their three one-link URDFs with meshes, as in iGibson."""

from __future__ import annotations

import io
import pathlib
import random

import numpy as np

from ..dataset.model_writer import numbers, visual_obj
from ..objects.model import hull_mesh
from ..shapes import materials, textures
from ..shapes.bricks import block, join
from ..shapes.materials import Material
from .plan import HEIGHT, Edge, Plan
from .porch import porch_rails, porch_slab

FLOOR_DEPTH, CEILING_DEPTH = 0.2, 0.1  # m
PARAPET = 1.05  # m, height of a balcony's outer walls
STEPS, TREAD, STAIR_WIDTH = 12, 0.25, 0.95
"""Of stairs: number, depth and width (m); they rise to the ceiling."""

WALL_COLOURS = (
    (0.93, 0.91, 0.86), (0.89, 0.91, 0.93), (0.94, 0.93, 0.90),
    (0.88, 0.91, 0.86), (0.94, 0.89, 0.85), (0.91, 0.90, 0.94),
)  # fmt: skip
FLOORING = {
    "bathroom": "tiles", "kitchen": "tiles", "utility_room": "tiles", "pantry_room": "tiles", "garage": "concrete",
    "storage_room": "concrete", "balcony": "concrete", "exercise_room": "cork", "lobby": "stone", "bedroom": "carpet",
    "childs_room": "carpet", "playroom": "carpet",
}  # fmt: skip
"""Room kind -> kind of floor; every other room has planks."""


def wall_boxes(plan: Plan) -> np.ndarray:
    """[n, 2, 3] blocks of all walls, with holes at the openings: full height, under sills and over lintels."""
    boxes = []
    outside = {room.name for room in plan.rooms if room.kind == "balcony"}
    for edge in plan.edges:
        if plan.fully_open(edge):
            continue
        if edge.outer and edge.rooms[0] in outside:
            boxes.append(edge.box(_end(plan, edge, edge.low, -1), _end(plan, edge, edge.high, 1), 0, PARAPET))
            continue
        at, end = _end(plan, edge, edge.low, -1), _end(plan, edge, edge.high, 1)
        for opening in plan.openings_of(edge):
            boxes.append(edge.box(at, opening.low, 0, HEIGHT))
            if opening.bottom > 0:
                boxes.append(edge.box(opening.low, opening.high, 0, opening.bottom))
            if opening.top < HEIGHT:
                boxes.append(edge.box(opening.low, opening.high, opening.top, HEIGHT))
            at = opening.high
        boxes.append(edge.box(at, end, 0, HEIGHT))
    found = np.array(boxes)
    return found[np.all(found[:, 1] - found[:, 0] > 1e-4, axis=1)]


def stair_boxes(plan: Plan) -> np.ndarray:
    """[n, 2, 3] the steps in every staircase, along the wall opposite its door (or the northern one)."""
    boxes = []
    for room in plan.rooms:
        if room.kind != "staircase":
            continue
        x0, y0, x1, y1 = plan.inside(room)
        doors = [o for o in plan.openings if o.walkable and room.name in o.edge.rooms and o.edge.axis == "x"]
        south = any(o.edge.at > room.centre[1] for o in doors)
        low = y0 if south else y1 - STAIR_WIDTH
        for k in range(STEPS):
            at = x0 + k * TREAD
            if at + TREAD <= x1 + 1e-6:
                boxes.append([[at, low, 0.0], [at + TREAD, low + STAIR_WIDTH, (k + 1) * HEIGHT / STEPS]])
    return np.array(boxes).reshape(-1, 2, 3)


def _end(plan: Plan, edge: Edge, end: float, way: int) -> float:
    """Where a wall ends so that corners are filled once: walls along x go on through the crossing wall unless another
    one takes over there; walls along y end at the crossing wall's face."""
    x, y = edge.point(end)
    crossing, follows = 0.0, False
    for other in plan.edges:
        if other is edge or plan.fully_open(other):
            continue
        if other.axis == edge.axis:
            start = other.low if way > 0 else other.high
            follows |= abs(other.at - edge.at) < 1e-6 and abs(start - end) < 1e-6
            continue
        at, along = (x, y) if other.axis == "y" else (y, x)
        if abs(other.at - at) < 1e-6 and other.low - 1e-6 <= along <= other.high + 1e-6:
            crossing = max(crossing, other.thickness / 2)
    if edge.axis == "y":
        return end - way * crossing
    return end if follows else end + way * crossing


def floor_boxes(plan: Plan) -> np.ndarray:
    """[rooms, 2, 3]: each room's floor up to its walls' centre lines, outer ones to the outer face; top at z = 0."""
    boxes = []
    for room in plan.rooms:
        x0, y0, x1, y1 = _to_outer_face(plan, room.name, room.rect)
        boxes.append([[x0, y0, -FLOOR_DEPTH], [x1, y1, 0.0]])
    return np.array(boxes)


def ceiling_boxes(plan: Plan) -> np.ndarray:
    boxes = floor_boxes(plan)
    boxes[:, :, 2] = (HEIGHT, HEIGHT + CEILING_DEPTH)
    return boxes


def _to_outer_face(plan: Plan, name: str, rect):
    x0, y0, x1, y1 = rect
    for edge in plan.edges:
        if name in edge.rooms and edge.outer:
            half = edge.thickness / 2
            if edge.axis == "x":
                y0, y1 = (y0 - half, y1) if edge.after == name else (y0, y1 + half)
            else:
                x0, x1 = (x0 - half, x1) if edge.after == name else (x0, x1 + half)
    return x0, y0, x1, y1


def write_building(plan: Plan, scene: pathlib.Path, rng: random.Random) -> None:
    """Writes `shape/`, `material/` and `urdf/<name>_{walls,floors,ceilings}.urdf` of a scene folder."""
    for part in ("shape/visual", "shape/collision", "urdf", "material"):
        (scene / part).mkdir(parents=True, exist_ok=True)
    paint = materials.plain(rng.choice(WALL_COLOURS), "wall", 0.1)
    stairs = stair_boxes(plan)
    wood = materials.wood("oak", rng)
    walls = [(paint, np.concatenate([wall_boxes(plan), porch_rails(plan)])), *([(wood, stairs)] if len(stairs) else [])]
    look = {kind: flooring(kind, rng) for kind in dict.fromkeys(room.kind for room in plan.rooms)}
    floors = [(look[room.kind], box[None]) for room, box in zip(plan.rooms, floor_boxes(plan), strict=True)]
    floors.append((materials.stone("grey", rng), porch_slab(plan)))
    ceilings = [(materials.plain("white", "wall", 0.1), ceiling_boxes(plan))]
    names: dict[str, Material] = {}
    for part, groups in (("wall", walls), ("floor", floors), ("ceiling", ceilings)):
        visuals, collisions = [], []
        for k, (material, boxes) in enumerate((material, boxes) for material, boxes in groups if len(boxes)):
            name = f"{part}_{k}" if material.texture is not None else material.name
            name = next((known for known, other in names.items() if other is material), name)
            names[name] = material
            solids = join([block(b[1] - b[0], (b[0] + b[1]) / 2) for b in boxes])
            visuals.append(f"{part}_{k}_vm.obj")
            _text(scene / "shape/visual" / visuals[-1], visual_obj(solids.visuals, material, name))
            for hull in solids.hulls:
                collisions.append(f"{part}_{len(collisions)}_cm.obj")
                _text(scene / "shape/collision" / collisions[-1], _hull_obj(hull))
        _text(scene / "urdf" / f"{plan.name}_{part}s.urdf", _one_link_urdf(f"{plan.name}_{part}s", visuals, collisions))
    _write_materials(names, scene)


def flooring(kind: str, rng: random.Random) -> Material:
    """The floor of a kind of room."""
    laid = FLOORING.get(kind, "planks")
    if laid == "tiles":
        rgb = materials.tint(rng.choice(("cream", "light_grey", "terracotta", "sky")), rng)
        grout = materials.colour("grey")
        return materials.picture(f"floor_{kind}", textures.tiles(rgb, grout), tile=1.2, kind="tile", shine=0.4)
    if laid == "planks":
        rgb = materials.tint(rng.choice(("oak", "walnut", "birch", "teak", "ash")), rng)
        return materials.picture(f"floor_{kind}", textures.planks(rgb, rng), tile=1.0, kind="wood", shine=0.3)
    if laid == "carpet":
        rgb = materials.tint(rng.choice(("beige", "light_grey", "sky", "tan")), rng)
        return materials.picture(f"floor_{kind}", textures.weave(rgb, rng), tile=0.25, kind="carpet")
    rgb = materials.tint({"concrete": "grey", "cork": "tan", "stone": "beige"}[laid], rng)
    return materials.picture(f"floor_{kind}", textures.speckle(rgb, rng, 0.12), tile=1.5, kind="concrete", shine=0.2)


def _write_materials(names: dict[str, Material], scene: pathlib.Path) -> None:
    lines = []
    for name, material in names.items():
        colour = (1.0, 1.0, 1.0) if material.texture is not None else material.rgb
        lines += [f"newmtl {name}", f"Kd {numbers(colour, 4)}", "Ks 0.1 0.1 0.1", "d 1"]
        if material.texture is not None:
            folder = scene / "material" / name
            folder.mkdir(parents=True, exist_ok=True)
            buffer = io.BytesIO()
            material.texture.save(buffer, "PNG", optimize=True)
            (folder / "COMBINED.png").write_bytes(buffer.getvalue())
            lines.append(f"map_Kd ../../material/{name}/COMBINED.png")
    _text(scene / "shape/visual/default.mtl", "\n".join([*lines, ""]))


def _one_link_urdf(name: str, visuals: list[str], collisions: list[str]) -> str:
    lines = ['<?xml version="1.0" ?>', f'<robot name="{name}">', '  <link name="base_link">']
    lines.append('    <inertial><origin rpy="0 0 0" xyz="0 0 0"/><mass value="10000"/>')
    lines.append('      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>')
    for kind, files in (("visual", visuals), ("collision", collisions)):
        for file in files:
            mesh = f'<mesh filename="shape/{kind}/{file}" scale="1 1 1"/>'
            lines.append(f'    <{kind}><origin rpy="0 0 0" xyz="0 0 0"/><geometry>{mesh}</geometry></{kind}>')
    return "\n".join([*lines, "  </link>", "</robot>", ""])


def _hull_obj(points: np.ndarray) -> str:
    mesh = hull_mesh(np.asarray(points).round(6))
    lines = ["o convex_0", *(f"v {numbers(v)}" for v in np.asarray(mesh.vertices))]
    return "\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in np.asarray(mesh.faces) + 1), ""])


def _text(path: pathlib.Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
