"""Bad input at the command line: exit status 2, one line on stderr that names file and element, nothing left behind."""

from __future__ import annotations

import json
import pathlib
import pickle
import re

import numpy as np
import pytest
from ig2mj_converters.base.read_limits import ReadLimits, limits_of
from ig2mj_converters.hulls.pieces import HullOptions
from ig2mj_converters.model_task import model_tasks, run_task
from ig2mj_converters.reading.dataset import Dataset
from PIL import Image
from tiny_geometry import box, groups, write_obj

from ig2mj.cli import call
from ig2mj.errors import InputError

MODEL = "objects/cup/m"
URDF, MESH, META = f"{MODEL}/m.urdf", f"{MODEL}/c.obj", f"{MODEL}/misc/metadata.json"
SCENE = "scenes/s_int/urdf/s_int_best.urdf"
SPECS, OVERLAPS = "metadata/avg_category_specs.json", "scenes/s_int/misc/bbox_overlap.json"
SEMANTIC, INSTANCES = "scenes/s_int/layout/floor_semseg_0.png", "scenes/s_int/layout/floor_insseg_0.png"

OBJECT = '<robot name="m">{}</robot>'
LINK = '<link name="base_link"><collision><geometry><mesh filename="{}"/></geometry></collision></link>'
CUP = '<link name="cup_0" category="cup" model="m" bounding_box="0.1 0.1 0.2"/>'
JOINT = '<joint name="j_cup_0" type="{}"><origin xyz="0 0 1"/><child link="cup_0"/><parent link="world"/></joint>'
WORLD = '<robot name="igibson_scene"><link name="world"/>{}</robot>'
TWO = '<link name="a"/><link name="b"/><joint name="j" type="{}"><parent link="a"/><child link="b"/>{}</joint>'
BACK = '<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>'
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\n"


def write(root: pathlib.Path, name: str, content: str | bytes) -> None:
    file = root / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content if isinstance(content, bytes) else content.encode())


@pytest.fixture
def root(tmp_path: pathlib.Path) -> pathlib.Path:
    """A dataset of one cup and one scene that holds it."""
    root = tmp_path / "dataset"
    write(root, "VERSION", "2.0.6\n")
    write(root, SPECS, json.dumps({"cup": {"size": [0.1, 0.1, 0.2], "mass": 0.2, "density": 100, "enable_ag": 1}}))
    for name, lines in (("categories", "cup"), ("room_categories", "kitchen"), ("non_sampleable_categories", "")):
        write(root, f"metadata/{name}.txt", lines + "\n")
    write(root, URDF, OBJECT.format(LINK.format("c.obj")))
    write_obj(root / MESH, groups(box((0.1, 0.1, 0.2))))
    write(root, META, json.dumps({"bbox_size": [0.1, 0.1, 0.2], "base_link_offset": [0, 0, 0]}))
    write(root, SCENE, WORLD.format(CUP + JOINT.format("floating")))
    write(root, OVERLAPS, "[]")
    (root / SEMANTIC).parent.mkdir(parents=True)
    for name in (SEMANTIC, INSTANCES):
        Image.fromarray(np.ones((100, 100), np.uint8)).save(root / name)
    return root


def convert(root: pathlib.Path, *more: str) -> int:
    out = root.parent / "out"
    return call(["convert", "scene", "--dataset", str(root), "--scene", "s_int", "--out", str(out), *more])


def complaint(capsys: pytest.CaptureFixture) -> str:
    """The one line on stderr."""
    lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert len(lines) == 1 and lines[0].startswith("error: "), lines
    return lines[0]


