"""Looks as urdfdom, RViz and COLLADA readers have them: an error in a look is a warning, and never costs geometry."""

from __future__ import annotations

import pytest
from ig2mj_converters.base.file_access import FileGuard
from ig2mj_converters.reading.mesh_files import read_visual
from ig2mj_converters.reading.urdf import read_urdf
from PIL import Image

from ig2mj.errors import InputError

RED, BLUE = (1, 0, 0, 1), (0, 0, 1, 1)
BOX = '<geometry><box size="1 1 1"/></geometry>'
CUBE = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
SIDES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4)]


def read(folder, *inside: str, root: str = '<robot name="r">'):
    file = folder.write("r.urdf", f"{root}{''.join(inside)}{'</u:robot>' if 'u:' in root else '</robot>'}")
    return read_urdf(file, "cup", "r")


def visual(material: str, name: str = "a", geometry: str = BOX) -> str:
    return f'<link name="{name}"><visual>{geometry}{material}</visual></link>'


def colour(rgba: str, name: str = "paint") -> str:
    return f'<material name="{name}"><color rgba="{rgba}"/></material>'


def look(model, link: str = "a"):
    shape = model.links[link].visuals[0]
    return shape.rgba, shape.texture


# ---- materials of a URDF


def test_a_material_is_found_wherever_it_is_defined(folder):
    use = '<material name="paint"/>'
    joint = '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'
    at_the_end = read(folder, visual(use), colour("1 0 0 1"))
    in_a_later_link = read(folder, visual(use), visual(colour("1 0 0 1"), "b"), joint)
    in_an_earlier_link = read(folder, visual(colour("1 0 0 1")), visual(use, "b"), joint)
    assert look(at_the_end) == look(in_a_later_link) == look(in_an_earlier_link, "b") == (RED, None)
    assert not at_the_end.warnings + in_a_later_link.warnings + in_an_earlier_link.warnings


@pytest.mark.parametrize(
    ("material", "warning"),
    [
        ('<material name="gone"/>', "material 'gone' is not defined"),
        (colour("1 0"), "rgba='1 0' is not 3 or 4 numbers"),
        (colour("1 0 0 1 1"), "is not 3 or 4 numbers"),
        (colour("1 0 0 x"), "is not 3 or 4 numbers"),
        (colour("nan 0 0 1"), "is not 3 or 4 numbers"),
        ('<material name="paint"><color/></material>', "rgba='' is not 3 or 4 numbers"),
        ('<material name="paint"><texture filename="gone.png"/></material>', "gone.png is left out"),
        ('<material name="paint"><texture filename="../../x.png"/></material>', "lies outside"),
    ],
)
def test_an_error_in_a_material_costs_the_colour_with_a_warning(folder, material, warning):
    model = read(folder, visual(material))
    assert look(model) == (None, None)
    assert warning in model.warnings[0]


@pytest.mark.parametrize("material", ["", "<material/>", '<material name=""/>'])
def test_no_material_is_no_warning(folder, material):
    model = read(folder, visual(material))
    assert (look(model), model.warnings) == ((None, None), [])


def test_a_broken_definition_falls_back_to_a_good_one_of_that_name(folder):
    assert look(read(folder, colour("0 0 1 1"), visual(colour("1 0")))) == (BLUE, None)


def test_numbers_are_clipped_and_three_are_opaque(folder):
    assert look(read(folder, visual(colour("255 0 -3"))))[0] == RED
    assert look(read(folder, visual(colour("0 0 1 0"))))[0] == BLUE, "an alpha of 0 is drawn as 1"


def test_numbers_of_a_colour_above_one_are_a_warning(folder):
    assert "are they of 255?" in " ".join(read(folder, visual(colour("255 128 0"))).warnings)
    assert "255" not in " ".join(read(folder, visual(colour("1 0.5 0"))).warnings)


