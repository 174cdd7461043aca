"""How a hand can take an object: poses from its convex pieces, as they lie now, with room for the hand around them.

A pose is a point of the object's surface, the direction of the fingers along it, and that of the palm onto it. Rays go
from many sides towards the centre of mass, and towards the middles of pieces where they miss.

Axes: N candidates, S spheres of a hand, K pieces, C corners of a gripper.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.planning.bodies import HandedBody
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.moves import BELOW
from ig2mj.planning.pinches import SHALLOW, around_corners, between_fingers, holds, over_edges
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.scene.tables import SceneTables

UP = np.array([0.0, 0.0, 1.0])

COMPASS = 8
"""Horizontal directions that are tried."""

DEPTH = 0.06
"""m below an object's outermost point of a side that is still taken: not the bottom of a bowl."""

BEFORE, FLAT = (0.12, 0.06), 0.02
"""m before a grasp from which on a hand comes straight to it, the best first; that of a hand that floats where it has
less room: it goes in between a thing and what is above it."""

NARROW = 0.2
"""Discomfort of a hand that comes straight to a grasp from nearer than it likes to."""

AT_OBJECT = 0.4
"""Share of the spheres' radii that keeps clear of others where the hand takes hold: its parts are thinner."""

OBLIQUE = (0.9, 0.44)
"""Ahead and down: where a gripper on an arm likes to point, a unit vector."""

RAISED = 0.028
"""m by which a gripper is raised off a surface at most where its fingers would enter what a thin object lies on: they
are long enough to hold it with their tips."""

TIPS = 0.01
"""m beyond a grasp point that a gripper goes for which holds an object with the tips of its fingers."""

LEVEL = 0.3
"""Vertical part of the direction between fingers up to which they are about level."""

EDGE = 0.3
"""Discomfort of a gripper that holds with its fingertips: what fits between its fingers is held better."""

GRAZE, SCRAPE = 0.025, 2.0
"""m by which fingertips may seem to enter what is around the object, which stops them, and discomfort of entering
farther: a finger that closes on a table presses the hand off it."""

PASSING, CATCHES = np.arange(0.03, 0.105, 0.01), 0.003
"""m before a grasp at which an open gripper is looked at on its way there, and by which it seems to enter something
that stops it."""

APART = 0.03
"""m between points of a side."""

HIGH = 0.75
"""Share of an object's height, without lids and flaps, at which its sides are taken, too: a hand has room there above
the floor."""

OUTER = 0.8
"""Share of the way from an object's centre of mass to its rim at which it is taken, too."""

LOW, UPRIGHT = 0.08, 0.5
"""m above an object's lowest point below which a hand is in the way where it is put down; vertical part of a palm from
which on it is not at the side."""

GRAVITY, MOST_TORQUE, BURDEN = 9.81, 6.0, 0.6
"""m/s2; Nm from which on a hand does not keep what it holds level; discomfort of what is held badly."""

TINY, BEHIND_TINY = 0.05, 0.04
"""m along palm and fingers up to which a thing is tiny, and by which a palm that floats is behind its middle then."""

FLATTEST, SWEEPS, STRAIGHT = 0.025, 0.07, 0.99
"""m of height up to which closing fingers that lie on what a tiny thing lies on close over it without touching it; m
above that at which a palm is from which their tips sweep it towards the palm; vertical part of that palm's
direction."""

OFF_SWEPT = ((0.055, 0.0), (0.07, 0.0), *((0.055, side) for side in (0.015, -0.015, 0.025, -0.025, 0.032, -0.032)))
OFF_TINY = (
    (BEHIND_TINY, 0.0),
    (BEHIND_TINY, 0.02),
    (BEHIND_TINY, -0.02),
    (0.065, 0.0),
    (0.085, 0.0),
    (0.055, 0.032),
    (0.055, -0.032),
)
OFF_SLENDER = ((0.0, 0.0), (0.0, 0.02), (0.0, -0.02), (0.0, 0.03), (0.0, -0.03), (0.0, 0.036), (0.0, -0.036))
OFF_FLAT = ((0.0, 0.0), (0.0, 0.02), (0.0, -0.02))
"""m by which a palm is behind what is tiny and flat, or tiny, or lies along the fingers and is as narrow, or is wider
and as low, and to its side, the best first: next to a wall it lies below the outer fingers, or their tips."""

MIDDLES = 8
"""Pieces whose middles are aimed at, at most."""


