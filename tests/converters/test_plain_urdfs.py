"""Plain URDFs as people have them: what is lost is told at the shell, and no unit error passes in silence."""

from __future__ import annotations

import errno
import json
import pathlib

import mujoco
import numpy as np
import pytest
import shapely
import trimesh
from ig2mj_converters.base.description import Mesh, Shape
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.base.output import replaced_folder
from ig2mj_converters.bodies.kinematics import model_bounds
from ig2mj_converters.convert_object import convert_object
from ig2mj_converters.hulls.link_hulls import HullOptions, decompose_link
from ig2mj_converters.reading.scaling import scale_model
from ig2mj_converters.reading.urdf import read_urdf
from tiny_geometry import box, write_obj

from ig2mj.cli import call
from ig2mj.errors import InputError
from ig2mj.scene.manifest import load_manifest

LINK = '<link name="{}"><collision><geometry><mesh filename="{}"{}/></geometry></collision></link>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><axis xyz="0 0 1"/>{}</joint>'


def urdf(folder: pathlib.Path, content: str, name: str = "thing") -> pathlib.Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.urdf").write_text(f'<robot name="{name}">{content}</robot>')
    return folder / f"{name}.urdf"


def a_box(folder: pathlib.Path, size=(0.2, 0.1, 0.1), name: str = "a.obj") -> str:
    write_obj(folder / name, [("", box(size))])
    return name


def convert(file: pathlib.Path, out: pathlib.Path, *more: str, category: str = "toy") -> int:
    args = ["--urdf", str(file), "--category", category, "--out", str(out), "--no-report", "--no-cache", *more]
    return call(["convert", "object", *args])


def test_the_first_warnings_are_told_at_the_shell_and_strict_makes_them_errors(tmp_path, capsys):
    lost = LINK.format("body", a_box(tmp_path), "") + LINK.format("alone", "a.obj", "")
    file = urdf(tmp_path, lost)
    assert convert(file, tmp_path / "out") == 0
    assert "warning: thing: links without a parent joint are left out: alone" in capsys.readouterr().out
    assert convert(file, tmp_path / "strict", "--strict") == 2
    assert "alone" in capsys.readouterr().err and not (tmp_path / "strict").exists()


def test_an_unknown_category_gets_near_matches(tmp_path, capsys):
    file = urdf(tmp_path, LINK.format("body", a_box(tmp_path), ""))
    assert convert(file, tmp_path / "out", category="frigde") == 0
    told = capsys.readouterr().out
    assert "--category frigde is not known" in told and "fridge" in told


@pytest.mark.parametrize(
    ("size", "odd"), [((0.2, 0.1, 0.1), False), ((200.0, 100.0, 100.0), True), ((2e-4,) * 3, True)]
)
def test_sizes_that_smell_of_a_unit_error_are_told(size, odd, tmp_path, capsys):
    assert convert(urdf(tmp_path, LINK.format("body", a_box(tmp_path, size), "")), tmp_path / "out") == 0
    assert ("another unit" in capsys.readouterr().out) == odd


def test_an_object_without_geometry_is_told(tmp_path, capsys):
    assert convert(urdf(tmp_path, '<link name="body"/>'), tmp_path / "out") == 0
    assert "has no geometry at all" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("limit", "lower", "upper", "told"),
    [
        ('lower="-1e+16" upper="1e+16"', None, None, False),
        ('lower="-inf" upper="inf"', None, None, False),
        ('lower="-1e+16" upper="1"', None, None, True),
        ('lower="-2" upper="1"', -2.0, 1.0, False),
    ],
)
def test_a_limit_beyond_all_use_is_no_limit(limit, lower, upper, told, tmp_path):
    mesh = a_box(tmp_path)
    links = LINK.format("a", mesh, "") + LINK.format("b", mesh, "")
    file = urdf(tmp_path, links + JOINT.format("j", "revolute", "a", "b", f"<limit {limit}/>"))
    model = read_urdf(file, "toy", "thing")
    assert (model.joints["j"].lower, model.joints["j"].upper) == (lower, upper)
    assert any("only one limit is finite" in w for w in model.warnings) == told


def test_a_mirroring_scale_is_told(tmp_path):
    model = read_urdf(urdf(tmp_path, LINK.format("a", a_box(tmp_path), ' scale="-1 1 1"')), "toy", "thing")
    assert any("mirrors the mesh" in w for w in model.warnings)


