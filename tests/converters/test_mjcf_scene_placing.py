"""A scene in MJCF and manifest, from iGibson's format."""

from __future__ import annotations

import math
import pathlib

import mujoco
import numpy as np
import pytest
from ig2mj_converters.base.description import Inertial, Instance, Metadata, ObjectModel
from ig2mj_converters.bodies.assembly import Assembly, BodyPlan
from ig2mj_converters.bodies.placements import Placement
from ig2mj_converters.mjcf.scene import root_poses


def test_the_joint_origin_is_the_pose_of_the_bounding_box_centre(house):
    for name, centre in (("bottom_cabinet_0", (-1.6, 1.0, 0.41)), ("fridge_0", (-1.6, -1.1, 0.9))):
        entry, body = house.entries[name], house.model.body(name)
        assert np.allclose(body.quat, [1, 0, 0, 0])
        np.testing.assert_allclose(body.pos + entry.base_link_offset, centre, atol=1e-5)


def test_the_offset_is_turned_with_the_object():
    model = ObjectModel("c", "m", pathlib.Path("m.urdf"), {}, {}, "base_link")
    model.metadata = Metadata(bbox_size=np.ones(3), base_link_offset=np.array([0.3, 0.0, 0.1]))
    body = BodyPlan("base_link", None, np.eye(4), None, ["base_link"], [], [], Inertial(1.0, np.eye(3)), np.zeros(3))
    plan = Assembly(model, np.ones(3), [body], {}, [])
    pose = np.eye(4)
    pose[:2, :2], pose[:3, 3] = [[0, -1], [1, 0]], (5.0, 6.0, 1.0)  # yaw 90 degrees
    (base,) = root_poses(Placement(Instance("c_0", "c", "m", pose, fixed=True)), plan)
    np.testing.assert_allclose(base[:3, 3], [5.0, 5.7, 0.9], atol=1e-12)
    np.testing.assert_allclose(base[:3, :3], pose[:3, :3])


def two_bodied(box: bool) -> Assembly:
    """A base whose centre of mass is at (0.1, 0, 0), and a body split off at (0, 0, 1)."""
    model = ObjectModel("c", "m", pathlib.Path("m.urdf"), {}, {}, "base_link")
    if box:
        model.metadata = Metadata(bbox_size=np.ones(3), base_link_offset=np.zeros(3))
    above = np.eye(4)
    above[2, 3] = 1.0
    inertial = Inertial(1.0, np.eye(3))
    bodies = [
        BodyPlan("base_link", None, np.eye(4), None, ["base_link"], [], [], inertial, np.array([0.1, 0, 0])),
        BodyPlan("link_0", None, above, None, ["link_0"], [], [], inertial, np.array([0, 0.2, 0])),
    ]
    return Assembly(model, np.ones(3), bodies, {}, [])


def test_saved_poses_are_of_centres_of_mass_and_place_the_split_off_bodies():
    saved = [[[9.0, 9.0, 9.0], [1.0, 0.0, 0.0, 0.0]], [[2.0, 3.2, 4.0], [1.0, 0.0, 0.0, 0.0]]]
    instance = Instance("c_0", "c", "m", np.eye(4), fixed=True, base_poses=saved)
    base, other = root_poses(Placement(instance), two_bodied(box=True))
    np.testing.assert_allclose(base, np.eye(4))  # the joint origin wins: it does not depend on a centre of mass
    np.testing.assert_allclose(other[:3, 3], [2.0, 3.0, 4.0])


