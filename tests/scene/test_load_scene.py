"""Loading: what a user may point at, and every way in which manifest.json and scene.xml can disagree."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import jaxtyping
import msgspec
import numpy as np
import pytest
import tiny_home as homes

import ig2mj
from ig2mj.agents import Fetch
from ig2mj.errors import Ig2mjError, InputError, ManifestError, UnknownNameError
from ig2mj.scene import manifest as mf


@pytest.mark.parametrize("name", ["", "scene.xml", "manifest.json"])
def test_a_scene_is_found_by_its_folder_or_either_file(tiny_home_folder: pathlib.Path, name: str):
    scene = ig2mj.load_scene(tiny_home_folder / name)
    assert scene.name == "tiny_home"
    assert scene.object_names[:3] == ("floor", "walls", "table")
    assert "tiny_home" in repr(scene)


def test_objects_keep_the_order_of_the_manifest(tiny_home: ig2mj.Scene):
    assert list(tiny_home.tables.object_names) == [o.name for o in tiny_home.manifest.objects]
    assert tiny_home.object("knife").category == "carving_knife"


def test_an_unknown_object_lists_near_matches(tiny_home: ig2mj.Scene):
    with pytest.raises(UnknownNameError, match="near matches: table"):
        tiny_home.object_index("tabel")


def test_importing_the_package_loads_neither_mujoco_nor_jax():
    code = "import ig2mj, sys; assert not {'mujoco', 'jax'} & set(sys.modules); assert 'load_scene' in dir(ig2mj)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_name_the_package_does_not_have_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Scenery'"):
        _ = ig2mj.Scenery


def broken(folder: pathlib.Path, change) -> pathlib.Path:
    """A tiny home whose manifest was changed by `change(manifest)`."""
    homes.write_tiny_home(folder)
    manifest = homes.home_manifest()
    change(manifest)
    mf.save_manifest(manifest, folder / "manifest.json")
    return folder


def entry(manifest: mf.Manifest, name: str) -> mf.ObjectEntry:
    return next(o for o in manifest.objects if o.name == name)


def drop_body(m):
    entry(m, "table").bodies = ["tabel"]


def drop_joint(m):
    entry(m, "cabinet").joints[0].name = "cabinet_nothing"
    entry(m, "cabinet").openable = []


def drop_site(m):
    entry(m, "stove").links["heat_source"].site = "stove/fire"


def drop_geom(m):
    entry(m, "knife").links["slicer"].geom = "knife/edge"


def foreign_site(m):
    entry(m, "stove").links["heat_source"].site = "sink/water_source"


def strange_kind(m):
    entry(m, "stove").links["warp_core"] = mf.LinkEntry(site="stove/heat_source")


def free_in_manifest(m):
    entry(m, "table").fixed = False


def fixed_in_manifest(m):
    entry(m, "box").fixed = True


def two_owners(m):
    entry(m, "box").bodies = ["box", "book"]


def agent_without_body(m):
    m.agents = [mf.AgentEntry("robot", "robot")]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (drop_body, "object 'table': names the body 'tabel'"),
        (drop_joint, "object 'cabinet': names the joint 'cabinet_nothing'"),
        (drop_site, "object 'stove', link 'heat_source': names the site 'stove/fire'"),
        (drop_geom, "object 'knife', link 'slicer': names the geom 'knife/edge'"),
        (foreign_site, "rides on a body of another object"),
        (strange_kind, "link 'warp_core': is of no known kind; kinds are heat_source"),
        (free_in_manifest, "object 'table': is free in the manifest"),
        (fixed_in_manifest, "object 'box': is fixed in the manifest"),
        (two_owners, "body 'book' is also"),
        (agent_without_body, "agent 'robot': names the body 'robot'"),
    ],
)
def test_a_manifest_that_does_not_fit_the_model_is_refused_in_one_line(tmp_path, change, says):
    folder = broken(tmp_path, change)
    with pytest.raises(ManifestError) as error:
        ig2mj.load_scene(folder)
    assert says in str(error.value)
    assert str(folder / "manifest.json") in str(error.value)
    assert "\n" not in str(error.value)


def test_a_colliding_plane_is_refused_by_name(tmp_path):
    homes.write_tiny_home(tmp_path)
    text = (tmp_path / "scene.xml").read_text()
    box = '<geom name="floor/collision_0" type="box" size="2 2 0.05" pos="0 0 0" density="300"'
    assert box in text
    (tmp_path / "scene.xml").write_text(
        text.replace(box, '<geom name="floor/collision_0" type="plane" size="2 2 0.05" pos="0 0 0"')
    )
    with pytest.raises(ManifestError, match=r"geom 'floor/collision_0' of scene\.xml: collides and is not a box"):
        ig2mj.load_scene(tmp_path)


def test_files_that_are_missing_or_broken_are_named(tmp_path):
    with pytest.raises(InputError, match="there is no such scene"):
        ig2mj.load_scene(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"holds no scene\.xml"):
        ig2mj.load_scene(tmp_path)
    (tmp_path / "scene.xml").write_text("<mujoco><worldbody><body></mujoco>")
    with pytest.raises(ManifestError, match="there is no such file"):
        ig2mj.load_scene(tmp_path)
    mf.save_manifest(homes.home_manifest(), tmp_path / "manifest.json")
    with pytest.raises(InputError, match="MuJoCo cannot load it") as error:
        ig2mj.load_scene(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("objects", "tells_line"), [((), True), (("apple",), False)])
def test_an_error_names_a_line_only_where_it_is_one_of_the_users_file(tmp_path, objects, tells_line):
    """With added objects MuJoCo reads a text made from several files, whose lines are nobody's."""
    homes.write_tiny_home(tmp_path)
    lines = (tmp_path / "scene.xml").read_text().splitlines()
    number = next(n for n, line in enumerate(lines) if '<geom name="box/collision_0"' in line)
    lines[number] = lines[number].replace('<geom name="box/collision_0"', '<geom name="box/collision_0" mass="-1"')
    (tmp_path / "scene.xml").write_text("\n".join(lines))
    with pytest.raises(InputError, match="box/collision_0") as error:
        ig2mj.load_scene(tmp_path, objects=objects)
    assert str(error.value).startswith(f"{tmp_path / 'scene.xml'}: MuJoCo cannot load it")
    assert (f"line {number + 1}" in str(error.value)) == tells_line
    assert (", line " in str(error.value)) == tells_line


