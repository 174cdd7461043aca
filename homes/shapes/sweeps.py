"""What the moving parts of a model fill on their ways: convex hulls that no corner leaves between two steps."""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.spatial import ConvexHull

from ..objects.model import HouseholdObject, Joint

Hull = tuple[np.ndarray, np.ndarray]
"""Points [n, 3], outward face normals [m, 3] without repeats."""

BULGE = 1e-3
"""m: how far a swept hull may reach beyond what the part really sweeps; sets the angle between two steps."""
LEAST_STEPS, MOST_STEP = 4, math.radians(12)
"""Steps of a hinge at least, and the angle (radians) between two of them at most."""


def face_normals(points: np.ndarray) -> np.ndarray:
    """Outward face normals [m, 3] of the convex hull of points [n, 3], without repeats."""
    return np.unique(ConvexHull(points).equations[:, :3].round(5), axis=0)


def carried(model: HouseholdObject, joint: Joint) -> list[str]:
    """Names of the links that a joint moves: its child and all that hangs on it."""
    found = [joint.child]
    for name in found:
        found += [other.child for other in model.joints if other.parent == name]
    return found


def swept(model: HouseholdObject) -> list[Hull]:
    """What all moving parts sweep, each from one end of its joint's range to the other, the others at 0; base frame.

    Joints without limits are left out.
    """
    return [hull for joint in model.joints for hull in sweep(model, joint)]


def sweep(model: HouseholdObject, joint: Joint) -> list[Hull]:
    """What the parts on one joint sweep.

    The hulls together hold everything that is swept: a slide's piece sweeps the hull of its two ends exactly; a hinge's
    piece is taken step by step, its points at the start and end of a step and where the tangents of their arcs meet,
    which is at most `BULGE` outside the arc.
    """
    if joint.kind not in ("revolute", "prismatic"):
        return []
    links = {link.name: link for link in model.links}
    pieces = [points + links[name].origin for name in carried(model, joint) for points in links[name].hulls]
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    low, high = joint.limits
    if joint.kind == "prismatic":
        clouds = [np.concatenate([points + low * axis, points + high * axis]) for points in pieces]
    else:
        clouds = [c for points in pieces for c in _arcs(points - links[joint.child].origin, axis, low, high)]
        clouds = [cloud + links[joint.child].origin for cloud in clouds]
    return [(cloud, face_normals(cloud)) for cloud in clouds]


def opened(model: HouseholdObject) -> list[np.ndarray]:
    """Hulls [n, 3] of the parts on joints that open, each at the end of its range, the others at 0; base frame."""
    links = {link.name: link for link in model.links}
    found = []
    for joint in model.joints:
        if not joint.openable or joint.kind not in ("revolute", "prismatic"):
            continue
        origin, axis, by = links[joint.child].origin, np.array(joint.axis) / np.linalg.norm(joint.axis), joint.limits[1]
        for name in carried(model, joint):
            for points in links[name].hulls:
                points = points + links[name].origin
                turned = (points - origin) @ turn(axis, by).T + origin
                found.append(turned if joint.kind == "revolute" else points + by * axis)
    return found


def _arcs(points: np.ndarray, axis: np.ndarray, low: float, high: float) -> list[np.ndarray]:
    """Point clouds around `points` [n, 3] on their way about an axis through the origin, one per step."""
    along = np.outer(points @ axis, axis)
    reach = float(np.linalg.norm(points - along, axis=1).max())
    # Half a step a gives a bulge of reach (1 / cos a - 1).
    step = min(MOST_STEP, 2 * math.acos(1 / (1 + BULGE / max(reach, 1e-6))))
    count = max(LEAST_STEPS, math.ceil((high - low) / step))
    angles = np.linspace(low, high, count + 1)
    outwards = 1 / math.cos((high - low) / count / 2)
    clouds = []
    for start, stop in itertools.pairwise(angles):
        tips = along + outwards * (points - along) @ turn(axis, (start + stop) / 2).T
        clouds.append(np.concatenate([points @ turn(axis, start).T, tips, points @ turn(axis, stop).T]))
    return clouds


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation matrix [3, 3] about a unit axis, radians."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def overlap(a: Hull, b: Hull) -> float:
    """m by which two hulls overlap along the face normal that parts them best; negative: they are apart, -inf: even
    their boxes are."""
    if np.any(a[0].min(0) > b[0].max(0)) or np.any(b[0].min(0) > a[0].max(0)):
        return -np.inf
    axes = np.concatenate([a[1], b[1]])
    pa, pb = a[0] @ axes.T, b[0] @ axes.T
    return float(np.minimum(pa.max(0) - pb.min(0), pb.max(0) - pa.min(0)).min())


def self_clashes(model: HouseholdObject, tolerance: float = 1e-3) -> list[tuple[str, str, float]]:
    """(joint, link that it meets, m of overlap) wherever a moving part goes through another part of the same model.

    What overlaps already while the joint is at 0 (a hinge in its post, a lid on its rim) is left out, and so is what
    opens before a part that does not open by itself (a dishwasher's door before its racks).
    """
    found = []
    links = {link.name: link for link in model.links}
    doors = {name for joint in model.joints if joint.openable for name in carried(model, joint)}
    for joint in model.joints:
        moving = carried(model, joint)
        apart = {*moving, *(() if joint.openable else doors)}
        own = [_hull(points + links[name].origin) for name in moving for points in links[name].hulls]
        deepest: dict[str, float] = {}
        ways = sweep(model, joint)
        for name, link in links.items():
            if name in apart:
                continue
            for points in link.hulls:
                still = _hull(points + link.origin)
                if any(overlap(piece, still) > 0 for piece in own):
                    continue
                depth = max((overlap(way, still) for way in ways), default=0.0)
                if depth > tolerance:
                    deepest[name] = max(depth, deepest.get(name, 0.0))
        found += [(joint.name, name, depth) for name, depth in deepest.items()]
    return found


def _hull(points: np.ndarray) -> Hull:
    return points, face_normals(points)
