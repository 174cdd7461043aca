"""The openly licensed data in iGibson's layout that stands beside the checkout, and what its README says of it."""

from __future__ import annotations

import numpy as np
import pytest
from ig2mj_converters.bodies.inertia import is_possible, link_inertials
from ig2mj_converters.bodies.kinematics import model_bounds
from ig2mj_converters.reading.dataset import Dataset, SceneOptions
from ig2mj_converters.reading.room_maps import room_at
from ig2mj_converters.reading.scaling import instance_scale, scale_model
from ig2mj_converters.reading.urdf import read_urdf


@pytest.fixture(scope="module")
def house(shared_data):
    return Dataset(shared_data / "small_house")


@pytest.fixture(scope="module")
def ycb(shared_data):
    return Dataset(shared_data / "ycb")


@pytest.fixture(scope="module")
def scene(house):
    return house.scene("small_house_int")


def test_the_house_has_84_objects_of_60_models(house, scene):
    objects = [i for i in scene.instances if i.kind == "object"]
    assert len(scene.instances) == 87
    assert len(objects) == 84
    assert len({(i.category, i.model) for i in objects}) == 60
    assert sum(i.fixed for i in scene.instances) == 59
    assert not house.warnings
    assert not scene.warnings
    assert not house.missing(scene)


def test_every_scaled_object_has_the_box_it_asked_for(house, scene):
    """The tolerance is 1.5 %; here the metadata's boxes are exact."""
    for instance in scene.instances:
        if instance.kind == "object":
            model = house.model(instance.category, instance.model)
            scaled = scale_model(model, instance_scale(instance, model))
            low, high = model_bounds(scaled)
            np.testing.assert_allclose(high - low, instance.bounding_box, rtol=1e-4, atol=1e-5)
            np.testing.assert_allclose((high + low) / 2, scaled.metadata.base_link_offset, atol=1e-5)
            assert not scaled.warnings


def test_masses_are_the_urdfs_own_and_else_follow_the_categories(house, scene):
    for instance in scene.instances[:30]:
        model = house.instance_model(scene, instance)
        scaled = scale_model(model, instance_scale(instance, model))
        if instance.kind == "building":
            assert link_inertials(scaled, None)["base_link"].mass == 10000
            continue
        own = scaled.links["base_link"].inertial
        assert own is not None
        assert link_inertials(scaled, house.density(instance.category))["base_link"].mass == own.mass
        scaled.links["base_link"].inertial = None
        found = link_inertials(scaled, house.density(instance.category))["base_link"]
        assert found.mass == pytest.approx(house.specs[instance.category].density * np.prod(instance.bounding_box))
        assert is_possible(found.inertia)


def test_only_the_balls_are_scaled(house, scene):
    """The boxes asked for are rounded to a micrometre."""
    scaled = {
        i.name
        for i in scene.instances
        if i.kind == "object"
        and not np.allclose(instance_scale(i, house.model(i.category, i.model)), 1, rtol=0, atol=2e-4)
    }
    assert scaled == {i.name for i in scene.instances if i.category == "ball"}


def test_rooms_agree_with_where_objects_stand(scene):
    assert scene.rooms.names == ["balcony_0", "bedroom_0", "dining_room_0", "kitchen_0", "living_room_0"]
    inside = [i for i in scene.instances if len(i.rooms) == 1]
    found = [(room_at(scene.rooms, *i.pose[:2, 3].tolist()), i.rooms[0]) for i in inside]
    assert sum(a is not None and a != b for a, b in found) <= 0.1 * len(found), "on walls it is another room's cell"
    assert 0 < scene.rooms.traversable.sum() < scene.rooms.traversable_no_obj.sum()


def test_rooms_can_be_read_alone(house, scene):
    kitchen = house.scene("small_house_int", options=SceneOptions(only_rooms=["kitchen"]))
    names = {i.name for i in kitchen.instances if i.kind == "object"}
    assert names == {i.name for i in scene.instances if "kitchen_0" in i.rooms}


def test_ycb_objects_are_39_hull_groups(ycb):
    count = 0
    for category, models in ycb.index().items():
        for name in models:
            model = ycb.model(category, name)
            shape = model.links["base_link"].collisions[0]
            assert shape.grouped
            assert not model.warnings
            count += len(shape.meshes)
            low, high = model_bounds(model)
            np.testing.assert_allclose(high - low, model.metadata.bbox_size, rtol=1e-4)
    assert count == 39


def test_a_dataset_object_is_a_plain_urdf_too(shared_data, ycb):
    file = shared_data / "ycb/objects/drill/PowerDrill/PowerDrill.urdf"
    model = read_urdf(file, "drill", "PowerDrill")
    assert link_inertials(scale_model(model, 1), None)["base_link"].mass == pytest.approx(0.895)
    assert sum(len(s.meshes) for s in model.links["base_link"].collisions) == 9