def test_a_name_of_5000_characters_is_quoted_with_120(tmp_path, capsys):
    file = urdf(tmp_path, LINK.format("a", "x" * 5000 + ".obj", ""))
    assert convert(file, tmp_path / "out") == 2
    assert len(capsys.readouterr().err) < 600
    file = urdf(tmp_path, f'<link name="{"n" * 5000}"/>')
    assert convert(file, tmp_path / "out") == 2
    assert len(capsys.readouterr().err) < 600


def test_meshes_of_a_sibling_folder_need_mesh_root(tmp_path, capsys):
    (tmp_path / "work" / "meshes").mkdir(parents=True)
    a_box(tmp_path / "work" / "meshes")
    file = urdf(tmp_path / "work" / "models", LINK.format("a", "../meshes/a.obj", ""))
    assert convert(file, tmp_path / "out") == 2
    assert "--mesh-root" in capsys.readouterr().err
    assert convert(file, tmp_path / "out", "--mesh-root", str(tmp_path / "work" / "meshes")) == 0
    write_obj(tmp_path / "secret.obj", [("", box((1, 1, 1)))])
    file = urdf(tmp_path / "work" / "models", LINK.format("a", "../../secret.obj", ""))
    assert convert(file, tmp_path / "out", "--mesh-root", str(tmp_path / "work" / "meshes")) == 2


@pytest.mark.parametrize("named", ["package:///meshes/a.obj", "package://robot/meshes/a.obj"])
def test_packages_are_found_on_the_package_path_and_nothing_else_is_read(named, tmp_path, capsys):
    (tmp_path / "share" / "robot" / "meshes").mkdir(parents=True)
    a_box(tmp_path / "share" / "robot" / "meshes")
    file = urdf(tmp_path / "elsewhere" / "models", LINK.format("a", named, ""))
    assert convert(file, tmp_path / "out") == 2
    assert "--package-path" in capsys.readouterr().err
    assert convert(file, tmp_path / "out", "--package-path", str(tmp_path / "share" / "robot")) == 0
    out_of_it = urdf(tmp_path / "elsewhere" / "models", LINK.format("a", "package://robot/../../a.obj", ""))
    a_box(tmp_path)
    assert convert(out_of_it, tmp_path / "out", "--package-path", str(tmp_path / "share" / "robot")) == 2
    assert convert(file, tmp_path / "out", "--package-path", str(tmp_path / "nowhere")) == 2


def test_a_full_disk_names_the_path(tmp_path):
    with (
        pytest.raises(InputError, match=r"out: --out: cannot be written: No space left"),
        replaced_folder(tmp_path / "out"),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")


PLACEHOLDER = '<inertial><mass value="0.1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def test_a_placeholder_inertia_is_computed_from_the_shape(tmp_path, capsys):
    """0.1 kg with 1 kg m2 is a mass 3.2 m away from the middle of a box of 0.2 m."""
    a_box(tmp_path)
    file = urdf(tmp_path, LINK.format("a", "a.obj", "").replace("<collision>", PLACEHOLDER + "<collision>"))
    assert convert(file, tmp_path / "out") == 0
    assert "radius of gyration 3.2 m for a 0.24 m link" in capsys.readouterr().out
    text = (tmp_path / "out" / "object.xml").read_text()
    assert 'mass="0.1"' in text and 'diaginertia="1 1 1"' not in text


def test_scene_and_object_give_one_model_one_mass(dataset, house, tmp_path):
    """Density times the box of the whole, split over the links by volume, in both commands."""
    import mujoco

    convert_object(
        dataset / "objects" / "bottom_cabinet" / "cab0" / "cab0.urdf", "bottom_cabinet", tmp_path / "out",
        model="cab", options=ConvertOptions(report=False),
    )  # fmt: skip
    alone = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "object.xml"))
    (there,) = [e for e in house.entries.values() if e.model == "cab0" and e.scale == (1.0, 1.0, 1.0)][:1]
    masses = sorted(house.model.body(b).mass[0] for b in range(house.model.nbody)
                    if house.model.body(house.model.body_rootid[b]).name == there.name)  # fmt: skip
    assert sorted(m for m in alone.body_mass if m > 0) == pytest.approx(masses, rel=1e-5)


