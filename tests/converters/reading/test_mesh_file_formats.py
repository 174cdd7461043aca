"""Mesh files of every kind: groups, materials, units and axes."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from ig2mj_converters.base.description import PackedImage
from ig2mj_converters.base.file_access import FileGuard
from ig2mj_converters.base.xml_reader import read_xml
from ig2mj_converters.bodies.solids import hull_volume, joined, signed_volume
from ig2mj_converters.reading.json_reader import read_json
from ig2mj_converters.reading.mesh_files import read_collision, read_visual
from PIL import Image

from ig2mj.errors import InputError


def collision(file):
    return read_collision(file, FileGuard(file))


def visual(file, warnings=None):
    return read_visual(file, FileGuard(file), "link 'a'", [] if warnings is None else warnings)


def extents(meshes):
    return np.ptp(np.concatenate([m.vertices for m in meshes]), axis=0)


# ---- OBJ


@pytest.mark.parametrize("word", ["o", "g"])
def test_each_o_or_g_is_a_group(folder, make, word):
    """One collision OBJ per link holds many `o convex_N` groups; `g` counts as well."""
    text = make.boxes_obj(((1, 1, 1), (0, 0, 0)), ((2, 1, 1), (3, 0, 0)), ((1, 3, 1), (0, 5, 0)))
    meshes, grouped = collision(folder.write("c.obj", text.replace("o convex", f"{word} convex")))
    assert grouped
    assert [m.name for m in meshes] == ["convex_0", "convex_1", "convex_2"]
    assert [hull_volume(m) for m in meshes] == pytest.approx([1, 2, 3])
    assert [len(m.vertices) for m in meshes] == [8, 8, 8]


def test_o_and_g_mixed_and_groups_without_faces(folder, make):
    text = "o empty\ng also_empty\n" + make.box_obj(group="a").replace("o a", "o a\ng b") + "g c\n"
    meshes, grouped = collision(folder.write("c.obj", text))
    assert [m.name for m in meshes] == ["b"]
    assert grouped


def test_without_groups_it_is_one_mesh_and_said_so(folder, make):
    meshes, grouped = collision(folder.write("c.obj", make.box_obj() + make.box_obj(centre=(3, 0, 0), first=8)))
    assert not grouped
    assert len(meshes) == 1


def test_faces_before_the_first_group_make_the_file_ungrouped(folder, make):
    meshes, grouped = collision(folder.write("c.obj", make.box_obj() + make.box_obj(group="a", first=8)))
    assert not grouped
    assert len(meshes) == 2


@pytest.mark.parametrize(
    "faces",
    [
        "f 1 2 3\n",
        "f 1/1 2/2 3/3\n",
        "f 1//1 2//1 3//1\n",
        "f 1/1/1 2/2/1 3/3/1\n",
        "f -3 -2 -1\n",
        "f -3/-3 -2/-2 -1/-1\n",
        "f 1 2 \\\n 3\n",
        "f 1 2 3 # a comment\n",
        "f 1 2 3 3\n",
        "f 1 2\nf 1 2 3\n",
    ],
)
def test_every_way_to_write_a_face(folder, faces):
    text = "# c\r\nmtllib x.mtl\ns off\nl 1 2\nv 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv 0 1e0 0.\nvt 0 0\nvt 1 0\nvt 0 1\n"
    meshes, _ = collision(folder.write("c.obj", text + faces))
    np.testing.assert_array_equal(meshes[0].faces, [[0, 1, 2]])
    np.testing.assert_array_equal(meshes[0].vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_polygons_are_cut_into_fans_that_keep_their_volume(folder, make):
    meshes, _ = collision(folder.write("c.obj", make.box_obj((1, 2, 3))))
    assert len(meshes[0].faces) == 12
    assert signed_volume(joined(meshes)) == pytest.approx(6)


def test_case_of_the_extension_does_not_matter(folder, make):
    assert collision(folder.write("C.OBJ", make.box_obj()))[0]


def test_negative_indices_count_from_the_line_they_stand_in(folder):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n"
    mesh = collision(folder.write("c.obj", text))[0][0]
    assert mesh.vertices[mesh.faces[1]].tolist() == [[5, 0, 0], [6, 0, 0], [5, 1, 0]]


def test_materials_split_a_visual_and_give_colour_texture_and_uv(folder):
    Image.new("RGB", (4, 4), (200, 0, 0)).save(folder.write("tex/a b.png", ""))
    folder.write(
        "m.mtl",
        "newmtl plain\nKd 0.5 0.25 0\nd 0.5\nnewmtl shiny\nKd 1 1 1\nmap_Kd tex/a b.png\nnewmtl gone\nmap_Kd no.png\n"
        "newmtl secret\nKd 0 0 1\nmap_Kd ../material/DIFFUSE.encrypted.png\n",
    )
    text = (
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\n"
        "usemtl plain\nf 1 2 3\nusemtl shiny\nf 1/1 2/2 4/3\nf 1/4 3/2 4/3\nusemtl gone\nf 2/1 3/2 4/3\n"
        "usemtl secret\nf 1/1 4/2 3/3\nusemtl none\nf 4 2 1\n"
    )
    warnings: list[str] = []
    file = folder.write("v.obj", text)
    plain, shiny, gone, secret, none = read_visual(file, FileGuard(file, root=folder.root.parent), "x", warnings)
    assert plain.rgba == (0.5, 0.25, 0, 0.5)
    assert plain.texture is None
    assert shiny.texture == (folder.root / "tex/a b.png").resolve()
    mesh, uv = shiny.meshes[0], shiny.uv[0]
    assert len(uv) == len(mesh.vertices) == 5, "vertex 1 has two texture coordinates"
    corners = {(*mesh.vertices[i], *uv[i]) for i in mesh.faces.ravel()}
    assert corners == {(0, 0, 0, 0, 0), (1, 0, 0, 1, 0), (0, 0, 1, 0, 1), (0, 0, 0, 1, 1), (0, 1, 0, 1, 0)}
    assert gone.texture is None
    assert secret.rgba == (0, 0, 1, 1)
    assert secret.texture is None
    assert none.rgba is None
    assert len(warnings) == 2
    assert "no MTL file defines: none" in warnings[0]
    assert "no.png" in warnings[1]


def test_materials_and_textures_outside_are_left_out_with_a_warning(folder, tmp_path, make):
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0 0\n")
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    folder.write("in.mtl", "newmtl b\nmap_Kd ../t.png\n")
    warnings: list[str] = []
    visual(folder.write("v.obj", "mtllib ../m.mtl\nmtllib in.mtl\nusemtl b\n" + make.box_obj()), warnings)
    assert ["m.mtl" in warnings[0], "t.png" in warnings[1]] == [True, True]
    assert all("outside" in w for w in warnings)


def test_a_texture_that_is_no_image_is_left_out(folder, make):
    folder.write("t.png", b"\x89PNG broken")
    folder.write("m.mtl", "newmtl a\nKd 1 0 0\nmap_Kd t.png\n")
    warnings: list[str] = []
    part = visual(folder.write("v.obj", "mtllib m.mtl\nusemtl a\n" + make.box_obj()), warnings)[0]
    assert (part.texture, part.rgba) == (None, (1, 0, 0, 1))
    assert "t.png" in warnings[0]


# ---- STL, PLY


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply"])
def test_stl_and_ply_keep_their_numbers(folder, kind):
    data = trimesh.creation.box((1, 2, 3)).export(file_type=kind)
    file = folder.write(f"c.{kind[:3]}", data)
    meshes, grouped = collision(file)
    assert not grouped
    assert extents(meshes) == pytest.approx([1, 2, 3])
    assert len(meshes[0].vertices) == 8, "equal vertices of an STL are merged"
    assert signed_volume(joined(meshes)) == pytest.approx(6)


def test_vertex_colours_give_their_mean(folder):
    box = trimesh.creation.box()
    box.visual.vertex_colors = [[255, 0, 0, 255]] * 4 + [[0, 0, 255, 255]] * 4
    part = visual(folder.write("v.ply", box.export(file_type="ply")))[0]
    assert part.rgba == pytest.approx((0.5, 0, 0.5, 1))


# ---- DAE


def dae(folder, up_axis=None, meter=None, material=True):
    box = trimesh.creation.box((1, 2, 3))
    box.apply_translation((10, 20, 30))
    if material:
        box.visual = trimesh.visual.TextureVisuals(
            material=trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 128, 0, 255])
        )
    text = trimesh.exchange.dae.export_collada(box).decode()
    start, end = text.index("<asset>"), text.index("</asset>") + len("</asset>")
    asset = f'<unit meter="{meter}" name="x"/>' if meter else ""
    asset += f"<up_axis>{up_axis}</up_axis>" if up_axis else ""
    return folder.write("c.dae", text[:start] + f"<asset>{asset}</asset>" + text[end:])


@pytest.mark.parametrize(
    ("up_axis", "meter", "size", "centre"),
    [
        ("Z_UP", None, (1, 2, 3), (10, 20, 30)),
        ("Z_UP", "0.01", (0.01, 0.02, 0.03), (0.1, 0.2, 0.3)),
        ("Y_UP", "1", (1, 3, 2), (10, -30, 20)),
        (None, None, (1, 3, 2), (10, -30, 20)),  # COLLADA's default is Y_UP
        ("X_UP", "0.001", (0.002, 0.001, 0.003), (-0.02, 0.01, 0.03)),
    ],
)
def test_dae_units_and_axes(folder, up_axis, meter, size, centre):
    meshes, _ = collision(dae(folder, up_axis, meter))
    assert extents(meshes) == pytest.approx(size)
    vertices = np.concatenate([m.vertices for m in meshes])
    assert (vertices.max(axis=0) + vertices.min(axis=0)) / 2 == pytest.approx(centre)
    assert signed_volume(joined(meshes)) > 0


def test_dae_colour(folder):
    part = visual(dae(folder, "Z_UP"))[0]
    assert part.rgba == pytest.approx((1, 0.5, 0, 1), abs=0.01)


def test_dae_texture_is_the_file_on_disk(folder):
    Image.new("RGB", (2, 2), (0, 255, 0)).save(folder.write("t.png", ""))
    folder.write(
        "t.dae",
        """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
        <asset><up_axis>Z_UP</up_axis></asset>
        <library_images><image id="i"><init_from>t.png</init_from></image></library_images>
        <library_effects><effect id="e"><profile_COMMON>
        <newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
        <newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>
        <technique sid="t"><lambert><diffuse><texture texture="p" texcoord="c"/></diffuse></lambert></technique>
        </profile_COMMON></effect></library_effects>
        <library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
        <library_geometries><geometry id="g"><mesh>
        <source id="v"><float_array id="va" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
        <accessor source="#va" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
        <param name="Z" type="float"/></accessor></technique_common></source>
        <source id="u"><float_array id="ua" count="6">0 0 1 0 0 1</float_array><technique_common>
        <accessor source="#ua" count="3" stride="2"><param name="S" type="float"/><param name="T" type="float"/>
        </accessor></technique_common></source>
        <vertices id="vs"><input semantic="POSITION" source="#v"/></vertices>
        <triangles count="1" material="x"><input semantic="VERTEX" source="#vs" offset="0"/>
        <input semantic="TEXCOORD" source="#u" offset="1" set="0"/><p>0 0 1 1 2 2</p></triangles></mesh></geometry>
        </library_geometries>
        <library_visual_scenes><visual_scene id="sc"><node><instance_geometry url="#g"><bind_material>
        <technique_common><instance_material symbol="x" target="#m"/></technique_common></bind_material>
        </instance_geometry></node></visual_scene></library_visual_scenes>
        <scene><instance_visual_scene url="#sc"/></scene></COLLADA>""",
    )
    part = visual(folder.root / "t.dae")[0]
    assert part.texture == (folder.root / "t.png").resolve()
    found = {(*v[:2], *uv) for v, uv in zip(part.meshes[0].vertices.tolist(), part.uv[0].tolist(), strict=True)}
    assert found == {(0, 0, 0, 0), (1, 0, 1, 0), (0, 1, 0, 1)}


# ---- glTF


@pytest.mark.parametrize("kind", ["glb", "gltf"])
def test_gltf_is_y_up_and_becomes_z_up(folder, kind):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1, 2, 3)), transform=trimesh.transformations.translation_matrix((1, 2, 3)))
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), transform=np.diag([-2.0, 1, 1, 1]))
    data = scene.export(file_type=kind)
    if kind == "glb":
        folder.write("c.glb", data)
    else:
        for name, content in data.items():
            folder.write(f"sub/{name}", content)
    meshes, _ = collision(folder.root / "c.glb" if kind == "glb" else folder.root / "sub/model.gltf")
    assert len(meshes) == 2
    big = max(meshes, key=lambda m: np.ptp(m.vertices[:, 1]))
    assert np.ptp(big.vertices, axis=0) == pytest.approx([1, 3, 2])
    assert (big.vertices.max(axis=0) + big.vertices.min(axis=0)) / 2 == pytest.approx([1, -3, 2])
    assert all(signed_volume(joined([m])) > 0 for m in meshes), "a mirroring node must not turn the mesh inside out"


def test_a_texture_packed_into_a_glb_is_kept(folder):
    box = trimesh.creation.box()
    image = Image.new("RGB", (2, 2), (255, 0, 0))
    image.putpixel((0, 0), (0, 255, 0))
    image.putpixel((1, 0), (0, 255, 0))
    box.visual = trimesh.visual.TextureVisuals(
        uv=np.zeros((8, 2)), material=trimesh.visual.material.PBRMaterial(baseColorTexture=image)
    )
    part = visual(folder.write("v.glb", trimesh.Scene(box).export(file_type="glb")))[0]
    assert isinstance(part.texture, PackedImage)
    with Image.open(io.BytesIO(part.texture.content)) as kept:
        assert kept.convert("RGB").tobytes() == image.tobytes()
    assert len(part.uv[0]) == len(part.meshes[0].vertices)


CORNER = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n"
SIDES = "f 1/1 2/2 3/3\nf 1/1 2/2 4/3\nf 2/1 3/2 4/3\nf 1/1 3/2 4/3\n"


def _visual(folder, head: str, mtl: str, mtl_name: str = "m.mtl", faces: str = SIDES):
    """(parts, warnings) of an OBJ in meshes/, whose only image is meshes/t.png."""
    Image.new("RGB", (4, 4), (200, 0, 0)).save(folder.write("meshes/t.png", ""))
    folder.write(f"meshes/{mtl_name}", mtl)
    file = folder.write("meshes/v.obj", f"{head}\n{CORNER}usemtl k\n{faces}")
    warnings: list[str] = []
    return read_visual(file, FileGuard(file, root=folder.root), "x", warnings), warnings


@pytest.mark.parametrize(
    ("head", "file", "warns"),
    [
        ("mtllib my own.mtl", "my own.mtl", False),
        ("mtllib a.mtl m.mtl", "m.mtl", True),  # two files, of which one is not there
        ('mtllib "m.mtl"', "m.mtl", True),
        ("mtllib M.MTL", "m.mtl", True),
        ("mtllib /home/somebody/m.mtl", "m.mtl", True),
        ("mtllib C:\\Users\\somebody\\m.mtl", "m.mtl", True),
    ],
)
def test_materials_are_found_as_exporters_name_them(folder, head, file, warns):
    """What is not where it is said to be is taken from next to the mesh, with a warning."""
    (part,), warnings = _visual(folder, head, "newmtl k\nKd 0.2 0.4 0.6\n", file)
    assert part.rgba == (0.2, 0.4, 0.6, 1.0)
    assert bool(warnings) == warns


@pytest.mark.parametrize(
    ("statement", "warns"),
    [
        ("map_Kd t.png", False),
        ("map_kd t.png", False),
        ("MAP_KD T.PNG", True),
        ('map_Kd "t.png"', True),
        ("map_Kd /home/somebody/textures/t.png", True),
        ("map_Kd D:\\textures\\t.png", True),
        ("map_Kd ../../elsewhere/t.png", True),
    ],
)
def test_textures_are_found_as_exporters_name_them(folder, statement, warns):
    (part,), warnings = _visual(folder, "mtllib m.mtl", f"newmtl k\n{statement}\n")
    assert part.texture == (folder.root / "meshes/t.png").resolve()
    assert [("t.png next to the mesh is used" in w) for w in warnings] == [True] * warns


def test_a_texture_is_looked_for_next_to_its_mtl_and_then_next_to_its_mesh(folder):
    mtl = "newmtl k\nmap_Kd t.png\n"
    (part,), warnings = _visual(folder, "mtllib looks/m.mtl", mtl, "looks/m.mtl")
    assert part.texture == (folder.root / "meshes/t.png").resolve() and not warnings
    folder.image("meshes/looks/t.png", np.zeros((2, 2, 3)))
    (part,), warnings = _visual(folder, "mtllib looks/m.mtl", mtl, "looks/m.mtl")
    assert part.texture == (folder.root / "meshes/looks/t.png").resolve() and not warnings


def test_only_faces_without_texture_coordinates_lose_the_texture(folder):
    faces = "f 1/1 2/2 3/3\nf 1 2 4\nf 2 3 4\nf 1/1 3/2 4/3\n"
    (textured, flat), warnings = _visual(folder, "mtllib m.mtl", "newmtl k\nmap_Kd t.png\n", faces=faces)
    assert textured.texture is not None and len(textured.meshes[0].faces) == len(flat.meshes[0].faces) == 2
    assert flat.rgba == pytest.approx((200 / 255, 0, 0, 1)) and "mean colour" in warnings[0]


@pytest.mark.parametrize("colour", ["spectral f.rfl 1", "0,5 0,5 0,5", "nan 0 0", "0.5 0.5"])
def test_a_colour_that_is_not_read_is_a_warning(folder, colour):
    (part,), warnings = _visual(folder, "mtllib m.mtl", f"newmtl k\nKd {colour}\n")
    assert part.rgba is None and f"not read: Kd {colour}" in warnings[0]


def test_black_under_a_texture_means_the_texture(folder):
    (part,), _ = _visual(folder, "mtllib m.mtl", "newmtl k\nKd 0 0 0\nd 0.5\nmap_Kd t.png\n")
    assert part.rgba == (1, 1, 1, 0.5) and part.texture is not None


def _stl(count: int) -> bytes:
    triangles = np.zeros(count, dtype=[("numbers", "<f4", 12), ("more", "<u2")])
    triangles["numbers"] = np.arange(12 * count).reshape(count, 12) ** 2 % 7
    return b"made somewhere".ljust(80) + count.to_bytes(4, "little") + triangles.tobytes()


def test_bytes_after_the_triangles_of_an_stl_are_passed_over(folder):
    plain, more = (collision(folder.write(f"{n}.stl", _stl(4) + b"x" * n))[0][0] for n in (0, 60))
    np.testing.assert_array_equal(plain.vertices[plain.faces], more.vertices[more.faces])


@pytest.mark.parametrize(
    ("raw", "problem"),
    [
        (_stl(4)[:-10], "its header counts 4 triangles, and 3 are there"),
        (_stl(4)[:60], "too short"),
        (b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nver", "truncated or damaged"),
    ],
)
def test_a_truncated_stl_says_so(folder, raw, problem):
    with pytest.raises(InputError, match=problem):
        collision(folder.write("c.stl", raw))


def test_pointers_of_git_lfs_are_named(folder):
    """As meshes, URDFs, JSON files and textures: large files of a repository that was cloned without them."""
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
    readers = {"c.obj": collision, "c.stl": collision, "x.urdf": lambda f: read_xml(f, "robot"),
               "x.json": lambda f: read_json(f, dict)}  # fmt: skip
    for name, reader in readers.items():
        with pytest.raises(InputError, match="run git lfs pull"):
            reader(folder.write(name, pointer))
    folder.write("p.png", pointer)
    _, warnings = _visual(folder, "mtllib m.mtl", "newmtl k\nmap_Kd ../p.png\n")
    assert "run git lfs pull" in warnings[0]
