"""From links to bodies: what an object becomes before any MuJoCo element exists.

Links joined by fixed joints, or by joints without room to move, become one body, as in iGibson
(merge_fixed_links); a floating joint cuts the object into several independent trees; every other
joint leads to a body of its own. All lengths are scaled already. Poses are 4x4.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence

import numpy as np

from ..base.description import Inertial, Joint, ObjectModel, PackedImage, Shape
from ..base.transforms import apply
from ..hulls.pieces import HullPiece
from .joint_limits import clamp, is_locked, motion

#: A body without mass cannot move in MuJoCo: the least mass (kg) and the least radius of gyration (m) we give one.
MIN_MASS = 1e-3
MIN_GYRATION_RADIUS = 1e-3
#: No body's largest moment of inertia exceeds the sum of the other two. Flat and slender bodies lie near that bound,
#: and MJCF's six digits must not round them across it: the distance kept, relative to the largest.
MOMENT_MARGIN = 1e-5
#: MuJoCo refuses meshes with fewer vertices.
LEAST_CORNERS = 4


@dataclasses.dataclass
class VisualPart:
    """An object to draw, in its body's frame: a triangle mesh (vertices, faces, perhaps uv) or a primitive."""

    kind: str  # "mesh", "box", "cylinder", "sphere" or "capsule"
    pose: np.ndarray
    size: tuple[float, ...] = ()
    vertices: np.ndarray | None = None
    faces: np.ndarray | None = None
    uv: np.ndarray | None = None
    rgba: tuple[float, float, float, float] | None = None
    texture: pathlib.Path | PackedImage | None = None


@dataclasses.dataclass
class BodyPlan:
    """One rigid body.

    Attributes:
      name: the link that gives the body its frame, as in the URDF.
      parent: index of the parent body in `Assembly.bodies`; None for a root.
      pose: 4x4, in the parent's frame; of a root, in the base link's frame at joint positions 0.
      joint: the joint to the parent; None for a root.
      links: the links merged into it, this body's own first.
      collisions, visuals: in the body's frame. hulls_as_visuals: draw the collision pieces, there is nothing better.
      inertial: of all merged links together. com: centre of mass by iGibson's rule, as its saved poses use it.
    """

    name: str
    parent: int | None
    pose: np.ndarray
    joint: Joint | None
    links: list[str]
    collisions: list[HullPiece]
    visuals: list[VisualPart]
    inertial: Inertial
    com: np.ndarray
    hulls_as_visuals: bool = False


@dataclasses.dataclass
class Assembly:
    """An object as bodies: roots are the base first, then the links behind floating joints, in document order.

    Attributes:
      model: the scaled model it was made from, without its meshes.
      link_poses: link -> (index of the body that carries it, 4x4 pose in that body).
      warnings: what a user should know, one line each.
    """

    model: ObjectModel
    scale: np.ndarray
    bodies: list[BodyPlan]
    link_poses: dict[str, tuple[int, np.ndarray]]
    warnings: list[str]

    @property
    def roots(self) -> list[int]:
        """Indices of the root bodies, the base first."""
        return [i for i, body in enumerate(self.bodies) if body.parent is None]

    def joints(self) -> list[Joint]:
        """The moving joints, in the order of their bodies."""
        return [body.joint for body in self.bodies if body.joint is not None]

    @property
    def mass(self) -> float:
        return float(sum(body.inertial.mass for body in self.bodies))


def assemble(
    model: ObjectModel,
    scale: np.ndarray,
    pieces: Mapping[str, Sequence[HullPiece]],
    inertials: Mapping[str, Inertial],
    *,
    igibson_visuals: bool = True,
) -> Assembly:
    """Plans the bodies of a scaled object.

    Args:
      model: as `scaling.scale_model` returned it.
      scale: the scale it was given, for the record.
      pieces: link -> convex collision pieces in the link's frame.
      inertials: link -> inertial in the link's frame.
      igibson_visuals: as iGibson draws: primitive visuals are left out where a link also has a mesh, and links
        without any collision are not drawn. False draws everything the URDF says.
    """
    plan = _Planner(model, pieces, inertials, igibson_visuals)
    base_poses = _poses_at_zero(model)
    plan.add_tree(model.base, None, base_poses[model.base], None)
    for joint in model.joints.values():
        if joint.type == "floating":
            plan.add_tree(joint.child, None, base_poses[joint.child], None)
    warnings = [*model.warnings, *plan.warnings]
    return Assembly(_without_meshes(model), np.asarray(scale, dtype=float), plan.bodies, plan.link_poses, warnings)


