"""Bad input gives an InputError whose one line names the file and the element; it never crashes, hangs or reads
outside the dataset root."""

from __future__ import annotations

import pytest
from ig2mj_converters.reading.dataset import Dataset
from ig2mj_converters.reading.urdf import read_urdf

from ig2mj.errors import Ig2mjError, InputError

MESH = "shape/c.obj"


def read_object(root):
    return Dataset(root.root).model("cup", "m")


def read_scene(root):
    return Dataset(root.root).scene("S_int")


# (what is wrong, what the URDF's inside is, what the message must hold besides the file's name)
URDFS = {
    "no links": ("", "has no link"),
    "cycle": (
        "{link a}{link b}{link c}{joint j1 revolute b c}{joint j2 revolute c b}",
        "joint 'j2'.*cycle|joint 'j1'.*cycle",
    ),
    "link is its own parent": ("{link a}{link b}{joint j fixed b b}", "joint 'j'.*cycle"),
    "several parents": ("{link a}{link b}{link c}{joint j1 fixed a c}{joint j2 fixed b c}", "joint 'j2'.*'c'.*parent"),
    "duplicate link": ("{link a}{link a}", "link 'a' \\(line.*twice"),
    "duplicate joint": ("{link a}{link b}{link c}{joint j fixed a b}{joint j fixed a c}", "joint 'j'.*twice"),
    "nameless link": ("<link/>", "link.*has no name"),
    "control character in a name": ("<link name='a&#9;b'/>", "link.*control characters"),
    "parent does not exist": ("{link a}{joint j fixed x a}", "joint 'j'.*parent link 'x'"),
    "child does not exist": ("{link a}{joint j fixed a x}", "joint 'j'.*child link 'x'"),
    "joint without child": ("{link a}<joint name='j' type='fixed'><parent link='a'/></joint>", "joint 'j'.*no child"),
    "joint type spherical": ("{link a}{link b}{joint j spherical a b}", "joint 'j'.*'spherical'"),
    "joint type planar": ("{link a}{link b}{joint j planar a b}", "joint 'j'.*'planar'"),
    "joint without type": (
        "{link a}{link b}<joint name='j'><parent link='a'/><child link='b'/></joint>",
        "joint 'j'.*joint type ''",
    ),
    "axis of length zero": ("{link a}{link b}{joint j revolute a b <axis xyz='0 0 0'/>}", "joint 'j' axis.*direction"),
    "axis of two numbers": ("{link a}{link b}{joint j revolute a b <axis xyz='0 1'/>}", "joint 'j' axis.*2 numbers"),
    "NaN in a joint limit": (
        "{link a}{link b}{joint j revolute a b <limit lower='nan' upper='1'/>}",
        "joint 'j' limit.*lower.*nan",
    ),
    "comma for a point in an origin": (
        "{link a}{link b}<joint name='j' type='fixed'><origin xyz='0,5 0 0'/>"
        "<parent link='a'/><child link='b'/></joint>",
        "joint 'j' origin.*0,5",
    ),
    "underscore in a number": ("{link a <inertial><mass value='1_0'/></inertial>}", "link 'a'.*mass.*1_0"),
    "a mass no float can hold twice": ("{link a <inertial><mass value='1e200'/></inertial>}", "link 'a'.*mass.*1e200"),
    "negative mass": ("{link a <inertial><mass value='-1'/></inertial>}", "link 'a' inertial mass.*negative"),
    "mass is not a number": ("{link a <inertial><mass value='heavy'/></inertial>}", "link 'a' inertial mass.*heavy"),
    "inertia not finite": (
        "{link a <inertial><mass value='1'/><inertia ixx='inf'/></inertial>}",
        "link 'a' inertial inertia.*ixx",
    ),
    "mimic without joint": (
        "{link a}{link b}{joint j revolute a b <limit lower='0' upper='1'/><mimic/>}",
        "joint 'j' mimic.*'joint' is missing",
    ),
    "collision without geometry": ("{link a <collision/>}", "link 'a' collision.*0 geometries"),
    "two geometries": (
        "{link a <collision><geometry><box size='1 1 1'/><box size='1 1 1'/></geometry></collision>}",
        "link 'a' collision.*2 geometries",
    ),
    "unknown geometry": (
        "{link a <collision><geometry><plane normal='0 0 1'/></geometry></collision>}",
        "link 'a' collision.*<plane>",
    ),
    "negative box": (
        "{link a <collision><geometry><box size='1 -1 1'/></geometry></collision>}",
        "link 'a'.*box.*not positive",
    ),
    "sphere without radius": (
        "{link a <collision><geometry><sphere/></geometry></collision>}",
        "link 'a'.*sphere.*'radius' is missing",
    ),
    "NaN in a collision origin": (
        "{link a <collision><origin xyz='0 0 NaN'/><geometry><box size='1 1 1'/></geometry></collision>}",
        "link 'a' collision origin.*NaN",
    ),
    "mesh scale zero": ("{link a {mesh shape/c.obj 1 0 1}}", "link 'a'.*mesh.*flat"),
    "mesh scale of two numbers": ("{link a {mesh shape/c.obj 1 1}}", "link 'a'.*mesh.*2 numbers"),
    "mesh without filename": (
        "{link a <collision><geometry><mesh/></geometry></collision>}",
        "link 'a'.*mesh.*'filename' is missing",
    ),
    "mesh missing": ("{link a {mesh shape/no.obj}}", "link 'a'.*mesh.*shape/no.obj.*does not exist"),
    "mesh name empty": ("{link a <collision><geometry><mesh filename=' '/></geometry></collision>}", "link 'a'.*mesh"),
    "mesh is a folder": ("{link a {mesh ../m}}", "m.*not a supported mesh format"),
    "mesh leaves the dataset": ("{link a {mesh ../../../../secret.obj}}", "link 'a'.*outside the dataset root"),
    "mesh path is absolute": ("{link a {mesh /etc/passwd.obj}}", "link 'a'.*absolute"),
    "mesh path with a drive": ("{link a {mesh C:/x.obj}}", "link 'a'.*absolute"),
    "mesh at an address": ("{link a {mesh https://x.invalid/x.obj}}", "link 'a'.*not below the dataset root"),
    "mesh as file://": ("{link a {mesh file:///etc/passwd}}", "link 'a'.*not below the dataset root"),
    "mesh of unknown format": ("{link a {mesh shape/c.blend}}", "c.blend.*not a supported mesh format"),
    "encrypted collision": ("{link a {mesh shape/c.encrypted.obj}}", "link 'a'.*encrypted collision"),
}