def test_a_second_size_is_the_first_one_stretched(tmp_path, monkeypatch):
    """Convexity survives scaling: nothing is cut up twice, whatever the size."""
    outline = shapely.Polygon([(0, 0), (1, 0), (1, 0.1), (0.3, 0.25), (0.1, 1), (0, 1)])
    angle = trimesh.creation.extrude_polygon(outline, 0.2)
    write_obj(tmp_path / "angle.obj", [("", Mesh(np.asarray(angle.vertices), np.asarray(angle.faces)))])
    file = urdf(tmp_path, LINK.format("a", "angle.obj", ""))
    options = ConvertOptions(report=False)
    convert_object(file, "toy", tmp_path / "one", options=options)
    monkeypatch.setattr("ig2mj_converters.hulls.coacd_process.COMMAND", ("false",))
    size = np.array([1.0, 0.5, 0.2])
    convert_object(file, "toy", tmp_path / "two", bounding_box=tuple(size), options=options)
    one, two = (load_manifest(tmp_path / name).objects[0] for name in ("one", "two"))
    np.testing.assert_allclose(two.bounding_box, size, rtol=2e-3)
    assert len(list((tmp_path / "one" / "meshes").iterdir())) == len(list((tmp_path / "two" / "meshes").iterdir()))
    assert one.bounding_box != two.bounding_box


def fan():
    """Four thin, open, twisted blades round a hub, as ShapeNet has them: no closed surface anywhere."""
    along = np.linspace(0.1, 0.7, 7)
    parts = []
    for quarter in range(4):
        rows = []
        for r in along:
            y, z = 0.08 * np.cos(0.9 - 0.8 * r), 0.08 * np.sin(0.9 - 0.8 * r)
            rows.append(np.array([[r, -y, -z], [r, y, z]]))
        points = np.concatenate(rows)
        faces = [f for i in range(6) for f in ((2 * i, 2 * i + 2, 2 * i + 1), (2 * i + 1, 2 * i + 2, 2 * i + 3))]
        turn = trimesh.transformations.rotation_matrix(quarter * np.pi / 2, [0, 0, 1])
        parts.append(trimesh.Trimesh(points, faces, process=False).apply_transform(turn))
    return trimesh.util.concatenate(parts)


def test_a_fan_with_thin_blades_does_not_grow(tmp_path):
    """CoACD rebuilds open meshes as voxels and so inflates them: pieces are clipped to the hull of their source."""
    mesh = fan()
    shape = Shape("mesh", meshes=[Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))])
    found = decompose_link([shape], HullOptions(cache=False, coacd_threshold=0.2))
    corners = np.concatenate([p.vertices for p in found.pieces])
    allowed = 5e-4 + 1e-3 * np.ptp(mesh.vertices, axis=0)
    assert np.all(corners.min(axis=0) >= mesh.vertices.min(axis=0) - allowed)
    assert np.all(corners.max(axis=0) <= mesh.vertices.max(axis=0) + allowed)


def test_the_check_of_the_bounding_box_compares_with_the_source(tmp_path, monkeypatch):
    """Without metadata.json the manifest's box is the result's own, so only the source's meshes can tell."""
    file = urdf(tmp_path, LINK.format("a", a_box(tmp_path, (1.452, 1.0, 0.3)), ""))
    source = scale_model(read_urdf(file, "toy", "thing"), 1.0)
    bounds = model_bounds(source)
    assert bounds is not None and np.ptp(bounds, axis=0) == pytest.approx([1.452, 1.0, 0.3])
    for grown, passed in ((1.0, True), (1.478 / 1.452, False)):
        from ig2mj_converters.hulls import shapes

        was = shapes.placed
        monkeypatch.setattr(shapes, "placed", lambda mesh, shape, was=was, by=grown: Mesh(
            was(mesh, shape).vertices * by, was(mesh, shape).faces, mesh.name))  # fmt: skip
        outcome = convert_object(file, "toy", tmp_path / "out", options=ConvertOptions(cache=False))
        monkeypatch.undo()
        (check,) = [c for c in outcome.checks if c.name == "bounding_box"]
        assert check.passed == passed
        if not passed:
            assert "1.4780 m, 1.4520 m in the source's meshes" in check.failures[0]["problem"]


