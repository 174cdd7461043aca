"""A tool in a hand that cleans with it: how it is turned for a face, and which box it takes particles off in.

A tool takes off all particles in the box of its cleaning area, or of itself, while it touches the object
(`ig2mj.states.definitions.cleaning`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical, turn_about, turn_onto
from ig2mj.planning.cleaning_area import cleaning_area
from ig2mj.planning.grasps import OBLIQUE
from ig2mj.planning.moves import UP, ahead
from ig2mj.planning.world import DirtSpot, PlannedWorld, Rotation, Vector

PRESSED, LIFTED, CLOSE, SLACK = 0.02, 0.06, 0.03, 0.0
"""m that a tool is pressed into a face, and is lifted off it, also where there is less room; by which particles may be
outside of its box."""

TURNS = (np.pi / 2, -np.pi / 2, np.pi)
"""rad about a face's normal by which a tool is turned where it has no room otherwise."""

FIRST = 0.002
"""m by which the rest of a tool may come to a face before the part that cleans: farther away that touches nothing."""

RIM = 0.0003
"""m by which the rest of a tool may come to a face before the part that cleans, where an arm presses it: in turns with
more, as of a rag that is tilted onto its rim, it cleans in few strokes, and these come last."""

SHIFTED, SHIFTED_TURNS = 0.4, 2
"""Share of a tool's box, along the face, by which its middle is off a particle that has no room around it; and turns in
which it is shifted."""

BACKWARDS, ARM_TURNS = -0.2, 6
"""Cosine of the angle between where a gripper on an arm points and where it likes to, below which it does not clean;
and turns of its tool that are tried at most."""

FLAT, FLAT_TURNS = 0.3, 4
"""Times its width that a tool is thick at most which is pressed on faces with its flat side, and turns about a face's
normal in which a gripper does so, of those that are tried."""

TILTS = (-0.8, 0.8)
"""rad about an axis in a face by which a tool is tilted."""

ARM_TILTS, ALIKE = 12, 0.95
"""Tilted turns of a tool on an arm that are tried at most after those that are not, and cosine of the angle between
where the gripper points in two of them, above which an arm reaches both or none: its last joint turns about that."""

EAST = np.array([1.0, 0.0, 0.0])