def expand(text: str) -> str:
    """{link a ...}, {joint j type parent child ...}, {mesh file scale} -> URDF."""
    out, rest = "", text
    while "{" in rest:
        before, _, rest = rest.partition("{")
        depth, end = 1, 0
        while depth:
            depth += {"{": 1, "}": -1}.get(rest[end], 0)
            end += 1
        inside, rest = rest[: end - 1], rest[end:]
        words = inside.split(" ")
        if words[0] == "link":
            out += before + f"<link name='{words[1]}'>{expand(' '.join(words[2:]))}</link>"
        elif words[0] == "joint":
            name, kind, parent, child = words[1:5]
            out += before + f"<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>"
            out += " ".join(words[5:]) + "</joint>"
        else:
            scale = f" scale='{' '.join(words[2:])}'" if len(words) > 2 else ""
            out += before + f"<collision><geometry><mesh filename='{words[1]}'{scale}/></geometry></collision>"
    return out + rest


@pytest.mark.parametrize("what", URDFS)
def test_object_urdf(root, make, what):
    inside, message = URDFS[what]
    root.write("objects/cup/m/shape/c.blend", "x")
    root.write("objects/cup/m/shape/c.encrypted.obj", b"\0\1\2")
    root.write("../secret.obj", make.box_obj())
    root.write("objects/cup/m/m.urdf", make.robot(expand(inside)))
    with pytest.raises(InputError, match=f"(?s).*({message})") as caught:
        read_object(root)
    assert "\n" not in str(caught.value)
    assert str(root.root) in str(caught.value)


