"""The conversions as a whole: outputs, exit statuses, atomicity, reproducibility."""

from __future__ import annotations

import hashlib
import json
import os
import pathlib
import pickle
import shutil
import time

import mujoco
import numpy as np
import pytest
from ig2mj_converters.base import inputs, process_pool
from ig2mj_converters.base.output import replaced_folder
from tiny_dataset import write_dataset
from tiny_geometry import box, write_obj
from tiny_house import SCENE, instance_xml, scene_xml

from ig2mj.cli import call
from ig2mj.errors import InputError
from ig2mj.files.heartbeat import DEAD, identity
from ig2mj.scene.manifest import load_manifest


def hashes(folder: pathlib.Path) -> dict[str, str]:
    """Relative path -> hash of every file, except the report, which holds timings."""
    files = [f for f in sorted(folder.rglob("*")) if f.is_file() and f.stem != "report"]
    return {str(f.relative_to(folder)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


def scene_file(root: pathlib.Path, *instances: str, name: str = "extra") -> pathlib.Path:
    file = root / "scenes" / SCENE / "urdf" / f"{name}.urdf"
    file.write_text(scene_xml(*instances))
    return file


@pytest.fixture
def own(tmp_path, dataset) -> pathlib.Path:
    """A copy of the tiny dataset that a test may break."""
    return pathlib.Path(shutil.copytree(dataset, tmp_path / "own"))


def test_the_scene_command_writes_everything_the_contract_names(dataset, tmp_path, capsys):
    out = tmp_path / "out"
    assert call(["convert", "scene", "--dataset", str(dataset), "--scene", SCENE, "--out", str(out), "--json"]) == 0
    for name in ("scene.xml", "manifest.json", "meshes", "rooms.npz", "report.json", "report.html"):
        assert (out / name).exists(), name
    told = json.loads(capsys.readouterr().out)
    assert told["objects"] == len(load_manifest(out).objects) and told["skipped"] == []


def test_scene_xml_needs_nothing_but_its_folder(house, tmp_path):
    moved = shutil.copytree(house.folder, tmp_path / "elsewhere")
    assert mujoco.MjModel.from_xml_path(str(moved / "scene.xml")).nbody == house.model.nbody
    for name in ("scene.xml", "manifest.json"):
        assert str(house.folder.parent) not in (moved / name).read_text()


@pytest.mark.slow
def test_equal_input_gives_equal_bytes_and_jobs_make_no_difference(convert, house):
    with inputs.recording() as shared:
        again = convert(jobs=2, cache=False)
    assert hashes(again.folder) == hashes(house.folder)
    with inputs.recording() as alone:
        convert(cache=False)
    assert shared.answers == alone.answers  # the workers tell what they read


def test_the_object_command(dataset, tmp_path):
    urdf = dataset / "objects" / "fridge" / "fr0" / "fr0.urdf"
    out = tmp_path / "out"
    assert (
        call(["convert", "object", "--urdf", str(urdf), "--category", "fridge", "--out", str(out), "--no-report"]) == 0
    )
    (entry,) = load_manifest(out).objects
    assert entry.name == "fr0" and entry.category == "fridge" and not entry.fixed
    model = mujoco.MjModel.from_xml_path(str(out / "object.xml"))
    assert model.joint("fr0_joint_0").type[0] == mujoco.mjtJoint.mjJNT_HINGE
    assert entry.mass == pytest.approx(90.0 / (0.6 * 0.6 * 1.6) * 0.6 * 0.6 * 1.6, rel=1e-6)


def test_the_shapes_of_one_object_are_shared_among_the_jobs(dataset, tmp_path, monkeypatch):
    seen = []

    def here(pool, function, tasks, labels, *_):
        seen.append((list(labels), pool.jobs))
        return [pickle.loads(pickle.dumps(function(pickle.loads(pickle.dumps(task))))) for task in tasks]

    monkeypatch.setattr(process_pool.TaskPool, "map", here)
    urdf = dataset / "objects" / "bottom_cabinet" / "cab0" / "cab0.urdf"
    args = ["convert", "object", "--urdf", str(urdf), "--category", "bottom_cabinet", "--no-report", "--no-cache"]
    assert call([*args, "--jobs", "3", "--out", str(tmp_path / "out")]) == 0
    assert {jobs for _, jobs in seen} == {3}
    assert [label.split(":")[0] for label in seen[0][0]] == ["link base_link", "link link_0", "link link_1"]


def test_the_object_command_scales_to_a_bounding_box(dataset, tmp_path):
    urdf = dataset / "objects" / "stove" / "st0" / "st0.urdf"
    out = tmp_path / "out"
    args = ["convert", "object", "--urdf", str(urdf), "--category", "stove", "--model", "big", "--no-report"]
    assert call([*args, "--bbox", "1.2", "0.6", "0.9", "--out", str(out)]) == 0
    (entry,) = load_manifest(out).objects
    assert entry.name == "big" and entry.bounding_box == pytest.approx((1.2, 0.6, 0.9))
    model = mujoco.MjModel.from_xml_path(str(out / "object.xml"))
    np.testing.assert_allclose(model.site("big/heat_source").pos, [0.2, 0, 0.45], atol=1e-6)


def test_a_plain_urdf_keeps_its_masses_and_needs_no_dataset(tmp_path):
    write_obj(tmp_path / "meshes" / "a b.obj", [("", box((0.2, 0.1, 0.1)))])
    (tmp_path / "thing.urdf").write_text(
        '<robot name="thing"><link name="body"><inertial><mass value="2.5"/><inertia ixx="0.01" iyy="0.02" izz="0.02" '
        'ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><mesh filename="meshes/a b.obj"/></geometry>'
        '</collision></link><link name="wheel"><collision><geometry><cylinder radius="0.05" length="0.02"/></geometry>'
        '</collision></link><joint name="spin" type="continuous"><parent link="body"/><child link="wheel"/>'
        '<axis xyz="0 0 1"/><dynamics damping="0.3" friction="0.7"/></joint></robot>'
    )
    out = tmp_path / "out"
    assert call(["convert", "object", "--urdf", str(tmp_path / "thing.urdf"), "--category", "toy", "--no-report",
                 "--out", str(out)]) == 0  # fmt: skip
    model = mujoco.MjModel.from_xml_path(str(out / "object.xml"))
    assert model.body("thing").mass[0] == pytest.approx(2.5)
    assert model.body("thing_wheel").mass[0] > 0
    spin = model.joint("thing_spin")
    assert model.dof_frictionloss[spin.dofadr[0]] == pytest.approx(0.7)
    assert model.dof_damping[spin.dofadr[0]] == pytest.approx(0.3) and not model.jnt_limited[spin.id]
    (wheel,) = [g for g in range(model.ngeom) if model.geom(g).name == "thing_wheel/collision_0"]
    assert model.geom_type[wheel] == mujoco.mjtGeom.mjGEOM_CYLINDER


@pytest.mark.parametrize(("origin", "warned"), [("", True), ('<origin xyz="0 0 0.05"/>', False)])
def test_a_centre_of_mass_on_the_surface_is_a_warning(tmp_path, capsys, origin, warned):
    (tmp_path / "cup.urdf").write_text(
        f'<robot name="cup"><link name="body"><inertial>{origin}<mass value="0.3"/><inertia ixx="4e-4" iyy="4e-4" '
        'izz="4e-4" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0 0 0.05"/><geometry>'
        '<box size="0.07 0.07 0.1"/></geometry></collision></link></robot>'
    )
    words = ["--urdf", str(tmp_path / "cup.urdf"), "--category", "cup", "--no-report", "--out", str(tmp_path / "out")]
    assert call(["convert", "object", *words]) == 0
    assert ("centre of mass (0 0 0) is not inside of the shape" in capsys.readouterr().out) == warned


def test_a_missing_model_is_exit_2_and_all_of_them_are_named(own, tmp_path, capsys):
    shutil.rmtree(own / "objects" / "stove")
    shutil.rmtree(own / "objects" / "bed" / "bed0")
    out = tmp_path / "out"
    assert call(["convert", "scene", "--dataset", str(own), "--scene", SCENE, "--out", str(out)]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert "stove_0" in line and "bed_0" in line and "--skip-missing" in line
    assert not out.exists()


def test_skip_missing_is_exit_3_and_converts_the_rest(own, tmp_path, capsys):
    shutil.rmtree(own / "objects" / "stove")
    out = tmp_path / "out"
    args = ["--dataset", str(own), "--scene", SCENE, "--out", str(out), "--skip-missing", "--no-report"]
    assert call(["convert", "scene", *args]) == 3
    assert "stove_0" in capsys.readouterr().out
    names = [entry.name for entry in load_manifest(out).objects]
    assert "stove_0" not in names and "sink_0" in names


@pytest.mark.parametrize(
    ("arguments", "telling"),
    [
        (["scene", "--scene", "nowhere"], "nowhere"),
        (["scene", "--scene", SCENE, "--jobs", "0"], "--jobs"),
        (["scene", "--scene", SCENE, "--max-hulls", "0"], "--max-hulls"),
        (["scene", "--scene", SCENE, "--max-hull-vertices", "3"], "--max-hull-vertices"),
        (["scene", "--scene", SCENE, "--only-rooms", "sauna_0"], "sauna_0"),
        (["scene", "--scene", SCENE, "--urdf", "missing.urdf"], "missing.urdf"),
    ],
)
def test_bad_scene_arguments_are_exit_2_with_one_line(arguments, telling, dataset, tmp_path, capsys):
    out = tmp_path / "out"
    assert call(["convert", *arguments, "--dataset", str(dataset), "--out", str(out)]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert len(lines) == 1 and telling in lines[0]
    assert not out.exists()


@pytest.mark.parametrize("bbox", [("0", "1", "1"), ("-1", "1", "1"), ("nan", "1", "1"), ("inf", "1", "1")])
def test_a_bounding_box_that_cannot_be_is_exit_2(bbox, dataset, tmp_path, capsys):
    urdf = dataset / "objects" / "stove" / "st0" / "st0.urdf"
    args = ["--urdf", str(urdf), "--category", "stove", "--out", str(tmp_path / "out"), "--bbox", *bbox]
    assert call(["convert", "object", *args]) == 2
    assert "--bbox" in capsys.readouterr().err


def test_input_errors_survive_the_way_back_from_a_worker_process():
    error = pickle.loads(pickle.dumps(InputError("a.urdf", "is broken", element="link 'x'", fix="fix it")))
    assert (error.file, error.element) == ("a.urdf", "link 'x'")
    assert str(error) == "a.urdf: link 'x': is broken (fix it)"


@pytest.mark.slow
def test_a_broken_model_is_exit_2_also_from_a_worker_process(own, tmp_path, capsys):
    (own / "objects" / "stove" / "st0" / "st0.urdf").write_text("<robot name='st0'><link name='base_link'>")
    out = tmp_path / "out"
    args = ["--dataset", str(own), "--scene", SCENE, "--out", str(out), "--jobs", "2"]
    assert call(["convert", "scene", *args]) == 2
    assert "st0.urdf" in capsys.readouterr().err and not out.exists()


def test_rooms_and_categories_can_be_chosen(convert):
    kitchen = convert(only_rooms=("kitchen",)).entries
    assert "stove_0" in kitchen and "bed_0" not in kitchen and "walls" in kitchen
    beds = convert(only_categories=("bed",)).entries
    assert set(beds) == {"walls", "floors", "ceilings", "bed_0"}


def test_names_with_spaces_dots_and_other_letters(own, convert):
    odd = ["a b", "Größe.7-β", "stove_0 & co", "椅子"]
    file = scene_file(
        own,
        *(
            instance_xml(name.replace("&", "&amp;"), "pot_plant", "pl0", (0.5 + 0.3 * i, -1.0, 0.2), fixed=False)
            for i, name in enumerate(odd)
        ),
    )
    scene = convert(urdf=file, root=own)
    assert [e.name for e in scene.manifest.objects[3:]] == odd
    for name in odd:
        assert scene.model.body(name).jntnum[0] == 1
    assert {f.parent.name for f in scene.folder.rglob("*") if f.is_file()} <= {"scene", "meshes", "textures"}


def test_a_body_name_that_two_objects_claim_is_told_apart(own, convert):
    file = scene_file(
        own,
        instance_xml("fridge_0", "fridge", "fr0", (-1.0, 0, 0.81)),
        instance_xml("fridge_0_link_0", "pot_plant", "pl0", (1, 0, 0.2), fixed=False),
    )
    scene = convert(urdf=file, root=own)
    assert scene.entries["fridge_0_link_0"].bodies == ["fridge_0_link_0__2"]


def test_halves_whose_model_is_missing_are_a_warning(own, tmp_path):
    shutil.rmtree(own / "objects" / "half_apple")
    out = tmp_path / "out"
    assert call(["convert", "scene", "--dataset", str(own), "--scene", SCENE, "--out", str(out)]) == 0
    assert load_manifest(out).objects[-1].name == "knife-kn0-0"
    assert "half_apple/hap0" in (out / "report.json").read_text()


def test_the_old_output_stays_when_the_new_run_fails(house, own, tmp_path):
    out = pathlib.Path(shutil.copytree(house.folder, tmp_path / "out"))
    before = hashes(out)
    (own / "objects" / "stove" / "st0" / "st0.urdf").write_text("no xml")
    assert call(["convert", "scene", "--dataset", str(own), "--scene", SCENE, "--out", str(out)]) == 2
    assert hashes(out) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "own"]


def test_the_old_output_is_replaced_as_a_whole(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "manifest.json").write_text("{}")
    (out / "stale.obj").write_text("")
    with replaced_folder(out) as folder:
        (folder / "manifest.json").write_text('{"new": 1}')
        assert (out / "stale.obj").exists()
    assert [p.name for p in out.iterdir()] == ["manifest.json"]
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_an_interrupted_run_leaves_nothing_behind(tmp_path):
    with pytest.raises(KeyboardInterrupt), replaced_folder(tmp_path / "out") as folder:
        (folder / "scene.xml").write_text("half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_the_leftovers_of_a_killed_run_are_removed_by_the_next(tmp_path):
    dead = tmp_path / ".out.ig2mj-abc"
    dead.mkdir()
    own = json.loads(json.dumps(identity()))
    dead.with_name(f"{dead.name}.alive").write_text(
        json.dumps(own | {"process": 4194305})
    )  # no process has this number
    (tmp_path / ".out.ig2mj-old.alive").write_text(json.dumps(own | {"process": 4194305}))
    with replaced_folder(tmp_path / "out") as folder:
        (folder / "manifest.json").write_text("{}")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_the_folder_of_a_run_on_another_machine_is_removed_only_when_it_is_silent(tmp_path):
    other = tmp_path / ".out.ig2mj-abc"
    other.mkdir()
    sign = other.with_name(f"{other.name}.alive")
    sign.write_text(json.dumps({"boot": "another", "namespace": "pid:[1]", "process": 1, "started": "5"}))
    for seconds, left in ((DEAD - 10, ["out", sign.name[:-6], sign.name]), (DEAD + 5, ["out"])):
        os.utime(sign, (time.time() - seconds,) * 2)
        with replaced_folder(tmp_path / "out") as folder:
            (folder / "manifest.json").write_text("{}")
        assert sorted(p.name for p in tmp_path.iterdir()) == sorted(left)


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_what_is_no_output_of_ours_is_never_overwritten(kind, tmp_path):
    out = tmp_path / "thesis"
    if kind == "file":
        out.write_text("years of work")
    else:
        out.mkdir()
        (out / "chapter1.tex").write_text("years of work")
    with pytest.raises(InputError, match="thesis"), replaced_folder(out):
        pytest.fail("must not start")
    assert "years of work" in (out if kind == "file" else out / "chapter1.tex").read_text()


def test_a_robot_is_not_overwritten_by_an_object_nor_an_object_by_a_home(tmp_path, capsys):
    (tmp_path / "rover").mkdir()
    for name in ("manifest.json", "object.xml", "robot.json"):
        (tmp_path / "rover" / name).write_text("{}")
    words = ["--urdf", str(tmp_path / "cup.urdf"), "--out", str(tmp_path / "rover")]
    assert call(["convert", "object", *words, "--category", "cup"]) == 2
    assert "rover: --out: holds a robot, and is not overwritten" in capsys.readouterr().err
    (tmp_path / "rover" / "robot.json").unlink()
    assert call(["convert", "robot", *words]) == 2
    assert "rover: --out: holds an object" in capsys.readouterr().err
    assert call(["convert", "scene", "--dataset", str(tmp_path), "--scene", "x", *words[2:]]) == 2
    assert "rover: --out: holds an object" in capsys.readouterr().err


def test_the_seed_chooses_random_models_and_the_same_seed_the_same(own, convert):
    shutil.copytree(own / "objects" / "pot_plant" / "pl0", own / "objects" / "pot_plant" / "pl1")
    (own / "objects" / "pot_plant" / "pl1" / "pl0.urdf").rename(own / "objects" / "pot_plant" / "pl1" / "pl1.urdf")
    plants = [instance_xml(f"p_{i}", "pot_plant", "random", (0.5 + 0.2 * i, -1.0, 0.2)) for i in range(6)]
    file = scene_file(own, *plants)
    chosen = [[e.model for e in convert(urdf=file, root=own, seed=s).manifest.objects] for s in (1, 1, 2, 3)]
    assert (chosen[0] == chosen[1] and chosen[0] != chosen[2]) or chosen[0] != chosen[3]


def test_the_dataset_generator_is_deterministic(dataset, tmp_path):
    assert hashes(write_dataset(tmp_path / "again")) == hashes(dataset)
