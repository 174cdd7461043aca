"""iGibson's scenes: dataset root, scene URDF, loader filters, cached states."""

from __future__ import annotations

import json

import numpy as np
import pytest
from ig2mj_converters.reading.dataset import Dataset, SceneOptions
from ig2mj_converters.reading.scene_urdf import FIXED_FURNITURE, parse_object_scope, read_scene

from ig2mj.errors import InputError, UnknownNameError


def instances(root, *inside, **options):
    root.scene(*inside)
    return {i.name: i for i in Dataset(root.root).scene("S_int", options=SceneOptions(**options)).instances}


def placed(make, name, category="cup", kind="floating", xyz=(0, 0, 0), rpy=(0, 0, 0), **attributes):
    return make.scene_link(name, category, **attributes) + make.scene_joint(name, kind, xyz, rpy)


# ---- the root


def test_metadata_files(root):
    data = Dataset(root.root)
    assert data.version == "2.0.6"
    assert data.specs["cup"].density == 100
    assert data.enable_ag("cup")
    assert not data.enable_ag("unheard_of")
    assert data.categories == ["cup", "table"]
    assert data.room_types == ["bathroom", "bedroom", "kitchen"]
    assert data.non_sampleable == ["floor.n.01", "sink.n.01"], "floor.n.01 is prepended by iGibson's code"
    assert not data.warnings


@pytest.mark.parametrize(
    ("text", "fits"), [("2.0.6", True), ("2.2.2", True), ("2.2.3", False), ("2.0.5", False), ("x", False)]
)
def test_version_is_between_2_0_6_and_2_2_2(root, text, fits):
    root.write("VERSION", text + "\n")
    assert bool(Dataset(root.root).warnings) != fits


def test_missing_metadata_files_are_warnings(folder):
    folder.write("objects/x/readme", "")
    data = Dataset(folder.root)
    assert len(data.warnings) == 5
    assert data.specs == {}


def test_density_is_mass_over_box_where_it_is_not_given(root):
    root.write("metadata/avg_category_specs.json", '{"cup": {"size": [0.1, 0.1, 0.5], "mass": 1.0}}')
    assert Dataset(root.root).density("cup") == pytest.approx(200)


def test_index_skips_hidden_entries_and_files(root, make):
    root.object(make.robot(make.link("a")), model="b2")
    root.object(make.robot(make.link("a")), model=".hidden")
    root.write("objects/cup/notes.json", "{}")
    assert Dataset(root.root).index() == {"cup": ["b2", "m"]}


# ---- which file


def test_the_order_of_scene_files(root):
    for name in ("S_int.urdf", "S_int_best.urdf", "S_int_random_3.urdf", "S_int_task_x_0_0.urdf"):
        root.scene(file=name)
    data = Dataset(root.root)
    assert data.scene_file("S_int").name == "S_int_best.urdf"
    assert data.scene_file("S_int", random_index=3).name == "S_int_random_3.urdf"
    assert data.scene_file("S_int", "S_int_task_x_0_0").name == "S_int_task_x_0_0.urdf"
    assert data.scene_file("S_int", "S_int_task_x_0_0.urdf").name == "S_int_task_x_0_0.urdf"
    elsewhere = root.write("elsewhere/x.urdf", "<robot/>")
    assert data.scene_file("S_int", elsewhere) == elsewhere
    (root.root / "scenes/S_int/urdf/S_int_best.urdf").unlink()
    assert data.scene_file("S_int").name == "S_int.urdf"
    with pytest.raises(InputError, match=r"S_int_random_4.urdf.*does not exist"):
        data.scene_file("S_int", random_index=4)


# ---- 2.1: grammar


def test_the_joint_is_found_by_its_child_and_gives_pose_and_freedom(root, make):
    found = instances(
        root,
        make.scene_joint("b", "fixed", (1, 2, 3), (0, 0, np.pi / 2)),  # before its link, in another order
        make.scene_link("a"),
        make.scene_link("b"),
        make.scene_joint("a", "floating"),
    )
    assert [i.fixed for i in found.values()] == [False, True]
    assert found["b"].pose == pytest.approx(
        np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]), abs=1e-12
    )
    assert found["a"].kind == "object"