XML = {
    "empty file": (b"", "is empty"),
    "zero bytes": (b"\0" * 100, "is empty|not XML"),
    "no XML": (b"hello world", "not XML"),
    "binary": (bytes(range(256)) * 4, "XML"),
    "JSON": (b'{"robot": 1}', "not XML"),
    "HTML": (b"<html><body>404</body></html>", "root element is <html>"),
    "truncated": (b"<robot><link name='a'><visual>", "line 1.*truncated"),
    "truncated in a tag": (b"<robot>\n<link name='a", "truncated"),
    "truncated after oddities": (b"<robot a:b='1'><!-- a -- b --><x:y/>&<link name='a'>", "truncated"),
    "comment without end": (b"<robot><!-- <link name='a'/></robot>", "line 1"),
    "ill nested": (b"<robot><link name='a'></robot></link>", "line 1"),
    "attribute twice": (b"<robot><link name='a' name='b'/></robot>", "line 1.*redefined"),
    "attribute without quotes": (b"<robot><link name=a/></robot>", "line 1"),
    "nested 10,000 deep": (b"<robot>" + b"<a>" * 10_000 + b"</a>" * 10_000 + b"</robot>", "depth"),
    "billion laughs": (
        b'<!DOCTYPE r [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;">]><robot><link name="&b;"/></robot>',
        "entities",
    ),
    "external entity": (
        b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot><link name="&x;"/></robot>',
        "entities",
    ),
    "parameter entity in UTF-16": (
        '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE r [<!ENTITY % x "y">]><robot/>'.encode("utf-16"),
        "entities",
    ),
}


@pytest.mark.parametrize("what", XML)
def test_broken_or_hostile_xml(root, what):
    content, message = XML[what]
    root.write("objects/cup/m/m.urdf", content)
    with pytest.raises(InputError, match=message) as caught:
        read_object(root)
    assert "m.urdf" in str(caught.value)


METADATA = {
    "broken JSON": ('{"bbox_size": [1, 1,', "not valid JSON"),
    "a list": ("[1]", "list instead of a dict"),
    "nested too deeply": ("[" * 100_000 + "]" * 100_000, "nested too deeply"),
    "bbox_size of two numbers": ('{"bbox_size": [1, 1]}', "'bbox_size'.*3 numbers"),
    "bbox_size zero": ('{"bbox_size": [1, 0, 1]}', "'bbox_size'.*not positive"),
    "bbox_size negative": ('{"bbox_size": [1, -1, 1]}', "'bbox_size'.*not positive"),
    "bbox_size NaN": ('{"bbox_size": [1, NaN, 1]}', "'bbox_size'.*not finite"),
    "bbox_size huge": ('{"bbox_size": [1, 1' + "0" * 400 + ", 1]}", "'bbox_size'.*not finite"),
    "bbox_size of words": ('{"bbox_size": ["1", "1", "1"]}', "'bbox_size'.*3 numbers"),
    "meta link of unknown geometry": (
        '{"links": {"slicer": {"geometry": "mesh", "xyz": [0,0,0]}}}',
        "link 'slicer'.*mesh",
    ),
    "meta box without size": ('{"links": {"slicer": {"geometry": "box", "xyz": [0,0,0]}}}', "link 'slicer'.*size"),
    "openable joint without name": ('{"openable_joint_ids": [[3]]}', "openable joint 0"),
    "openable direction": ('{"openable_joint_ids": [[3, "j", 0]]}', "openable joint 0.*direction 0"),
    "object part without model": ('{"object_parts": [{"category": "x"}]}', "object part 0.*model"),
    "orientation of three numbers": ('{"orientations": [{"rotation": [0,0,1]}]}', "orientation 0.*4 numbers"),
}


@pytest.mark.parametrize("what", METADATA)
def test_metadata_json(root, what):
    content, message = METADATA[what]
    root.write("objects/cup/m/misc/metadata.json", content)
    with pytest.raises(InputError, match=message) as caught:
        read_object(root)
    assert "metadata.json" in str(caught.value)


