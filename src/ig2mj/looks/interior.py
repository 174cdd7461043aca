"""What is on the walls, floors and ceilings of rooms: their surfaces, skirting boards, frames, splashbacks, sockets."""

from __future__ import annotations

import numpy as np

from ig2mj.looks import mesh
from ig2mj.looks.home_plan import Face, HomePlan, Opening, Room, seed_of, spans
from ig2mj.looks.light import KEY, Light
from ig2mj.looks.materials import Material, Texture, mixed, shaded
from ig2mj.looks.mesh import Builder, Triangles
from ig2mj.looks.surfaces import (
    FACADE,
    FLOORS,
    STYLES,
    WALL_WIDTH,
    ceiling_texture,
    floor_texture,
    wall_texture,
)

SKIN, FLOOR_SKIN = 0.004, 0.002
"""m by which a surface lies before what it covers."""

PIECE = 0.8
"""m: size of the pieces of walls and ceilings, so that the light of lamps varies on them."""

SKIRTING, SKIRTING_DEPTH, CORNICE = 0.09, 0.014, 0.06
"""m."""

TRIM = (0.95, 0.945, 0.93)
BARE = frozenset({"balcony", "garage", "storage_room"})
"""Rooms without skirting boards and cornices."""

COUNTERS = frozenset({"bottom_cabinet", "stove", "sink", "dishwasher", "countertop", "fridge", "washer", "dryer"})


def add_interior(build: Builder, plan: HomePlan, light: Light) -> None:
    """Adds the surfaces of all rooms and of the outer walls."""
    for room in plan.rooms:
        style = STYLES.get(room.kind, STYLES["kitchen"])
        walls = Material(f"wall_{room.name}", wall_texture(style, plan.height, room.seed), specular=0.03, shininess=0.1)
        build.add(walls, *(_wall(face, plan.height, build.fine) for face in plan.of_room(room.name)))
        if room.kind not in BARE:
            _skirting(build, plan, room)
    facade = Material("wall_outside", wall_texture(FACADE, plan.height, seed_of(plan.name)), rgba=(*light.outside, 1.0))
    build.add(facade, *(_wall(face, plan.height, build.fine) for face in plan.of_room(None)))
    build.paint(TRIM, *(_wall(face, plan.height, build.fine) for face in plan.of_room("")))
    _floors(build, plan, light)
    _ceilings(build, plan)
    for room in (r for r in plan.rooms if r.kind == "kitchen"):
        _splashback(build, plan, room)
    for opening in plan.windows:
        _sill(build, opening)
    for room in plan.rooms:
        _sockets(build, plan, room)


def _wall(face: Face, height: float | int, fine: bool) -> Triangles:
    """The face, a little before itself; its texture goes from the floor to the ceiling."""
    up = np.array([0, 0, face.top - face.bottom])
    start, end = face.point(face.low, SKIN, face.bottom), face.point(face.high, SKIN, face.bottom)
    if np.cross(end - start, up)[face.axis] * face.sign < 0:
        start, end = end, start
    a, b = (float(p[1 - face.axis]) for p in (start, end))
    if b < a:
        a, b = -a, -b
    uv = (a / WALL_WIDTH, max(face.bottom, 0.0) / height, b / WALL_WIDTH, min(face.top / height, 1.0))
    return mesh.sheet(start, end - start, up, uv, PIECE * fine)


def _skirting(build: Builder, plan: HomePlan, room: Room) -> None:
    """A board along the floor and a cornice along the ceiling, of three faces each."""
    for face in plan.of_room(room.name):
        length = face.high - face.low
        middle = (face.low + face.high) / 2
        if face.bottom < 0.05:
            board = mesh.box((0, SKIRTING_DEPTH / 2, SKIRTING / 2), (length, SKIRTING_DEPTH, SKIRTING), "-y -z")
            build.paint(TRIM, board.moved(face.point(middle, 0.0, max(face.bottom, 0.0)), face.turn))
        if face.top > plan.height - 0.05:
            rail = mesh.quad(
                [
                    (length / 2, 0.0, -CORNICE),
                    (-length / 2, 0.0, -CORNICE),
                    (-length / 2, CORNICE, 0),
                    (length / 2, CORNICE, 0),
                ]
            )
            build.paint(TRIM, rail.moved(face.point(middle, 0.004, plan.height), face.turn))