@dataclasses.dataclass(frozen=True, eq=False)
class GraspPose:
    """See the module's text; world frame.

    Attributes:
      point: of the surface, m. fingers, palm: unit vectors. before: m along -palm from which the hand comes straight.
      burden: how badly the object is held there: far from below its centre of mass, or so low that the hand is in the
        way when it is put down; 0 to 1.
      scrapes: fingers meet what is around the object, unless the object stops the hand before.
      room: share of the spheres' radii that keeps clear of what is around on the hand's way.
      deep: m beyond the point that the hand goes for, until it touches the object; 0: it stays there (`sweeps`).
    """

    point: Vector
    fingers: Vector
    palm: Vector
    before: float
    burden: float = 0.0
    scrapes: bool = False
    deep: float = BELOW
    room: float = 1.0

    @property
    def sweeps(self) -> bool:
        """Fingers close slowly where the hand is, and sweep what is tiny and flat towards the palm."""
        return self.deep <= 0.0

    def at(self, away: float) -> Vector:
        """A point above the surface, m along its normal."""
        return self.point - away * self.palm

    def discomfort(self, yaw: float, on_arm: bool = False) -> float:
        """How far a hand of a robot that looks along `yaw` (rad) is turned from where it likes to be: palm down or
        forwards, fingers forwards or upwards. A gripper on an arm likes to point ahead or obliquely down."""
        ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        if on_arm:
            return 1.0 - float(self.palm @ (OBLIQUE[0] * ahead - OBLIQUE[1] * UP))
        palm = float(np.clip(1.0 - max(self.palm @ -UP, 0.85 * (self.palm @ ahead)), 0.0, 2.0))
        fingers = float(np.clip(1.0 - max(self.fingers @ ahead, self.fingers @ UP), 0.0, 2.0))
        return palm + 0.5 * fingers


def sides(rises: Sequence[float] = (1.0,)) -> list[tuple[Vector, list[Vector]]]:
    """Normals from which objects are taken, with the directions of fingers: from above, from all sides, and between.

    Args:
      rises: of the sides between, height for a unit of length.
    """
    angles = np.arange(COMPASS) * (2 * np.pi / COMPASS)
    level = [np.array([np.cos(a), np.sin(a), 0.0]) for a in angles]
    found = [(UP, level)]
    for normal in level:
        across = np.cross(UP, normal)
        found.append((normal, [UP, across, -across]))
        for rise in rises:
            slope, steep = (v / np.hypot(1.0, rise) for v in (normal + rise * UP, UP - rise * normal))
            found.append((slope, [steep, across, -across]))
    return found


_SIDES, _ARM_SIDES = sides(), sides((1.0, OBLIQUE[1] / OBLIQUE[0]))
"""Of a hand that floats, and of a gripper on an arm, which points obliquely down, too: in compartments it has little
room above."""


def grasp_poses(world: PlannedWorld, name: str, obstacles: Obstacles, room: float = 1.0) -> list[GraspPose]:
    """Poses of a hand on an object with room for the hand there, from above first.

    Args:
      obstacles: everything but the object. room: `GraspPose.room`.
    """
    tables, index = world.domain.model.tables, world.index(name)
    centre, corners = world.com(name), world.vertices(name)
    middles = [world.vertices_of_pieces(np.array([p])).mean(0) for p in np.flatnonzero(tables.piece_object == index)]
    middles.sort(key=lambda m: float(np.linalg.norm(m - centre)))
    trunk = world.vertices_of_pieces(main_pieces(tables, index))
    above = np.array([*centre[:2], trunk[:, 2].min() + HIGH * np.ptp(trunk[:, 2])])
    aims = np.array([centre, above, *middles[:MIDDLES], *(centre + OUTER * (world.rim(name) - centre))])
    size = float(np.linalg.norm(np.ptp(corners, axis=0))) + 0.1
    all_sides = _SIDES if world.body.opening is None else _ARM_SIDES
    normals = np.array([normal for normal, _ in all_sides])
    origins = aims[None] + size * normals[:, None]
    main = np.flatnonzero((tables.graspable_object == index) & (tables.graspable_joint < 0))
    rays = origins.reshape(-1, 3), np.repeat(-normals, len(aims), axis=0)
    hits = obstacles.entries(*rays, index)
    if len(main):  # not of lids and flaps, which hands do not take hold of
        hits = np.where(
            hits < obstacles.entries(*rays, index, int(tables.graspable_body[main[0]])) - 1e-6, np.inf, hits
        )
    points, fingers, palms = [], [], []
    for (normal, ways), start, away in zip(all_sides, origins, hits.reshape(len(normals), -1), strict=True):
        outermost = float((trunk @ normal).max())
        taken: list[Vector] = []
        for origin, hit in zip(start, away, strict=True):
            point = origin - (hit if np.isfinite(hit) else 0.0) * normal
            deep = not np.isfinite(hit) or point @ normal < outermost - DEPTH
            if deep or any(np.linalg.norm(point - t) < APART for t in taken):
                continue
            taken.append(point)
            for way in ways:
                points.append(point)
                fingers.append(way)
                palms.append(-normal)
    if not points:
        return []
    points, fingers, palms = np.array(points), np.array(fingers), np.array(palms)
    body, which, deep = world.body, np.arange(len(points)), np.full(len(points), BELOW)
    if body.opening is not None:
        own = world.only(index)
        which, points, fingers, palms, deep = _of_gripper(body, own, trunk, points, fingers, palms)
    else:
        which, points, swept = _under_fingers(corners, points, fingers, palms)
        fingers, palms, deep = fingers[which], palms[which], np.where(swept, 0.0, deep[which])
    if not len(points):
        return []
    spheres = np.stack([body.hand_spheres(f, p) for f, p in zip(fingers, palms, strict=True)])
    centres = points[:, None] + spheres[..., :3]
    before = np.where(_room(obstacles, centres, AT_OBJECT * spheres[..., 3]), 0.0, -1.0)
    for away in (*BEFORE, FLAT) if body.opening is None else BEFORE:
        still = np.flatnonzero(before == 0.0)
        off = centres[still] - away * palms[still, None]
        before[still[_room(obstacles, off, room * spheres[still, :, 3])]] = away
    lever = world.mass(name) * GRAVITY * np.linalg.norm((points - centre)[:, :2], axis=1)
    low = (points[:, 2] < corners[:, 2].min() + LOW) & (np.abs(palms[:, 2]) < UPRIGHT)
    burden = np.minimum(lever / MOST_TORQUE, 1.0) + low
    good = np.flatnonzero(before > 0)
    if room == 1.0:  # else also where the hand may have to push its way
        good = good[_passes(body, obstacles, points[good], fingers[good], palms[good])]
    scrapes = ~_fingers_have_room(body, obstacles, points[good], fingers[good], palms[good])
    order = np.lexsort((np.arange(len(good)), deep[good] < BELOW, scrapes, which[good]))
    good, scrapes = good[order], scrapes[order]
    first = np.unique(which[good], return_index=True)[1]  # of poses that differ by where the fingers are
    return [
        GraspPose(
            points[k], fingers[k], palms[k], float(before[k]), min(float(burden[k]), 1.0), bool(s), float(deep[k]), room
        )
        for k, s in zip(good[first], scrapes[first], strict=True)
    ]