# (links and joints of a scene, what the message must hold)
LINK, JOINT = "<link name='o' category='cup' model='m' {}/>", "<joint name='j' type='{}'>{}</joint>"
TO_WORLD = "<child link='o'/><parent link='world'/>"
SCENES = {
    "no category": ("<link name='o' model='m'/>" + JOINT.format("fixed", TO_WORLD), "link 'o'.*no category"),
    "no model": ("<link name='o' category='cup'/>" + JOINT.format("fixed", TO_WORLD), "link 'o'.*no model"),
    "no joint": (LINK.format(""), "link 'o'.*no joint"),
    "two joints": (LINK.format("") + 2 * JOINT.format("fixed", TO_WORLD), "joint 'j'.*another joint"),
    "name twice": (2 * LINK.format("") + JOINT.format("fixed", TO_WORLD), "link 'o'.*twice"),
    "joint of nothing": (JOINT.format("fixed", "<child link='x'/><parent link='world'/>"), "joint 'j'.*'x'"),
    "parent is not the world": (
        LINK.format("") + JOINT.format("fixed", "<child link='o'/><parent link='x'/>"),
        "joint 'j'.*not 'world'",
    ),
    "revolute joint": (LINK.format("") + JOINT.format("revolute", TO_WORLD), "joint 'j'.*'revolute'"),
    "box and scale": (
        LINK.format("bounding_box='1 1 1' scale='1 1 1'") + JOINT.format("fixed", TO_WORLD),
        "link 'o'.*both bounding_box and scale",
    ),
    "scale zero": (LINK.format("scale='1 0 1'") + JOINT.format("fixed", TO_WORLD), "link 'o'.*scale.*not positive"),
    "scale negative": (LINK.format("scale='1 -1 1'") + JOINT.format("fixed", TO_WORLD), "link 'o'.*scale"),
    "box zero": (LINK.format("bounding_box='0 1 1'") + JOINT.format("fixed", TO_WORLD), "link 'o'.*bounding_box"),
    "box NaN": (LINK.format("bounding_box='nan 1 1'") + JOINT.format("fixed", TO_WORLD), "link 'o'.*bounding_box.*nan"),
    "pose not finite": (
        LINK.format("") + JOINT.format("fixed", "<origin xyz='0 inf 0'/>" + TO_WORLD),
        "joint 'j' origin.*inf",
    ),
    "states is not JSON": (LINK.format("states='{'") + JOINT.format("fixed", TO_WORLD), "link 'o'.*'states'.*JSON"),
    "states is a list": (LINK.format("states='[]'") + JOINT.format("fixed", TO_WORLD), "link 'o'.*'states'|'states'.*"),
    "joint_states is a number": (LINK.format("joint_states='3'") + JOINT.format("fixed", TO_WORLD), "'joint_states'"),
    "joint state infinite": (
        LINK.format("joint_states='{\"a\": [Infinity, 0]}'") + JOINT.format("fixed", TO_WORLD),
        "joint 'a'.*not finite",
    ),
    "base_poses of three numbers": (
        LINK.format("base_poses='[[[0,0,0],[0,0,1]]]'") + JOINT.format("fixed", TO_WORLD),
        "'base_poses'.*4 numbers",
    ),
    "current_index 7": (
        "<link name='o' category='multiplexer' current_index='7'/>",
        "link 'o'.*current_index='7'",
    ),
    "multiplexer does not exist": (
        LINK.format("multiplexer='x'") + JOINT.format("fixed", TO_WORLD),
        "link 'o'.*multiplexer 'x'",
    ),
    "slash in a name": (
        "<link name='a/b' category='cup' model='m'/><joint name='j' type='fixed'><child link='a/b'/>"
        "<parent link='world'/></joint>",
        "link 'a/b'.*slash",
    ),
    "model leads upwards": (
        "<link name='o' category='cup' model='../../..'/>" + JOINT.format("fixed", TO_WORLD),
        "link 'o'.*model '../../..'.*slash",
    ),
    "category leads upwards": (
        "<link name='o' category='..' model='m'/>" + JOINT.format("fixed", TO_WORLD),
        "link 'o'.*category '..'.*dot",
    ),
}