def test_without_a_bounding_box_the_saved_pose_places_the_base():
    saved = [[[1.1, 2.0, 3.0], [1.0, 0.0, 0.0, 0.0]], [[0.0, 0.2, 5.0], [1.0, 0.0, 0.0, 0.0]]]
    instance = Instance("c_0", "c", "m", np.eye(4), fixed=True, base_poses=saved)
    base, other = root_poses(Placement(instance), two_bodied(box=False))
    np.testing.assert_allclose(base[:3, 3], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(other[:3, 3], [0.0, 0.0, 5.0])


def test_legacy_scenes_leave_split_off_bodies_at_their_default_places():
    instance = Instance("c_0", "c", "m", np.eye(4), fixed=True, base_poses=[[[0, 0, 0], [1, 0, 0, 0]]])
    _, other = root_poses(Placement(instance), two_bodied(box=True))
    np.testing.assert_allclose(other[:3, 3], [0.0, 0.0, 1.0])


def test_scale_is_the_bounding_box_over_the_models_size(house):
    fridge = house.entries["fridge_0"]
    np.testing.assert_allclose(fridge.scale, [1.0, 1.2, 1.1], atol=1e-6)
    np.testing.assert_allclose(fridge.bounding_box, [0.6, 0.72, 1.76], atol=1e-6)


def test_rooms_are_lists_of_room_instances(house):
    assert house.entries["stove_0"].rooms == ["kitchen_0"]
    assert house.entries["walls"].rooms == []
    assert {name: room.type for name, room in house.manifest.rooms.instances.items()} == {
        "kitchen_0": "kitchen",
        "bedroom_0": "bedroom",
    }
    assert house.manifest.rooms.file == "rooms.npz" and (house.folder / "rooms.npz").is_file()


def ray(scene, start, direction) -> float:
    """Distance to the nearest collision geom, inf where there is none."""
    geom, group = np.zeros(1, np.int32), np.array([0, 0, 0, 1, 0, 0], np.uint8)
    hit = mujoco.mj_ray(scene.model, scene.data, np.array(start, float), np.array(direction, float), group, 1, -1, geom)
    return hit if hit >= 0 else math.inf


def test_walls_have_real_door_holes(house):
    assert ray(house, (-0.3, 0.0, 1.5), (1, 0, 0)) > 1.0  # through the door
    assert ray(house, (-0.3, 0.0, 2.25), (1, 0, 0)) == pytest.approx(0.25, abs=1e-3)  # above it
    assert ray(house, (-0.3, 1.0, 1.5), (1, 0, 0)) == pytest.approx(0.25, abs=1e-3)  # beside it


def test_the_hull_budget_does_not_merge_wall_segments(convert):
    small = convert(max_hulls=1)
    assert len(small.geoms("walls", 3)) == 7
    assert ray(small, (-0.3, 0.0, 1.5), (1, 0, 0)) > 1.0


def test_the_floors_top_is_at_zero(house):
    assert ray(house, (1.0, -1.2, 1.0), (0, 0, -1)) == pytest.approx(1.0, abs=1e-3)


def test_ceilings_collide_only_when_asked(house, convert):
    assert ray(house, (1.0, -1.2, 1.0), (0, 0, 1)) == math.inf
    assert house.geoms("ceilings", 3) == [] and len(house.geoms("ceilings", 4)) == 1
    closed = convert(ceiling_collision=True)
    assert ray(closed, (1.0, -1.2, 1.0), (0, 0, 1)) == pytest.approx(1.5, abs=1e-3)


def test_fixed_furniture_turns_tables_fixed(house, convert):
    fixed = convert(fixed_furniture=True)
    assert not house.entries["breakfast_table_0"].fixed and fixed.entries["breakfast_table_0"].fixed
    assert fixed.model.body("breakfast_table_0").jntnum[0] == 0
    assert not fixed.entries["apple_0"].fixed


def test_joint_positions_are_zero_without_a_saved_state(house):
    for joint in ("bottom_cabinet_0_joint_0", "bottom_cabinet_0_joint_1", "fridge_0_joint_0"):
        assert house.data.joint(joint).qpos[0] == 0.0


def test_legacy_joint_positions_are_read_and_clamped_and_unknown_names_ignored(task_house):
    assert task_house.data.joint("bottom_cabinet_9_joint_0").qpos[0] == pytest.approx(0.25, abs=1e-6)
    assert task_house.data.joint("bottom_cabinet_9_joint_1").qpos[0] == pytest.approx(1.5, abs=1e-6)


def test_a_multiplexer_at_one_parks_the_whole_and_shows_the_halves(task_house):
    whole, half = task_house.entries["apple_7"], task_house.entries["apple_7_part_0"]
    assert whole.parked and not half.parked and half.part_of == "apple_7"
    assert [part.object for part in whole.parts] == ["apple_7_part_0", "apple_7_part_1"]
    np.testing.assert_allclose(whole.parts[0].pos, [0.001, 0, 0])
    np.testing.assert_allclose(whole.parts[1].quat, [0, 0, 0, 1])
    assert task_house.data.body("apple_7").xpos[0] > 30.0
    assert abs(task_house.data.body("apple_7_part_0").xpos[0]) < 2.0


def test_a_sliceable_object_of_a_plain_scene_gets_parked_halves(house):
    whole = house.entries["apple_0"]
    assert not whole.parked
    assert [part.object for part in whole.parts] == ["apple_0_part_0", "apple_0_part_1"]
    for part in whole.parts:
        half = house.entries[part.object]
        assert half.parked and half.part_of == "apple_0" and half.category == "half_apple"
        assert half.scale == whole.scale and half.synset == whole.synset
        assert house.data.body(half.name).xpos[0] > 30.0


def test_parked_objects_fall_asleep_at_once_on_a_slab_and_stay_there(task_house, house):
    for scene in (house, task_house):
        m, d = scene.model, mujoco.MjData(scene.model)
        mujoco.mj_resetDataKeyframe(m, d, m.key("initial").id)
        parked = [e.name for e in scene.manifest.objects if e.parked]
        trees = [m.body_treeid[m.body(name).id] for name in parked]
        before = {name: d.qpos[m.joint(f"{name}/free").qposadr[0] :][:7].copy() for name in parked}
        for _ in range(30):
            mujoco.mj_step(m, d)
        assert parked and all(d.tree_asleep[t] >= 0 for t in trees)
        for name in parked:
            after = d.qpos[m.joint(f"{name}/free").qposadr[0] :][:7]
            np.testing.assert_allclose(after, before[name], atol=1e-3)
        spots = [tuple(before[name][:2]) for name in parked]
        assert all(math.dist(a, b) > 0.08 for i, a in enumerate(spots) for b in spots[:i])


def test_woken_parked_objects_still_rest_on_the_slab(house):
    m, d = house.model, mujoco.MjData(house.model)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    half = m.joint("apple_0_part_0/free")
    height = d.qpos[half.qposadr[0] + 2]
    d.qvel[half.dofadr[0] + 2] = 0.05
    for _ in range(120):
        mujoco.mj_step(m, d)
    assert d.qpos[half.qposadr[0] + 2] == pytest.approx(height, abs=0.01)


def test_object_scope_becomes_the_task(task_house):
    task = task_house.manifest.task
    assert (task["activity"], task["definition"], task["instance"]) == ("slicing_fruit", 0, 7)
    assert task["object_scope"] == {
        "apple.n.01_1": "apple_7",
        "knife.n.01_1": "carving_knife_3",
        "sink.n.01_1": "sink_9",
        "agent.n.01_1": "agent",
    }
    (agent,) = task["agents"]
    assert agent["model"] == "BehaviorRobot"
    np.testing.assert_allclose(agent["pos"], [1.0, -0.8, 1.0], atol=1e-6)


def test_a_plain_scene_has_no_task(house):
    assert house.manifest.task is None


def test_saved_states_have_our_names(task_house):
    entries = task_house.entries
    assert entries["apple_7"].state == {"temperature": 23.0, "sliced": True, "wetness": 0.0}
    assert entries["apple_7_part_0"].state == {"temperature": 60.0, "max_temperature": 75.5, "sliced": True}
    assert entries["apple_7_part_1"].state["temperature"] == 61.0
    knife = entries["carving_knife_3"]
    assert knife.state == {
        "wetness": knife.abilities.get("soakable", {}).get("wetness_soaked", 1.0),
        "temperature": 30.5,
    }
    sink = entries["sink_9"].state
    assert sink["toggled_on"] is True and sink["press_count"] == 2
    assert sink["water"] == {"steps_since_drop": None, "drops": [None, [-0.8, -1.1, 0.9]]}


def test_saved_particles_move_from_the_world_into_the_links_frame(task_house):
    state = task_house.entries["breakfast_table_9"].state
    nothing, named, base = state["dust"]
    assert nothing is None and named["body"] == base["body"] == "breakfast_table_9"
    np.testing.assert_allclose(named["pos"], [0.1, 0.1, 0.351], atol=1e-5)
    np.testing.assert_allclose(base["pos"], [-0.2, 0.0, 0.351], atol=1e-5)
    assert state["stain"] == [None] * 20 and state["stain_sizes"][0] == [0.01, 0.02, 0.004]


def test_a_camera_looks_into_every_room_and_one_from_above(house):
    m = house.model
    assert {m.camera(c).name for c in range(m.ncam)} == {"top", "kitchen_0", "bedroom_0"}
    assert m.camera("kitchen_0").pos[0] < 0 < m.camera("bedroom_0").pos[0]
    corners = [(x, y, 0.0) for x in (-2.0, 2.0) for y in (-1.5, 1.5)]
    camera = m.camera("top")
    half_angle = math.radians(camera.fovy[0] / 2)
    for x, y, z in corners:
        assert abs(y - camera.pos[1]) < (camera.pos[2] - z) * math.tan(half_angle)
        assert abs(x - camera.pos[0]) < (camera.pos[2] - z) * math.tan(half_angle) * 4 / 3


def test_hovering_objects_are_let_down_unless_told_otherwise(house, convert):
    high = convert(keep_hovering=True)
    asked = 0.75  # the knife's box centre in the scene file; the table's top is at 0.701
    assert high.data.body("knife-kn0-0").xpos[2] == pytest.approx(asked, abs=1e-5)
    assert house.data.body("knife-kn0-0").xpos[2] < asked - 0.02
    assert house.model.body("knife-kn0-0").pos[2] == pytest.approx(asked, abs=1e-5)


def test_the_house_stays_put_for_a_second(house):
    m, d = house.model, mujoco.MjData(house.model)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    mujoco.mj_kinematics(m, d)
    start = d.xpos.copy()
    for _ in range(120):
        mujoco.mj_step(m, d)
    assert np.linalg.norm(d.xpos - start, axis=1).max() < 0.02
