"""Seeded mutations of valid inputs: every reader of the converter answers with a result or a typed error, in time."""

from __future__ import annotations

import base64
import io
import json
import pathlib
import tempfile

import numpy as np
import pytest
import trimesh
from fuzz import mutated_bytes, mutated_json, untyped_errors
from ig2mj_converters.base.file_access import FileGuard
from ig2mj_converters.reading.mesh_files import read_collision, read_visual
from ig2mj_converters.reading.metadata import read_metadata
from ig2mj_converters.reading.room_maps import read_room_maps
from ig2mj_converters.reading.scene_urdf import read_scene
from ig2mj_converters.reading.urdf import read_urdf
from limits import run_limited
from PIL import Image

from ig2mj.errors import Ig2mjError

QUICK, MANY = 40, 3000
"""Mutations of each reader's input in `make test` and in `make test-slow`."""

URDF = """<?xml version="1.0" encoding="utf-8"?><robot name="r"><material name="m"><color rgba="1 0 0 1"/></material>
<link name="a"><inertial><origin xyz="0 0 1" rpy="0 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"/>
</inertial><visual><origin xyz="0 0 1"/><geometry><mesh filename="c.obj" scale="1 1 1"/></geometry>
<material name="m"><texture filename="t.png"/></material></visual><collision><geometry><box size="1 2 3"/></geometry>
</collision></link><link name="b"><collision><geometry><cylinder radius="1" length="2"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="0" upper="1"
effort="3" velocity="2"/><dynamics damping="0.1" friction="0.2"/><mimic joint="k" multiplier="2" offset="0"/></joint>
<!-- the end --></robot>"""
SCENE = """<robot name="s"><link name="world"/><link name="cup_0" category="cup" model="m" bounding_box="1 1 1"
room="kitchen_0" states='{"Soaked": true}' joint_positions='{"j": 0.1}' object_scope="cup.n.01_1"/>
<joint name="j_cup_0" type="floating"><origin xyz="1 2 3" rpy="0 0 1"/><child link="cup_0"/><parent link="world"/>
</joint></robot>"""
OBJ = """mtllib m.mtl
o one
usemtl a
v 0 0 0
v 1 0 0 1 0 0
v 0 1 0
v 0 0 1
vt 0 0
vt 1 0
f 1/1 2/2 3/1
g two
f -1//1 -2//2 -3
"""
MTL = "newmtl a\nKd 1 0 0\nd 0.5\nTr 0.2\nmap_Kd -s 1 1 1 t.png\nnewmtl b\n"
METADATA = {
    "bbox_size": [1, 1, 1], "base_link_offset": [0, 0, 0], "links": {"heat_source": {"xyz": [0, 0, 0], "rpy": [0, 0, 0],
    "geometry": "box", "size": [1, 1, 1]}},
    "orientations": [{"rotation": [0, 0, 0, 1], "prob": 0.5, "size": [1, 1, 1]}],
    "openable_joint_ids": [[0, "j"]], "openable_both_sides": False,
    "object_parts": [{"category": "half_cup", "model": "m_part_0", "pos": [0, 0, 0], "orn": [0, 0, 0, 1]}],
}  # fmt: skip


def _gltf() -> dict:
    content = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4").tobytes() + bytes([0, 1, 2, 0, 2, 3])
    content += b"\0\0" + np.zeros((4, 2), "<f4").tobytes()
    uri = f"data:application/octet-stream;base64,{base64.b64encode(content).decode()}"
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(content), "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": 6},
                        {"buffer": 0, "byteOffset": 56, "byteLength": 32, "byteStride": 8}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2",
             "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}}},
        ],
        "images": [{"uri": "t.png"}], "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}]}],
        "nodes": [{"children": [1], "rotation": [0, 0, 0, 1]},
                  {"mesh": 0, "scale": [1, 1, 1], "translation": [0, 0, 1]}],
        "scenes": [{"nodes": [0]}], "scene": 0,
    }  # fmt: skip


def _png() -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.arange(400, dtype=np.uint8).reshape(20, 20) % 3).save(buffer, "PNG")
    return buffer.getvalue()


def _dae() -> bytes:
    box = trimesh.creation.box((1, 2, 3))
    box.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(baseColorFactor=[1, 0, 0, 1])
    )
    return trimesh.exchange.dae.export_collada(box)


def _mesh(folder: pathlib.Path, name: str, raw: bytes) -> None:
    file = folder / name
    file.write_bytes(raw)
    read_visual(file, FileGuard(file), "x", [])
    read_collision(file, FileGuard(file))


def _obj(folder: pathlib.Path, raw: bytes) -> None:
    _mesh(folder, "v.obj", raw)


def _mtl(folder: pathlib.Path, raw: bytes) -> None:
    (folder / "m.mtl").write_bytes(raw)
    _mesh(folder, "v.obj", OBJ.encode())