@pytest.mark.parametrize("what", SCENES)
def test_scene_urdf(root, what):
    inside, message = SCENES[what]
    root.scene(inside)
    with pytest.raises(InputError, match=message) as caught:
        read_scene(root)
    assert "S_int_best.urdf" in str(caught.value)


ROOTS = {
    "specs are no JSON": ("metadata/avg_category_specs.json", "{", "not valid JSON"),
    "specs with density 0": (
        "metadata/avg_category_specs.json",
        '{"cup": {"density": 0}}',
        "category 'cup'.*density 0 is not positive",
    ),
    "specs entry is a number": ("metadata/avg_category_specs.json", '{"cup": 3}', "category 'cup'"),
    "overlaps are no pairs": ("scenes/S_int/misc/bbox_overlap.json", '[["a"]]', "entry 0.*pair"),
    "overlaps are no JSON": ("scenes/S_int/misc/bbox_overlap.json", "[", "not valid JSON"),
    "room map is not an image": ("scenes/S_int/layout/floor_semseg_0.png", "PNG?", "not an image"),
}


@pytest.mark.parametrize("what", ROOTS)
def test_files_of_the_root(root, what):
    name, content, message = ROOTS[what]
    root.scene()
    root.image("scenes/S_int/layout/floor_semseg_0.png", [[1] * 20] * 20)
    root.image("scenes/S_int/layout/floor_insseg_0.png", [[1] * 20] * 20)
    root.write(name, content)
    with pytest.raises(InputError, match=message) as caught:
        read_scene(root)
    assert name.rsplit("/", 1)[1] in str(caught.value)


def test_a_root_that_is_none(tmp_path):
    with pytest.raises(InputError, match=r"not a dataset root.*VERSION"):
        Dataset(tmp_path)


def test_names_that_do_not_exist_are_told_with_near_ones(root):
    root.scene()
    data = Dataset(root.root)
    with pytest.raises(Ig2mjError, match=r"'S_in'.*S_int"):
        data.scene("S_in")
    with pytest.raises(InputError, match=r"other.urdf.*S_int_best.urdf"):
        data.scene("S_int", "other.urdf")
    with pytest.raises(InputError, match=r"cup/x.*does not exist.*known models: m"):
        data.model("cup", "x")
    with pytest.raises(InputError, match=r"'\.\.' is not a name"):
        data.model("..", "x")


def test_symbolic_links_out_of_the_root_are_refused(root, make, tmp_path):
    outside = tmp_path / "outside.obj"
    outside.write_text(make.box_obj())
    mesh = root.root / "objects/cup/m/shape/c.obj"
    mesh.unlink()
    mesh.symlink_to(outside)
    with pytest.raises(InputError, match=r"m.urdf.*link 'base_link'.*outside the dataset root"):
        read_object(root)
    (tmp_path / "models").mkdir()
    (root.root / "objects/plate").symlink_to(tmp_path / "models")
    with pytest.raises(InputError, match=r"symbolic link"):
        Dataset(root.root).model("plate", "x")


def test_a_plain_urdf_reads_below_its_folder_or_package_only(tmp_path, make):
    secret = tmp_path / "secret.obj"
    secret.write_text(make.box_obj())
    home = tmp_path / "thing"
    home.mkdir()
    for name in (str(secret), "../secret.obj", f"file://{secret}"):
        urdf = home / "t.urdf"
        urdf.write_text(make.robot(make.link("a", make.shape("collision", name))))
        with pytest.raises(InputError, match=r"t.urdf.*link 'a'.*outside the URDF's folder"):
            read_urdf(urdf, "thing", "t")
        assert len(read_urdf(urdf, "thing", "t", allow_outside=True).links["a"].collisions) == 1
    urdf.write_text(make.robot(make.link("a", make.shape("collision", "package://nowhere/x.obj"))))
    with pytest.raises(InputError, match=r"link 'a'.*package 'nowhere'"):
        read_urdf(urdf, "thing", "t")
