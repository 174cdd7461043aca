"""Scaling an articulated object per axis (iGibson's dataset format).

The whole object, at joint positions 0, is stretched by s along its base link's axes. A link whose frame is turned by R
against the base sees the linear map A = R^T diag(s) R, which is a shear where s is not uniform and R is no quarter
turn. iGibson applies diag(s) in every link frame instead: the same for trees without rotations, a distortion
for others. Here A is baked into the vertices, so the stretched object is right at joint positions 0; joints keep their
orientation, axes and origins are mapped with the geometry. The one object that has no rigid result is a hinge whose
axis is oblique to s in a turned frame: what is perpendicular to it would not stay so. That is refused.
"""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import trimesh

from ig2mj.errors import InputError

from ..base.description import Inertial, Instance, Joint, Link, Mesh, Metadata, Mimic, ObjectModel, Shape
from ..base.transforms import is_identity, pose_from, rotation_from_wxyz
from ..bodies.inertia import link_com
from ..bodies.kinematics import link_poses
from ..bodies.solids import covariance_of, inertia_of

OBLIQUE = 0.01
"""Sine of the angle by which a scale may turn a hinge's axis."""
STRAIGHT = 1e-3
"""Shear, relative, below which a primitive stays one."""
LARGE_RATIO = 3.0
"""max(s) / min(s) from which a warning is given."""


def instance_scale(instance: Instance, model: ObjectModel) -> np.ndarray:
    """Scale [3] of an instance: bounding_box / metadata.bbox_size, or its scale, or 1.

    A bounding box asked of a model that has none says nothing: scale 1.

    Raises:
      InputError: a scale that is not positive and finite.
    """
    if instance.bounding_box is not None and model.metadata.bbox_size is not None:
        s = np.asarray(instance.bounding_box, dtype=float) / model.metadata.bbox_size
    elif instance.scale is not None:
        s = np.asarray(instance.scale, dtype=float)
    else:
        s = np.ones(3)
    return _checked(s, model, f"object '{instance.name}'")


def scale_model(model: ObjectModel, s: np.ndarray | tuple[float, float, float] | float) -> ObjectModel:
    """A copy of the model scaled by s in its base link's axes.

    All meshes are baked: every shape's `scale` is 1 and its vertices are in the frame of the shape's `pose`. Joint
    origins, axes, prismatic limits, inertials and the metadata (bbox_size, base_link_offset, links, parts,
    orientations' sizes; not `raw`) are scaled too; `Link.com` is filled. `scale_model(model, 1)` only bakes.
    An URDF's own mass stays; its inertia is that of the stretched body. Spheres and cylinders, which iGibson leaves
    unscaled, are scaled, and become meshes where the scale is not uniform.

    Raises:
      InputError: s is not positive and finite, or no rigid articulated result exists.
    """
    s = _checked(np.broadcast_to(np.asarray(s, dtype=float), 3), model, f"model '{model.model}'")
    warnings = list(model.warnings)
    uniform = _is_uniform(s)
    turned = [name for name, pose in link_poses(model).items() if not is_identity(pose[:3, :3])]
    maps = link_maps(model, s)
    if s.max() > LARGE_RATIO * s.min():
        warnings.append(f"scaled very unevenly: {' x '.join(f'{v:.3g}' for v in s)}")
    if sheared := [name for name in turned if not _is_diagonal(maps[name])]:
        warnings.append(f"the uneven scale shears the turned links {', '.join(sheared[:5])}: baked into the vertices")
    links = {name: _scaled_link(link, maps[name], warnings) for name, link in model.links.items()}
    joints: dict[str, Joint] = {}
    factors: dict[str, float] = {}
    for name, joint in model.joints.items():
        # Base axes; where no frame is turned, these are the joint's own and the rule is iGibson's to the letter.
        exact = bool(turned) and not uniform
        joints[name], factors[name] = _scaled_joint(joint, model, maps, s, exact)
    for joint in joints.values():
        if joint.mimic is not None:
            f = factors[joint.name]
            ratio = f / factors.get(joint.mimic.joint, 1.0)
            joint.mimic = Mimic(joint.mimic.joint, joint.mimic.multiplier * ratio, joint.mimic.offset * f)
    return dataclasses.replace(
        model, links=links, joints=joints, metadata=_scaled_metadata(model.metadata, s), warnings=warnings
    )


def link_maps(model: ObjectModel, s: np.ndarray) -> dict[str, np.ndarray]:
    """link -> [3, 3], the map of its frame that stretches the whole object by s [3] along its base's axes."""
    maps = {}
    for name, pose in link_poses(model).items():
        rotation = pose[:3, :3]
        straight = _is_uniform(s) or is_identity(rotation)
        maps[name] = np.diag(s) if straight else rotation.T @ np.diag(s) @ rotation
    return maps


def _is_uniform(s: np.ndarray) -> bool:
    return float(np.ptp(s)) <= 1e-9 * float(s.max())


def _checked(s: np.ndarray, model: ObjectModel, element: str) -> np.ndarray:
    if s.shape != (3,) or not np.all(np.isfinite(s)) or np.any(s <= 0):
        raise InputError(model.file, f"scale {' '.join(f'{v:g}' for v in s)} is not positive", element=element)
    return np.array(s, dtype=float)