def main_pieces(tables: SceneTables, index: int) -> Int[np.ndarray, "n"]:
    """Pieces of an object that hands take hold of: without lids and flaps, which stand out when they are open; all of
    what they do not take hold of."""
    own = tables.piece_object == index
    main = tables.graspable_body[(tables.graspable_object == index) & (tables.graspable_joint < 0)]
    return np.flatnonzero(own & np.isin(tables.piece_body, main) if len(main) else own)


def _of_gripper(
    body: HandedBody,
    own: Obstacles,
    corners: Float[np.ndarray, "V 3"],
    points: Float[np.ndarray, "N 3"],
    fingers: Float[np.ndarray, "N 3"],
    palms: Float[np.ndarray, "N 3"],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Poses of a gripper: with the object between the fingers, where the points of its surface are, and raised off
    them; and over its edges. Number of each that differ only by where the fingers are, points, fingers, palms, and how
    deep the hand goes.

    Args:
      own: the object alone. corners: its own.
    """
    opening = body.opening
    assert opening is not None
    which, at = between_fingers(own, points, fingers, palms, opening)
    thin = np.setdiff1d(np.arange(len(points)), which)
    more, shallow = between_fingers(own, points[thin], fingers[thin], palms[thin], opening, SHALLOW)
    which, at = np.concatenate([which, thin[more]]), np.concatenate([at, shallow])
    lowest = np.array([body.hand_corners(f, p)[:, 2].min() for f, p in zip(fingers, palms, strict=True)])[which]
    below = corners[:, 2].min() - (at[:, 2] + lowest)
    raised = below / np.maximum(-palms[which][:, 2], 1e-6)
    tips = np.flatnonzero((np.abs(fingers[which][:, 2]) < LEVEL) & (raised > 0.0) & (raised < RAISED))
    higher = at[tips] - raised[tips, None] * palms[which[tips]]
    good = holds(body.hand_corners, opening, own, higher, fingers[which[tips]], palms[which[tips]])
    deep = np.repeat([BELOW, TIPS], [len(which), good.sum()])
    which, at = np.concatenate([which, which[tips[good]]]), np.concatenate([at, higher[good]])
    kinds = (take(body.hand_corners, opening, own, corners) for take in (over_edges, around_corners))
    edge, edge_fingers, edge_palms = (np.concatenate(parts) for parts in zip(*kinds, strict=True))
    return (
        np.concatenate([which, len(points) + np.arange(len(edge))]),
        np.concatenate([at, edge]),
        np.concatenate([fingers[which], edge_fingers]),
        np.concatenate([palms[which], edge_palms]),
        np.concatenate([deep, np.full(len(edge), TIPS)]),
    )


def _under_fingers(
    corners: Float[np.ndarray, "V 3"],
    points: Float[np.ndarray, "N 3"],
    fingers: Float[np.ndarray, "N 3"],
    palms: Float[np.ndarray, "N 3"],
) -> tuple[Int[np.ndarray, "M"], Float[np.ndarray, "M 3"], Bool[np.ndarray, "M"]]:
    """Points for a palm that comes from above, with the numbers of the poses from which they come: on what is tiny, so
    far behind it that it lies below the fingers. Below the palm, fingers that close are stopped by what it lies on
    before they come to it. What is flat, too, is swept towards the palm; the last array says where.

    Args:
      corners: of the object.
    """
    across = np.cross(fingers, palms)
    low, ahead, aside = (np.ptp(corners @ axes.T, axis=0) < TINY for axes in (palms, fingers, across))
    low &= palms[:, 2] < -UPRIGHT
    swept = (palms[:, 2] < -STRAIGHT) & bool((np.ptp(corners, axis=0) < (TINY, TINY, FLATTEST)).all())
    tiny, slender, flat = low & ahead & ~swept, low & ~ahead & aside, low & ~ahead & ~aside
    kinds = (swept, OFF_SWEPT), (tiny, OFF_TINY), (slender, OFF_SLENDER), (flat, OFF_FLAT)
    which, offset = [np.flatnonzero(~low)], [np.zeros((int((~low).sum()), 3))]
    for kind, offsets in kinds:
        for behind, side in offsets:
            which.append(np.flatnonzero(kind))
            offset.append((side * across - behind * fingers)[kind])
    order = np.argsort(np.concatenate(which), kind="stable")
    which = np.concatenate(which)[order]
    found = points[which] + np.concatenate(offset)[order]
    found[swept[which], 2] = corners[:, 2].min() + SWEEPS
    return which, found, swept[which]


def _hands_at(
    body: HandedBody,
    points: Float[np.ndarray, "N 3"],
    fingers: Float[np.ndarray, "N 3"],
    palms: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, "N C 3"]:
    """Corners of open grippers at some poses, m, world frame."""
    return np.stack([body.hand_corners(f, p) for f, p in zip(fingers, palms, strict=True)]) + points[:, None]


def _fingers_have_room(
    body: HandedBody,
    obstacles: Obstacles,
    points: Float[np.ndarray, "N 3"],
    fingers: Float[np.ndarray, "N 3"],
    palms: Float[np.ndarray, "N 3"],
) -> Bool[np.ndarray, "N"]:
    """Whether open grippers meet nothing but the object at some poses; other hands do."""
    if not len(points) or body.opening is None:
        return np.ones(len(points), bool)
    corners = _hands_at(body, points, fingers, palms)
    distance = obstacles.distance(corners)
    return np.all(distance > -GRAZE, axis=1)


def _passes(
    body: HandedBody,
    obstacles: Obstacles,
    points: Float[np.ndarray, "N 3"],
    fingers: Float[np.ndarray, "N 3"],
    palms: Float[np.ndarray, "N 3"],
) -> Bool[np.ndarray, "N"]:
    """Whether open grippers meet nothing on their last way to some poses, straight ahead: not the front of a drawer,
    behind which there is room again. Other hands do not."""
    room = np.ones(len(points), bool)
    if not len(points) or body.opening is None:
        return room
    corners = _hands_at(body, points, fingers, palms)
    for away in PASSING:
        left = np.flatnonzero(room)
        room[left] = np.all(obstacles.distance(corners[left] - away * palms[left, None]) > -CATCHES, axis=1)
    return room


def _room(
    obstacles: Obstacles, centres: Float[np.ndarray, "N S 3"], radii: Float[np.ndarray, "N S"]
) -> Bool[np.ndarray, "N"]:
    """Whether the spheres of hands have room."""
    return np.all(obstacles.distance(centres) >= radii, axis=1) if len(centres) else np.zeros(0, bool)


def ordered(poses: Sequence[GraspPose], yaw: float, on_arm: bool = False) -> list[GraspPose]:
    """The most comfortable first, for a robot that looks along `yaw`, rad. on_arm: its hand is on an arm."""

    def cost(pose: GraspPose) -> float:
        narrow = NARROW * (float(pose.before < BEFORE[0]) + float(pose.before < BEFORE[-1]))
        tips = EDGE * (pose.deep < BELOW and not pose.sweeps)
        return pose.discomfort(yaw, on_arm) + narrow + BURDEN * pose.burden + SCRAPE * pose.scrapes + tips

    return sorted(poses, key=cost)
