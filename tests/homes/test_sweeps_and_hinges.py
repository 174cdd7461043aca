"""What moving parts sweep, whether they meet other parts, and what holds them."""

from __future__ import annotations

import random

import numpy as np
import pytest
from ig2mj_homes.dataset.shipped_homes import build_homes, furnished
from ig2mj_homes.furnish.arrangement import Arrangement
from ig2mj_homes.furnish.clearances import blocked
from ig2mj_homes.furnish.placed import Placed, shape
from ig2mj_homes.objects.catalogue import build_model, catalogue, find
from ig2mj_homes.objects.hinges import GRAVITY, friction, gravity_torque
from ig2mj_homes.objects.model import HouseholdObject, ObjectBuilder
from ig2mj_homes.objects.opening_strength import STRENGTH
from ig2mj_homes.shapes.bricks import block
from ig2mj_homes.shapes.materials import plain
from ig2mj_homes.shapes.sweeps import BULGE, self_clashes, sweep, turn

WHITE = plain("white")
HINGE_STRENGTH = min(STRENGTH.values())  # N m


def cupboard(gap: float, *, slide: bool = False) -> HouseholdObject:
    """A box with a leaf 0.7 m by 5.5 cm before it, and a post `gap` beside the leaf's free edge."""
    b = ObjectBuilder("cupboard", "cupboard_00", (0.5, 0.7, 0.8), random.Random(0))
    b.add(block((0.4, 0.7, 0.8), (-0.2, 0, 0.4)), WHITE)
    b.add(block((0.2, 0.1, 0.8), (0.05, -0.4 - gap, 0.4)), WHITE)
    if slide:
        link = b.slide("door_0", (0, 0, 0.4), (1, 0, 0), 0.3)
    else:
        link = b.hinge("door_0", (0.055, 0.35, 0.4), (0, 0, 1), 1.9)
    link.add(block((0.055, 0.7, 0.8), (0.0275, 0, 0.4)), WHITE)
    return b.finish()


def mass_of(model: HouseholdObject) -> float:
    """kg: by the box, as iGibson's loader does."""
    entry = find(model.category)
    return entry.mass * float(np.prod(np.ptp(model.bounds(), axis=0)) / np.prod(entry.size))


@pytest.mark.parametrize("slide", [False, True])
def test_every_place_of_a_moving_corner_lies_in_what_is_swept_and_little_more_is_swept(slide: bool):
    model = cupboard(0.1, slide=slide)
    (joint,) = model.joints
    link = model.links[1]
    ways = sweep(model, joint)
    reach = np.hypot(0.7, 0.055)
    for q in np.linspace(*joint.limits, 997):
        if slide:
            corners = link.hulls[0] + link.origin + q * np.array([1, 0, 0])
        else:
            corners = link.hulls[0] @ turn(np.array([0.0, 0, 1]), q).T + link.origin
        inside = np.zeros(len(corners), bool)
        for points, normals in ways:
            inside |= np.all(corners @ normals.T <= (points @ normals.T).max(0) + 2e-5, axis=1)
        assert inside.all(), q
    if not slide:
        farthest = max(np.linalg.norm((points - link.origin)[:, :2], axis=1).max() for points, _ in ways)
        assert reach <= farthest <= reach + 1.01 * BULGE


def test_a_corner_that_swings_beyond_the_leafs_edge_between_two_steps_is_found():
    """It reaches 2.2 mm beyond the free edge at 4.5 degrees; at 0, 33, 66 and 100 % of the range nothing is seen."""
    ((joint, link, depth),) = self_clashes(cupboard(0.0005), 1e-4)
    assert (joint, link) == ("door_0_joint", "base_link") and 0.001 < depth < 0.003
    assert not self_clashes(cupboard(0.0035), 1e-4)