def _floors(build: Builder, plan: HomePlan, light: Light) -> None:
    for low, high, z, name in plan.floors:
        if name is None:
            continue
        room = plan.room(name)
        things = [
            (s.low[:2], s.high[:2], max(0.0, float(s.low[2]) - z))
            for s in plan.solids
            if s.fixed and s.low[2] - z < 0.6 and (s.high[:2] > low).all() and (s.low[:2] < high).all()
            and s.category not in ("carpet", "door", "window")
        ]  # fmt: skip
        patches = [_sunlight(w) for w in plan.windows if w.face.room == name] if light.sun else []
        inner_low, inner_high = np.maximum(low, room.low - 0.05), np.minimum(high, room.high + 0.05)
        sides = [
            any(f.axis == a and f.sign == s and f.bottom < 0.1 and f.high - f.low > 0.3 for f in plan.of_room(name))
            for a, s in ((0, 1), (0, -1), (1, 1), (1, -1))
        ]
        image = floor_texture(
            FLOORS.get(room.kind, "planks"),
            inner_low,
            inner_high,
            room.seed,
            things,
            [p for p in patches if p is not None],
            sides,
        )
        material = Material(f"floor_{name}", image, specular=0.12, shininess=0.4)
        uv0, uv1 = ((c - inner_low) / (inner_high - inner_low) for c in (low, high))
        edges = np.array([high[0] - low[0], 0, 0]), np.array([0, high[1] - low[1], 0])
        build.add(material, mesh.sheet((*low, z + FLOOR_SKIN), *edges, (*uv0, *uv1), PIECE * build.fine))


def _sunlight(window: Opening) -> np.ndarray | None:
    """Outline [n, 2] on the floor of the light that falls through a window; None where the sun does not reach it."""
    face = window.face
    if not window.outside or KEY[face.axis] * face.sign <= 0.05:
        return None
    low, high = window.along
    corners = [
        (low + 0.08, face.bottom + 0.1),
        (high - 0.08, face.bottom + 0.1),
        (high - 0.08, face.top - 0.1),
        (low + 0.08, face.top - 0.1),
    ]
    points = [face.point(along, -0.1, z) for along, z in corners]
    return np.array([p[:2] - p[2] / KEY[2] * np.asarray(KEY[:2]) for p in points])


def _ceilings(build: Builder, plan: HomePlan) -> None:
    """White, seen from below only, so that views from above look into the rooms."""
    material = Material("ceiling", ceiling_texture())
    for low, high, _, name in plan.floors:
        if name is None or plan.room(name).kind == "balcony":
            continue
        size, step = high - low, PIECE * build.fine
        build.add(
            material,
            mesh.sheet((low[0], high[1], plan.height - 0.001), (size[0], 0, 0), (0, -size[1], 0), (0, 0, 1, 1), step),
        )


def _splashback(build: Builder, plan: HomePlan, room: Room) -> None:
    """Tiles between the counters and the cabinets above them."""
    rng = np.random.default_rng(room.seed + 1)
    tones = ((0.90, 0.92, 0.90), (0.50, 0.66, 0.66), (0.86, 0.72, 0.56), (0.55, 0.62, 0.74))
    material = Material(
        "splashback", _metro_tiles(tones[int(rng.integers(len(tones)))], room.seed), specular=0.2, shininess=0.5
    )
    counters = [s for s in plan.solids if s.category in COUNTERS and room.name in s.rooms]
    for face in plan.of_room(room.name):
        if face.bottom > 0.05 or face.top < 1.5:
            continue
        k = 1 - face.axis
        near = [s for s in counters if abs((s.low if face.sign > 0 else s.high)[face.axis] - face.at) < 0.12]
        near = [s for s in near if s.high[k] > face.low and s.low[k] < face.high]
        if not near:
            continue
        low = max(face.low, min(float(s.low[k]) for s in near))
        high = min(face.high, max(float(s.high[k]) for s in near))
        if high - low > 0.3:
            piece = Face(face.room, face.axis, face.sign, face.at, low, high, 0.85, 1.5)
            tiled = _wall(piece, 0.6, build.fine)
            uv = np.stack([tiled.uv[:, 0] * WALL_WIDTH / 0.6, (tiled.vertices[:, 2] - 0.85) / 0.6], 1)
            out = np.zeros(3)
            out[face.axis] = face.sign * 0.004
            build.add(material, Triangles(tiled.vertices + out, tiled.normals, uv, tiled.faces))