class _Planner:
    """Walks the tree of links and fills the list of bodies."""

    def __init__(
        self,
        model: ObjectModel,
        pieces: Mapping[str, Sequence[HullPiece]],
        inertials: Mapping[str, Inertial],
        igibson_visuals: bool,
    ):
        self._model, self._pieces, self._inertials = model, pieces, inertials
        self._igibson_visuals = igibson_visuals
        self._children: dict[str, list[Joint]] = {}
        for joint in model.joints.values():
            self._children.setdefault(joint.parent, []).append(joint)
        self._any_visual = any(_is_drawable(shape) for link in model.links.values() for shape in link.visuals)
        self.bodies: list[BodyPlan] = []
        self.link_poses: dict[str, tuple[int, np.ndarray]] = {}
        self.warnings: list[str] = []

    def add_tree(self, link: str, parent: int | None, pose: np.ndarray, joint: Joint | None) -> None:
        """Adds the body that starts at `link` and everything below it, except behind floating joints."""
        index = len(self.bodies)
        merged, moving = self._merge_fixed(link)
        body = BodyPlan(
            name=link,
            parent=parent,
            pose=pose,
            joint=joint,
            links=[name for name, _ in merged],
            collisions=[_moved(piece, at) for name, at in merged for piece in self._pieces.get(name, ())],
            visuals=[part for name, at in merged for part in self._visuals(name, at)],
            inertial=merge_inertials([(self._inertials[name], at) for name, at in merged]),
            com=self._igibson_com(merged),
            hulls_as_visuals=any(self._draws_hulls(name) for name, _ in merged),
        )
        self.bodies.append(body)
        for name, at in merged:
            self.link_poses[name] = (index, at)
        self._ensure_movable(body)
        for child, at in moving:
            self.add_tree(child.child, index, at @ child.origin, child)

    def _merge_fixed(self, link: str) -> tuple[list[tuple[str, np.ndarray]], list[tuple[Joint, np.ndarray]]]:
        """Links rigidly joined to `link` with their poses in it, and the moving joints that leave them."""
        merged, moving, open_links = [], [], [(link, np.eye(4))]
        while open_links:
            name, pose = open_links.pop(0)
            merged.append((name, pose))
            for joint in self._children.get(name, ()):
                if joint.type == "fixed":
                    open_links.append((joint.child, pose @ joint.origin))
                elif joint.type != "floating" and is_locked(joint):
                    self.warnings.append(f"joint '{joint.name}' has equal limits; treated as fixed")
                    open_links.append((joint.child, pose @ joint.origin @ motion(joint, clamp(joint, 0.0))))
                elif joint.type != "floating":
                    moving.append((joint, pose))
        return merged, moving

    def _igibson_com(self, merged: list[tuple[str, np.ndarray]]) -> np.ndarray:
        total, weighted = 0.0, np.zeros(3)
        for name, at in merged:
            com = self._model.links[name].com
            point = at[:3, :3] @ (np.zeros(3) if com is None else com) + at[:3, 3]
            mass = self._inertials[name].mass
            total, weighted = total + mass, weighted + mass * point
        return weighted / total if total > 0 else np.zeros(3)

    def _draws_hulls(self, link: str) -> bool:
        """Whether a link shows its collision pieces: its visuals are encrypted, or the whole object has none."""
        shapes = self._model.links[link].visuals
        if any(_is_drawable(shape) for shape in shapes):
            return False
        return bool(self._pieces.get(link)) and (any(shape.encrypted for shape in shapes) or not self._any_visual)

    def _visuals(self, link: str, at: np.ndarray) -> list[VisualPart]:
        drawable = [shape for shape in self._model.links[link].visuals if _is_drawable(shape)]
        if self._igibson_visuals:
            if not self._model.links[link].collisions:
                drawable = []
            if any(shape.kind == "mesh" for shape in drawable):
                drawable = [shape for shape in drawable if shape.kind == "mesh"]
        parts = [part for shape in drawable for part in _visual_parts(shape, at)]
        kept = [part for part in parts if part.kind != "mesh" or _corners(part) >= LEAST_CORNERS]
        if few := len(parts) - len(kept):
            what = "a visual mesh has" if few == 1 else f"{few} visual meshes have"
            self.warnings.append(f"link '{link}': {what} fewer than {LEAST_CORNERS} vertices and is left out")
        return kept

    def _ensure_movable(self, body: BodyPlan) -> None:
        inertial = body.inertial
        if inertial.mass < MIN_MASS:
            if inertial.mass <= 0 and body.parent is None and body.name == self._model.base:
                self.warnings.append(
                    f"base link '{body.name}' has no mass (Bullet would make the object static); {MIN_MASS} kg assigned"
                )
            inertial.mass = MIN_MASS
        floor = inertial.mass * MIN_GYRATION_RADIUS**2
        values, axes = np.linalg.eigh((inertial.inertia + inertial.inertia.T) / 2)
        values = np.maximum(values, floor)
        values[2] = min(values[2], values[0] + values[1])
        margin = MOMENT_MARGIN * values[2]
        values[0] = max(values[0], 3 * margin)
        values[2] = min(values[2], values[0] + values[1] - margin)
        inertial.inertia = axes @ np.diag(values) @ axes.T