def test_rooms_named_by_the_manifest_must_be_on_the_map(tmp_path):
    homes.write_tiny_home(tmp_path)
    manifest = homes.home_manifest()
    manifest.rooms.file = "rooms.npz"
    mf.save_manifest(manifest, tmp_path / "manifest.json")
    with pytest.raises(InputError, match=r"rooms\.npz"):
        ig2mj.load_scene(tmp_path)


def test_a_manifest_of_another_version_is_refused(tmp_path):
    homes.write_tiny_home(tmp_path)
    raw = msgspec.json.decode((tmp_path / "manifest.json").read_bytes())
    raw["format_version"] = 99
    (tmp_path / "manifest.json").write_bytes(msgspec.json.encode(raw))
    with pytest.raises(ManifestError, match="format version 99"):
        ig2mj.load_scene(tmp_path)


@pytest.mark.parametrize(
    ("agents", "says"),
    [
        ("fetch", "agents = 'fetch': a list of robots is expected"),
        (["fetch"], "agents: 'fetch' is not a robot"),
        (Fetch().at(0, 0, 0), "a list of robots is expected"),
        ([Fetch], "Fetch'> is not a robot"),
        ([Fetch().at(float("nan"), 0, 0)], "robot 'fetch' starts at .*finite numbers are expected"),
        ([Fetch().at(0, 0, 0), Fetch().at(1, 0, 0)], "two robots are named 'fetch'"),
        ([Fetch(name="table").at(1, 0, 0)], "robot 'table' cannot be added to the scene: .*repeated name 'table'"),
    ],
)
def test_what_is_no_robot_is_refused_in_one_line(tiny_home_folder, agents, says, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as users call
    with pytest.raises(Ig2mjError, match=says) as told:
        ig2mj.load_scene(tiny_home_folder, agents=agents)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("path", [None, 3])
def test_what_is_no_path_is_refused(path, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    with pytest.raises(InputError, match=f"{path}: is not a path"):
        ig2mj.load_scene(path)


def test_agents_are_compiled_in_and_listed(tiny_home_folder, tiny_home):
    from ig2mj.agents.floating_hand import FloatingHand

    scene = ig2mj.load_scene(tiny_home_folder, agents=[FloatingHand(pos=(0, 0, 1.5))])
    tables = scene.tables
    assert tables.agent_names == ("hand",)
    assert (tables.body_object[tables.agent_body] == -1).all()
    assert len(tables.finger_body) == 10 and (tables.finger_agent == 0).all()
    assert tables.agent_fovy[0] == pytest.approx(np.deg2rad(60))
    assert scene.model.nq == tiny_home.model.nq + 16
    assert tables.openable_qposadr.tolist() == tiny_home.tables.openable_qposadr.tolist()
    assert not tiny_home.manifest.agents
