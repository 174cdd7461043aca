"""Doors, drawers and lids as hands move them: where a link can be taken, and where that goes as its joint moves."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.host_rotations import turn_about
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.scene import Scene

OPEN_TO, AJAR, STEPS = 0.75, 0.25, 10
"""Shares of a joint's range to which it is opened, and to which a hand on its inner side pulls it; places of a hand on
the way."""

FAR_OUT, HEIGHTS = 0.85, (0.35, 1.35)
"""Share of the distance from a hinge to the link's edge at which it is taken; m: heights at which it is best taken."""

SIDE_PLACES = ((0.0, 0.0), (0.0, -0.3), (0.0, 0.3), (-0.35, 0.0), (0.35, 0.0), (-0.35, -0.3), (0.35, -0.3))
"""Shares of the length of what slides, along its axis, and of its height, from its middle to where it is taken by its
side."""

Vector = Float[np.ndarray, "3"]

FaceGrip = tuple[Vector, Vector]
"""A point of a face where a hand is, and the face's normal."""


@dataclasses.dataclass(frozen=True, eq=False)
class OpenableJoint:
    """One joint of one world as it is now; world frame, m and rad.

    Attributes:
      name: of the joint. object, object_index: whose it is. hinge: it turns; else it slides.
      anchor, axis: of the hinge; the slide's axis. now, closed, open: positions. vertices: corners of the link.
      grips: points of the face that moves ahead when it opens, with its normal, the best first. edges: of the side of
        a door that is farthest from its hinge, or of the faces along which something slides.
    """

    name: str
    object: str
    object_index: int
    hinge: bool
    anchor: Vector
    axis: Vector
    now: float
    closed: float
    open: float
    vertices: Float[np.ndarray, "V 3"]
    grips: tuple[FaceGrip, ...]
    edges: tuple[FaceGrip, ...] = ()

    @property
    def fraction(self) -> float:
        """How far it is open, 0 to 1."""
        return (self.now - self.closed) / (self.open - self.closed)

    def surrounds(self, point: Vector) -> bool:
        """Whether a point is in the box of the link, as what lies in a drawer is."""
        return bool((self.vertices.min(0) <= point).all() and (point <= self.vertices.max(0)).all())

    def is_above(self, other: OpenableJoint) -> bool:
        """Whether the link is above that of another joint, as drawers are, where both were shut."""
        mine, low = self.shut, other.shut
        over = (mine.max(0) > low.min(0))[:2].all() and (low.max(0) > mine.min(0))[:2].all()
        return bool(over and mine[:, 2].mean() > low[:, 2].max())

    @property
    def shut(self) -> Float[np.ndarray, "V 3"]:
        """Corners of the link where it would be if the joint were closed."""
        return self.moved(self.vertices, self.closed - self.now)

    def moved(self, points: Float[np.ndarray, "V 3"], by: float) -> Float[np.ndarray, "V 3"]:
        """Points of the link after the joint has moved."""
        if not self.hinge:
            return points + by * self.axis
        return (points - self.anchor) @ turn_about(self.axis, by).T + self.anchor

    def path(self, grip: FaceGrip, fraction: float) -> list[FaceGrip]:
        """Points and normals of the face where a hand is, from where the link is now to a share of its range."""
        by = self.closed + fraction * (self.open - self.closed) - self.now
        point, normal = grip
        ways = []
        for share in np.linspace(0, 1, STEPS):
            there = self.moved(point[None], share * by)[0]
            ahead = self.moved((point + normal)[None], share * by)[0] - there
            ways.append((there, ahead))
        return ways

    def sweep(self, fraction: float) -> Float[np.ndarray, "n 3"]:
        """Corners of the link on that way."""
        by = self.closed + fraction * (self.open - self.closed) - self.now
        corners = self.vertices[:: max(1, len(self.vertices) // 40)]
        return np.concatenate([self.moved(corners, share * by) for share in np.linspace(0, 1, STEPS)])

    @property
    def inner_grips(self) -> tuple[FaceGrip, ...]:
        """Points of the other face, with its normal."""
        found = []
        for point, normal in self.grips:
            away = (self.vertices - point) @ normal
            found.append((point + float(away.min()) * normal, -normal))
        return tuple(found)


def openable_joints(scene: Scene, view: PhysicsView, index: int, world: int = 0) -> list[OpenableJoint]:
    """Joints of an object that count for `open`, the largest links first."""
    tables, model = scene.tables, scene.model
    found = []
    for j in np.flatnonzero(tables.openable_object == index):
        number = int(np.flatnonzero(model.jnt_qposadr == tables.openable_qposadr[j])[0])
        body = int(model.jnt_bodyid[number])
        turn = matrices_on_host(np.asarray(view.body_quat)[world, [body]])[0]
        origin = np.asarray(view.body_pos)[world, body].astype(float)
        pieces = np.flatnonzero(tables.piece_body == body)
        if not len(pieces):
            continue
        own = matrices_on_host(tables.piece_quat[pieces])
        points = np.einsum("kij,kvj->kvi", own, tables.piece_vertices[pieces]) + tables.piece_pos[pieces][:, None]
        vertices = points.reshape(-1, 3) @ turn.T + origin
        hinge = int(model.jnt_type[number]) == int(mujoco.mjtJoint.mjJNT_HINGE)
        axis, anchor = turn @ model.jnt_axis[number], origin + turn @ model.jnt_pos[number]
        now = float(np.asarray(view.joint_pos)[world, j])
        closed, opened = float(tables.openable_closed[j]), float(tables.openable_open[j])
        joint = OpenableJoint(
            model.joint(number).name,
            tables.object_names[index],
            index,
            hinge,
            anchor,
            axis,
            now,
            closed,
            opened,
            vertices,
            (),
        )
        grips, edges = _grips(joint)
        found.append(dataclasses.replace(joint, grips=grips, edges=edges))
    return sorted(found, key=lambda joint: -float(np.ptp(joint.vertices, axis=0).prod()))


def _grips(joint: OpenableJoint) -> tuple[tuple[FaceGrip, ...], tuple[FaceGrip, ...]]:
    """Points on the face that is ahead when the joint opens, far from a hinge, at heights that hands like; and on the
    side that is farthest from a hinge."""
    sign = np.sign(joint.open - joint.closed)
    vertices = joint.vertices
    middle = vertices.mean(0)
    if not joint.hinge:
        middle = (vertices.min(0) + vertices.max(0)) / 2  # most corners of a drawer are those of its bottom
        normal = sign * joint.axis
        across = [v for v in np.eye(3) if abs(v @ normal) < 0.7]
        face = middle + (((vertices - middle) @ normal).max()) * normal
        grips = tuple((face + s * a * 0.25 * np.ptp(vertices @ a), normal) for a in across for s in (0, 1, -1))
        return grips, _side_grips(joint, middle)
    radial = vertices - joint.anchor
    radial -= np.outer(radial @ joint.axis, joint.axis)
    farthest = radial[np.argmax(np.linalg.norm(radial, axis=1))]
    out = middle - joint.anchor
    out -= (out @ joint.axis) * joint.axis
    out /= max(float(np.linalg.norm(out)), 1e-9)
    reach = float((radial @ out).max()) if len(radial) else float(np.linalg.norm(farthest))
    normal = sign * np.cross(joint.axis, out)
    depth = (vertices - joint.anchor) @ normal
    along = (vertices - joint.anchor) @ joint.axis
    grips, edges = [], []
    for share in (0.5, 0.35, 0.65, 0.2, 0.8):
        height = (along.min() + share * np.ptp(along)) * joint.axis
        for part in (FAR_OUT, 0.65):
            grips.append((joint.anchor + part * reach * out + height + float(depth.max()) * normal, normal))
        tip = depth[radial @ out > 0.95 * reach]
        edges.append((joint.anchor + reach * out + height + float(tip.max() + tip.min()) / 2 * normal, out))

    def discomfort(grip: FaceGrip) -> float:
        z = float(grip[0][2])
        return max(HEIGHTS[0] - z, 0.0) + max(z - HEIGHTS[1], 0.0)

    return tuple(sorted(grips, key=discomfort)), tuple(sorted(edges, key=discomfort))


def _side_grips(joint: OpenableJoint, middle: Vector) -> tuple[FaceGrip, ...]:
    """Points of the largest upright faces along which what slides moves, as of a window's sash: their middles, and
    others, which hands reach over furniture."""
    sides = [v for v in np.eye(3)[:2] if abs(v @ joint.axis) < 0.7]
    if not sides:
        return ()
    thin = min(sides, key=lambda v: float(np.ptp(joint.vertices @ v)))
    depth, up = (joint.vertices - middle) @ thin, float(np.ptp(joint.vertices[:, 2])) * np.eye(3)[2]
    along, found = float(np.ptp(joint.vertices @ joint.axis)) * joint.axis, []
    for part, share in SIDE_PLACES:
        at = middle + part * along + share * up
        found += [(at + float(depth.max()) * thin, thin), (at + float(depth.min()) * thin, -thin)]
    return tuple(found)