@dataclasses.dataclass(frozen=True, eq=False)
class Region:
    """Where a held tool cleans when it is turned by `rotation`: corners of the part that cleans, and their box, m from
    the hand's grasp point.

    Attributes:
      lifted: m off a face from which on the tool is pressed on it. shift: m from the particle that it is pressed on to
        its middle, along the face.
    """

    rotation: Rotation
    corners: Float[np.ndarray, "n 3"]
    low: Vector
    high: Vector
    lifted: float = LIFTED
    shift: Vector = dataclasses.field(default_factory=lambda: np.zeros(3))

    @classmethod
    def turned(cls, rotation: Rotation, corners: Float[np.ndarray, "n 3"]) -> Region:
        """`corners`: as the tool is held now."""
        points = corners @ rotation.T
        return cls(rotation, points, points.min(0), points.max(0))

    def at(self, spot: DirtSpot) -> Vector:
        """Grasp point of the hand when the tool is pressed on a particle."""
        return self.at_all(spot.pos[None], spot.normal[None])[0]

    def at_all(self, pos: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """`at` of many particles."""
        depth = np.ptp(normal @ self.corners.T, axis=1) / 2
        return pos + normal * (depth - PRESSED)[:, None] + self.shift - (self.low + self.high) / 2

    def shifted(self, normal: Vector) -> list[Region]:
        """The same with the particle near each side, and each corner, of its box: where something stands next to it."""
        across, along = (axis * self._far(axis) for axis in axes_along(normal))
        steps = [(a, b) for a in (0, 1, -1) for b in (0, 1, -1)][1:]
        return [dataclasses.replace(self, shift=SHIFTED * (a * across + b * along)) for a, b in steps]

    def _far(self, axis: Vector) -> float:
        """m along an axis from one side of its box to the other, through the middle."""
        return float(((self.high - self.low) / np.maximum(np.abs(axis), 1e-6)).min())

    def above(self, spot: DirtSpot) -> Vector:
        """Grasp point of the hand right before."""
        return self.at(spot) + self.lifted * spot.normal

    def box(self, grip: Vector) -> tuple[Vector, Vector]:
        """Lower and upper corner of what it cleans with the hand's grasp point at a place."""
        return grip + self.low - SLACK, grip + self.high + SLACK

    def swept(self, spot: DirtSpot) -> tuple[Vector, Vector]:
        """Lower and upper corner of what it cleans from where it comes to a particle's face, which stops it, to where
        it would be pressed into it: particles of that face, in front of a thin tool, are between."""
        low, high = self.box(self.at(spot))
        back = PRESSED * spot.normal
        return np.minimum(low, low + back), np.maximum(high, high + back)


class HeldTool:
    """A tool as a hand holds it now: the part that cleans, and spheres of hand and tool, m from the grasp point.

    Attributes:
      flat: the direction that the flat side of a tool faces which cleans with all of it; None: it has none.
    """

    flat: Vector | None = None

    def __init__(self, world: PlannedWorld, tool: str, hand: int, share: float = 1.0):
        """`share`: of the spheres' radii that need room."""
        self.world, self.tool, self.hand, self.share = world, tool, hand, share
        area, self.out = cleaning_area(world, tool)
        self.has_area = area is not None
        self.whole = world.vertices(tool) - world.grip(hand)
        self.corners = self.whole if area is None else area - world.grip(hand)
        self._spheres = world.spheres(*world.hand_axes(hand), holding=tool, hand=hand) * (1.0, 1.0, 1.0, share)
        self.flat = None if self.has_area else _flat_side(self.whole)

    def spheres(self, rotation: Rotation) -> Float[np.ndarray, "S 4"]:
        """Of hand and tool, if they were turned."""
        return np.concatenate([self._spheres[:, :3] @ rotation.T, self._spheres[:, 3:]], axis=1)


def _flat_side(corners: Float[np.ndarray, "n 3"]) -> Vector | None:
    """The direction that the flat side of a tool faces which is away from the hand; None: it has no flat side.

    Args:
      corners: m from the hand's grasp point.
    """
    middle = corners.mean(0)
    axes = np.linalg.svd(corners - middle, full_matrices=False)[2]
    wide, thin = (float(np.ptp(corners @ axis)) for axis in axes[1:])
    if thin > FLAT * wide:
        return None
    return axes[2] if float(middle @ axes[2]) >= 0.0 else -axes[2]


def regions_of(held: HeldTool, yaw: float, normal: Vector) -> list[Region]:
    """Turns of a tool with its box, for a robot that looks along `yaw`, rad: with its cleaning area towards the face;
    as it is carried; of a hand that floats, turned about the normal and tilted, too, and close to the face, where there
    is less room. A tilted tool cleans in a larger box. Only those count in which the part that cleans comes to the face
    first: the others touch nothing with it. Then come the first of them with the particle near the rim of the box. An
    arm tilts a tool, too, in turns in which that part comes to the face first but for `RIM`, and in others at last.
    """
    found = _turned_regions(held, yaw, normal)
    late = [float((held.whole @ (r.rotation.T @ normal)).min() - (r.corners @ normal).min()) for r in found]
    enough = min(-FIRST, max(late))
    first = [r for r, by in zip(found, late, strict=True) if by >= enough]
    near = [r for r in first if r.lifted == first[0].lifted]
    off = [shifted for r in near[:SHIFTED_TURNS] for shifted in r.shifted(normal)]
    if held.world.body.opening is None:
        return [*first, *off]
    soon = [r for r, by in zip(found, late, strict=True) if by >= max(enough, -RIM)]
    return [*soon, *off, *(r for r in first if r not in soon)]


def _turned_regions(held: HeldTool, yaw: float, normal: Vector) -> list[Region]:
    """Those with the particle in the middle."""
    world, points = held.world, held.corners
    carried = about_vertical(yaw - world.base[1])
    facing = turn_onto(carried @ held.out, -normal) @ carried if held.has_area else carried
    rotations = [facing, carried] if held.has_area else [facing]
    if world.body.opening is not None:
        return [Region.turned(r, points) for r in _of_arm(held, yaw, normal, facing, carried)]
    rotations += [turn_about(normal, angle) @ facing for angle in TURNS]
    tilts = [turn_about(axis, angle) for axis in axes_along(normal, aside(yaw)) for angle in TILTS]
    rotations += [tilt @ facing for tilt in tilts] + [tilt @ turn_about(normal, np.pi / 2) @ facing for tilt in tilts]
    found = [Region.turned(r, points) for r in rotations]
    return found + [dataclasses.replace(r, lifted=CLOSE) for r in found]


def _of_arm(held: HeldTool, yaw: float, normal: Vector, facing: Rotation, carried: Rotation) -> list[Rotation]:
    """Turns of a tool on an arm: about the normal, and of one that cleans with all of it also with the gripper towards
    the face, and before these with its flat side on the face; those first in which the gripper points about where it
    likes to."""
    _, palm = held.world.hand_axes(held.hand)
    aim = OBLIQUE[0] * ahead(yaw) - OBLIQUE[1] * UP

    def turned(bases: Sequence[Rotation]) -> list[Rotation]:
        found = [turn_about(normal, k * np.pi / 4) @ base for base in bases for k in range(8)]
        score = [round(float(r @ palm @ aim), 1) for r in found]
        order = sorted(range(len(found)), key=lambda k: -score[k])
        return [found[k] for k in order if score[k] > BACKWARDS]

    flat = [] if held.flat is None else turned([turn_onto(carried @ held.flat, -normal) @ carried])[:FLAT_TURNS]
    bases = [facing] if held.has_area else [facing, turn_onto(carried @ palm, -normal) @ carried]
    found = [*flat, *turned(bases)][:ARM_TURNS] or [facing]
    for share in (0.5, 1.0):
        tilts = [turn_about(axis, share * angle) for axis in axes_along(normal, aside(yaw)) for angle in TILTS]
        leaning = sorted((tilt @ r for tilt in tilts for r in turned(bases)), key=lambda r: -float(r @ palm @ aim))
        for rotation in leaning:
            points = rotation @ palm
            if points @ aim > BACKWARDS and all(points @ other @ palm < ALIKE for other in found):
                found.append(rotation)
    return found[: ARM_TURNS + ARM_TILTS]


def aside(yaw: float) -> Vector:
    """The horizontal direction to the left of a robot that looks along `yaw`, rad."""
    return np.array([-np.sin(yaw), np.cos(yaw), 0.0])


def axes_along(normal: Vector, level: Vector = EAST) -> tuple[Vector, Vector]:
    """Two axes along a face at right angles, the first one horizontal; of one that is about level, about `level`."""
    across = np.cross(normal, UP) if abs(normal[2]) < 0.9 else level - (level @ normal) * normal
    across = across / np.linalg.norm(across)
    return across, np.cross(normal, across)
