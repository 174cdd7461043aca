"""Small inputs that ask for everything are refused within limits of time and memory, with an error that names them."""

from __future__ import annotations

import base64
import json
import shutil
import struct
import zlib

import numpy as np
import pytest
from ig2mj_converters.base.file_access import FileGuard
from ig2mj_converters.base.read_limits import ReadLimits, limits_of
from ig2mj_converters.reading.json_reader import read_json
from ig2mj_converters.reading.mesh_files import read_collision, read_visual
from ig2mj_converters.reading.room_maps import read_room_maps
from ig2mj_converters.reading.urdf import read_urdf
from limits import run_limited

from ig2mj.errors import InputError

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
BOX = '<collision><geometry><box size="1 1 1"/></geometry></collision>'


def read_collision_file(file):
    return len(read_collision(file, FileGuard(file))[0])


def read_visual_file(file):
    warnings: list[str] = []
    return len(read_visual(file, FileGuard(file), "link 'a'", warnings)), warnings


def read_robot(file):
    model = read_urdf(file, "agent", "r")
    return len(model.links), model.warnings


def read_rooms(folder):
    return read_room_maps(folder, ["kitchen"])


# ---- XML


def chain(kind: str, count: int) -> str:
    links = "".join(f'<link name="l{i}"/>' for i in range(count))
    limit = '<limit lower="0" upper="1"/>'
    joints = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>{limit}</joint>'
        for i in range(count - 1)
    )
    return links + joints


XML = {
    "comments that do not end": ("<!--" * 500_000, "a comment does not end"),
    "comments that end late": ("<!-- <!-- " * 200_000 + "-->", None),
    "CDATA that does not end": ("<![CDATA[" * 300_000, "CDATA section does not end"),
    "two million elements": ("<a/>" * 2_000_001, "--limit xml-elements=N"),
    "a million attributes": ("<a " + " ".join(f'b{i}=""' for i in range(1_100_000)) + "/>", "xml-elements"),
    "nested without end": ("<a>" * 100_000, "depth"),
    "ampersands": ("& " * 5_000_000, None),
    "a comment per element": ("<!----><a/>" * 300_000, None),
    "a chain of 3,000 moving links": (chain("revolute", 3000), "2999 or more moving joints.*--limit joints=N"),
    "a chain of 350 moving links": (chain("revolute", 350), "moving joints in a row.*--limit link-depth=N"),
    "a chain of 3,000 fixed links": (chain("fixed", 3000), None),
    "6,000 links": (chain("fixed", 6000), "--limit links=N"),
    "100,000 boxes in a link": (
        f'<link name="a">{BOX * 100_000}</link>',
        "link 'a'.*100000 or more collisions.*link-sh",
    ),
}


@pytest.mark.parametrize("what", XML)
def test_xml(folder, what):
    inside, message = XML[what]
    file = folder.write("r.urdf", f'<robot name="r">{inside}<link name="end_"/></robot>')
    outcome = run_limited(read_robot, file)
    outcome.check(InputError if message else None, f"r.urdf.*{message}" if message else "")


