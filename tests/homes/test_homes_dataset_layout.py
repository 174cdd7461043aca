"""The generated dataset is laid out as iGibson's, and the same seed gives the same bytes."""

from __future__ import annotations

import hashlib
import json
import pathlib
from xml.etree import ElementTree

import numpy as np
import pytest
from ig2mj_converters.reading.obj_files import read_obj
from ig2mj_homes.dataset.root import build_dataset
from ig2mj_homes.objects.catalogue import catalogue
from PIL import Image

from ig2mj.errors import UnknownNameError

SOME = ("apple", "bottom_cabinet", "carving_knife", "hardback", "jar", "stove")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    out = tmp_path_factory.mktemp("dataset")
    assert build_dataset(out, only=SOME, jobs=1) == {name: catalogue()[name].count for name in SOME}
    return out


def models(root: pathlib.Path, category: str) -> list[pathlib.Path]:
    found = sorted((root / "objects" / category).iterdir())
    assert found, category
    return found


def floats(text: str) -> np.ndarray:
    return np.array([float(v) for v in text.split()])


def metadata(model: pathlib.Path) -> dict:
    return json.loads((model / "misc/metadata.json").read_text())


def digest(root: pathlib.Path) -> dict[str, str]:
    files = sorted(f for f in root.rglob("*") if f.is_file())
    return {str(f.relative_to(root)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


def test_version_is_one_that_igibson_accepts(root: pathlib.Path):
    version = tuple(int(v) for v in (root / "VERSION").read_text().strip().split("."))
    assert (2, 0, 6) <= version < (2, 2, 3)


def test_categories_file_lists_objects_and_building_parts(root: pathlib.Path):
    lines = (root / "metadata/categories.txt").read_text().split()
    assert lines == sorted({*SOME, "walls", "floors", "ceilings"})


def test_specs_hold_the_density_of_the_bounding_box(root: pathlib.Path):
    """Density = mass / (sx sy sz)."""
    specs = json.loads((root / "metadata/avg_category_specs.json").read_text())
    for name, spec in specs.items():
        assert spec["density"] == pytest.approx(spec["mass"] / np.prod(spec["size"]), rel=1e-3), name
    assert specs["apple"]["enable_ag"] == 1 and specs["stove"]["enable_ag"] == 0


def test_non_sampleable_categories_are_synsets_of_fixed_furniture(root: pathlib.Path):
    lines = (root / "metadata/non_sampleable_categories.txt").read_text().split()
    assert "stove.n.01" in lines and "apple.n.01" not in lines


@pytest.mark.parametrize("category", SOME)
def test_urdf_names_files_that_exist(root: pathlib.Path, category: str):
    for model in models(root, category):
        tree = ElementTree.parse(model / f"{model.name}.urdf").getroot()
        assert tree.find(".//mesh") is not None
        for mesh in tree.iter("mesh"):
            assert (model / mesh.attrib["filename"]).is_file()
        for link in tree.iter("link"):
            assert len(link.findall("collision")) == 1, "one collision OBJ per link"
        links = {link.attrib["name"] for link in tree.iter("link")}
        children = {joint.find("child").attrib["link"] for joint in tree.iter("joint")}  # type: ignore[union-attr]
        assert links - children == {"base_link"}


@pytest.mark.parametrize("category", SOME)
def test_collision_files_hold_one_convex_group_per_piece(root: pathlib.Path, category: str):
    files = list((root / "objects" / category).glob("*/shape/collision/*_cm.obj"))
    assert len(files) >= len(models(root, category))
    for file in files:
        names = [line.split()[1] for line in file.read_text().splitlines() if line.startswith("o ")]
        assert names == [f"convex_{k}" for k in range(len(names))] and names


@pytest.mark.parametrize("category", SOME)
def test_metadata_box_is_that_of_the_collision_meshes(root: pathlib.Path, category: str):
    """bbox_size and base_link_offset hold at scale 1, all joints at 0, base axes."""
    for model in models(root, category):
        tree = ElementTree.parse(model / f"{model.name}.urdf").getroot()
        origin = {"base_link": np.zeros(3)}
        for joint in tree.iter("joint"):
            parent, child = joint.find("parent").attrib["link"], joint.find("child").attrib["link"]  # type: ignore[union-attr]
            origin[child] = origin[parent] + floats(joint.find("origin").attrib["xyz"])  # type: ignore[union-attr]
        cloud = []
        for name, place in origin.items():
            for line in (model / f"shape/collision/{name}_cm.obj").read_text().splitlines():
                if line.startswith("v "):
                    cloud.append(np.array([float(v) for v in line.split()[1:4]]) + place)
        low, high = np.min(cloud, 0), np.max(cloud, 0)
        np.testing.assert_allclose(metadata(model)["bbox_size"], high - low, atol=5e-6)
        np.testing.assert_allclose(metadata(model)["base_link_offset"], (high + low) / 2, atol=5e-6)


def test_material_groups_name_classes_that_the_library_has(root: pathlib.Path):
    library = json.loads((root / "materials/materials.json").read_text())
    for instances in library.values():
        for files in instances.values():
            assert (root / "materials" / files["diffuse"]).is_file()
    assert set(json.loads((root / "materials/material_friction.json").read_text())) == set(library)
    for category in SOME:
        for model in models(root, category):
            groups, files = json.loads((model / "misc/material_groups.json").read_text())
            assert {name for names in groups.values() for name in names} <= set(library)
            assert {str(k) for k in files.values()} <= set(groups)
            assert all((model / "shape/visual" / file).is_file() for file in files)


def test_openable_joints_are_named_and_directed(root: pathlib.Path):
    for model in models(root, "bottom_cabinet"):
        tree = ElementTree.parse(model / f"{model.name}.urdf").getroot()
        joints = {joint.attrib["name"]: joint for joint in tree.iter("joint")}
        assert metadata(model)["openable_joint_ids"], model.name
        for _, name, direction in metadata(model)["openable_joint_ids"]:
            assert direction == 1
            limit = joints[name].find("limit")
            assert limit is not None and float(limit.attrib["lower"]) == 0 < float(limit.attrib["upper"])


def test_point_links_have_no_geometry_and_blades_are_boxes(root: pathlib.Path):
    stove = metadata(models(root, "stove")[0])["links"]
    assert stove["heat_source"]["geometry"] is None and stove["toggle_button"]["geometry"] is None
    blade = metadata(models(root, "carving_knife")[0])["links"]["slicer"]
    assert blade["geometry"] == "box" and min(blade["size"]) > 0


def test_halves_lie_beside_their_whole(root: pathlib.Path):
    """The halves' category is the whole's."""
    wholes = [m for m in models(root, "apple") if "object_parts" in metadata(m)]
    assert len(wholes) >= catalogue()["apple"].count
    for whole in wholes:
        for part in metadata(whole)["object_parts"]:
            assert part["category"] == "apple"
            assert (root / "objects" / "apple" / part["model"] / f"{part['model']}.urdf").is_file()


def test_orientations_are_likely_and_sorted(root: pathlib.Path):
    for category in SOME:
        for model in models(root, category):
            listed = metadata(model)["orientations"]
            probs = [o["prob"] for o in listed]
            assert min(probs) >= 0.03 and sum(probs) <= 1.01
            assert probs == sorted(probs, reverse=True)
            for o in listed:
                assert np.linalg.norm(o["rotation"]) == pytest.approx(1, abs=1e-5)


def test_visuals_have_a_material_and_small_textures(root: pathlib.Path):
    for model in models(root, "hardback") + models(root, "bottom_cabinet"):
        lines = (model / "shape/visual/default.mtl").read_text().splitlines()
        known = {line.split()[1] for line in lines if line.startswith("newmtl")}
        maps = [line.split()[1] for line in lines if line.startswith("map_Kd")]
        assert maps or model.parent.name != "hardback", "a book has a printed cover"
        for name in maps:
            file = (model / "shape/visual" / name).resolve()
            assert file.stat().st_size < 8000
            with Image.open(file) as image:
                assert max(image.size) <= 256
        for file in (model / "shape/visual").glob("*.obj"):
            used = [line.split()[1] for line in file.read_text().splitlines() if line.startswith("usemtl")]
            assert len(used) == 1 and used[0] in known
            assert read_obj(file)


@pytest.mark.slow
def test_same_seed_same_bytes_with_any_number_of_processes(root: pathlib.Path, tmp_path: pathlib.Path):
    build_dataset(tmp_path / "again", only=SOME, jobs=2)
    assert digest(tmp_path / "again") == digest(root)


def test_another_seed_gives_other_bytes(root: pathlib.Path, tmp_path: pathlib.Path):
    build_dataset(tmp_path / "other", only=["apple"], seed=1, jobs=1)
    urdf = "objects/apple/apple_00/shape/collision/base_link_cm.obj"
    assert (tmp_path / "other" / urdf).read_bytes() != (root / urdf).read_bytes()


@pytest.mark.slow
def test_rebuilding_a_category_leaves_nothing_of_the_old_one(root: pathlib.Path):
    stray = root / "objects/jar/old_model"
    stray.mkdir()
    build_dataset(root, only=SOME, jobs=1)
    assert not stray.exists()


def test_unknown_category_is_refused_before_anything_is_written(tmp_path: pathlib.Path):
    with pytest.raises(UnknownNameError, match="appel"):
        build_dataset(tmp_path / "none", only=["appel"])
    assert not (tmp_path / "none").exists()