def test_a_texture_of_the_urdf_is_put_on_meshes_and_its_mean_on_primitives(folder):
    Image.new("RGB", (2, 2), (0, 0, 255)).save(folder.write("t.png", ""))
    folder.write("v.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    paint = '<material name="paint"><texture filename="t.png"/></material>'
    mesh = read(folder, visual(paint, geometry='<geometry><mesh filename="v.obj"/></geometry>'))
    assert look(mesh) == (None, (folder.root / "t.png").resolve())
    assert len(mesh.links["a"].visuals[0].uv[0]) == 3
    box = read(folder, visual('<material name="paint"/>'), paint)
    assert look(box) == (BLUE, None)
    assert "mean colour of t.png" in box.warnings[0]


# ---- zero-size shapes, namespaces, byte-order marks, encoded names


@pytest.mark.parametrize(
    "geometry",
    [
        '<box size="0 0 0"/>', '<box size="1 0 1"/>', '<sphere radius="0"/>', '<cylinder radius="0.1" length="0"/>',
        '<cylinder radius="0" length="1"/>', '<mesh filename="c.obj" scale="0 0 0"/>',
    ],
)  # fmt: skip
def test_a_shape_of_size_zero_is_left_out_with_a_warning(folder, make, geometry):
    folder.write("c.obj", make.box_obj())
    inside = "".join(f"<{tag}><geometry>{geometry}</geometry></{tag}>" for tag in ("visual", "collision"))
    whole = f'<collision>{BOX}</collision><link name="b"/>'.partition("<link")[0]
    model = read(folder, f'<link name="a">{inside}{whole}</link>')
    assert (len(model.links["a"].visuals), len(model.links["a"].collisions)) == (0, 1)
    assert [("left out" in w, "no size" in w) for w in model.warnings] == [(True, True)] * 2


@pytest.mark.parametrize(
    "root",
    [
        '<robot name="r" xmlns="http://www.ros.org">',
        '<u:robot name="r" xmlns:u="http://www.ros.org">',
        '<u:robot name="r">',
    ],
)
def test_names_are_compared_without_the_namespace_of_the_root(folder, root):
    inside = visual(colour("1 0 0 1"))
    if "u:" in root:
        inside = inside.replace("</", "</u:").replace("<", "<u:").replace("<u:/u:", "</u:")
    assert look(read(folder, inside, root=root)) == (RED, None)


def test_elements_of_other_namespaces_are_not_the_urdfs(folder):
    root = '<robot name="r" xmlns:sim="http://example.org/sim">'
    model = read(folder, '<link name="a"/><sim:link name="b"/><sim:joint name="j"/>', root=root)
    assert list(model.links) == ["a"]


MARKS = {"utf-8": b"\xef\xbb\xbf", "utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}


@pytest.mark.parametrize("encoding", MARKS)
def test_a_byte_order_mark_is_no_part_of_a_file(folder, make, encoding):
    def marked(text: str) -> bytes:
        return MARKS[encoding] + text.encode(encoding)

    folder.write("m.mtl", marked("newmtl a\nKd 1 0 0\n"))
    folder.write("v.obj", marked("mtllib m.mtl\nusemtl a\n" + make.box_obj()))
    folder.write("d.dae", marked(dae(GOOD)))
    for name in ("v.obj", "d.dae"):
        mesh = f'<geometry><mesh filename="{name}"/></geometry>'
        text = f'<robot name="r">{visual("", geometry=mesh)}</robot>'
        model = read_urdf(folder.write("r.urdf", marked(text)), "cup", "r")
        assert (look(model), model.warnings) == ((RED, None), [])


@pytest.mark.parametrize("name", [
    "my%20mesh.obj", "package://pack/my%20mesh.obj", "file://{root}/my%20mesh.obj", "package://p%61ck/my%20mesh.obj",
    "$(find pack)/my mesh.obj", "file://$(find pack)/my%20mesh.obj",
])  # fmt: skip
def test_percent_encoded_names_are_decoded(folder, make, name):
    folder.write("pack/package.xml", "<package><name>pack</name></package>")
    folder.write("pack/my mesh.obj", make.box_obj())
    named = name.format(root=folder.root / "pack")
    text = (
        f'<robot name="r"><link name="a"><collision><geometry><mesh filename="{named}"/></geometry></collision></link>'
    )
    model = read_urdf(folder.write("pack/r.urdf", text + "</robot>"), "cup", "r")
    assert len(model.links["a"].collisions[0].meshes) == 1


def test_a_file_whose_name_holds_a_percent_sign_is_found_first(folder, make):
    folder.write("a%20b.obj", make.box_obj((1, 1, 1)))
    folder.write("a b.obj", make.box_obj((2, 2, 2)))
    guard = FileGuard(folder.root / "r.urdf")
    assert guard.resolve("a%20b.obj", "x").name == "a%20b.obj"
    assert guard.resolve("a%2520b.obj", "x").name == "a%20b.obj"


@pytest.mark.parametrize("name", ["package://..%2F..%2Fetc/x.obj", "package://%2E%2E/x.obj", "$(find ..)/x.obj"])
def test_an_encoded_package_name_leads_no_further_than_a_plain_one(folder, name):
    with pytest.raises(InputError, match="package"):
        FileGuard(folder.root / "r.urdf").resolve(name, "x")


# ---- numbers that are too many, and what xacro leaves


@pytest.mark.parametrize(
    ("origin", "xyz", "warning"),
    [
        ('xyz="1 2 3 4"', (1, 2, 3), "xyz='1 2 3 4' has 4 numbers: the first 3 are read, as Bullet does"),
        ('xyz="1 2 3" rpy="0 0 0 0"', (1, 2, 3), "rpy='0 0 0 0' has 4 numbers"),
        ('xyz="$(optenv PLACE 1 2 3)"', (1, 2, 3), "$(optenv PLACE 1 2 3) is read as its default"),
    ],
)
def test_numbers_that_are_too_many_and_defaults_of_xacro_are_read_with_a_warning(folder, origin, xyz, warning):
    model = read(folder, f'<link name="a"><collision><origin {origin}/>{BOX}</collision></link>')
    assert tuple(model.links["a"].collisions[0].pose[:3, 3]) == xyz
    assert len(model.warnings) == 1 and warning in model.warnings[0]


def test_a_visual_mesh_scaled_flat_costs_no_geometry(folder, make):
    folder.write("c.obj", make.box_obj())
    flat = '<visual><geometry><mesh filename="c.obj" scale="1 1 0"/></geometry></visual>'
    model = read(folder, f'<link name="a">{flat}<collision>{BOX}</collision></link>')
    assert (len(model.links["a"].visuals), len(model.links["a"].collisions)) == (0, 1)
    assert len(model.warnings) == 1 and "gives its mesh no size" in model.warnings[0]


def test_a_mesh_with_four_scales_has_the_first_three(folder, make):
    folder.write("c.obj", make.box_obj())
    model = read(folder, visual("", geometry='<geometry><mesh filename="c.obj" scale="1 2 3 4"/></geometry>'))
    assert model.links["a"].visuals[0].scale == (1, 2, 3)


@pytest.mark.parametrize("word", ["${width}", "$(arg width)"])
def test_what_only_xacro_can_expand_is_refused_with_the_remedy(folder, word):
    with pytest.raises(InputError, match="expand the file with xacro"):
        read(folder, f'<link name="a"><collision><geometry><sphere radius="{word}"/></geometry></collision></link>')


@pytest.mark.parametrize("declared", ['xmlns:xacro="http://www.ros.org/wiki/xacro"', ""])
def test_macros_that_were_not_expanded_are_left_out_with_a_warning(folder, declared):
    macros = '<xacro:property name="w" value="1"/><xacro:wheel name="left"/><xacro:wheel name="right"/>'
    inside = f'<link name="a"><collision>{BOX}</collision></link>{macros}'
    (warning,) = read(folder, inside, root=f'<robot name="m" {declared}>').warnings
    assert warning == "elements of xacro are left out: <xacro:property>, <xacro:wheel> (expand the file with xacro)"


# ---- OBJ


def test_vertex_colours_of_an_obj_are_drawn_in_their_mean(folder):
    text = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0.7 0 0\nf 1 2 3\n"
    part, warnings = visual_of(folder.write("v.obj", text))
    assert part.rgba == pytest.approx((0.9, 0, 0, 1))
    assert "v.obj has colours per vertex: their mean colour is used" in warnings[0]


def test_materials_that_no_mtl_defines_are_a_warning(folder, make):
    part, warnings = visual_of(folder.write("v.obj", "usemtl gone\n" + make.box_obj()))
    assert (part.rgba, len(part.meshes[0].faces)) == (None, 12)
    assert "no MTL file defines: gone" in warnings[0]


# ---- COLLADA


EFFECT = (
    '<effect id="e"><profile_COMMON>{0}<technique sid="t"><lambert>{1}</lambert></technique></profile_COMMON></effect>'
)
MATERIAL = '<library_materials><material id="paint"><instance_effect url="#e"/></material></library_materials>'


def effect(inside: str, parameters: str = "") -> str:
    return f"<library_effects>{EFFECT.format(parameters, inside)}</library_effects>"


GOOD = effect("<diffuse><color>1 0 0 1</color></diffuse>") + MATERIAL
SAMPLER = (
    '<newparam sid="sf"><surface type="2D"><init_from>gone</init_from></surface></newparam>'
    '<newparam sid="sm"><sampler2D><source>sf</source></sampler2D></newparam>'
)


def dae(
    looks: str, symbol: str = "m", target: str = "#paint", mesh: str = "", inputs: str = "", stride: int = 1
) -> str:
    """A cube with two sides missing, placed by a node."""
    indices = " ".join(str(i) + " 0" * (stride - 1) for side in SIDES for i in side)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>{looks}
<library_geometries><geometry id="cube"><mesh><source id="p"><float_array id="pa" count="24">
{" ".join(str(c) for p in CUBE for c in p)}</float_array><technique_common><accessor source="#pa" count="8" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
</source>{mesh}<vertices id="pv"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="10" material="{symbol}"><input semantic="VERTEX" source="#pv" offset="0"/>{inputs}<p>{indices}</p>
</triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#cube"><bind_material>
<technique_common><instance_material symbol="m" target="{target}"/></technique_common></bind_material>
</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def visual_of(file):
    warnings: list[str] = []
    parts = read_visual(file, FileGuard(file), "link 'a'", warnings)
    assert len(parts) == 1
    return parts[0], warnings


def source(name: str, values: str, parameters: str) -> str:
    inner = "".join(f'<param name="{p}" type="float"/>' for p in parameters)
    array = f'<float_array id="{name}a" count="{len(values.split())}">{values}</float_array>'
    return (
        f'<source id="{name}">{array}<technique_common><accessor source="#{name}a" count="1" '
        f'stride="{len(parameters)}">{inner}</accessor></technique_common></source>'
    )


NORMAL = '<input semantic="NORMAL" source="#no" offset="1"/>'
TEXTURED = '<diffuse><texture texture="sm" texcoord="UV"/></diffuse>'
BROKEN_DAES = {
    "no material": (dae(""), "material 'paint' does not exist"),
    "no effect": (dae(MATERIAL), "effect 'e' of material 'paint' does not exist"),
    "no image": (dae(effect(TEXTURED, SAMPLER) + MATERIAL), "the image of material 'paint' does not exist"),
    "no sampler": (dae(effect(TEXTURED) + MATERIAL), "the image of material 'paint' does not exist"),
    "no image file": (
        dae('<library_images><image id="gone"><init_from>x.png</init_from></image></library_images>'
            + effect(TEXTURED, SAMPLER) + MATERIAL), "x.png is left out",
    ),
    "two numbers": (dae(effect("<diffuse><color>1 0</color></diffuse>") + MATERIAL), "'1 0' of 'paint' is not 3 or 4"),
    "five numbers": (dae(effect("<diffuse><color>1 0 0 1 1</color></diffuse>") + MATERIAL), "is not 3 or 4"),
    "words": (dae(effect("<diffuse><color>red</color></diffuse>") + MATERIAL), "'red' of 'paint' is not 3 or 4"),
    "empty target": (dae(GOOD, target=""), ""),
    "no profile": (dae('<library_effects><effect id="e"/></library_effects>' + MATERIAL), "effect 'e' has no colour"),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN_DAES)
def test_a_dae_keeps_its_geometry_whatever_its_materials_lack(folder, what):
    text, warning = BROKEN_DAES[what]
    part, warnings = visual_of(folder.write("v.dae", text))
    assert (len(part.meshes[0].faces), part.texture) == (10, None)
    assert part.rgba is None
    assert any(warning in line for line in warnings) or not warning


BROKEN_MESHES = {
    "normals that do not exist": dae(GOOD, inputs=NORMAL, stride=2),
    "normals that are too few": dae(GOOD, mesh=source("no", "0 0", "XYZ"), inputs=NORMAL, stride=2),
    "texture coordinates that do not exist": dae(GOOD, inputs=NORMAL.replace("NORMAL", "TEXCOORD"), stride=2),
    "texture coordinates of one number": dae(
        GOOD, mesh=source("no", "0", "S"), inputs=NORMAL.replace("NORMAL", "TEXCOORD"), stride=2
    ),
    "an input that nobody knows": dae(GOOD, inputs=NORMAL.replace("NORMAL", "WEATHER"), stride=2),
    "line strips": dae(GOOD, mesh="<linestrips><p>0 1</p></linestrips>"),
    "an unknown element": dae(GOOD, mesh='<x:y xmlns:x="http://x"/>'),
}


@pytest.mark.parametrize("what", BROKEN_MESHES)
def test_a_dae_keeps_its_geometry_and_colour_whatever_else_its_mesh_lacks(folder, what):
    part, _ = visual_of(folder.write("v.dae", BROKEN_MESHES[what]))
    assert (len(part.meshes[0].faces), part.rgba) == (10, RED)


def test_the_looks_of_a_dae(folder):
    cases = {
        "three numbers": (effect("<diffuse><color>0 0 1</color></diffuse>") + MATERIAL, BLUE),
        "not bound, but named": (GOOD.replace('"paint"', '"m"'), RED),
        "half transparent": (
            effect('<diffuse><color>1 0 0 1</color></diffuse><transparent opaque="A_ONE"><color>1 1 1 0.5</color>'
                   "</transparent><transparency><float>1</float></transparency>") + MATERIAL, (1, 0, 0, 0.5),
        ),
        "opaque by RGB_ZERO": (
            effect('<diffuse><color>1 0 0 1</color></diffuse><transparent opaque="RGB_ZERO"><color>0 0 0 1</color>'
                   "</transparent><transparency><float>1</float></transparency>") + MATERIAL, RED,
        ),
    }  # fmt: skip
    for what, (looks, rgba) in cases.items():
        symbol, target = ("m", "") if what.startswith("not") else ("m", "#paint")
        part, _ = visual_of(folder.write("v.dae", dae(looks, symbol, target).replace('target=""', 'target="#m"')))
        assert part.rgba == pytest.approx(rgba), what


def test_a_dae_without_namespace_or_scene_is_read(folder):
    text = dae(GOOD).replace(' xmlns="http://www.collada.org/2005/11/COLLADASchema"', "")
    text = text.replace('<scene><instance_visual_scene url="#s"/></scene>', "")
    part, warnings = visual_of(folder.write("v.dae", text))
    assert (len(part.meshes[0].faces), part.rgba, warnings) == (10, RED, [])


def test_a_skinned_geometry_of_a_dae_stands_in_its_bind_shape(folder):
    skin = (
        '<library_controllers><controller id="k"><skin source="#cube">'
        "<bind_shape_matrix>1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</bind_shape_matrix>"
        "</skin></controller></library_controllers>"
    )
    text = dae(GOOD + skin).replace('<instance_geometry url="#cube">', '<instance_controller url="#k">')
    part, _ = visual_of(folder.write("v.dae", text.replace("</instance_geometry>", "</instance_controller>")))
    assert part.meshes[0].vertices[:, 0].min() == pytest.approx(5)
    assert part.rgba == RED