def test_euler_angles_are_about_fixed_axes(root, make):
    """R = Rz(y) Ry(p) Rx(r): roll by 90 degrees, then yaw by 90 degrees, takes x to y and y to z."""
    found = instances(root, placed(make, "a", rpy=(np.pi / 2, 0, np.pi / 2)))
    assert found["a"].pose[:3, :3] @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=1e-12)
    assert found["a"].pose[:3, :3] @ [0, 1, 0] == pytest.approx([0, 0, 1], abs=1e-12)


def test_numbers_are_split_on_runs_of_blanks_and_rpy_may_be_missing(root):
    found = instances(
        root,
        "<link name='a' category='cup' model='m' bounding_box=' 1.  2\t3e0 '/>"
        "<joint name='j' type='fixed'><origin xyz='1   -0.0  .5'/><child link='a'/><parent link='world'/></joint>",
    )
    assert found["a"].bounding_box == pytest.approx([1, 2, 3])
    assert found["a"].pose[:3, 3] == pytest.approx([1, 0, 0.5])
    assert found["a"].pose[:3, :3] == pytest.approx(np.eye(3))


def test_commas_after_numbers_are_harmless(root):
    found = instances(
        root,
        "<link name='a' category='cup' model='m' bounding_box='1, 2, 3'/>"
        "<joint name='j' type='fixed'><origin xyz='1, 0, .5'/><child link='a'/><parent link='world'/></joint>",
    )
    assert found["a"].bounding_box == pytest.approx([1, 2, 3])
    assert found["a"].pose[:3, 3] == pytest.approx([1, 0, 0.5])


def test_scale_box_and_neither(root, make):
    found = instances(
        root, placed(make, "a", scale="1 2 3"), placed(make, "b", bounding_box="1 2 3"), placed(make, "c")
    )
    assert found["a"].scale == pytest.approx([1, 2, 3])
    assert found["a"].bounding_box is None
    assert found["b"].bounding_box == pytest.approx([1, 2, 3])
    assert found["c"].scale is None
    assert found["c"].bounding_box is None


def test_rooms_scope_and_odd_names(root, make):
    """Clutter names hold '-', '.' and capitals; `room` is a comma list."""
    found = instances(
        root,
        placed(make, "cup-Cup_2.1-0", room="kitchen_0,bedroom_1", object_scope="cup.n.01_1"),
        placed(make, "tasse_é"),
    )
    assert found["cup-Cup_2.1-0"].rooms == ["kitchen_0", "bedroom_1"]
    assert found["cup-Cup_2.1-0"].object_scope == "cup.n.01_1"
    assert found["tasse_é"].rooms == []


def test_object_scope_of_floors_names_rooms():
    text = "floor.n.01_1:room_floor_living_room_0,floor.n.01_2:room_floor_kitchen_0"
    assert parse_object_scope(text) == {"floor.n.01_1": "living_room_0", "floor.n.01_2": "kitchen_0"}
    assert parse_object_scope("book.n.02_1") == {"book.n.02_1": None}
    assert parse_object_scope("") == {}


def test_kinds(root, make):
    found = instances(
        root,
        *(placed(make, name, name, "fixed") for name in ("walls", "floors", "ceilings")),
        make.scene_link("robot", "agent", "BehaviorRobot"),
        make.scene_link("start", "agent_pose", "BehaviorRobot") + make.scene_joint("start", xyz=(1, 2, 0)),
    )
    assert [i.kind for i in found.values()] == ["building"] * 3 + ["agent", "agent_pose"]
    assert found["start"].pose[:3, 3] == pytest.approx([1, 2, 0])