@pytest.mark.parametrize("encoding", ["punycode", "idna", "utf-7", "unicode_escape", "hex", "rot13"])
def test_encodings_that_are_no_text_encodings_are_passed_over(folder, encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?><robot name="r"><link name="a"/>{"ab-" * 700_000}</robot>'
    assert run_limited(read_robot, folder.write("r.urdf", text)).check().value[0] == 1


def test_a_file_over_the_limit_of_bytes_is_not_read(folder):
    file = folder.root / "r.urdf"
    file.parent.mkdir(parents=True)
    with file.open("wb") as out:
        out.truncate(2**33)
    run_limited(read_robot, file).check(InputError, "8589934592 or more bytes.*--limit xml-bytes=N")


# ---- OBJ


OBJS = {
    "80,000 groups": (TRIANGLE + "".join(f"g {i}\nf 1 2 3\n" for i in range(80_000)), "groups.*--limit mesh-groups=N"),
    "80,000 groups in one collision": (TRIANGLE + "g a\nf 1 2 3\n" + "g b\n" * 80_000, None),
    "80 MB of vertices": ("v 0 0 0\n" * 10_000_000 + "f 1 2 3\n", "vertices.*--limit mesh-vertices=N"),
    "texture coordinates": (TRIANGLE + "vt 0 0\n" * 3_100_000 + "f 1 2 3\n", "--limit mesh-vertices=N"),
    "one face of two million corners": (TRIANGLE + "f" + " 1 2 3" * 700_000, "--limit mesh-faces=N"),
    "empty lines": (TRIANGLE + "\n" * 13_000_000 + "f 1 2 3\n", "--limit mesh-lines=N"),
    "a line without end": (TRIANGLE + "# \\\n" * 1_000_000 + "f 1 2 3\n", "no faces"),
}


LARGE_OBJS = {
    "vertices behind tabs": ("v\t0 0 0\n" * 3_100_000 + "f 1 2 3\n", "--limit mesh-vertices=N"),
    "three million vertices": (TRIANGLE + "v 0 0 1\n" * 2_900_000 + "f 1 2 3\n", None),
}


@pytest.mark.parametrize("what", OBJS)
def test_obj(folder, what):
    text, message = OBJS[what]
    run_limited(read_collision_file, folder.write("c.obj", text)).check(InputError if message else None, message or "")


@pytest.mark.slow
@pytest.mark.parametrize("what", LARGE_OBJS)
def test_large_obj(folder, what):
    text, message = LARGE_OBJS[what]
    run_limited(read_collision_file, folder.write("c.obj", text)).check(InputError if message else None, message or "")


@pytest.mark.slow
def test_an_obj_of_many_materials_is_drawn_in_one_colour(folder):
    text = TRIANGLE + "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(200_000))
    mtl = "".join(f"newmtl m{i}\nKd {i / 200_000} 0 0\n" for i in range(200_000))
    folder.write("m.mtl", mtl)
    parts, warnings = run_limited(read_visual_file, folder.write("v.obj", "mtllib m.mtl\n" + text)).check().value
    assert parts == 1
    assert "200000 materials, the limit is 500 (--limit mesh-materials=N): drawn in one colour" in warnings[-1]


# ---- COLLADA


def dae(nodes: str, library: str = "", triangles: int = 1) -> str:
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>
    <library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0
    </float_array><technique_common><accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>
    <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="{triangles}">
    <input semantic="VERTEX" source="#v" offset="0"/><p>{"0 1 2 " * triangles}</p></triangles></mesh></geometry>
    </library_geometries><library_nodes>{library}</library_nodes><library_visual_scenes><visual_scene id="s">{nodes}
    </visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def doubling(levels: int) -> str:
    leaf = '<node id="n0"><instance_geometry url="#g"/></node>'
    return leaf + "".join(
        f'<node id="n{i + 1}"><instance_node url="#n{i}"/><instance_node url="#n{i}"/></node>' for i in range(levels)
    )


DAES = {
    "nodes that double": (
        dae('<node><instance_node url="#n40"/></node>', doubling(40)), "nodes and instances.*--limit mesh-instances=N",
    ),
    "a node in itself": (
        dae('<node><instance_node url="#a"/></node>', '<node id="a"><instance_node url="#a"/></node>'),
        "node 'a'.*instance of itself",
    ),
    "nodes in one another": (
        dae(
            '<node><instance_node url="#a"/></node>',
            '<node id="a"><instance_node url="#b"/></node><node id="b"><instance_node url="#a"/></node>',
        ),
        "instance of itself",
    ),
    "many instances": (dae('<node><instance_geometry url="#g"/></node>' * 5_000), "--limit mesh-instances=N"),
    "instances of a large mesh": (
        dae('<node><instance_geometry url="#g"/></node>' * 900, triangles=5_000), "4500000 or more.*mesh-faces=N",
    ),
    "a text of 20 MB": (
        dae('<node><instance_geometry url="#g"/></node>').replace("0 1 0", "0 1 0" + " " * 20_000_000), None,
    ),
    "nested nodes": (dae("<node>" * 5_000 + "</node>" * 5_000), "DAE|XML"),
}  # fmt: skip


@pytest.mark.parametrize("what", DAES)
def test_dae(folder, what):
    text, message = DAES[what]
    outcome = run_limited(read_collision_file, folder.write("c.dae", text))
    outcome.check(InputError if message else None, f"c.dae.*{message}" if message else "")


# ---- glTF


def gltf(faces: int = 1, **changes) -> dict:
    content = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]] * faces, dtype="<f4").tobytes()
    data = base64.b64encode(content).decode()
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(content), "uri": f"data:application/octet-stream;base64,{data}"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(content)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3 * faces, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    } | changes


