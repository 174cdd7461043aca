"""Tiny objects, datasets and scenes, written into a temporary folder."""

from __future__ import annotations

import json
import pathlib
from typing import Any

import numpy as np
import pytest
from PIL import Image

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def box_obj(size=(1, 1, 1), centre=(0, 0, 0), group: str | None = None, first: int = 0) -> str:
    """OBJ text of a box of quads, outward normals; `first`: how many vertices stand before it."""
    lines = [] if group is None else [f"o {group}"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in (CORNERS * size + centre).tolist()]
    lines += ["f " + " ".join(str(1 + first + i) for i in side) for side in SIDES]
    return "\n".join(lines) + "\n"


def boxes_obj(*boxes: tuple) -> str:
    """OBJ text of (size, centre) boxes, one `o` group each."""
    return "".join(box_obj(size, centre, f"convex_{i}", 8 * i) for i, (size, centre) in enumerate(boxes))


def origin(xyz=(0, 0, 0), rpy=(0, 0, 0)) -> str:
    return f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(map(str, rpy))}"/>'


def shape(tag: str, mesh: str, xyz=(0, 0, 0), rpy=(0, 0, 0), scale: str = "") -> str:
    extra = f' scale="{scale}"' if scale else ""
    return f'<{tag}>{origin(xyz, rpy)}<geometry><mesh filename="{mesh}"{extra}/></geometry></{tag}>'


def link(name: str, *inside: str) -> str:
    return f'<link name="{name}">{"".join(inside)}</link>'


def joint(name: str, kind: str, parent: str, child: str, *inside: str, xyz=(0, 0, 0), rpy=(0, 0, 0)) -> str:
    return (
        f'<joint name="{name}" type="{kind}">{origin(xyz, rpy)}<parent link="{parent}"/><child link="{child}"/>'
        f"{''.join(inside)}</joint>"
    )


def axis(x, y, z) -> str:
    return f'<axis xyz="{x} {y} {z}"/>'


def limit(lower, upper) -> str:
    return f'<limit lower="{lower}" upper="{upper}"/>'


def robot(*inside: str) -> str:
    return f'<?xml version="1.0"?>\n<robot name="r">\n{"".join(f"{i}{chr(10)}" for i in inside)}</robot>\n'


def metadata(size, offset=(0, 0, 0), **more: Any) -> str:
    return json.dumps({"bbox_size": list(size), "base_link_offset": list(offset), **more})


def scene_link(name: str, category: str = "cup", model: str = "m", **attributes: str) -> str:
    words = "".join(f" {k}='{v}'" for k, v in attributes.items())
    return f"<link name='{name}' category='{category}' model='{model}'{words}/>"


def scene_joint(name: str, kind: str = "floating", xyz=(0, 0, 0), rpy=(0, 0, 0)) -> str:
    return (
        f'<joint name="j_{name}" type="{kind}">{origin(xyz, rpy)}<child link="{name}"/><parent link="world"/></joint>'
    )


class Folder:
    """A dataset root, or any folder, that files are written into."""

    def __init__(self, root: pathlib.Path):
        self.root = root

    def write(self, name: str, content: str | bytes) -> pathlib.Path:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def object(
        self, urdf: str, category="cup", model="m", meshes: dict[str, str] | None = None, meta: str = ""
    ) -> None:
        """objects/<category>/<model> with its URDF, meshes and metadata."""
        home = f"objects/{category}/{model}"
        self.write(f"{home}/{model}.urdf", urdf)
        for name, content in (meshes or {}).items():
            self.write(f"{home}/{name}", content)
        if meta:
            self.write(f"{home}/misc/metadata.json", meta)

    def scene(self, *inside: str, name="S_int", file: str | None = None) -> pathlib.Path:
        return self.write(f"scenes/{name}/urdf/{file or name + '_best.urdf'}", robot('<link name="world"/>', *inside))

    def image(self, name: str, pixels: np.ndarray) -> pathlib.Path:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(path)
        return path


@pytest.fixture
def folder(tmp_path: pathlib.Path) -> Folder:
    """An empty folder."""
    return Folder(tmp_path / "root")


@pytest.fixture
def root(folder: Folder) -> Folder:
    """A dataset root with VERSION and metadata/, and one rigid object cup/m: a box of 0.1 x 0.2 x 0.4 m."""
    folder.write("VERSION", "2.0.6\n")
    folder.write(
        "metadata/avg_category_specs.json",
        json.dumps({"cup": {"size": [0.1, 0.2, 0.4], "mass": 0.8, "density": 100.0, "enable_ag": 1}}),
    )
    folder.write("metadata/categories.txt", "cup\ntable\n")
    folder.write("metadata/room_categories.txt", "bathroom\nbedroom\nkitchen\n")
    folder.write("metadata/non_sampleable_categories.txt", "sink.n.01\n")
    folder.object(
        robot(link("base_link", shape("visual", "shape/v.obj"), shape("collision", "shape/c.obj"))),
        meshes={
            "shape/v.obj": box_obj((0.1, 0.2, 0.4)),
            "shape/c.obj": box_obj((0.1, 0.2, 0.4), group="convex_0"),
        },
        meta=metadata((0.1, 0.2, 0.4)),
    )
    return folder


class Samples:
    """The functions above, for tests: files of a test folder cannot import one another."""

    box_obj = staticmethod(box_obj)
    boxes_obj = staticmethod(boxes_obj)
    shape = staticmethod(shape)
    link = staticmethod(link)
    joint = staticmethod(joint)
    axis = staticmethod(axis)
    limit = staticmethod(limit)
    origin = staticmethod(origin)
    robot = staticmethod(robot)
    metadata = staticmethod(metadata)
    scene_link = staticmethod(scene_link)
    scene_joint = staticmethod(scene_joint)


@pytest.fixture
def make() -> Samples:
    return Samples()
