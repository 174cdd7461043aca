"""Where an object's links and shapes are at joint positions 0; those of locked joints, at their limit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..base.description import ObjectModel, Shape
from ..base.transforms import apply
from .joint_limits import clamp, is_locked, motion


def link_poses(model: ObjectModel, joints: Mapping[str, float] | None = None) -> dict[str, np.ndarray]:
    """link -> 4x4 in the base link's frame; floating joints at their origin.

    joints: positions of joints by name, rad or m; default 0, or the limit of a joint that has no room to move.
    """
    given = joints or {}
    children: dict[str, list[tuple[str, np.ndarray]]] = {name: [] for name in model.links}
    for joint in model.joints.values():
        position = given.get(joint.name, clamp(joint, 0.0) if is_locked(joint) else 0.0)
        moved = joint.origin @ motion(joint, position) if position else joint.origin
        children[joint.parent].append((joint.child, moved))
    poses = {model.base: np.eye(4)}
    queue = [model.base]
    while queue:
        parent = queue.pop()
        for child, origin in children[parent]:
            poses[child] = poses[parent] @ origin
            queue.append(child)
    return poses


def shape_bounds(shape: Shape, frame: np.ndarray | None = None) -> np.ndarray | None:
    """[2, 3] lowest and highest corner of a shape in its link's frame, or in `frame` @ link; None without points."""
    pose = shape.pose if frame is None else frame @ shape.pose
    rotation, centre = pose[:3, :3], pose[:3, 3]
    if shape.kind == "mesh":
        points = [apply(pose, m.vertices * np.array(shape.scale)) for m in shape.meshes if len(m.vertices)]
        if not points:
            return None
        stacked = np.concatenate(points)
        return np.array([stacked.min(axis=0), stacked.max(axis=0)])
    if shape.kind == "box":
        half = np.abs(rotation) @ (np.array(shape.size) / 2)
    elif shape.kind == "sphere":
        half = np.full(3, shape.size[0])
    else:
        radius, length = shape.size
        along = np.abs(rotation[:, 2])
        across = np.sqrt(np.clip(1 - along**2, 0, 1)) if shape.kind == "cylinder" else np.ones(3)
        half = radius * across + length / 2 * along
    return np.array([centre - half, centre + half])


def model_bounds(model: ObjectModel, visuals: bool = False) -> np.ndarray | None:
    """[2, 3] box of all collision shapes (or all visuals) in the base frame with joints at 0; None without shapes."""
    poses = link_poses(model)
    boxes = []
    for name, link in model.links.items():
        for shape in link.visuals if visuals else link.collisions:
            if (box := shape_bounds(shape, poses[name])) is not None:
                boxes.append(box)
    if not boxes:
        return None
    stacked = np.array(boxes)
    return np.array([stacked[:, 0].min(axis=0), stacked[:, 1].max(axis=0)])
