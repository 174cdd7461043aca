"""A mesh that cannot be used gives an InputError whose one line names the file and what is wrong in it."""

from __future__ import annotations

import json
import struct

import pytest
from ig2mj_converters.reading.dataset import Dataset

from ig2mj.errors import InputError

MESH = "shape/c.obj"


def read_object(root):
    return Dataset(root.root).model("cup", "m")


def ball_of_faces(count: int) -> str:
    return "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * count


OBJS = {
    "empty": ("", "has no faces"),
    "vertices only": ("v 0 0 0\nv 1 0 0\n", "has no faces"),
    "all faces degenerate": ("v 0 0 0\nv 1 0 0\nf 1 1 2\nf 2 2 2\n", "degenerate"),
    "binary": ("\0\1\2" * 50, "not text"),
    "face names a vertex that is not there": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4.*'4'"),
    "face names vertex 0": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4.*'0'"),
    "negative index too far": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -1 -2\n", "line 4.*'-4'"),
    "corner is not a number": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf a b c\n", "line 4.*'a'"),
    "vertex not a number": ("v 0 0 x\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1.*0 0 x"),
    "vertex NaN": ("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", "line 2.*nan"),
    "vertex infinite": ("v 0 0 0\nv 1 0 0\nv 0 1e999 0\nf 1 2 3\n", "line 3.*1e999"),
    "vertex light years away": ("v 0 0 0\nv 1 0 0\nv 0 1e50 0\nf 1 2 3\n", "1e.50 units away"),
    "vertex with two numbers": ("v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "line 2.*1 0"),
    "Git LFS pointer": ("version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
    "a million faces": (ball_of_faces(1_000_001), "faces, the limit is 1000000"),
}


@pytest.mark.parametrize("what", OBJS)
def test_collision_obj(root, what):
    content, message = OBJS[what]
    root.write("objects/cup/m/shape/c.obj", content)
    with pytest.raises(InputError, match=message) as caught:
        read_object(root)
    assert "c.obj" in str(caught.value)


OTHER_MESHES = {
    "STL cut short": ("c.stl", b"\0" * 80 + struct.pack("<I", 100) + b"\0" * 50, "STL|faces"),
    "STL of text garbage": ("c.stl", b"solid x\nfacet normal 0 0 zero\n", "STL|faces"),
    "STL of 2 million faces": ("c.stl", b"\0" * 80 + struct.pack("<I", 2_000_000) + b"\0" * 100_000_000, "the limit"),
    "STL with NaN": (
        "c.stl",
        b"\0" * 80 + struct.pack("<I", 1) + struct.pack("<12f", *[0] * 3, float("nan"), *[1.0] * 8) + b"\0\0",
        "not finite",
    ),
    "PLY garbage": ("c.ply", b"ply\nformat nonsense\n", "PLY"),
    "GLB garbage": ("c.glb", b"glTF\2\0\0\0\xff\xff\xff\xff", "GLB"),
    "GLB empty": ("c.glb", b"", "GLB"),
    "glTF no JSON": ("c.gltf", b"{", "glTF"),
    "glTF reads outside": (
        "c.gltf",
        json.dumps(
            {"asset": {"version": "2.0"}, "buffers": [{"uri": "../../../../../x.bin", "byteLength": 4}]}
        ).encode(),
        "outside the dataset root",
    ),
    "DAE truncated": ("c.dae", b"<COLLADA><asset>", "XML"),
    "DAE with entities": ("c.dae", b'<!DOCTYPE r [<!ENTITY a "b">]><COLLADA/>', "entities"),
    "DAE without geometry": (
        "c.dae",
        b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/></COLLADA>',
        "DAE|faces",
    ),
    "DAE unit zero": ("c.dae", b"<COLLADA><asset><unit meter='0'/></asset></COLLADA>", "unit meter='0'"),
}


@pytest.mark.parametrize("what", OTHER_MESHES)
def test_other_mesh_files(root, make, what):
    name, content, message = OTHER_MESHES[what]
    root.write(f"objects/cup/m/shape/{name}", content)
    root.write("objects/cup/m/m.urdf", make.robot(make.link("a", make.shape("collision", f"shape/{name}"))))
    with pytest.raises(InputError, match=message) as caught:
        read_object(root)
    assert name in str(caught.value)