def _metro_tiles(rgb: tuple[float | int, float | int, float | int], seed: int, size: int = 120) -> Texture:
    y, x = np.mgrid[:size, :size] * 0.6 / size
    row = np.floor(y / 0.1).astype(int)
    along = x + 0.1 * (row % 2)
    tone = np.random.default_rng(seed).uniform(-1, 1, (6, 3))[row % 6, np.floor(along / 0.2).astype(int) % 3]
    joint = np.minimum(np.minimum(along % 0.2, 0.2 - along % 0.2), np.minimum(y % 0.1, 0.1 - y % 0.1))
    image = shaded(shaded(rgb, tone, 0.06), np.clip((joint - 0.012) / 0.01, -1, 0), 0.10)
    return mixed(image, (0.93, 0.93, 0.92), np.clip((0.005 - joint) / 0.003, 0, 1))


def _sill(build: Builder, window: Opening) -> None:
    """A board below the window and an architrave around it."""
    low, high = window.along
    face, middle, width = window.face, (low + high) / 2, high - low
    sill = mesh.box((0, 0.05, -0.02), (width + 0.16, 0.13, 0.03))
    build.paint(TRIM, sill.moved(face.point(middle, 0.0, face.bottom), face.turn))
    for x in (-width / 2 - 0.03, width / 2 + 0.03):
        side = mesh.box((x, 0.012, (face.top - face.bottom) / 2), (0.06, 0.022, face.top - face.bottom + 0.06), "-y")
        build.paint(TRIM, side.moved(face.point(middle, 0.0, face.bottom), face.turn))
    top = mesh.box((0, 0.012, 0.03), (width + 0.12, 0.022, 0.06), "-y")
    build.paint(TRIM, top.moved(face.point(middle, 0.0, face.top), face.turn))


def _sockets(build: Builder, plan: HomePlan, room: Room) -> None:
    """A switch next to each door, and two sockets near the floor."""
    plate = mesh.joined([mesh.box((0, 0.005, 0), (0.08, 0.01, 0.08), "-y")])
    for door in (d for d in plan.doors if d.face.room == room.name):
        for along in (door.along[1] + 0.16, door.along[0] - 0.16):
            free = [
                s for s in spans(plan, room.name, 1.0, 1.12, 0.05) if _same(s, door.face) and s.low < along < s.high
            ]
            if free:
                at = door.face.point(along, SKIN, 1.06)
                build.paint((0.98, 0.98, 0.97), plate.moved(at, door.face.turn))
                rocker = mesh.box((0, 0.012, 0), (0.05, 0.006, 0.05), "-y")
                build.paint((0.90, 0.90, 0.89), rocker.moved(at, door.face.turn))
                break
    rng = np.random.default_rng(room.seed + 2)
    free = [s for s in spans(plan, room.name, 0.2, 0.32, 0.05) if s.high - s.low > 0.5]
    for face in [free[k] for k in rng.permutation(len(free))[:2]]:
        at = face.point(float(rng.uniform(face.low + 0.15, face.high - 0.15)), SKIN, 0.26)
        build.paint((0.97, 0.97, 0.96), plate.moved(at, face.turn))
        for x in (-0.016, 0.016):
            hole = mesh.box((x, 0.0108, 0), (0.008, 0.001, 0.016), "-y")
            build.paint((0.25, 0.25, 0.25), hole.moved(at, face.turn))


def _same(a: Face, b: Face) -> bool:
    return a.axis == b.axis and a.sign == b.sign and abs(a.at - b.at) < 0.02