def test_a_door_is_kept_from_a_wall_that_its_corner_would_meet():
    """In a room: the fridge's leaf needs its full width, with the wall at its free edge."""
    fridge = shape("fridge", 1)
    door = next(link for link in fridge.model.links if link.name == "door_0")
    side = np.sign(-door.hulls[0][:, 1].mean() - 1e-9)  # of its hinge
    edge = max(abs(float(p[:, 1].max() if side < 0 else p[:, 1].min()) + door.origin[1]) for p in door.hulls)
    lying = Placed("fridge_0", "fridge", 1, np.zeros(3), np.eye(3), True)
    for gap, fits in ((0.02, True), (-0.002, False)):
        at = -side * (edge + gap)
        wall = np.sort(np.array([[0.2, at, 0], [3.0, at - side * 0.1, 2]]), axis=0)
        assert Arrangement(wall[None]).fits(lying) == fits, gap


def test_a_home_with_a_door_that_cannot_open_is_not_written(monkeypatch, tmp_path):
    """The fridge is moved until its open door meets the wall beside it; then what it would meet is named."""
    home = furnished("small_home")
    assert blocked(home.plan, home.things.things.values()) == []
    fridge = next(thing for thing in home.things.things.values() if thing.category == "fridge")
    walls = home.plan.inside(home.plan.room("kitchen_0"))
    (low, high), hinge = fridge.box(), shape("fridge", fridge.index).model.joints[0].origin[1]
    left = fridge.rotation[0, 1] * hinge < 0  # the hinge's side, seen along x
    fridge.position[0] += (walls[0] + 0.001 - low[0]) if left else (walls[2] - 0.001 - high[0])
    jams = blocked(home.plan, [fridge])
    assert jams == [(fridge.name, "walls")]
    monkeypatch.setattr("ig2mj_homes.dataset.shipped_homes.furnished", lambda name, seed: home)
    with pytest.raises(AssertionError, match="fridge_0"):
        build_homes(tmp_path, ["small_home"])
    assert not (tmp_path / "scenes").exists()


@pytest.mark.slow
def test_no_part_of_any_model_goes_through_another_part():
    """All doors, drawers and lids of all models, each with the others closed."""
    met = []
    for entry in catalogue().values():
        for index in range(entry.count if build_model(entry, 0).joints else 0):
            model = build_model(entry, index)
            met += [(model.model, *clash) for clash in self_clashes(model)]
    assert not met


def test_a_lids_hinge_holds_its_weight_at_any_angle():
    b = ObjectBuilder("trunk", "trunk_00", (0.4, 0.6, 0.4), random.Random(0))
    b.add(block((0.4, 0.6, 0.3), (0, 0, 0.15)), WHITE)
    lid = b.hinge("lid", (-0.2, 0, 0.3), (0, -1, 0), 1.7)
    lid.add(block((0.4, 0.6, 0.1), (0, 0, 0.35)), WHITE)
    model = b.finish()
    (joint,) = model.joints
    weight = 20.0 * 0.25 * GRAVITY  # a quarter of the volume, its middle 0.2 m before the axis when closed
    assert gravity_torque(model, joint, 20.0) == pytest.approx(weight * 0.2)
    assert friction(model, joint, 20.0) > gravity_torque(model, joint, 20.0)


def test_what_opens_about_a_level_axis_can_be_lifted_and_held_by_five_newton_metres():
    """Friction and weight together stay below the hand's strength for lids; for flaps the weight helps it."""
    for category in ("backpack", "briefcase", "carton", "chest", "folder", "jar", "laptop", "package", "pencil_box"):
        for index in range(find(category).count):
            model = build_model(find(category), index)
            for joint in model.joints:
                torque = gravity_torque(model, joint, mass_of(model))
                assert torque < joint.friction and torque + joint.friction < HINGE_STRENGTH, (category, index)
    for category in ("dishwasher", "oven", "stove"):
        for index in range(find(category).count):
            model = build_model(find(category), index)
            joint = next(j for j in model.joints if j.openable)
            assert gravity_torque(model, joint, mass_of(model)) < joint.friction < 0.95 * HINGE_STRENGTH
