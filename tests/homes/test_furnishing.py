"""How homes are furnished: the rules hold, nothing overlaps, nothing blocks a way or a door."""

from __future__ import annotations

import pathlib
from xml.etree import ElementTree

import numpy as np
import pytest
from furnished_homes import home
from ig2mj_homes.dataset.root import write_models
from ig2mj_homes.dataset.scene_writer import scene_urdf
from ig2mj_homes.dataset.shipped_homes import furnished, home_names
from ig2mj_homes.furnish import small_home
from ig2mj_homes.furnish.arrangement import AIR, Arrangement
from ig2mj_homes.furnish.ground import CELL, Ground
from ig2mj_homes.furnish.home import RULES
from ig2mj_homes.furnish.placed import Placed, rpy_of, shape, yaw
from ig2mj_homes.plans.layout_maps import Maps, reachable
from ig2mj_homes.plans.shipped import DRAWINGS, plan
from ig2mj_homes.shapes.surfaces import insides, tops

from ig2mj.errors import UnknownNameError

SMALL = ("aspen", "hazel", "small_home")
"""Homes that are furnished in half a second."""
each_home = pytest.mark.parametrize("name", home_names())


def things(name: str, category: str) -> list[Placed]:
    return [t for t in home(name).things.things.values() if t.category == category]


def box_thing(x: float, y: float, z: float = 0.0, degrees: float = 0.0) -> Placed:
    return Placed("stool_9", "stool", 0, np.array([x, y, z]), yaw(degrees), True)


def test_every_room_kind_of_the_plans_has_a_rule():
    assert {room.kind for name in DRAWINGS for room in plan(name).rooms} <= set(RULES)


@pytest.mark.parametrize("name", sorted(DRAWINGS))
def test_a_home_holds_as_many_things_as_asked(name: str):
    assert len(home(name).things.things) == DRAWINGS[name].objects


@pytest.mark.parametrize("name", SMALL)
def test_the_same_seed_gives_the_same_scene_to_the_byte(name: str):
    again = furnished(name)
    texts = [scene_urdf(name, list(h.things.things.values())) for h in (home(name), again)]
    assert texts[0] == texts[1]


def test_another_seed_gives_another_home():
    texts = [scene_urdf("aspen", list(h.things.things.values())) for h in (home("aspen"), furnished("aspen", 1))]
    assert texts[0] != texts[1]


@each_home
def test_nothing_overlaps(name: str):
    placed = Arrangement(np.zeros((0, 2, 3)))
    for thing in home(name).things.things.values():
        assert placed.fits(thing, ways=False, ignore=[t for t in placed.things]), thing.name
        placed.put(thing)
    assert len(placed.things) >= 20


@each_home
def test_a_disc_of_30_cm_reaches_every_room_with_the_furniture_in_place(name: str):
    maps = Maps(home(name).plan, home(name).things)
    reach = reachable(maps.trav == 255, 0.30, 0.01)
    for number, room in enumerate(home(name).plan.rooms):
        assert (reach & (maps.insseg == number + 1)).any(), room.name


@each_home
def test_loose_things_stand_on_something_right_below_them(name: str):
    all_things = list(home(name).things.things.values())
    assert not all(thing.fixed for thing in all_things)
    for thing in all_things:
        if thing.fixed:
            continue
        low, high = thing.box()
        tops_below = [0.0] + [
            b[1, 2]
            for other in all_things
            if other is not thing
            for b in other.boxes()
            if np.all(b[0, :2] < high[:2]) and np.all(b[1, :2] > low[:2]) and b[1, 2] <= low[2] + 1e-6
        ]
        assert low[2] - max(tops_below) <= AIR + 1e-4, thing.name


def test_the_bed_has_its_head_at_a_wall_and_a_stand_beside_it():
    (bed,) = things("hazel", "bed")
    room = home("hazel").plan.room("bedroom_0")
    x0, y0, x1, y1 = home("hazel").plan.inside(room)
    back = bed.centre[:2] - bed.front * bed.size[0] / 2
    assert min(abs(back[0] - x0), abs(back[0] - x1), abs(back[1] - y0), abs(back[1] - y1)) < 0.02
    stands = [t for t in things("hazel", "stand") if t.rooms == ("bedroom_0",)]
    assert stands
    for stand in stands:
        away = bed.rotation[:2, :2].T @ (stand.centre - bed.centre)[:2]
        assert abs(away[1]) < bed.size[1] / 2 + stand.size[1] / 2 + 0.05
        assert np.allclose(stand.front, bed.front)


def test_chairs_look_at_their_table_and_are_tucked_in():
    (table,) = things("small_home", "breakfast_table")
    chairs = things("small_home", "straight_chair")
    assert chairs
    for chair in chairs:
        towards = table.centre[:2] - chair.centre[:2]
        assert np.dot(towards, chair.front) > 0
        assert np.dot(towards, chair.front) < (table.size[0] + chair.size[0]) / 2