def _urdf(folder: pathlib.Path, raw: bytes) -> None:
    (folder / "c.obj").write_text(OBJ)
    (folder / "r.urdf").write_bytes(raw)
    read_urdf(folder / "r.urdf", "cup", "r")


def _scene(folder: pathlib.Path, raw: bytes) -> None:
    (folder / "s.urdf").write_bytes(raw)
    read_scene(folder / "s.urdf", "s")


def _metadata(folder: pathlib.Path, raw: bytes) -> None:
    (folder / "misc").mkdir(exist_ok=True)
    (folder / "misc/metadata.json").write_bytes(raw)
    read_metadata(folder, [])


def _rooms(folder: pathlib.Path, raw: bytes) -> None:
    (folder / "layout").mkdir(exist_ok=True)
    for name in ("floor_semseg_0.png", "floor_insseg_0.png", "floor_trav_0.png"):
        (folder / "layout" / name).write_bytes(raw if name != "floor_insseg_0.png" else _png())
    read_room_maps(folder, ["kitchen", "bedroom"])


def _dumped(value) -> bytes:
    return json.dumps(value).encode("utf-8", errors="surrogatepass")


READERS = {
    "urdf": (_urdf, lambda seed: mutated_bytes(URDF.encode(), seed)),
    "scene": (_scene, lambda seed: mutated_bytes(SCENE.encode(), seed)),
    "obj": (_obj, lambda seed: mutated_bytes(OBJ.encode(), seed)),
    "mtl": (_mtl, lambda seed: mutated_bytes(MTL.encode(), seed)),
    "dae": (lambda folder, raw: _mesh(folder, "v.dae", raw), lambda seed: mutated_bytes(_dae(), seed)),
    "gltf": (lambda folder, raw: _mesh(folder, "v.gltf", raw), lambda seed: _dumped(mutated_json(_gltf(), seed))),
    "glb": (
        lambda folder, raw: _mesh(folder, "v.glb", raw),
        lambda seed: mutated_bytes(trimesh.creation.box().export(file_type="glb"), seed),
    ),
    "ply": (
        lambda folder, raw: _mesh(folder, "v.ply", raw),
        lambda seed: mutated_bytes(trimesh.creation.box().export(file_type="ply", encoding="ascii"), seed),
    ),
    "binary ply": (
        lambda folder, raw: _mesh(folder, "v.ply", raw),
        lambda seed: mutated_bytes(trimesh.creation.box().export(file_type="ply"), seed),
    ),
    "stl": (
        lambda folder, raw: _mesh(folder, "v.stl", raw),
        lambda seed: mutated_bytes(trimesh.creation.box().export(file_type="stl_ascii").encode(), seed),
    ),
    "binary stl": (
        lambda folder, raw: _mesh(folder, "v.stl", raw),
        lambda seed: mutated_bytes(trimesh.creation.box().export(file_type="stl"), seed),
    ),
    "metadata": (_metadata, lambda seed: _dumped(mutated_json(METADATA, seed))),
    "room maps": (_rooms, lambda seed: mutated_bytes(_png(), seed)),
}


def fuzz(what: str, count: int) -> dict[int, str]:
    """Seed -> error of the mutations at which a reader raised anything but a typed error."""
    read, make = READERS[what]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        Image.new("RGB", (2, 2)).save(folder / "t.png")
        (folder / "m.mtl").write_text(MTL)
        read(folder, make_valid(what))
        return untyped_errors(lambda raw: read(folder, raw), ((s, make(s)) for s in range(count)), (Ig2mjError,))


def make_valid(what: str) -> bytes:
    """The input before any mutation, which is read without an error."""
    valid = {"urdf": URDF, "scene": SCENE, "obj": OBJ, "mtl": MTL}
    if what in valid:
        return valid[what].encode()
    box = trimesh.creation.box()
    return {
        "dae": _dae, "gltf": lambda: _dumped(_gltf()), "glb": lambda: box.export(file_type="glb"),
        "ply": lambda: box.export(file_type="ply", encoding="ascii"), "binary ply": lambda: box.export(file_type="ply"),
        "stl": lambda: box.export(file_type="stl_ascii").encode(), "binary stl": lambda: box.export(file_type="stl"),
        "metadata": lambda: _dumped(METADATA), "room maps": _png,
    }[what]()  # fmt: skip


@pytest.mark.parametrize("what", READERS)
def test_a_few_mutations(what):
    outcome = run_limited(fuzz, what, QUICK).check()
    assert not outcome.value, next(iter(outcome.value.items()))


@pytest.mark.slow
@pytest.mark.parametrize("what", READERS)
def test_many_mutations(what):
    outcome = run_limited(fuzz, what, MANY, seconds=300).check()
    assert not outcome.value, (len(outcome.value), next(iter(outcome.value.items())))