#: what is wrong: (file, its content, what the line says after naming the file)
CASES: dict[str, tuple[str, str | bytes, str]] = {
    # scene files
    "scene: empty": (SCENE, b"", "is empty"),
    "scene: no XML": (SCENE, "hello", "not XML"),
    "scene: truncated": (SCENE, WORLD[:40], "line 1.*truncated"),
    "scene: entity expansion": (SCENE, '<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "entities"),
    "scene: external entity": (SCENE, '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot/>', "entities"),
    "scene: other root": (SCENE, "<mujoco/>", "root element is <mujoco>"),
    "scene: no joint": (SCENE, WORLD.format(CUP), "cup_0.*no joint"),
    "scene: a name twice": (SCENE, WORLD.format(CUP + CUP + JOINT.format("fixed")), "cup_0.*twice"),
    "scene: revolute instance": (SCENE, WORLD.format(CUP + JOINT.format("revolute")), "j_cup_0.*'revolute'"),
    "scene: box of NaN": (SCENE, WORLD.format(CUP.replace("0.2", "nan") + JOINT.format("fixed")), "cup_0.*nan"),
    "scene: box of zero": (SCENE, WORLD.format(CUP.replace("0.2", "0") + JOINT.format("fixed")), "cup_0.*box"),
    "scene: negative box": (SCENE, WORLD.format(CUP.replace("0.2", "-1") + JOINT.format("fixed")), "cup_0.*box"),
    "scene: box and scale": (
        SCENE, WORLD.format(CUP.replace("/>", ' scale="1 1 1"/>') + JOINT.format("fixed")), "cup_0.*both",
    ),
    "scene: negative scale": (
        SCENE, WORLD.format(CUP.replace("bounding_box", "scale").replace("0.2", "-1") + JOINT.format("fixed")),
        "cup_0.*scale",
    ),
    "scene: pose infinite": (
        SCENE, WORLD.format(CUP + JOINT.format("fixed").replace("0 0 1", "0 0 inf")), "j_cup_0.*inf",
    ),
    "scene: broken states": (
        SCENE, WORLD.format(CUP.replace("/>", " states='{'/>") + JOINT.format("fixed")), "cup_0.*JSON",
    ),
    "scene: slash in a name": (SCENE, WORLD.format(CUP + JOINT.format("fixed")).replace("cup_0", "c/p"), "c/p.*slash"),
    "scene: category leads upwards": (
        SCENE, WORLD.format(CUP.replace('category="cup"', 'category=".."') + JOINT.format("fixed")), r"cup_0.*'\.\.'",
    ),
    "scene: model missing": (
        SCENE, WORLD.format(CUP.replace('"m"', '"x"') + JOINT.format("fixed")), r"cup_0 \(cup/x\).*--skip-missing",
    ),
    # object URDFs
    "urdf: truncated": (URDF, OBJECT[:18] + "<link name='a", "truncated|line 1"),
    "urdf: no link": (URDF, OBJECT.format(""), "no link"),
    "urdf: cycle": (URDF, OBJECT.format(TWO.format("fixed", "") + BACK), "joint .*cycle"),
    "urdf: unknown joint type": (URDF, OBJECT.format(TWO.format("helical", "")), "joint 'j'.*'helical'"),
    "urdf: planar joint": (URDF, OBJECT.format(TWO.format("planar", "")), "joint 'j'.*'planar'"),
    "urdf: axis of zero": (URDF, OBJECT.format(TWO.format("revolute", '<axis xyz="0 0 0"/>')), "joint 'j' axis"),
    "urdf: limit of NaN": (URDF, OBJECT.format(TWO.format("revolute", '<limit lower="nan" upper="1"/>')), "'j' limit"),
    "urdf: link twice": (URDF, OBJECT.format('<link name="a"/><link name="a"/>'), "link 'a'.*twice"),
    "urdf: child unknown": (URDF, OBJECT.format('<link name="b"/>' + BACK), "joint 'k'.*'a'"),
    "urdf: mesh missing": (URDF, OBJECT.format(LINK.format("no.obj")), "link 'base_link'.*no.obj.*does not exist"),
    "urdf: mesh outside": (URDF, OBJECT.format(LINK.format("../../../../x.obj")), "base_link.*outside the dataset"),
    "urdf: mesh absolute": (URDF, OBJECT.format(LINK.format("/etc/passwd")), "base_link.*absolute"),
    "urdf: mesh at an address": (URDF, OBJECT.format(LINK.format("http://x.invalid/c.obj")), "base_link.*dataset root"),
    "urdf: mesh format unknown": (URDF, OBJECT.format(LINK.format("c.fbx")), "c.fbx.*not a supported mesh format"),
    "urdf: mesh scale zero": (
        URDF, OBJECT.format(LINK.format("c.obj").replace("c.obj\"", 'c.obj" scale="1 0 1"')), "base_link.*flat",
    ),
    "urdf: negative mass": (
        URDF, OBJECT.format('<link name="a"><inertial><mass value="-1"/></inertial></link>'), "link 'a'.*negative",
    ),
    # meshes
    "obj: empty": (MESH, "", "no faces"),
    "obj: binary": (MESH, b"\0\1\2" * 40, "not text"),
    "obj: NaN": (MESH, SQUARE.replace("1 1 0", "1 nan 0") + "f 1 2 3\nf 1 3 4\n", "line 3.*nan"),
    "obj: a vertex that is not there": (MESH, SQUARE + "f 1 2 9\n", "line 5.*'9'"),
    "obj: flat faces only": (MESH, SQUARE + "f 1 1 2\n", "degenerate"),
    "obj: million faces": (MESH, SQUARE + "f 1 2 3\n" * 1_000_001, "faces.*limit"),
    "obj: Git LFS pointer": (MESH, "version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
    # JSON and images
    "metadata: broken": (META, '{"bbox_size": [1,', "not valid JSON"),
    "metadata: NaN": (META, '{"bbox_size": [NaN, 1, 1]}', "bbox_size.*not finite"),
    "metadata: size zero": (META, '{"bbox_size": [0, 1, 1]}', "bbox_size.*not positive"),
    "metadata: a list": (META, "[]", "list instead of"),
    "metadata: deep": (META, "[" * 100_000, "nested too deeply|not valid JSON"),
    "specs: broken": (SPECS, "{", "not valid JSON"),
    "specs: negative density": (SPECS, '{"cup": {"density": -1}}', "category 'cup'.*not positive"),
    "overlaps: no pairs": (OVERLAPS, '[["cup_0"]]', "entry 0"),
    "rooms: no image": (SEMANTIC, b"\x89PNG no", "not an image"),
    "rooms: empty image": (INSTANCES, b"", "not an image"),
}  # fmt: skip


@pytest.mark.parametrize("what", CASES)
def test_a_broken_file_of_the_dataset(what, root, capsys):
    name, content, telling = CASES[what]
    write(root, name, content)
    assert convert(root) == 2
    line = complaint(capsys)
    assert pathlib.Path(name).name in line or "c.fbx" in line
    assert re.search(telling, line), line
    assert sorted(p.name for p in root.parent.iterdir()) == ["dataset"]


def test_at_least_forty_kinds_are_tried():
    assert len(CASES) >= 40


ARGUMENTS = {
    "dataset is not a folder": (["--dataset", "/nowhere/at/all"], "not a dataset root"),
    "scene unknown": (["--scene", "s_in"], "s_int"),
    "scene leads upwards": (["--scene", "../../etc"], "not a name of a folder"),
    "scene file missing": (["--urdf", "no.urdf"], "no.urdf"),
    "room unknown": (["--only-rooms", "sauna"], "sauna"),
    "no jobs": (["--jobs", "0"], "--jobs"),
    "no hulls": (["--max-hulls", "0"], "--max-hulls"),
    "too few vertices": (["--max-hull-vertices", "3"], "--max-hull-vertices"),
}


@pytest.mark.parametrize("what", ARGUMENTS)
def test_a_wrong_argument(what, root, capsys):
    more, telling = ARGUMENTS[what]
    assert convert(root, *more) == 2
    assert telling in complaint(capsys)
    assert sorted(p.name for p in root.parent.iterdir()) == ["dataset"]


@pytest.mark.parametrize("more", [["--seed", "x"], ["--jobs", "1.5"], ["--no-such-flag"]])
def test_bad_usage_is_exit_2_and_no_traceback(more, root, capsys):
    assert convert(root, *more) == 2
    told = capsys.readouterr()
    assert "Traceback" not in told.err + told.out


OBJECTS = {
    "file missing": (None, [], "m.urdf"),
    "mesh outside": (OBJECT.format(LINK.format("../../../../../etc/passwd")), [], "link 'base_link'.*outside"),
    "mesh as file://": (OBJECT.format(LINK.format("file:///etc/hostname.obj")), [], "link 'base_link'.*outside"),
    "unknown package": (OBJECT.format(LINK.format("package://nowhere/c.obj")), [], "link 'base_link'.*'nowhere'"),
    "an SDF": ("<sdf version='1.6'/>", [], "root element is <sdf>"),
    "no such size": (OBJECT.format(LINK.format("c.obj")), ["--bbox", "1", "0", "1"], "--bbox"),
    "no category": (OBJECT.format(LINK.format("c.obj")), ["--category", " "], "--category"),
    "nothing solid to scale": (OBJECT.format('<link name="a"/>'), ["--bbox", "1", "1", "1"], "flat|cannot be scaled"),
}


@pytest.mark.parametrize("what", OBJECTS)
def test_a_bad_object(what, tmp_path, capsys):
    content, more, telling = OBJECTS[what]
    folder = tmp_path / "thing"
    write_obj(folder / "c.obj", groups(box((0.1, 0.1, 0.2))))
    if content is not None:
        write(folder, "m.urdf", content)
    out = str(tmp_path / "out")
    assert call(["convert", "object", "--urdf", str(folder / "m.urdf"), "--category", "cup", "--out", out, *more]) == 2
    line = complaint(capsys)
    assert "m.urdf" in line and re.search(telling, line), line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["thing"]


@pytest.mark.parametrize("name", [URDF, MESH, META, SCENE, SPECS, OVERLAPS, SEMANTIC, INSTANCES, "VERSION"])
def test_damage_of_any_kind_never_fails_otherwise(name, root, capsys):
    """Whatever the damage: converted, or one line; never status 1, which is an error of the converter itself."""
    whole = (root / name).read_bytes()
    rng = np.random.default_rng(7)
    noise = bytes(rng.integers(0, 256, 200, dtype=np.uint8))
    places = rng.integers(0, max(len(whole), 1), 4)
    damaged = [whole[: len(whole) * k // 4] for k in (1, 2, 3)] + [noise, whole + noise, b"\xff\xfe" + whole]
    damaged += [whole[:at] + bytes([whole[at] ^ 0x15]) + whole[at + 1 :] for at in places if len(whole)]
    for content in damaged:
        (root / name).write_bytes(content)
        status = convert(root, "--no-report")
        assert status in (0, 2), (status, content)
        if status == 2:
            assert complaint(capsys)
        capsys.readouterr()


def test_limits_of_the_readers_are_options(root, capsys):
    assert convert(root, "--no-report", "--no-cache", "--limit", "mesh-faces=5", "links=9") == 2
    assert "c.obj: has 12 or more faces, the limit is 5" in (said := capsys.readouterr().err)
    assert "--limit mesh-faces=N" in said
    assert convert(root, "--no-report", "--no-cache", "--limit", "mesh-faces=500") == 0
    assert convert(root, "--limit", "mesh-faced=5") == 2
    assert "there is no limit 'mesh-faced'" in capsys.readouterr().err


def test_limits_go_along_into_worker_processes(root):
    dataset = Dataset(root)
    scene = dataset.scene("s_int")
    with limits_of(ReadLimits(mesh_faces=5)):
        (task,), _ = model_tasks(dataset, scene, scene.instances, lambda _: HullOptions(), False)
    with pytest.raises(InputError, match="the limit is 5"):
        run_task(pickle.loads(pickle.dumps(task)))