def has_own_look(assembly: Assembly) -> bool:
    """Whether the visuals say how the object looks: a texture, or more than one colour."""
    parts = [part for body in assembly.bodies for part in body.visuals]
    return any(part.texture for part in parts) or len({part.rgba for part in parts if part.rgba is not None}) > 1


def merge_inertials(parts: Sequence[tuple[Inertial, np.ndarray]]) -> Inertial:
    """One inertial out of several, each with the 4x4 pose of its link in the common frame; axes of the common frame.

    The pose of the result is a translation to the common centre of mass.
    """
    mass = float(sum(inertial.mass for inertial, _ in parts))
    frames = [(inertial, at @ inertial.pose) for inertial, at in parts]
    centre = frames[0][1][:3, 3].copy()
    if mass > 0:
        centre = sum((inertial.mass * frame[:3, 3] for inertial, frame in frames), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for inertial, frame in frames:
        rotation, arm = frame[:3, :3], frame[:3, 3] - centre
        steiner = inertial.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        inertia += rotation @ inertial.inertia @ rotation.T + steiner
    pose = np.eye(4)
    pose[:3, 3] = centre
    return Inertial(mass=mass, inertia=inertia, pose=pose)


def extent(assembly: Assembly, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the collision pieces of the base's tree, the base at `pose`, joints at 0."""
    poses: dict[int, np.ndarray] = {0: pose}
    points = []
    for index, body in enumerate(assembly.bodies):
        if body.parent is not None and body.parent in poses:
            poses[index] = poses[body.parent] @ body.pose
        if index in poses:
            points += [apply(poses[index], piece.vertices) for piece in body.collisions]
    cloud = np.concatenate(points) if points else pose[None, :3, 3]
    return cloud.min(axis=0), cloud.max(axis=0)


def _poses_at_zero(model: ObjectModel) -> dict[str, np.ndarray]:
    """Pose of every link in the base link's frame with all joints at 0, floating joints included."""
    poses = {model.base: np.eye(4)}
    pending = list(model.joints.values())
    while pending:
        waiting = []
        for joint in pending:
            if joint.parent in poses:
                poses[joint.child] = poses[joint.parent] @ joint.origin
            else:
                waiting.append(joint)
        assert len(waiting) < len(pending), "the reader lets only connected trees through"
        pending = waiting
    return poses


def _moved(piece: HullPiece, at: np.ndarray) -> HullPiece:
    """A piece of a merged link in the body's frame; the vertices are in that frame whatever the piece's own pose."""
    if np.array_equal(at, np.eye(4)):
        return piece
    pose = piece.pose if piece.kind == "hull" else at @ piece.pose
    return dataclasses.replace(piece, pose=pose, vertices=apply(at, piece.vertices))


def _corners(part: VisualPart) -> int:
    """Vertices of a mesh at different places; of a mesh with enough of them those among its first."""
    assert part.vertices is not None
    first = len(np.unique(np.round(part.vertices[:100], 7), axis=0))
    return first if first >= LEAST_CORNERS else len(np.unique(np.round(part.vertices, 7), axis=0))


def _is_drawable(shape: Shape) -> bool:
    return shape.kind != "mesh" or any(len(mesh.faces) for mesh in shape.meshes)


def _visual_parts(shape: Shape, at: np.ndarray) -> list[VisualPart]:
    """A visual in its body's frame. The untextured groups of a mesh file are joined: they share one colour."""
    pose = at @ shape.pose
    if shape.kind != "mesh":
        return [VisualPart(kind=shape.kind, pose=pose, size=tuple(shape.size), rgba=shape.rgba)]
    meshes = [mesh for mesh in shape.meshes if len(mesh.faces)]
    textured = shape.texture is not None and shape.uv is not None
    uv = None
    if textured and shape.uv is not None:
        uv = np.concatenate([uv for mesh, uv in zip(shape.meshes, shape.uv, strict=True) if len(mesh.faces)])
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return [
        VisualPart(
            kind="mesh",
            pose=pose,
            vertices=np.concatenate([mesh.vertices for mesh in meshes]),
            faces=np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
            uv=uv,
            rgba=shape.rgba,
            texture=shape.texture if textured else None,
        )
    ]


def _without_meshes(model: ObjectModel) -> ObjectModel:
    """A copy that is cheap to send between processes: links keep their names, not their geometry."""
    links = {name: dataclasses.replace(link, collisions=[], visuals=[]) for name, link in model.links.items()}
    return dataclasses.replace(model, links=links, metadata=dataclasses.replace(model.metadata, raw={}), warnings=[])