def _scaled_joint(
    joint: Joint, model: ObjectModel, maps: dict[str, np.ndarray], s: np.ndarray, exact: bool
) -> tuple[Joint, float]:
    """(scaled joint, factor of its position)."""
    origin = joint.origin.copy()
    origin[:3, 3] = maps[joint.parent] @ origin[:3, 3]
    stretched = maps[joint.child] @ joint.axis
    length = float(np.linalg.norm(stretched))
    axis = stretched / length
    if exact and joint.type in ("revolute", "continuous") and np.linalg.norm(np.cross(axis, joint.axis)) > OBLIQUE:
        raise InputError(
            model.file,
            f"the uneven scale {' '.join(f'{v:g}' for v in s)} would bend this hinge: its axis is oblique to the base",
            element=f"joint '{joint.name}'",
            fix="scale the object evenly",
        )
    factor = 1.0
    if joint.type == "prismatic":
        factor = length if exact else float(s[np.argmax(np.abs(joint.axis))])
    lower, upper = (None if limit is None else limit * factor for limit in (joint.lower, joint.upper))
    return dataclasses.replace(joint, origin=origin, axis=axis, lower=lower, upper=upper), factor


def _scaled_link(link: Link, linear: np.ndarray, warnings: list[str]) -> Link:
    com = link_com(link)
    return Link(
        link.name,
        collisions=[_scaled_shape(shape, linear, link.name, warnings) for shape in link.collisions],
        visuals=[_scaled_shape(shape, linear, link.name, warnings) for shape in link.visuals],
        inertial=None if link.inertial is None else _scaled_inertial(link.inertial, linear),
        com=None if com is None else linear @ com,
    )


def _scaled_shape(shape: Shape, linear: np.ndarray, link: str, warnings: list[str]) -> Shape:
    rotation = shape.pose[:3, :3]
    pose = shape.pose.copy()
    pose[:3, 3] = linear @ pose[:3, 3]
    inside = linear if is_identity(rotation) else rotation.T @ linear @ rotation
    if shape.kind == "mesh":
        inside = inside @ np.diag(shape.scale)
        meshes = [_mapped(mesh, inside) for mesh in shape.meshes]
        return dataclasses.replace(shape, pose=pose, meshes=meshes, scale=(1.0, 1.0, 1.0))
    diagonal = np.diag(inside)
    straight = _is_diagonal(inside)
    round_ = straight and np.isclose(diagonal[0], diagonal[1], rtol=1e-5)
    even = round_ and np.isclose(diagonal[0], diagonal[2], rtol=1e-5)
    size = None
    if shape.kind == "box" and straight:
        size = tuple(float(v) for v in np.array(shape.size) * diagonal)
    elif shape.kind == "cylinder" and round_:
        size = (shape.size[0] * float(diagonal[0]), shape.size[1] * float(diagonal[2]))
    elif shape.kind in ("sphere", "capsule") and even:
        size = tuple(v * float(diagonal[0]) for v in shape.size)
    if size is not None:
        return dataclasses.replace(shape, pose=pose, size=size)
    warnings.append(f"link '{link}': the uneven scale turns a {shape.kind} into a mesh")
    mesh = _mapped(_tessellated(shape), inside)
    return dataclasses.replace(shape, kind="mesh", pose=pose, size=(), meshes=[mesh], grouped=True, was_primitive=True)


def _is_diagonal(linear: np.ndarray) -> bool:
    """No shear worth a mesh: files write a quarter turn as 1.5708, or even 1.57."""
    diagonal = np.diag(linear)
    return bool(np.allclose(linear, np.diag(diagonal), rtol=0, atol=STRAIGHT * np.abs(diagonal).max()))


def _mapped(mesh: Mesh, linear: np.ndarray) -> Mesh:
    """Vertices under a linear map; a mirroring one turns the faces round so that they look outwards still."""
    faces = mesh.faces[:, ::-1] if np.linalg.det(linear) < 0 else mesh.faces
    return Mesh(mesh.vertices @ linear.T, faces, mesh.name)


def _tessellated(shape: Shape) -> Mesh:
    if shape.kind == "box":
        body = trimesh.creation.box(shape.size)
    elif shape.kind == "sphere":
        body = trimesh.creation.icosphere(subdivisions=2, radius=shape.size[0])
    elif shape.kind == "cylinder":
        body = trimesh.creation.cylinder(radius=shape.size[0], height=shape.size[1], sections=32)
    else:
        body = trimesh.creation.capsule(radius=shape.size[0], height=shape.size[1], count=(16, 16))
        body.vertices[:, 2] -= body.bounds[:, 2].mean()  # centred, as URDF has it
    return Mesh(np.array(body.vertices, dtype=float), np.array(body.faces, dtype=np.int64))


def _scaled_inertial(inertial: Inertial, linear: np.ndarray) -> Inertial:
    """Same mass; second moments under the linear map."""
    rotation = inertial.pose[:3, :3]
    pose = inertial.pose.copy()
    pose[:3, 3] = linear @ pose[:3, 3]
    inside = rotation.T @ linear @ rotation
    return Inertial(inertial.mass, inertia_of(inside @ covariance_of(inertial.inertia) @ inside.T), pose)


def _scaled_metadata(data: Metadata, s: np.ndarray) -> Metadata:
    raw = data.raw
    data = copy.deepcopy(dataclasses.replace(data, raw={}))
    data.raw = raw
    for link in data.links.values():
        if link.size is not None:  # the lengths of its stretched edges: s * size where rpy is 0
            edges = np.diag(s) @ pose_from(np.zeros(3), link.rpy)[:3, :3]
            link.size = link.size * np.linalg.norm(edges, axis=0)
        link.xyz = link.xyz * s
    for part in data.object_parts:
        part.pos = part.pos * s
    for orientation in data.orientations:
        turned = np.abs(rotation_from_wxyz(orientation.quat))
        box = data.bbox_size if data.bbox_size is not None else np.ones(3)
        orientation.size = orientation.size * (turned @ (s * box)) / (turned @ box)
    if data.bbox_size is not None:
        data.bbox_size = data.bbox_size * s
    if data.base_link_offset is not None:
        data.base_link_offset = data.base_link_offset * s
    return data