def accessor(**fields) -> list[dict]:
    return [{"componentType": 5126, "type": "VEC3"} | fields]


LAYERS = [{"children": [i + 1] * 2} for i in range(30)]
GLTFS = {
    "2,000 instances of a large mesh": (gltf(5_000, nodes=[{"mesh": 0}] * 2_000, scenes=[{"nodes": [*range(2_000)]}]),
                                        "--limit mesh-faces=N"),
    "nodes that double": (gltf(nodes=[*LAYERS, {"mesh": 0}]), "--limit mesh-instances=N"),
    "a node in itself": (gltf(nodes=[{"children": [0]}]), "holds itself|mesh-instances"),
    "an accessor without a view": (gltf(accessors=accessor(count=10**10)), "faces' worth of data.*mesh-faces=N"),
    "a stride of zero": (gltf(accessors=accessor(bufferView=0, count=10**7),
                              bufferViews=[{"buffer": 0, "byteLength": 36, "byteStride": 0}]), "outside its buffer"),
    "a stride shorter than the values": (gltf(accessors=accessor(bufferView=0, count=10**7),
                              bufferViews=[{"buffer": 0, "byteLength": 36, "byteStride": 1}]), "stride is shorter"),
    "a negative stride": (gltf(bufferViews=[{"buffer": 0, "byteLength": 36, "byteStride": -12}]), "stride is '-12'"),
    "a view outside its buffer": (gltf(bufferViews=[{"buffer": 0, "byteLength": 10**9}]), "ends at byte"),
    "a million small lists": (gltf(extras=[[]] * 3_000_000), "json-values=N"),
}  # fmt: skip


@pytest.mark.parametrize("what", GLTFS)
def test_gltf(folder, what):
    tree, message = GLTFS[what]
    run_limited(read_collision_file, folder.write("c.gltf", json.dumps(tree))).check(InputError, f"c.gltf.*{message}")


def test_small_gltf_is_read(folder):
    assert run_limited(read_collision_file, folder.write("c.gltf", json.dumps(gltf()))).check().value == 1


@pytest.mark.parametrize("text", ["[" * 1_000_000, "[" + "{}," * 3_000_000 + "{}]", '{"a":' * 100_000])
def test_json(folder, text):
    run_limited(read_json, folder.write("a.json", text), dict).check(InputError, "a.json.*(nested|json-values)")


# ---- PLY and STL


PLYS = {
    "a vertex count beyond the file": b"element vertex 99999999999\nproperty float x\n",
    "a face count beyond the file": b"element face 99999999999\nproperty list uchar int vertex_indices\n",
}


@pytest.mark.parametrize("what", PLYS)
def test_ply(folder, what):
    raw = b"ply\nformat binary_little_endian 1.0\n" + PLYS[what] + b"end_header\n" + b"\0" * 100
    run_limited(read_collision_file, folder.write("c.ply", raw)).check(InputError, "c.ply")


# ---- images


EPS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 100 100\n%%EndComments\nshowpage\n"


@pytest.fixture
def no_programs(monkeypatch):
    """Fails where anything starts a program."""
    import subprocess

    def start(*args, **kwargs):
        raise AssertionError(f"started {args}")

    monkeypatch.setattr(subprocess, "Popen", start)
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")