def test_a_joint_without_room_to_move_is_compared_at_its_limit(tmp_path):
    box = '<collision><geometry><box size="1 0.2 0.2"/></geometry></collision>'
    joint = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
    joint += '<limit lower="0.8" upper="0.8" effort="1" velocity="1"/></joint>'
    file = urdf(tmp_path, f'<link name="a">{box}</link><link name="b">{box}</link>{joint}')
    outcome = convert_object(file, "toy", tmp_path / "out", options=ConvertOptions(cache=False))
    (check,) = [c for c in outcome.checks if c.name == "bounding_box"]
    assert check.passed, check.failures


def test_models_whose_mesh_files_are_gone_are_skipped_as_missing_file_by_file(dataset, tmp_path, capsys):
    import shutil

    from tiny_house import SCENE

    own = tmp_path / "dataset"
    shutil.copytree(dataset, own)
    gone = sorted((own / "objects" / "stove").rglob("*.obj"))
    collision = [file for file in gone if "collision" in str(file)] or gone
    for file in collision:
        file.unlink()
    args = ["convert", "scene", "--dataset", str(own), "--scene", SCENE, "--no-report", "--json"]
    assert call([*args, "--out", str(tmp_path / "refused")]) == 2
    capsys.readouterr()
    assert call([*args, "--out", str(tmp_path / "out"), "--skip-missing"]) == 3
    (line,) = [s for s in json.loads(capsys.readouterr().out)["skipped"] if s.startswith("stove_0")]
    assert collision[0].name in line


def test_a_visual_mesh_of_fewer_than_four_vertices_is_left_out(tmp_path):
    """MuJoCo refuses such meshes; the object is converted without it, with a warning that names the link."""
    (tmp_path / "sliver.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0.1 0.2 0\nv 0 0 0\nf 1 2 3\nf 4 2 3\n")
    mesh = '<visual><geometry><mesh filename="sliver.obj"/></geometry></visual>'
    box = "<geometry><box size='0.1 0.1 0.1'/></geometry>"
    text = f'<robot name="r"><link name="l">{mesh}<visual>{box}</visual><collision>{box}</collision></link></robot>'
    (tmp_path / "r.urdf").write_text(text)
    outcome = convert_object(tmp_path / "r.urdf", "toy", tmp_path / "out", options=ConvertOptions(report=False))
    assert "r: link 'l': a visual mesh has fewer than 4 vertices and is left out" in outcome.first_warnings
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "object.xml"))
    assert model.ngeom == 3 and model.nmesh == 0  # the ground, a collision box and a visual one


BODY = '<collision><geometry><box size=".2 .1 .1"/></geometry></collision>'
INERTIA = '<inertia ixx=".001" iyy=".001" izz=".001"/>'


@pytest.mark.parametrize(
    ("inside", "warning"),
    [
        (f'<inertial><mass value="1"/>{INERTIA}</inertial><inertial><mass value="5"/></inertial>', "has 2 inertial"),
        (f'<inertial><mass value="1"/><mass value="5"/>{INERTIA}</inertial>', "has 2 mass elements: the first is read"),
        (f"<inertial>{INERTIA}</inertial>", "has no <mass>: it is left out"),
    ],
)
def test_what_is_read_once_or_not_at_all_is_a_warning(tmp_path, inside, warning):
    model = read_urdf(urdf(tmp_path, f'<link name="body">{inside}{BODY}</link>'), "toy", "thing")
    assert [w for w in model.warnings if warning in w]
    inertial = model.links["body"].inertial
    assert inertial is None if "no <mass>" in warning else inertial.mass == 1.0


def test_a_second_axis_or_limit_of_a_joint_is_a_warning(tmp_path):
    links = "".join(f'<link name="{name}">{BODY}</link>' for name in "ab")
    twice = '<limit lower="0" upper="1"/><limit lower="0" upper="2"/><axis xyz="0 1 0"/>'
    model = read_urdf(urdf(tmp_path, links + JOINT.format("j", "revolute", "a", "b", twice)), "toy", "thing")
    assert {w.partition(": has ")[2] for w in model.warnings if ": has " in w} == {
        "2 axis elements: the first is read",
        "2 limit elements: the first is read",
    }
    assert model.joints["j"].upper == 1.0 and model.joints["j"].axis[2] == 1.0
