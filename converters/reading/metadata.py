"""misc/metadata.json of an object (iGibson's dataset format)."""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np

from ig2mj.errors import InputError

from ..base import inputs
from ..base.description import Metadata, MetaLink, ObjectPart, StableOrientation
from ..base.transforms import wxyz
from .json_reader import read_json, scalar, vector


def read_metadata(folder: pathlib.Path, warnings: list[str]) -> Metadata:
    """Metadata of a model folder: misc/metadata.json, else misc/bbox.json, else empty.

    Raises:
      InputError: a file is not JSON or a field has the wrong form.
    """
    file = folder / "misc" / "metadata.json"
    if inputs.is_file(file):
        return _parse(read_json(file, dict), file, warnings)
    old = folder / "misc" / "bbox.json"
    if inputs.is_file(old):
        raw = read_json(old, dict)
        high, low = (vector(raw.get(key), 3, old, f"'{key}'") for key in ("max", "min"))
        size = _positive(high - low, old, "'max' - 'min'")
        return Metadata(bbox_size=size, base_link_offset=(high + low) / 2, raw=raw)
    warnings.append("no misc/metadata.json: size unknown, so scales are used as given")
    return Metadata()


def _parse(raw: dict[str, Any], file: pathlib.Path, warnings: list[str]) -> Metadata:
    data = Metadata(raw=raw)
    if raw.get("bbox_size") is not None:
        data.bbox_size = _positive(vector(raw["bbox_size"], 3, file, "'bbox_size'"), file, "'bbox_size'")
        offset = raw.get("base_link_offset")
        data.base_link_offset = np.zeros(3) if offset is None else vector(offset, 3, file, "'base_link_offset'")
    else:
        warnings.append("metadata.json has no bbox_size, so scales are used as given")
    for i, item in enumerate(_list(raw, "orientations", file)):
        at = f"orientation {i}"
        _expect(item, dict, file, at)
        size = item.get("size")
        quat = wxyz(vector(item.get("rotation"), 4, file, f"{at} 'rotation'"))
        fallback = data.bbox_size if data.bbox_size is not None else np.zeros(3)
        data.orientations.append(
            StableOrientation(
                quat=quat,
                prob=max(scalar(item.get("prob", 1.0), file, f"{at} 'prob'"), 0.0),
                size=fallback.copy() if size is None else vector(size, 3, file, f"{at} 'size'"),
            )
        )
    links = raw.get("links") or {}
    _expect(links, dict, file, "'links'")
    for name, item in links.items():
        data.links[name] = _meta_link(name, item, file)
    for i, item in enumerate(_list(raw, "openable_joint_ids", file)):
        data.openable_joints.append(_openable(item, file, f"openable joint {i}"))
    data.openable_both_sides = bool(raw.get("openable_both_sides", False))
    data.keep_inertials = bool(raw.get("keep_inertials", False))
    for i, item in enumerate(_list(raw, "object_parts", file)):
        data.object_parts.append(_part(item, file, f"object part {i}"))
    return data


def _meta_link(name: str, item: Any, file: pathlib.Path) -> MetaLink:
    at = f"link '{name}'"
    if isinstance(item, list):  # the oldest form: a point
        return MetaLink(name, vector(item, 3, file, at))
    _expect(item, dict, file, at)
    geometry = item.get("geometry")
    if geometry not in (None, "box"):
        raise InputError(file, f"geometry '{geometry}' is neither null nor \"box\"", element=at)
    size = item.get("size")
    if geometry == "box" and size is None:
        raise InputError(file, "a box needs a size", element=at)
    rpy = item.get("rpy")
    return MetaLink(
        name,
        xyz=vector(item.get("xyz"), 3, file, f"{at} 'xyz'"),
        rpy=np.zeros(3) if rpy is None else vector(rpy, 3, file, f"{at} 'rpy'"),
        size=_positive(vector(size, 3, file, f"{at} 'size'"), file, f"{at} 'size'") if geometry == "box" else None,
        geometry=geometry,
    )


def _openable(item: Any, file: pathlib.Path, at: str) -> tuple[str, int]:
    """[id, "joint"] or [id, "joint", direction]: the id is a pybullet id, of no use elsewhere."""
    if not isinstance(item, list) or len(item) not in (2, 3) or not isinstance(item[1], str):
        raise InputError(file, 'is not [id, "joint name"] or [id, "joint name", direction]', element=at)
    direction = item[2] if len(item) == 3 else 1
    if direction not in (1, -1):
        raise InputError(file, f"direction {direction} is neither 1 nor -1", element=at)
    return item[1], int(direction)


def _part(item: Any, file: pathlib.Path, at: str) -> ObjectPart:
    _expect(item, dict, file, at)
    names = item.get("category"), item.get("model")
    if not all(isinstance(n, str) and n for n in names):
        raise InputError(file, "names no category and model", element=at)
    pos = vector(item.get("pos"), 3, file, f"{at} 'pos'")
    return ObjectPart(str(names[0]), str(names[1]), pos, wxyz(vector(item.get("orn"), 4, file, f"{at} 'orn'")))


def _list(raw: dict[str, Any], key: str, file: pathlib.Path) -> list[Any]:
    value = raw.get(key) or []
    _expect(value, list, file, f"'{key}'")
    return value


def _expect(value: Any, kind: type, file: pathlib.Path, at: str) -> None:
    if not isinstance(value, kind):
        raise InputError(file, f"is a {type(value).__name__} instead of a {kind.__name__}", element=at)


def _positive(size: np.ndarray, file: pathlib.Path, at: str) -> np.ndarray:
    if np.any(size <= 0):
        raise InputError(file, f"size {size.tolist()} is not positive", element=at)
    return size
