"""What is added to each room: by its type, where its walls, corners and windows are free.

Nothing here is an object of the home: it cannot be touched, grasped or named, and it stands on no surface that objects
stand on.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ig2mj.looks import drawings, mesh, ornaments, shelves
from ig2mj.looks.corner_things import IN_CORNERS
from ig2mj.looks.home_plan import Face, HomePlan, Room, Solid, seed_of, spans
from ig2mj.looks.light import Light
from ig2mj.looks.materials import Material
from ig2mj.looks.mesh import Builder
from ig2mj.looks.ornaments import OrnamentPlace, Stock, pick

CURTAINS = {
    "living_room": (0.88, 0.84, 0.76), "bedroom": (0.62, 0.70, 0.78), "dining_room": (0.76, 0.52, 0.42),
    "childs_room": (0.97, 0.83, 0.52), "television_room": (0.35, 0.40, 0.50), "library": (0.55, 0.30, 0.26),
    "home_office": (0.80, 0.82, 0.80), "playroom": (0.72, 0.82, 0.62),
}  # fmt: skip
"""Room type -> colour of its curtains; kitchens, bathrooms and the like have blinds."""

BLINDS = {
    "kitchen": (0.93, 0.86, 0.66),
    "bathroom": (0.86, 0.92, 0.93),
    "utility_room": (0.92, 0.92, 0.90),
    "pantry_room": (0.9, 0.88, 0.82),
}
RUGS = {
    "living_room": "border",
    "bedroom": "kilim",
    "dining_room": "border",
    "childs_room": "kilim",
    "library": "border",
    "home_office": "kilim",
    "television_room": "border",
}
LAMPS = {
    "living_room": "drum", "bedroom": "drum", "dining_room": "cone", "kitchen": "cone", "childs_room": "globe",
    "playroom": "globe", "library": "drum", "home_office": "cone", "television_room": "drum", "lobby": "globe",
    "garage": "tube", "storage_room": "tube", "utility_room": "tube", "exercise_room": "tube",
}  # fmt: skip
"""Room type -> lamp at its ceiling; others have a dome."""

PICTURES = {
    "living_room": 3,
    "bedroom": 2,
    "dining_room": 2,
    "corridor": 3,
    "lobby": 2,
    "staircase": 3,
    "home_office": 1,
    "library": 1,
    "television_room": 2,
    "childs_room": 2,
    "playroom": 1,
    "kitchen": 1,
    "closet": 0,
}
SHELVES = {
    "living_room": 1,
    "bedroom": 1,
    "library": 12,
    "home_office": 2,
    "childs_room": 2,
    "playroom": 2,
    "dining_room": 1,
    "kitchen": 1,
    "pantry_room": 3,
    "bathroom": 1,
    "utility_room": 2,
    "garage": 2,
    "storage_room": 3,
    "closet": 1,
    "exercise_room": 1,
    "television_room": 1,
}
PLANTS = {
    "living_room": 2,
    "bedroom": 1,
    "dining_room": 1,
    "home_office": 1,
    "lobby": 2,
    "library": 1,
    "corridor": 1,
    "bathroom": 1,
    "television_room": 1,
    "balcony": 2,
    "staircase": 1,
    "exercise_room": 1,
}

PLANT_HEIGHT, PLANT_RADIUS = 1.05, 0.17
"""m."""

BESIDE_WALL, FROM_DOORS = 0.23, 0.95
"""m from a wall, and from the middle of a door, to the middle of what stands next to the wall."""


def add_furnishing(build: Builder, plan: HomePlan, light: Light) -> None:
    """Adds what each room is decorated with."""
    art = Material("art", drawings.art_texture(seed_of(plan.name, "art")), specular=0.1, shininess=0.5)
    glow = Material("glow", None, rgba=(1.0, 0.90, 0.72, 1.0), emission=light.glow)
    for room in plan.rooms:
        _Furnisher(build, plan, room, Stock(art, glow, np.random.default_rng(room.seed))).add()


@dataclasses.dataclass
class _Furnisher:
    """One room."""

    build: Builder
    plan: HomePlan
    room: Room
    stock: Stock
    taken: list[Solid] = dataclasses.field(default_factory=list)

    def add(self) -> None:
        kind = self.room.kind
        self._windows()
        self._lamp()
        if kind == "balcony":
            self._balcony()
        if kind in ("corridor", "lobby"):
            self._entrance()
        if kind == "bathroom":
            self._on_wall(
                0.7, 0.95, 1.45, 0.12, lambda p, f: ornaments.towel_rail(self.build, p.at(0, 0, 0.25), self.stock)
            )
        if kind == "kitchen":
            self._on_wall(
                0.8,
                1.02,
                1.42,
                0.1,
                lambda p, f: ornaments.utensil_rail(self.build, p.at(0, 0, 0.16), min(1.1, f), self.stock),
            )
        if kind == "closet":
            self._clothes()
        if kind in ("childs_room", "playroom"):
            self._on_wall(
                1.2,
                1.95,
                2.25,
                0.05,
                lambda p, f: ornaments.bunting(self.build, p.at(0, 0, 0.12), min(2.2, f), self.stock),
                2,
            )
        if kind == "exercise_room":
            self._on_wall(
                1.0, 0.1, 2.2, 0.15, lambda p, f: ornaments.wall_bars(self.build, p.at(0, 0, -1.15), self.stock)
            )
        if kind in ("garage", "storage_room", "utility_room"):
            self._on_wall(
                1.0, 0.3, 1.75, 0.12, lambda p, f: ornaments.garden_tools(self.build, p.at(0, 0, 0.5), self.stock)
            )
        if kind == "home_office":
            self._on_wall(0.9, 1.25, 1.85, 0.05, lambda p, f: ornaments.pinned_papers(self.build, p, self.stock))
        self._shelves()
        self._pictures()
        if kind in ("corridor", "lobby", "staircase"):
            self._on_wall(0.25, 1.6, 1.9, 0.2, lambda p, f: ornaments.sconce(self.build, p, self.stock), 2)
        self._rug()
        self._corners()

    def _free(self, bottom: float | int, top: float | int, depth: float | int) -> list[Face]:
        return spans(self.plan, self.room.name, bottom, top, depth, 0.05, self.taken)

    def _on_wall(
        self, width: float | int, bottom: float | int, top: float | int, depth: float | int, make, count: int = 1
    ) -> int:
        """Calls `make` with places in the middle of free stretches of wall and the length of each; widest first."""
        made = 0
        while made < count:
            free = [f for f in self._free(bottom, top, depth) if f.high - f.low >= width]
            if not free:
                break
            face = max(free, key=lambda f: (round(f.high - f.low, 2), f.axis, f.at))
            length = face.high - face.low
            along = (face.low + face.high) / 2
            make(OrnamentPlace(face.point(along, 0.004, (bottom + top) / 2), face.turn), length)
            self._take(face, along, max(width, min(length, 1.5)), depth)
            made += 1
        return made

    def _take(self, face: Face, along: float | int, width: float | int, depth: float | int) -> None:
        a, b = face.point(along - width / 2, 0.0, face.bottom), face.point(along + width / 2, depth, face.top)
        self.taken.append(Solid(np.minimum(a, b), np.maximum(a, b), "decoration"))

    def _windows(self) -> None:
        kind, rng = self.room.kind, self.stock.rng
        hue = CURTAINS.get(kind)
        cloth = ornaments.cloth(f"curtain_{self.room.name}", hue, self.room.seed) if hue is not None else None
        for window in (w for w in self.plan.windows if w.face.room == self.room.name and w.outside):
            low, high = window.along
            face = window.face
            place = OrnamentPlace(face.point((low + high) / 2, 0.004, 0.0), face.turn)
            if cloth is not None:
                clear = not any(
                    s.category not in ("window", "carpet") and s.low[2] < face.bottom and s.high[2] > 0.12
                    and self._near(s, face, low - 0.3, high + 0.3, 0.14) for s in self.plan.solids
                )  # fmt: skip
                ornaments.curtains(
                    self.build, place, high - low, face.top + 0.08, 0.03 if clear else face.bottom - 0.1, cloth
                )
            elif kind in BLINDS:
                drop = float(rng.uniform(0.25, 0.45)) * (face.top - face.bottom)
                ornaments.blind(self.build, place, high - low, face.top + 0.06, drop, BLINDS[kind])
            self._take(
                dataclasses.replace(face, bottom=0.0, top=face.top + 0.15), (low + high) / 2, high - low + 0.6, 0.15
            )

    def _near(self, s: Solid, face: Face, low: float | int, high: float | int, depth: float | int) -> bool:
        near, far = sorted((face.at, face.at + face.sign * depth))
        k = 1 - face.axis
        return bool(s.high[face.axis] > near and s.low[face.axis] < far and s.high[k] > low and s.low[k] < high)

    def _lamp(self) -> None:
        kind = LAMPS.get(self.room.kind, "dome")
        if self.room.kind == "balcony":
            return
        spots = [self.room.middle]
        if self.room.kind == "dining_room":
            tables = [
                s
                for s in self.plan.solids
                if "table" in s.category and self.room.name in s.rooms and s.category != "console_table"
            ]
            if tables:
                spots = [max(tables, key=lambda s: float(np.prod((s.high - s.low)[:2]))).middle[:2]]
        elif self.room.kind == "corridor" or max(self.room.size) > 2.6 * min(self.room.size):
            k = int(np.argmax(self.room.size))
            spots = [self.room.middle + (np.arange(2) == k) * self.room.size[k] * t for t in (-0.28, 0.28)]
        drop = {"dining_room": 0.75, "kitchen": 0.45}.get(self.room.kind, 0.3)
        for spot in spots:
            turn = 0.0 if self.room.size[0] >= self.room.size[1] else math.pi / 2
            ornaments.pendant(
                self.build, OrnamentPlace(np.array([*spot, self.plan.height]), turn), drop, kind, self.stock
            )

    def _entrance(self) -> None:
        """Coats on hooks and shoes below them."""

        def make(place: OrnamentPlace, length: float | int) -> None:
            width = min(1.1, length - 0.1)
            ornaments.coat_hooks(self.build, place.at(0, 0, 0.78), width, self.stock)
            self.build.paint((0.42, 0.36, 0.30), *place.put(mesh.box((0, 0.19, -0.935), (width, 0.34, 0.012))))
            for k in range(max(1, int(width / 0.32))):
                ornaments.shoes(self.build, place.at(-width / 2 + 0.18 + 0.32 * k, 0.03, -0.93), self.stock)

        self._on_wall(0.75, 0.02, 1.86, 0.16, make)

    def _clothes(self) -> None:
        """Rails with coats, or with shirts above what stands at the wall."""
        for bottom, shortest, longest in ((0.6, 0.55, 0.9), (1.15, 0.4, 0.5)):

            def make(place: OrnamentPlace, length: float | int, bottom=bottom, sizes=(shortest, longest)) -> None:
                rail = place.at(0, 0, (1.75 - bottom) / 2 - 0.05)
                ornaments.clothes_rail(self.build, rail, min(1.4, length), self.stock, sizes)

            self._on_wall(0.6, bottom, 1.75, 0.3, make, 2)

    def _shelves(self) -> None:
        count, kind = SHELVES.get(self.room.kind, 0), self.room.kind
        rows = {"library": 4, "pantry_room": 3, "storage_room": 2, "home_office": 2}.get(kind, 1)
        bottom = {3: 1.02, 4: 0.72}.get(rows, 1.38)

        def make(place: OrnamentPlace, length: float | int) -> None:
            for row in range(rows):
                shelves.wall_shelf(
                    self.build,
                    place.at(0, 0, bottom + 0.09 + 0.37 * row + 0.1 * (rows == 1) - (bottom + 2.12) / 2),
                    min(1.3, length - 0.1),
                    kind,
                    self.stock,
                )

        made = self._on_wall(0.6, bottom, 2.12, 0.22, make, -(-count // rows))
        if rows > 2 and made * rows < count:  # above what stands at the walls
            rows, bottom = 2, 1.38
            self._on_wall(0.6, bottom, 2.12, 0.22, make, -(-(count - 4 * made) // rows))

    def _pictures(self) -> None:
        rng, stock = self.stock.rng, self.stock
        sizes = ((0.62, 0.45), (0.45, 0.6), (0.9, 0.6), (0.36, 0.36))

        def make(place: OrnamentPlace, length: float | int) -> None:
            width, height = pick(rng, [s for s in sizes if s[0] < length - 0.1])
            if length > 1.9 and rng.integers(2):
                for x in (-0.5, 0.0, 0.5):
                    ornaments.picture(self.build, place.at(x, 0, 0.03), 0.38, 0.5, stock)
            else:
                ornaments.picture(self.build, place, width, height, stock)

        self._on_wall(0.5, 1.3, 1.92, 0.06, make, PICTURES.get(self.room.kind, 0))

    def _rug(self) -> None:
        kind = RUGS.get(self.room.kind)
        if kind is None or any(s.category == "carpet" and self.room.name in s.rooms for s in self.plan.solids):
            return
        anchors = {
            "living_room": ("coffee_table", "sofa"),
            "dining_room": ("breakfast_table", "pedestal_table"),
            "bedroom": ("bed",),
            "childs_room": ("bed",),
        }
        size = np.clip(0.62 * self.room.size, 0.9, [2.4, 2.4])
        middle = self.room.middle
        for category in anchors.get(self.room.kind, ()):
            there = [s for s in self.plan.solids if s.category == category and self.room.name in s.rooms]
            if there:
                middle = there[0].middle[:2]
                size = np.maximum(size, 0)
                break
        if size[0] > size[1]:
            size[1] = min(size[1], 0.7 * size[0])
        else:
            size[0] = min(size[0], 0.7 * size[1])
        middle = np.clip(middle, self.room.low + size / 2 + 0.15, self.room.high - size / 2 - 0.15)
        turned = size[1] > size[0]
        long, short = max(size), min(size)
        material = Material(f"rug_{self.room.name}", drawings.rug_texture(kind, self.room.seed, float(long / short)))
        low, high = middle - size / 2, middle + size / 2
        corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
        if turned:
            corners = [*corners[1:], corners[0]]
        self.build.add(material, mesh.quad([(*c, 0.008) for c in corners]))

    def _corners(self) -> None:
        """What stands in corners of walls where nothing else does, and plants in those that are left."""
        rng, kind, middle = self.stock.rng, self.room.kind, self.room.middle
        free = self._free_corners()
        spots = [free[k] for k in rng.permutation(len(free)).tolist()]
        for thing in IN_CORNERS.get(kind, ()):
            at_wall = [] if spots else self._ends_of_walls()
            if spots or at_wall:
                spot = spots.pop() if spots else pick(rng, at_wall)
                away = middle - spot
                turn = math.atan2(-away[0], away[1])  # its front (y) looks into the room
                thing(self.build, OrnamentPlace(np.array([*spot, 0.0]), turn), self.stock)
                low, high = spot - BESIDE_WALL, spot + BESIDE_WALL
                self.taken.append(Solid(np.array([*low, 0.0]), np.array([*high, PLANT_HEIGHT]), "decoration"))
        for spot in spots[: PLANTS.get(kind, 0)]:
            height = float(rng.uniform(0.8, 1.0)) * PLANT_HEIGHT
            ornaments.plant(self.build, OrnamentPlace(np.array([*spot, 0.0])), height, self.stock)

    def _ends_of_walls(self) -> list[np.ndarray]:
        """Where something may stand next to a wall: at the ends of free stretches, away from doors."""
        found = []
        for face in self._free(0.02, 0.95, 2 * BESIDE_WALL):
            if face.high - face.low > 2 * BESIDE_WALL + 0.1:
                for along in (face.low + BESIDE_WALL, face.high - BESIDE_WALL):
                    found.append(face.point(along, BESIDE_WALL, 0.0)[:2])
        doors = [door.solid.middle[:2] for door in self.plan.doors]
        return [spot for spot in found if all(np.linalg.norm(door - spot) > FROM_DOORS for door in doors)]

    def _free_corners(self) -> list[np.ndarray]:
        spots = []
        for a in self.plan.of_room(self.room.name):
            for b in self.plan.of_room(self.room.name):
                if (
                    a.axis != 0
                    or b.axis != 1
                    or min(a.bottom, b.bottom) > 0.05
                    or min(a.high - a.low, b.high - b.low) < 0.4
                ):
                    continue
                x, y = a.at, b.at
                if min(abs(y - a.low), abs(y - a.high)) < 0.06 and min(abs(x - b.low), abs(x - b.high)) < 0.06:
                    inside = (a.low + a.high) / 2 - y, (b.low + b.high) / 2 - x
                    if inside[0] * b.sign > 0 and inside[1] * a.sign > 0:
                        spots.append(np.array([x + a.sign * (PLANT_RADIUS + 0.06), y + b.sign * (PLANT_RADIUS + 0.06)]))
        free = []
        for spot in spots:
            reach = PLANT_RADIUS + 0.04
            blocked = any(
                s.category not in ("carpet", "window") and s.low[2] < PLANT_HEIGHT
                and (s.high[:2] > spot - reach).all() and (s.low[:2] < spot + reach).all()
                for s in (*self.plan.solids, *self.taken)
            )  # fmt: skip
            doors = any(np.linalg.norm(d.solid.middle[:2] - spot) < 0.75 for d in self.plan.doors)
            if not blocked and not doors:
                free.append(spot)
        return free

    def _balcony(self) -> None:
        """Boxes with flowers on the parapet."""
        for face in self.plan.of_room(self.room.name):
            if 0.7 < face.top < 1.3 and face.high - face.low > 0.8:
                along = face.low + 0.5
                while along < face.high - 0.3:
                    place = OrnamentPlace(face.point(along, -0.05, face.top), face.turn)
                    self.build.paint((0.70, 0.42, 0.30), *place.put(mesh.box((0, 0, 0.08), (0.6, 0.16, 0.16))))
                    for k in range(12):
                        x = -0.26 + 0.047 * k
                        y = float(self.stock.rng.uniform(-0.05, 0.05))
                        self.build.paint(
                            pick(self.stock.rng, ornaments.LEAVES), *place.put(mesh.ball(0.05, (x, y, 0.19), 6))
                        )
                        hue = pick(
                            self.stock.rng,
                            ((0.88, 0.34, 0.40), (0.98, 0.80, 0.36), (0.92, 0.90, 0.95), (0.70, 0.45, 0.75)),
                        )
                        self.build.paint(hue, *place.put(mesh.ball(0.024, (x, y + 0.03, 0.235), 6)))
                    along += 0.8
