"""One object as MJCF elements: bodies, joints, inertials, geoms, annotated links, excludes."""

from __future__ import annotations

import dataclasses
import itertools

import mujoco
import numpy as np

from ig2mj.scene.manifest import LinkEntry

from ..base.description import MetaLink
from ..base.transforms import pose_from, quat_from_rotation
from ..bodies.assembly import Assembly, BodyPlan, VisualPart
from ..bodies.joint_limits import clamp, is_locked, joint_range, mujoco_type, unit_axis
from ..bodies.joint_rules import ARMATURE, DAMPING, friction, reach
from ..hulls.pieces import HullPiece
from .colours import Rgba, category_colour
from .model_builder import FRICTION, HIDDEN_GROUP, ROLLING_FRICTION, ModelBuilder

#: The annotated links that states know (iGibson's dataset format; water_sink is ours, paper table A.3).
LINK_KINDS = ("heat_source", "toggle_button", "water_source", "water_sink", "slicer", "cleaning_tool_area")

_GEOM_TYPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
}


@dataclasses.dataclass
class ObjectElements:
    """Names of what an object became.

    Attributes:
      bodies: MJCF body of each of the assembly's bodies, same order.
      joints: joint of the URDF -> MJCF joint.
      free_joints: MJCF free joint of each root body that has one.
      links: annotated links, as the manifest lists them.
    """

    bodies: list[str]
    joints: dict[str, str]
    free_joints: dict[str, str]
    links: dict[str, LinkEntry]


def add_object(
    builder: ModelBuilder,
    assembly: Assembly,
    name: str,
    root_poses: list[np.ndarray],
    *,
    fixed: bool,
    collide: bool = True,
    visual_group: int | None = None,
) -> ObjectElements:
    """Adds an object to the model.

    Args:
      name: of the object; also of its base body. Other bodies and joints are `<name>_<original name>`.
      root_poses: world pose, 4x4, of each root body of the assembly, the base first.
      fixed: the base gets no joint. Bodies behind floating joints are free whatever the base is.
      collide: False leaves the collision geoms out.
      visual_group: geom group of the visuals, default 0.
    """
    return _ObjectWriter(builder, assembly, name, collide, visual_group).write(root_poses, fixed)