def test_the_kitchen_run_stands_in_one_line():
    run = [things("small_home", c)[0] for c in ("fridge", "bottom_cabinet", "stove", "sink")]
    backs = [t.centre[1] + t.size[0] / 2 for t in run]
    assert np.ptp(backs) < 1e-6
    assert np.all(np.diff([t.centre[0] for t in run]) > 0)


def test_the_fish_lies_in_the_pan_on_the_stove_near_its_heat():
    (fish,), (pan,), (stove,) = (things("small_home", c) for c in ("fish", "frying_pan", "stove"))
    assert (fish.host, pan.host) == (pan.name, stove.name)
    heat = stove.world(np.array(stove.shape.model.areas["heat_source"].xyz))
    assert np.linalg.norm(heat - fish.centre) < 0.2, "the stove's reach (taxonomy: distance_threshold)"


def test_the_milk_is_in_the_fridge_and_the_towel_in_a_drawer():
    for category, host in (("milk", "fridge"), ("dishtowel", "bottom_cabinet")):
        (thing,), (box,) = things("small_home", category), things("small_home", host)
        (low, high), (outer_low, outer_high) = thing.box(), box.box()
        assert np.all(low > outer_low) and np.all(high < outer_high)


def test_tops_have_nothing_above_and_insides_do():
    found = tops("fridge", 0) + insides("fridge", 0)
    assert max(s.z for s in tops("fridge", 0)) == pytest.approx(shape("fridge", 0).high[2], abs=0.01)
    assert len(insides("fridge", 0)) >= 3
    assert len(found) == len(set(found))


def test_overlap_is_seen_and_near_misses_are_not():
    placed = Arrangement(np.array([[[-1, -1, 0], [1, -0.9, 2]]]))
    placed.put(box_thing(0, 0))
    assert not placed.fits(box_thing(0.1, 0.1))
    assert not placed.fits(box_thing(0.0, -0.8)), "in the wall"
    assert placed.fits(box_thing(0.6, 0.0))
    assert not placed.fits(box_thing(0.6, 0.0), gap=0.5)


def test_what_opens_is_kept_free():
    placed = Arrangement(np.zeros((0, 2, 3)))
    placed.put(Placed("fridge_0", "fridge", 0, np.zeros(3), np.eye(3), True))
    before = shape("fridge", 0).high[0] + 0.25
    assert not placed.fits(box_thing(before, 0.0)), "the door swings here"
    assert placed.fits(box_thing(before + 1.0, 0.0))


def test_what_was_tried_is_taken_back():
    tried = furnished("aspen")
    before, free = list(tried.things.things), tried.ground.free.copy()
    earlier = tried.now()
    thing = box_thing(0.0, 0.0)
    tried.things.put(thing)
    tried.ground.occupy(thing)
    tried.back_to(earlier)
    assert list(tried.things.things) == before
    assert np.array_equal(tried.ground.free, free)
    assert tried.things.fits(box_thing(0.0, 0.0), ways=False) == home("aspen").things.fits(box_thing(0, 0), ways=False)


def test_carpets_need_no_air_around_them_and_block_no_way():
    placed = Arrangement(np.zeros((0, 2, 3)))
    placed.put(Placed("carpet_0", "carpet", 0, np.zeros(3), np.eye(3), True))
    length = float(shape("carpet", 0).size[0])
    assert placed.fits(box_thing(length / 2 + 0.2, 0.0), gap=0.1)
    assert not placed.fits(box_thing(length / 2 + 0.1, 0.0)), "half on it"
    assert placed.free(np.array([[-0.2, -0.2, 0.0], [0.2, 0.2, 1.0]]))


def test_furniture_that_would_block_a_doorway_is_refused():
    drawn = home("aspen").plan
    ground = Ground(drawn)
    door = next(o for o in drawn.openings if o.kind == "door" and not o.edge.outer)
    x, y = door.edge.point(door.centre)
    assert not ground.allows(box_thing(x, y))
    occupied = int(ground.free.sum())
    ground.occupy(box_thing(*drawn.room("living_room_0").centre))
    assert (occupied - ground.free.sum()) * CELL**2 > 0.02


def test_rotation_becomes_the_urdfs_roll_pitch_yaw():
    for degrees in (0, 90, 180, 270, 33.0):
        assert np.degrees(rpy_of(yaw(degrees))[2]) % 360 == pytest.approx(degrees)


def test_an_unknown_home_is_refused_with_the_near_name():
    with pytest.raises(UnknownNameError, match="aspen"):
        furnished("aspn")
    assert len(home_names()) == 17


def test_the_models_of_the_small_home_are_those_that_its_scene_places(tmp_path: pathlib.Path):
    write_models(tmp_path, small_home.models())
    scene = ElementTree.parse(small_home.build(tmp_path) / "urdf" / "small_home.urdf")
    placed = {(link.get("category"), link.get("model")) for link in scene.iter("link") if link.get("bounding_box")}
    written = {(folder.parent.name, folder.name) for folder in (tmp_path / "objects").glob("*/*")}
    assert placed <= written
    assert len(placed) == sum(map(len, small_home.models().values()))