def test_cached_attributes(root, make):
    """Quaternions leave the reader as w, x, y, z; Infinity is JSON here; unknown joints stay."""
    states = {
        "Temperature": 23.0,
        "MaxTemperature": float("-inf"),
        "WaterSource": {"steps": float("inf")},
        "Pose": None,
    }
    found = instances(
        root,
        placed(
            make,
            "a",
            base_poses="[[[1, 2, 3], [0, 0, 1, 0]], [[0, 0, 0], [0, 0, 0, 1]]]",
            base_velocities="[[[1, 0, 0], [0, 0, 1]]]",
            joint_states='{"a_joint_0": [0.5, 0.1], "j_a": [0, 0], "none": null}',
            states=json.dumps(states),
        ),
    )["a"]
    position, quat = found.base_poses[0]
    assert position == pytest.approx([1, 2, 3])
    assert quat == pytest.approx([0, 0, 0, 1])
    assert found.base_poses[1][1] == pytest.approx([1, 0, 0, 0])
    assert found.base_velocities[0][1] == pytest.approx([0, 0, 1])
    assert found.joint_states == {"a_joint_0": (0.5, 0.1), "j_a": (0.0, 0.0)}
    assert found.states == states


def test_legacy_joint_positions_read_only_the_first_body(root, make):
    found = instances(
        root,
        placed(make, "a", joint_positions='[{"a_joint_0": 0.5}, {"a_joint_0": 0.9}]'),
        placed(make, "b", joint_positions="[]"),
        placed(make, "c", joint_states='{"x": [1, 0]}', joint_positions='[{"x": 2}]'),
    )
    assert found["a"].joint_states == {"a_joint_0": (0.5, 0.0)}
    assert found["b"].joint_states == {}
    assert found["c"].joint_states == {"x": (1.0, 0.0)}, "joint_states is the newer form"


def test_multiplexers_and_groupers(root, make):
    found = instances(
        root,
        make.scene_link("m", "multiplexer", current_index="1"),
        make.scene_link(
            "g", "grouper", multiplexer="m", pose_offsets="[[[1, 0, 0], [0, 0, 0, 1]], [[0, 1, 0], [1, 0, 0, 0]]]"
        ),
        placed(make, "whole", multiplexer="m"),
        placed(make, "half_0", grouper="g"),
        placed(make, "half_1", grouper="g"),
    )
    assert found["m"].current_index == 1
    assert found["whole"].multiplexer == found["g"].multiplexer == "m"
    assert found["half_1"].grouper == "g"
    assert found["g"].pose_offsets[1][1] == pytest.approx([0, 1, 0, 0])


def test_overlaps_that_are_allowed(root):
    root.write("scenes/S_int/misc/bbox_overlap.json", '[["chair_0", "table_0"], ["a", "b"]]')
    root.scene()
    allowed = Dataset(root.root).scene("S_int").overlaps_allowed
    assert allowed == {frozenset({"table_0", "chair_0"}), frozenset({"a", "b"})}


def test_tolerated_xml(root):
    """BOM, blanks before the declaration, version 0.0, stray text, unbound prefixes, comments, bare ampersands."""
    text = (
        '\ufeff\n \n<?xml version="0.0" encoding="utf-8"?>\n<!-- a -- b --><robot name="x">stray & text'
        '<link name="world"/><xacro:property a:b="c"/><link name="a&b" category="cup" model="m" sim:hint="1"/>'
        '<joint name="j" type="fixed"><child link="a&amp;b"/><parent link="world"/></joint></robot>\nthe end'
    )
    for content in (text.encode(), text.removeprefix("\ufeff").encode("utf-16")):
        file = root.write("x.urdf", content)
        scene = read_scene(file, "x")
        assert [i.name for i in scene.instances] == ["a&b"]


# ---- filters; random models


def test_random_models_depend_on_the_seed_only(root, make):
    for model in ("b", "c", "d", "e"):
        root.object(make.robot(make.link("a")), model=model)
    inside = [placed(make, f"x{i}", "cup").replace("model='m'", "model='random'") for i in range(8)]
    chosen = [[i.model for i in instances(root, *inside, seed=s).values()] for s in (0, 0, 1)]
    assert chosen[0] == chosen[1] != chosen[2]
    assert set(chosen[0]) <= {"b", "c", "d", "e", "m"}
    assert len(set(chosen[0])) > 1


def test_one_random_group_is_one_model(root, make):
    for model in ("b", "c", "d", "e"):
        root.object(make.robot(make.link("a")), model=model)
    inside = [placed(make, f"x{i}", random_group="7").replace("model='m'", "model='random'") for i in range(8)]
    assert len({i.model for i in instances(root, *inside).values()}) == 1