class _ObjectWriter:
    def __init__(
        self,
        builder: ModelBuilder,
        assembly: Assembly,
        name: str,
        collide: bool,
        visual_group: int | None,
    ):
        self._builder, self._assembly, self._name = builder, assembly, name
        self._collide, self._visual_group = collide, visual_group
        self._category = assembly.model.category
        self._label = f"{self._category}-{assembly.model.model}"
        self._colour = category_colour(self._category)

    def write(self, root_poses: list[np.ndarray], fixed: bool) -> ObjectElements:
        builder, bodies = self._builder, self._assembly.bodies
        poses = dict(zip(self._assembly.roots, root_poses, strict=True))
        elements = ObjectElements([], {}, {}, {})
        added: list[mujoco.MjsBody] = []
        for index, plan in enumerate(bodies):
            name = builder.body_names.take(self._name if index == 0 else f"{self._name}_{plan.name}")
            parent = builder.spec.worldbody if plan.parent is None else added[plan.parent]
            body = parent.add_body(name=name)
            body.pos, body.quat = pos_quat(poses[index] if plan.parent is None else plan.pose)
            self._add_inertial(body, plan)
            if plan.joint is not None:
                elements.joints[plan.joint.name] = self._add_joint(body, index)
            elif index > 0 or not fixed:
                elements.free_joints[name] = builder.joint_names.take(f"{name}/free")
                body.add_freejoint(name=elements.free_joints[name])
            self._add_geoms(body, plan, name)
            added.append(body)
            elements.bodies.append(name)
        elements.links = self._add_links(added[0])
        self._add_mimics(elements.joints)
        self._add_excludes(elements.bodies)
        return elements

    def _add_inertial(self, body: mujoco.MjsBody, plan: BodyPlan) -> None:
        inertial, tensor = plan.inertial, plan.inertial.inertia
        body.explicitinertial = True
        body.mass = inertial.mass
        body.ipos = inertial.pose[:3, 3]
        if np.allclose(tensor, np.diag(np.diag(tensor)), rtol=0, atol=1e-9 * np.trace(tensor)):
            body.inertia = np.diag(tensor)
        else:
            xx, yy, zz = np.diag(tensor)
            body.fullinertia = [xx, yy, zz, tensor[0, 1], tensor[0, 2], tensor[1, 2]]

    def _add_joint(self, body: mujoco.MjsBody, index: int) -> str:
        source = self._assembly.bodies[index].joint
        assert source is not None
        kind = mujoco_type(source)
        name = self._builder.joint_names.take(f"{self._name}_{source.name}")
        joint = body.add_joint(name=name)
        joint.type = mujoco.mjtJoint.mjJNT_SLIDE if kind == "slide" else mujoco.mjtJoint.mjJNT_HINGE
        joint.axis = unit_axis(source)
        limits = joint_range(source)
        if limits is not None:
            joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, limits
        joint.frictionloss = friction(source, self._category, reach(self._assembly, index))
        joint.damping = (max(source.damping, DAMPING[kind]), 0.0, 0.0)  # linear in velocity
        joint.armature = ARMATURE[kind]
        return name

    def _add_geoms(self, body: mujoco.MjsBody, plan: BodyPlan, name: str) -> None:
        if self._collide:
            for i, piece in enumerate(plan.collisions):
                self._add_piece(body, piece, plan.name, f"{name}/collision_{i}", visual=False)
        visuals = [(part, None) for part in plan.visuals]
        if plan.hulls_as_visuals:
            visuals += [(None, piece) for piece in plan.collisions]
        for i, (part, piece) in enumerate(visuals):
            if part is not None:
                self._add_visual(body, part, plan.name, f"{name}/visual_{i}")
            elif piece is not None:
                self._add_piece(body, piece, plan.name, f"{name}/visual_{i}", visual=True)

    def _add_piece(self, body: mujoco.MjsBody, piece: HullPiece, link: str, name: str, *, visual: bool) -> None:
        geom = body.add_geom(self._builder.visual_class if visual else self._builder.collision_class)
        geom.name, geom.rgba = name, self._colour
        if piece.kind == "hull":
            geom.type = mujoco.mjtGeom.mjGEOM_MESH
            geom.meshname = self._builder.meshes.add(piece.vertices, piece.faces, f"{self._label}-{link}-hull")
        else:
            _set_primitive(geom, piece.kind, piece.size, piece.pose)
            if not visual and piece.kind != "box":
                geom.condim = 6
                geom.friction = (FRICTION[0], FRICTION[1], ROLLING_FRICTION)
        if visual:
            self._set_visual_group(geom)

    def _add_visual(self, body: mujoco.MjsBody, part: VisualPart, link: str, name: str) -> None:
        geom = body.add_geom(self._builder.visual_class)
        own = None if self._builder.category_colours else part.rgba
        geom.name, geom.rgba = name, own or self._colour
        if part.kind == "mesh":
            assert part.vertices is not None and part.faces is not None
            geom.type = mujoco.mjtGeom.mjGEOM_MESH
            geom.pos, geom.quat = pos_quat(part.pose)
            geom.meshname = self._builder.meshes.add(
                part.vertices, part.faces, f"{self._label}-{link}-visual", uv=part.uv, surface=True
            )
            material = self._builder.textures.material(part.texture) if part.texture else None
            if material is not None:
                geom.material, geom.rgba = material, (1.0, 1.0, 1.0, 1.0)
        else:
            _set_primitive(geom, part.kind, part.size, part.pose)
        self._set_visual_group(geom)

    def _set_visual_group(self, geom) -> None:
        if self._visual_group is not None:
            geom.group = self._visual_group

    def _add_links(self, base: mujoco.MjsBody) -> dict[str, LinkEntry]:
        entries: dict[str, LinkEntry] = {}
        for kind, link in self._assembly.model.metadata.links.items():
            if kind not in LINK_KINDS:
                self._builder.warn(self._name, f"annotated link '{kind}' is of no known kind and left out")
                continue
            element = f"{self._name}/{kind}"
            if link.geometry is None:
                site = base.add_site(name=element, pos=link.xyz, size=(0.02, 0.02, 0.02), group=HIDDEN_GROUP)
                site.rgba = _LINK_COLOURS[kind]
                entries[kind] = LinkEntry(site=element)
            elif link.size is None or np.any(np.asarray(link.size) <= 0):
                self._builder.warn(self._name, f"annotated link '{kind}' has a box without a size and is left out")
            else:
                self._add_link_box(base, link, element)
                entries[kind] = LinkEntry(geom=element)
        return entries

    def _add_link_box(self, base: mujoco.MjsBody, link: MetaLink, element: str) -> None:
        geom = base.add_geom(self._builder.collision_class)
        geom.name, geom.rgba = element, _LINK_COLOURS[link.name]
        assert link.size is not None
        _set_primitive(geom, "box", tuple(link.size), pose_from(link.xyz, link.rpy))

    def _add_mimics(self, joints: dict[str, str]) -> None:
        """Follower = multiplier x leader + offset: both joints have their reference at position 0."""
        for joint in self._assembly.joints():
            if joint.mimic is None:
                continue
            leader, source = joints.get(joint.mimic.joint), self._assembly.model.joints.get(joint.mimic.joint)
            offset, multiplier = joint.mimic.offset, joint.mimic.multiplier
            if leader is None:
                if source is None or not is_locked(source):
                    text = f"joint '{joint.name}' mimics '{joint.mimic.joint}', which does not move: left independent"
                    self._builder.warn(self._name, text)
                    continue
                offset, multiplier = offset + multiplier * clamp(source, 0.0), 0.0
            name = f"{joints[joint.name]}/mimic"
            equality = self._builder.spec.add_equality(name=name, type=mujoco.mjtEq.mjEQ_JOINT)
            equality.name1, equality.name2 = joints[joint.name], leader or ""
            equality.data[:5] = [offset, multiplier, 0.0, 0.0, 0.0]

    def _add_excludes(self, names: list[str]) -> None:
        """No contacts between bodies of one tree; split-off bodies do touch the rest."""
        trees: dict[int, list[int]] = {}
        root: dict[int, int] = {}
        for index, plan in enumerate(self._assembly.bodies):
            root[index] = index if plan.parent is None else root[plan.parent]
            trees.setdefault(root[index], []).append(index)
        for tree in trees.values():
            for a, b in itertools.combinations(tree, 2):
                exclude = self._builder.spec.add_exclude(name=f"{names[a]}--{names[b]}")
                exclude.bodyname1, exclude.bodyname2 = names[a], names[b]


_LINK_COLOURS: dict[str, Rgba] = {
    "heat_source": (0.95, 0.35, 0.15, 0.8),
    "toggle_button": (0.85, 0.15, 0.20, 0.8),
    "water_source": (0.20, 0.50, 0.95, 0.8),
    "water_sink": (0.15, 0.30, 0.70, 0.8),
    "slicer": (0.80, 0.80, 0.85, 0.5),
    "cleaning_tool_area": (0.30, 0.75, 0.45, 0.5),
}


def pos_quat(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and quaternion (w, x, y, z; w >= 0) of a 4x4."""
    return pose[:3, 3], quat_from_rotation(pose[:3, :3])


def _set_primitive(geom, kind: str, size: tuple[float, ...], pose: np.ndarray) -> None:
    """Type, half sizes and pose of a primitive geom (sizes as `description.Shape` gives them)."""
    geom.type = _GEOM_TYPES[kind]
    geom.pos, geom.quat = pos_quat(pose)
    if kind == "box":
        geom.size = np.asarray(size, dtype=float) / 2
    elif kind == "sphere":
        geom.size = (size[0], 0.0, 0.0)
    else:
        geom.size = (size[0], size[1] / 2, 0.0)
