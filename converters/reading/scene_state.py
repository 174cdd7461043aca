"""The JSON attributes of cached scenes: body poses, velocities, joint states, offsets (iGibson's dataset format)."""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np

from ig2mj.errors import InputError

from ..base.transforms import wxyz
from ..base.xml_reader import Element, where
from .json_reader import decode_json, scalar, vector


def read_body_poses(link: Element, file: pathlib.Path) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """base_poses: (position [3], quaternion w, x, y, z [4]) per body, of its centre-of-mass frame."""
    return _pairs(link, "base_poses", 4, file)


def read_pose_offsets(link: Element, file: pathlib.Path) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """pose_offsets of a grouper: (position [3], quaternion w, x, y, z [4]) per part."""
    return _pairs(link, "pose_offsets", 4, file)


def read_body_velocities(link: Element, file: pathlib.Path) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """base_velocities: (linear [3], angular [3]) per body."""
    return _pairs(link, "base_velocities", 3, file)


def read_joint_states(link: Element, file: pathlib.Path) -> dict[str, tuple[float, float]] | None:
    """joint_states {joint: [q, qd]}, else the legacy joint_positions [{joint: q}, ...], of which only the first counts.

    Names are as written, with the instance's prefix; unknown ones are the caller's to ignore.
    """
    attribute = "joint_states"
    value = _json(link, attribute, file)
    if value is None:
        attribute = "joint_positions"
        value = _json(link, attribute, file)
        if isinstance(value, list):
            value = value[0] if value else {}
    if value is None:
        return None
    if not isinstance(value, dict):
        raise InputError(file, f"attribute '{attribute}' holds no joints by name", element=where(link))
    states: dict[str, tuple[float, float]] = {}
    for joint, entry in value.items():
        at = f"{where(link)} attribute '{attribute}' joint '{joint}'"
        if isinstance(entry, list):
            if len(entry) not in (1, 2):
                raise InputError(file, "is not [q, qd]", element=at)
            states[joint] = (scalar(entry[0], file, at), scalar(entry[1], file, at) if len(entry) == 2 else 0.0)
        elif entry is not None:
            states[joint] = (scalar(entry, file, at), 0.0)
    return states


def _json(link: Element, attribute: str, file: pathlib.Path) -> Any:
    text = link.get(attribute)
    if text is None or not text.strip():
        return None
    return decode_json(text, file, f"{where(link)} attribute '{attribute}'")


def _pairs(
    link: Element, attribute: str, second: int, file: pathlib.Path
) -> list[tuple[np.ndarray, np.ndarray]] | None:
    """[[[3 numbers], [`second` numbers]], ...]; four numbers are a quaternion x, y, z, w and become w, x, y, z."""
    value = _json(link, attribute, file)
    if value is None:
        return None
    at = f"{where(link)} attribute '{attribute}'"
    if not isinstance(value, list) or not all(isinstance(item, list) and len(item) == 2 for item in value):
        raise InputError(file, "is not a list of pairs", element=at)
    pairs = []
    for first, other in value:
        tail = vector(other, second, file, at)
        pairs.append((vector(first, 3, file, at), wxyz(tail) if second == 4 else tail))
    return pairs