def test_category_filters_keep_the_building_unless_it_is_excluded(root, make):
    inside = [
        placed(make, n, c) for n, c in (("walls", "walls"), ("ceilings", "ceilings"), ("a", "cup"), ("b", "table"))
    ]
    assert set(instances(root, *inside, only_categories=["table"])) == {"walls", "ceilings", "b"}
    assert set(instances(root, *inside, without_categories=["ceilings", "cup"])) == {"walls", "b"}


def test_room_filters_know_instances_and_types_and_places(root, make):
    grey = np.ones((200, 200))
    root.image("scenes/S_int/layout/floor_semseg_0.png", 3 * grey)
    root.image("scenes/S_int/layout/floor_insseg_0.png", grey)
    inside = [
        placed(make, "walls", "walls"),
        placed(make, "both", room="bedroom_0,kitchen_0"),
        placed(make, "k", room="kitchen_0"),
        placed(make, "k1", room="kitchen_1"),
        placed(make, "standing_in_kitchen_0", xyz=(0.3, 0.2, 0)),
        placed(make, "outside", xyz=(30, 0, 0)),
    ]
    assert set(instances(root, *inside, only_rooms=["kitchen_0"])) == {"walls", "both", "k", "standing_in_kitchen_0"}
    assert set(instances(root, *inside, only_rooms=["kitchen"])) == {
        "walls",
        "both",
        "k",
        "k1",
        "standing_in_kitchen_0",
    }
    assert set(instances(root, *inside, only_rooms=["bedroom"])) == {"walls", "both"}
    with pytest.raises(UnknownNameError, match=r"'kitchn'.*kitchen"):
        instances(root, *inside, only_rooms=["kitchn"])


def test_multiplexers_go_with_their_objects(root, make):
    inside = [
        make.scene_link("m", "multiplexer"),
        make.scene_link("g", "grouper", multiplexer="m"),
        placed(make, "whole", multiplexer="m"),
        placed(make, "half", "half_cup", grouper="g"),
        placed(make, "t", "table"),
    ]
    assert set(instances(root, *inside, only_categories=["table"])) == {"t"}
    kept = instances(root, *inside, only_categories=["cup"])
    assert set(kept) == {"m", "whole"}


def test_fixed_furniture_is_twelve_categories(root, make):
    assert len(FIXED_FURNITURE) == 12
    inside = [placed(make, "a", "desk"), placed(make, "b", "cup"), placed(make, "c", "pool_table")]
    assert [i.fixed for i in instances(root, *inside).values()] == [False] * 3
    assert [i.fixed for i in instances(root, *inside, fixed_furniture=True).values()] == [True, False, True]


# ---- 2.3: building parts


def test_building_parts_resolve_their_meshes_in_the_scenes_folder(root, make):
    root.scene(placed(make, "walls", "walls", "fixed").replace("model='m'", "model='S_int'"))
    root.write(
        "scenes/S_int/urdf/S_int_walls.urdf",
        make.robot(make.link("base_link", *(make.shape("collision", f"shape/wall_{i}_cm.obj") for i in (0, 1)))),
    )
    for i in (0, 1):
        root.write(f"scenes/S_int/shape/wall_{i}_cm.obj", make.box_obj((1, 0.1, 2), (i, 0, 1)))
    data = Dataset(root.root)
    scene = data.scene("S_int")
    model = data.instance_model(scene, scene.instances[0])
    assert len(model.links["base_link"].collisions) == 2
    assert model.metadata.bbox_size is None
    assert not data.missing(scene)


def test_missing_models_are_listed(root, make):
    root.scene(
        placed(make, "a"),
        placed(make, "b", "plate"),
        placed(make, "walls", "walls", "fixed"),
        placed(make, "r", "plate").replace("model='m'", "model='random'"),
        make.scene_link("robot", "agent", "BehaviorRobot"),
    )
    data = Dataset(root.root)
    assert [i.name for i in data.missing(data.scene("S_int"))] == ["b", "walls", "r"]


def test_content_after_the_root_is_a_warning(root):
    file = root.write("x.urdf", '<robot name="x"/>\nthe end')
    assert any("after the root" in w for w in read_scene(file, "x").warnings)
