"""What a visitor of any of the fifteen homes would look for: the rules of homes/furnish hold everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from furnished_homes import home
from ig2mj_homes.furnish.placed import Placed
from ig2mj_homes.furnish.television_area import ASIDE, FARTHEST, NEAREST, aside, floor_between
from ig2mj_homes.plans.plan import Room
from ig2mj_homes.plans.shipped import DRAWINGS

each_home = pytest.mark.parametrize("name", sorted(DRAWINGS))
LARGE = [name for name, drawing in sorted(DRAWINGS.items()) if drawing.objects >= 40]
EYES = 1.1
"""m above the floor, where who sits on a sofa looks along."""
OPENINGS = ("door", "window")


def things_in(name: str, room: Room, *categories: str) -> list[Placed]:
    """All objects of a room, or those of some categories."""
    found = [t for t in home(name).things.things.values() if t.rooms == (room.name,)]
    return [t for t in found if not categories or t.category in categories]


def rooms_of(name: str, *kinds: str) -> list[Room]:
    return [room for room in home(name).plan.rooms if room.kind in kinds]


def faces(a: Placed, b: Placed) -> bool:
    return float(a.front @ (b.centre - a.centre)[:2]) > 0


@each_home
def test_every_living_room_has_a_television_and_a_sofa_that_faces_it(name: str):
    for room in rooms_of(name, "living_room", "television_room"):
        (television,) = things_in(name, room, "standing_tv", "wall_mounted_tv")
        (sofa,) = things_in(name, room, "sofa")
        assert np.allclose(sofa.front, -television.front, atol=1e-9), "they look at each other"
        assert faces(sofa, television) and faces(television, sofa)
        assert aside(sofa, television) <= ASIDE + 1e-6
        assert NEAREST <= floor_between(sofa, television) <= FARTHEST + 0.3


@each_home
def test_nothing_stands_between_the_sofa_and_the_screen(name: str):
    for room in rooms_of(name, "living_room", "television_room"):
        (television,) = things_in(name, room, "standing_tv", "wall_mounted_tv")
        (sofa,) = things_in(name, room, "sofa")
        start, end = sofa.centre[:2], television.centre[:2]
        for share in np.linspace(0.0, 1.0, 60):
            eye = np.array([*(start + share * (end - start)), EYES])
            for thing in home(name).things.things.values():
                if thing in (sofa, television):
                    continue
                low, high = thing.box()
                assert not (np.all(low < eye) and np.all(eye < high)), thing.name


@each_home
def test_every_kitchen_cooks_and_every_bathroom_washes_and_every_bedroom_sleeps(name: str):
    for room in rooms_of(name, "kitchen"):
        assert things_in(name, room, "fridge") and things_in(name, room, "stove")
        assert name not in LARGE or things_in(name, room, "bottom_cabinet")
        assert all(sink.shape.model.joints for sink in things_in(name, room, "sink")), "over a cupboard"
        assert things_in(name, room, "sink")
    for room in rooms_of(name, "bathroom"):
        assert things_in(name, room, "toilet") and things_in(name, room, "sink")
        assert things_in(name, room, "bathtub", "shower")
    for room in rooms_of(name, "bedroom", "childs_room"):
        assert things_in(name, room, "bed", "crib")


@each_home
def test_chairs_face_a_table_that_they_stand_at(name: str):
    for room in home(name).plan.rooms:
        tables = things_in(name, room, "breakfast_table", "desk")
        for chair in things_in(name, room, "straight_chair", "swivel_chair"):
            near = [t for t in tables if np.linalg.norm((t.centre - chair.centre)[:2]) < max(t.size[:2]) / 2 + 0.75]
            assert any(faces(chair, table) for table in near), chair.name


@each_home
def test_a_dining_table_has_two_chairs_at_least_and_desks_a_seat(name: str):
    for room in rooms_of(name, "dining_room"):
        assert len(things_in(name, room, "straight_chair")) >= 2
    for room in rooms_of(name, "home_office"):
        assert things_in(name, room, "desk") and things_in(name, room, "swivel_chair")


@each_home
def test_nightstands_stand_beside_the_bed_and_its_head_is_at_a_wall(name: str):
    for room in rooms_of(name, "bedroom"):
        (bed,) = things_in(name, room, "bed")
        x0, y0, x1, y1 = home(name).plan.inside(room)
        back = bed.centre[:2] - bed.front * bed.size[0] / 2
        assert min(abs(back[0] - x0), abs(back[0] - x1), abs(back[1] - y0), abs(back[1] - y1)) < 0.02
        for stand in things_in(name, room, "stand"):
            away = bed.rotation[:2, :2].T @ (stand.centre - bed.centre)[:2]
            assert abs(away[1]) < bed.size[1] / 2 + stand.size[1] / 2 + 0.05
            assert np.allclose(stand.front, bed.front)


@each_home
def test_lamps_stand_on_something_and_floor_lamps_on_the_floor(name: str):
    for thing in home(name).things.things.values():
        if thing.category == "table_lamp":
            assert thing.host is not None and thing.box()[0, 2] > 0.3
        if thing.category == "floor_lamp":
            assert thing.host is None and thing.box()[0, 2] < 0.01


@each_home
def test_carpets_lie_on_the_floor_and_what_stands_on_one_stands_on_it_wholly(name: str):
    placed = home(name).things.things
    for carpet in (t for t in placed.values() if t.category == "carpet"):
        low, high = carpet.box()
        assert low[2] == pytest.approx(0.0, abs=1e-6) and high[2] < 0.02
        for thing in (t for t in placed.values() if t.host == carpet.name):
            feet = np.concatenate([p[p[:, 2] < high[2] + 0.01] for p in thing.hulls()])
            assert len(feet)
            edge = 0.007 if thing.category != "coffee_table" else 1e-6  # what lies may reach a little over the edge
            assert np.all(feet[:, :2] > low[:2] - edge) and np.all(feet[:, :2] < high[:2] + edge), thing.name


@pytest.mark.parametrize("name", LARGE)
def test_no_room_of_a_larger_home_is_empty(name: str):
    for room in home(name).plan.rooms:
        assert len([t for t in things_in(name, room) if t.category not in OPENINGS]) >= 2, room.name


@pytest.mark.parametrize("name", LARGE)
def test_a_mat_lies_before_the_front_door(name: str):
    plan = home(name).plan
    x0, y0, x1, y1 = plan.extent()
    outside = [
        mat
        for mat in home(name).things.things.values()
        if mat.category == "mat" and not (x0 < mat.centre[0] < x1 and y0 < mat.centre[1] < y1)
    ]
    assert len(outside) == 1


def test_the_homes_together_use_a_good_part_of_the_catalogue():
    used = {thing.category for name in DRAWINGS for thing in home(name).things.things.values()}
    assert used & {"backpack", "duffel_bag", "shoulder_bag"}
    assert {"jar", "paper_towel", "carpet", "piano", "heater", "coatrack", "car", "countertop"} <= used
    assert len(used) > 140
