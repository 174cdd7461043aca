"""Objects of the library that are added to a home when it is loaded."""

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.knowledge import synset
from ig2mj.scene.additions import SLAB, name_additions
from ig2mj.scene.library import find_model, library
from ig2mj.scene.resting import STIRS
from ig2mj.scene.scene import load_scene

ADDED = ("apple", "apple", "jar", "steak/steak_00")


@pytest.fixture(scope="module")
def plain():
    return load_scene("birch")


@pytest.fixture(scope="module")
def stocked():
    return load_scene("birch", objects=ADDED)


def test_every_model_of_the_library_has_a_synset_and_all_but_the_wall_board_are_loose():
    assert len(library()) > 300
    for models in library().values():
        for model in models.values():
            assert model.entry.fixed == (model.category == "shelf")
            assert model.entry.category == model.category
            assert synset(model.category) == model.entry.synset


def test_all_that_can_be_sliced_comes_with_two_halves():
    whole = [find_model(category).manifest.objects for category in library()]
    sliceable = [objects for objects in whole if "sliceable" in objects[0].abilities and len(objects) > 1]
    assert len(sliceable) > 15
    for objects in sliceable:
        assert [o.part_of for o in objects] == [None, objects[0].name, objects[0].name]
        assert [p.object for p in objects[0].parts] == [o.name for o in objects[1:]]
        assert [o.parked for o in objects] == [False, True, True]


def test_additions_come_last_and_change_nothing_of_the_home(plain, stocked):
    own = len(plain.object_names)
    assert stocked.object_names[:own] == plain.object_names
    assert stocked.object_names[own:] == (
        *("apple_0", "apple_0_part_0", "apple_0_part_1", "apple_1", "apple_1_part_0", "apple_1_part_1"),
        *("jar_1", "steak_0"),  # birch has a jar of its own
    )
    start = stocked.start_data().qpos
    assert np.array_equal(start[: plain.model.nq], plain.start_data().qpos)
    assert [a.name for a in stocked.additions] == ["apple_0", "apple_1", "jar_1", "steak_0"]


def test_an_addition_with_a_place_is_fixed_there(plain):
    scene = load_scene("birch", objects=["steak", "shelf@-1,-3.4,0.9,90", "mug@0.5,0.25,1,0", "apple"])
    data = scene.start_data()
    names = ("steak_0", "shelf_2", "mug_0", "apple_0", "apple_0_part_0", "apple_0_part_1")
    assert scene.object_names[-6:] == names
    for name, pos, quat in (
        ("shelf_2", (-1, -3.4, 0.9), (0.5**0.5, 0, 0, 0.5**0.5)),
        ("mug_0", (0.5, 0.25, 1), (1, 0, 0, 0)),
    ):
        entry, body = scene.object(name), scene.model.body(name)
        assert entry.fixed and not entry.assisted_grasp and body.dofnum[0] == 0
        assert np.allclose(data.xpos[body.id], pos) and np.allclose(data.xquat[body.id], quat)
    assert scene.model.nq == plain.model.nq + 4 * 7
    assert [a.requested for a in scene.additions][1] == "shelf/shelf_14@-1,-3.4,0.9,90"
    again = load_scene("birch", objects=[a.requested for a in scene.additions])
    elsewhere = load_scene("birch", objects=["steak", "shelf@-1,-3.4,0.8,90", "mug@0.5,0.25,1,0", "apple"])
    assert scene.digest == again.digest != elsewhere.digest


@pytest.mark.parametrize("expected", ["shelf", "shelf@1,2", "shelf@1,2,3,left"])
def test_fixed_furniture_wants_a_place_of_four_numbers(expected):
    with pytest.raises(Ig2mjError, match=r"1,2,0\.9,-90|x,y,z,yaw"):
        load_scene("birch", objects=[expected])


def test_equal_models_share_their_meshes(plain, stocked):
    one = load_scene("birch", objects=["apple"])
    two = load_scene("birch", objects=["apple", "apple"])
    assert plain.model.nmesh < one.model.nmesh == two.model.nmesh


def test_additions_rest_outside_the_house(stocked):
    data = stocked.start_data()
    roots = stocked.tables.object_root[-8:]
    before = data.xpos[roots].copy()
    assert np.all(before[:, 2] < -4.5)
    for _ in range(240):
        mujoco.mj_step(stocked.model, data)
    assert np.abs(data.xpos[roots] - before).max() < STIRS
    slab = stocked.model.body(SLAB).id
    for contact in data.contact:
        bodies = stocked.model.geom_bodyid[list(contact.geom)]
        owners = stocked.tables.body_object[bodies]
        if np.any(np.isin(owners, stocked.tables.body_object[roots])):
            assert slab in bodies or owners[0] == owners[1]


def test_an_added_object_is_at_rest_at_load_and_forbids_no_placement(tiny_home_folder):
    """A model that stands on a point would roll off it: it lies on its side from the start, on every engine."""
    scene = load_scene(tiny_home_folder, objects=["apple", "chestnut", "honing_steel", "jar"])
    data = scene.start_data()
    roots = scene.tables.object_root[
        [o for o, n in enumerate(scene.object_names) if data.xpos[scene.tables.object_root[o], 2] < -4]
    ]
    before = data.subtree_com[roots].copy()
    for _ in range(240):
        mujoco.mj_step(scene.model, data)
        assert np.linalg.norm(data.subtree_com[roots] - before, axis=1).max() < STIRS
    simulation = ig2mj.Simulation(scene)
    assert simulation.set_predicate("on_top", "can", "box"), simulation.last_sampling


def test_the_start_of_an_addition_is_rounded_and_the_same_each_time(tiny_home_folder):
    one, two = (load_scene(tiny_home_folder, objects=["chestnut"]) for _ in range(2))
    start = one.model.key_qpos if one.model.nkey else one.model.qpos0
    assert np.array_equal(start, two.model.key_qpos if two.model.nkey else two.model.qpos0)


def test_the_spec_of_a_scene_holds_its_additions(stocked):
    again = stocked.spec().compile()
    assert [again.body(i).name for i in range(again.nbody)] == [
        stocked.model.body(i).name for i in range(stocked.model.nbody)
    ]


def test_links_and_joints_of_an_addition_carry_its_name(stocked):
    jar = stocked.object("jar_1")
    assert jar.openable and all(stocked.model.joint(o.joint).id >= 0 for o in jar.openable)
    assert all(name.startswith("jar_1") for name in (*jar.bodies, *(j.name for j in jar.joints)))


def test_numbers_go_on_where_the_home_stops():
    assert [name for name, _ in name_additions(["jar_0", "jar_4", "mug_7"], ["jar", "jar", "apple"])] == [
        *("jar_5", "jar_6", "apple_0")
    ]


def test_hashes_tell_models_apart_and_stay_the_same(stocked):
    hashes = {a.name: a.sha256 for a in stocked.additions}
    assert hashes["apple_0"] == hashes["apple_1"] == find_model("apple").sha256
    assert len(set(hashes.values())) == 3


@pytest.mark.parametrize(
    ("expected", "telling"),
    [("applee", "near matches: apple"), ("apple/apple_77", "no model of 'apple'"), ("fridge", "no category")],
)
def test_what_the_library_lacks_is_named(expected, telling):
    with pytest.raises(UnknownNameError, match=telling):
        load_scene("small_home", objects=[expected])