def textured(folder, kind: str, image: str) -> str | bytes:
    """A visual file that shows an image."""
    if kind == "obj":
        folder.write("m.mtl", f"newmtl a\nKd 1 0 0\nmap_Kd {image}\n")
        return "mtllib m.mtl\nusemtl a\nvt 0 0\n" + TRIANGLE + "f 1/1 2/1 3/1\n"
    if kind == "dae":
        looks = f"""<library_images><image id="i"><init_from>{image}</init_from></image></library_images>
        <library_effects><effect id="e"><profile_COMMON><technique><lambert><diffuse><texture texture="i"/></diffuse>
        </lambert></technique></profile_COMMON></effect></library_effects>
        <library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>"""
        text = dae('<node><instance_geometry url="#g"/></node>').replace("<asset/>", f"<asset/>{looks}")
        return text.replace('<triangles count="1">', '<triangles count="1" material="m">')
    tree = gltf(
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0}],
        images=[{"uri": image}],
    )
    tree["meshes"][0]["primitives"][0]["material"] = 0
    if kind == "glb":
        data = base64.b64encode((folder.root / image).read_bytes()).decode()
        tree["images"] = [{"uri": f"data:image/png;base64,{data}", "mimeType": "image/png"}]
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        head = b"glTF" + struct.pack("<III", 2, 20 + len(text), len(text)) + b"JSON"
        return head + text
    return json.dumps(tree)


@pytest.mark.parametrize("kind", ["obj", "dae", "gltf", "glb"])
def test_an_eps_called_png_is_no_texture_and_starts_no_program(folder, no_programs, kind):
    folder.write("t.png", EPS)
    file = folder.write(f"v.{kind}", textured(folder, kind, "t.png"))
    parts, warnings = read_visual_file(file)
    assert parts == 1, "the geometry stays"
    assert any("no image that is read (PNG, " in line for line in warnings)


def test_a_ply_with_an_eps_starts_no_program(folder, no_programs):
    folder.write("t.png", EPS)
    raw = "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 3\nproperty float x\nproperty float y\n"
    raw += (
        "property float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\n"
    )
    raw += "end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
    parts, warnings = read_visual_file(folder.write("v.ply", raw))
    assert parts == 1
    assert "t.png is left out" in warnings[0]


def test_room_maps_that_are_eps_are_refused_and_start_no_program(folder, no_programs):
    for name in ("floor_semseg_0.png", "floor_insseg_0.png"):
        folder.write(f"scenes/s/layout/{name}", EPS)
    with pytest.raises(InputError, match=r"floor_semseg_0.png.*no image that is read"):
        read_rooms(folder.root / "scenes/s")


def png_of(width: int, height: int) -> bytes:
    """A PNG of grey zeros, packed small."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    packer = zlib.compressobj(1)
    rows = b"".join(packer.compress(b"\0" * (width + 1)) for _ in range(height)) + packer.flush()
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def test_an_image_of_too_many_pixels_is_left_out(folder):
    folder.write("t.png", png_of(30_000, 4_000))
    file = folder.write("v.obj", textured(folder, "obj", "t.png"))
    parts, warnings = run_limited(read_visual_file, file).check().value
    assert parts == 1
    assert "30000 x 4000 pixels are over the limit of 89000000 (--limit image-pixels=N)" in warnings[0]
    with limits_of(ReadLimits(image_pixels=200_000_000)):
        assert read_visual_file(file)[1] == []


# ---- limits as options


def test_limits_are_words_of_the_command_line():
    assert ReadLimits.from_words(["mesh-faces=5", "links=7"]) == ReadLimits(mesh_faces=5, links=7)
    for word, message in (
        ("mesh-faced=5", "no limit 'mesh-faced'.*mesh-faces"),
        ("links=-1", "positive"),
        ("links", "pos"),
    ):
        with pytest.raises(InputError, match=message):
            ReadLimits.from_words([word])


def test_a_raised_limit_lets_a_file_pass(folder):
    file = folder.write("c.obj", TRIANGLE + "".join(f"g {i}\nf 1 2 3\n" for i in range(30)))
    with (
        limits_of(ReadLimits(mesh_groups=20)),
        pytest.raises(InputError, match="has 30 or more groups"),
    ):
        read_collision_file(file)
    assert read_collision_file(file) == 30
