"""One household object under construction: links, joints, shapes, annotated links, halves.

Everything is written down in the OBJECT's frame at joint positions zero: z up, front along +x, standing on z = 0 around
the origin; the builder turns it into link frames. A family is a function that receives an `ObjectBuilder`.
"""

from __future__ import annotations

import dataclasses
import random
import zlib
from collections.abc import Sequence

import numpy as np
import trimesh

from ..shapes.bricks import Mesh, Solid, Vec
from ..shapes.materials import Material

POINT_LINKS = ("heat_source", "toggle_button", "water_source", "water_sink")
BOX_LINKS = ("slicer", "cleaning_tool_area")


@dataclasses.dataclass
class Area:
    """An annotated link of metadata.json: a point (size None) or a box with full edge lengths, in the base frame."""

    xyz: tuple[float, float, float]
    size: tuple[float, float, float] | None = None
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclasses.dataclass
class Joint:
    """kind: revolute, prismatic, continuous, fixed; limits: radians or metres; openable: its direction, or 0."""

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    limits: tuple[float, float] = (0.0, 0.0)
    openable: int = 0
    friction: float = 0.0  # Coulomb friction, N or N m; set by catalogue.build_model


class LinkBuilder:
    """One rigid link. `origin` is its frame's place in the object's frame at joint positions zero (never turned)."""

    def __init__(self, name: str, origin: Vec = (0.0, 0.0, 0.0)):
        self.name = name
        self.origin = np.asarray(origin, float)
        self.visuals: list[tuple[Material, Mesh]] = []
        self.hulls: list[np.ndarray] = []

    def add(self, solid: Solid, material: Material, collide: bool = True) -> None:
        """Adds a solid, given in the object's frame. collide False: its hulls are left out."""
        self.visuals += [(material, dataclasses.replace(m, vertices=m.vertices - self.origin)) for m in solid.visuals]
        if collide:
            self.hulls += [points - self.origin for points in solid.hulls]


@dataclasses.dataclass
class Part:
    """One half of a sliceable: the finished half and its base position in the whole's base frame."""

    model: HouseholdObject
    position: tuple[float, float, float]


@dataclasses.dataclass
class HouseholdObject:
    """A finished model, ready to be written. Shapes are in link frames; joint origins are relative to the parent link.

    rest: which orientations it can be put down in: "upright", "standing" or "any" (see poses.stable_orientations).
    furniture: it stands fixed in a room, and its model says where objects can be put (see height_maps.py).
    mass: kg, of an object of one link, where the density of its category does not suit it.
    """

    category: str
    model: str
    links: list[LinkBuilder]
    joints: list[Joint]
    areas: dict[str, Area]
    rest: str
    both_sides: bool = False
    furniture: bool = False
    mass: float | None = None
    parts: list[Part] = dataclasses.field(default_factory=list)

    @property
    def base(self) -> LinkBuilder:
        return self.links[0]

    def bounds(self) -> np.ndarray:
        """[2, 3] box of all collision hulls in the base frame, joints at 0."""
        cloud = np.concatenate([points + link.origin for link in self.links for points in link.hulls])
        return np.array([cloud.min(0), cloud.max(0)])


class ObjectBuilder:
    """What a family function fills.

    Attributes:
      category, model: names. index: the model's running number within its category. rng: its own random generator.
      size: the wanted (x depth, y width, z height), metres, already varied around the category's real size.
    """

    def __init__(self, category: str, model: str, size: Vec, rng: random.Random, index: int = 0, rest: str = "any"):
        self.category, self.model, self.rng, self.index, self.rest = category, model, rng, index, rest
        self.size = tuple(float(v) for v in size)
        self.base = LinkBuilder("base_link")
        self.links = [self.base]
        self.joints: list[Joint] = []
        self.areas: dict[str, Area] = {}
        self.both_sides = False
        self.mass: float | None = None

    # --- shapes -------------------------------------------------------------------------------------------------

    def add(self, solid: Solid, material: Material, collide: bool = True) -> None:
        """Adds a solid to the base link."""
        self.base.add(solid, material, collide)

    def pick(self, choices: Sequence):
        """Cycles through choices by the model's index; each category begins elsewhere."""
        return choices[(self.index + zlib.crc32(self.category.encode())) % len(choices)]

    # --- joints -------------------------------------------------------------------------------------------------

    def hinge(
        self,
        name: str,
        origin: Vec,
        axis: Vec,
        upper: float,
        openable: bool = True,
        parent: LinkBuilder | None = None,
        lower: float = 0.0,
    ) -> LinkBuilder:
        """A link that turns about `axis` through `origin`; angles in radians, positive opens, 0 is closed."""
        return self._joint(name, "revolute", origin, axis, (lower, upper), openable, parent)

    def slide(
        self, name: str, origin: Vec, axis: Vec, upper: float, openable: bool = True, parent: LinkBuilder | None = None
    ) -> LinkBuilder:
        """A link that slides along `axis` by up to `upper` metres; positive opens, 0 is closed."""
        return self._joint(name, "prismatic", origin, axis, (0.0, upper), openable, parent)

    def spin(self, name: str, origin: Vec, axis: Vec, parent: LinkBuilder | None = None) -> LinkBuilder:
        """A link that turns without limit (a wheel, a swivel seat)."""
        return self._joint(name, "continuous", origin, axis, (0.0, -1.0), False, parent)

    def _joint(self, name, kind, origin, axis, limits, openable, parent) -> LinkBuilder:
        parent = parent or self.base
        link = LinkBuilder(name, origin)
        assert name not in {other.name for other in self.links}, f"{self.category}: two links named {name}"
        self.links.append(link)
        offset = link.origin - parent.origin
        ax, ay, az = (float(v) for v in axis)
        self.joints.append(Joint(f"{name}_joint", kind, parent.name, name, offset, (ax, ay, az), limits, int(openable)))
        return link

    # --- annotated links ----------------------------------------------------------------------------------------

    def point(self, kind: str, xyz: Vec) -> None:
        """heat_source, toggle_button, water_source or water_sink, in the object's frame."""
        assert kind in POINT_LINKS, kind
        x, y, z = (float(v) for v in xyz)
        self.areas[kind] = Area((x, y, z))

    def area(self, kind: str, size: Vec, xyz: Vec, rpy: Vec = (0.0, 0.0, 0.0)) -> None:
        """slicer or cleaning_tool_area: a colliding box of full edge lengths `size`."""
        assert kind in BOX_LINKS, kind
        (a, b, c), (x, y, z), (r, p, w) = (tuple(float(v) for v in t) for t in (size, xyz, rpy))
        self.areas[kind] = Area((x, y, z), (a, b, c), (r, p, w))

    # --- the end ------------------------------------------------------------------------------------------------

    def finish(self) -> HouseholdObject:
        for link in self.links:
            assert link.hulls, f"{self.category}/{self.model}: link {link.name} has no collision"
        made = HouseholdObject(
            self.category, self.model, self.links, self.joints, self.areas, self.rest, self.both_sides
        )
        made.mass = self.mass
        return made


def hull_mesh(points: np.ndarray) -> trimesh.Trimesh:
    """The convex hull of a collision piece; boxes keep their 8 vertices."""
    return trimesh.convex.convex_hull(points)
