"""The sixteen floor plans: 119 rooms, real holes in walls, every room within reach."""

from __future__ import annotations

import collections
import functools

import numpy as np
import pytest
from ig2mj_homes.dataset.root import ROOM_TYPES
from ig2mj_homes.furnish.ground import CELL, RADIUS, Ground
from ig2mj_homes.plans.building import PARAPET, floor_boxes, stair_boxes, wall_boxes
from ig2mj_homes.plans.layout_maps import reachable
from ig2mj_homes.plans.openings import opening_things
from ig2mj_homes.plans.plan import HEIGHT, Plan, grid_rooms, make_edges
from ig2mj_homes.plans.porch import front_door, porch_rails, porch_slab
from ig2mj_homes.plans.shipped import DRAWINGS, LEAVES_AT_WALLS, plan

cached_plan = functools.cache(plan)
each_home = pytest.mark.parametrize("name", sorted(DRAWINGS))


def boxes_overlap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[n, m] whether boxes [n, 2, 3] and [m, 2, 3] share more than a face."""
    return np.all((a[:, None, 0] < b[None, :, 1] - 1e-6) & (a[:, None, 1] > b[None, :, 0] + 1e-6), axis=-1)


def hole(home: Plan, opening) -> np.ndarray:
    """What must be free; where there is no wall at all, the walls at its ends may stand half inside."""
    end = 0.11 if home.fully_open(opening.edge) else 1e-3
    return opening.edge.box(opening.low + end, opening.high - end, opening.bottom + 1e-3, opening.top - 1e-3)


def test_sixteen_homes_have_119_rooms():
    assert len(DRAWINGS) == 16
    assert sum(len(cached_plan(name).rooms) for name in DRAWINGS) == 119


def test_three_homes_have_the_sizes_of_table_a7():
    sizes = [drawing.objects for drawing in DRAWINGS.values()]
    assert {20, 60, 120} <= set(sizes)
    assert min(sizes) >= 20 and max(sizes) <= 150


def test_every_home_has_a_kitchen_a_living_room_and_a_bathroom_and_room_kinds_are_known():
    kinds = {name: collections.Counter(room.kind for room in cached_plan(name).rooms) for name in DRAWINGS}
    for found in kinds.values():
        assert found["kitchen"] == 1 and found["living_room"] == 1 and found["bathroom"] >= 1
    total = sum(kinds.values(), collections.Counter())
    assert set(total) <= set(ROOM_TYPES)
    assert len(total) >= 18


@each_home
def test_rooms_tile_without_overlap_and_are_numbered_within_their_kind(name: str):
    home = cached_plan(name)
    rects = np.array([room.rect for room in home.rooms])
    boxes = np.stack([np.c_[rects[:, :2], np.zeros(len(rects))], np.c_[rects[:, 2:], np.ones(len(rects))]], 1)
    assert not np.triu(boxes_overlap(boxes, boxes), 1).any()
    seen: collections.Counter = collections.Counter()
    for room in home.rooms:
        assert room.name == f"{room.kind}_{seen[room.kind]}"
        seen[room.kind] += 1


@each_home
def test_openings_are_real_holes_between_wall_segments(name: str):
    home = cached_plan(name)
    walls = wall_boxes(home)
    holes = np.array([hole(home, opening) for opening in home.openings])
    assert not boxes_overlap(walls, holes).any()


@each_home
def test_walls_are_boxes_that_overlap_nowhere_and_close_every_room(name: str):
    home = cached_plan(name)
    walls = wall_boxes(home)
    assert not np.triu(boxes_overlap(walls, walls), 1).any()
    for edge in home.edges:
        covered = sum(o.high - o.low for o in home.openings_of(edge))
        middle = edge.box(edge.low + 0.15, edge.high - 0.15, 0.2, 0.21, across=0.01)
        solid = np.clip(np.minimum(walls[:, 1], middle[1]) - np.maximum(walls[:, 0], middle[0]), 0, None).prod(1).sum()
        whole = np.prod(middle[1] - middle[0])
        through = sum(o.high - o.low for o in home.openings_of(edge) if o.walkable)
        assert solid >= whole * (1 - (through + 1e-3) / (edge.length - 0.3)) - 1e-9, (edge, covered)


@each_home
def test_a_door_or_window_fills_its_opening_and_names_the_rooms_on_both_sides(name: str):
    home = cached_plan(name)
    found = list(opening_things(home))
    assert found
    for opening, thing in found:
        low, high = thing.box()
        along = 0 if opening.edge.axis == "x" else 1
        assert opening.low < low[along] and high[along] < opening.high
        assert opening.width - (high[along] - low[along]) < 0.02
        assert opening.bottom <= low[2] and high[2] <= opening.top
        assert thing.fixed and thing.rooms == opening.edge.rooms
        assert len(thing.rooms) == (1 if opening.edge.outer else 2)


@pytest.mark.parametrize("name", LEAVES_AT_WALLS)
def test_open_doors_and_the_front_door_leave_a_way_to_every_room_of_the_empty_home(name: str):
    home = cached_plan(name)
    doors = [thing for opening, thing in opening_things(home) if opening.kind == "door"]
    ground = Ground(home, np.concatenate([door.open_boxes() for door in doors]))
    assert ground.free.sum() < Ground(home).free.sum()
    assert ground.cut_off_by(np.zeros((0, 2, 3))) == ""


def test_a_door_left_open_across_a_corridor_cuts_a_room_off():
    home = cached_plan("alder")
    corridor = home.inside(home.room("corridor_0"))
    leaf = np.array([[[0.0, corridor[1], 0.0], [0.05, corridor[3], 2.0]]])
    assert Ground(home, leaf).cut_off_by(np.zeros((0, 2, 3))) != ""


@each_home
def test_a_disc_of_30_cm_reaches_every_room_and_doorway_of_the_empty_home(name: str):
    home = cached_plan(name)
    ground = Ground(home)
    reach = reachable(ground.free, RADIUS, CELL)
    half = len(reach) // 2
    for room in home.rooms:
        x0, y0, x1, y1 = (int(v / CELL) + half for v in home.inside(room))
        assert reach[y0:y1, x0:x1].any(), room.name


@each_home
def test_floors_cover_all_rooms_and_their_doorways(name: str):
    home = cached_plan(name)
    floors = floor_boxes(home)
    assert np.all(floors[:, 1, 2] == 0.0)
    places = [opening.edge.point(opening.centre) for opening in home.openings if opening.walkable]
    places += [room.centre for room in home.rooms]
    for x, y in places:
        assert any(np.all(box[0, :2] <= [x, y]) and np.all([x, y] <= box[1, :2]) for box in floors)


@each_home
def test_outside_the_front_door_is_a_landing_that_nobody_falls_from(name: str):
    home = cached_plan(name)
    door = front_door(home)
    assert door is not None and len(door.edge.rooms) == 1
    (slab,), rails = porch_slab(home), porch_rails(home)
    floors = np.concatenate([floor_boxes(home), slab[None]])
    assert slab[1, 2] == 0.0
    way = -1.0 if door.edge.before is None else 1.0
    for across in np.arange(-0.3, 1.2, 0.02):  # from the room through the door to the parapet
        x, y = door.edge.point(door.centre, way * across)
        assert np.any(np.all((floors[:, 0, :2] <= [x + 1e-6, y + 1e-6]) & (floors[:, 1, :2] >= [x, y]), axis=1))
    for along in (door.low - 0.2, door.centre, door.high + 0.2):
        end = np.array([*door.edge.point(along, way * (slab_depth(door, slab) - 0.01)), 0.5])
        assert np.any(np.all((rails[:, 0] < end) & (end < rails[:, 1]), axis=1)), "a parapet all along"
    assert not boxes_overlap(np.concatenate([wall_boxes(home), floor_boxes(home)]), np.array([*rails, slab])).any()


def slab_depth(door, slab: np.ndarray) -> float:
    """m from the wall's line to the landing's far edge."""
    axis = 1 if door.edge.axis == "x" else 0
    return float(np.abs(slab[:, axis] - door.edge.at).max())


def test_stairs_rise_to_the_ceiling_and_a_balcony_has_a_parapet():
    assert stair_boxes(cached_plan("poplar"))[:, 1, 2].max() == pytest.approx(HEIGHT)
    home = cached_plan("rowan")
    outer = [e for e in home.edges if e.rooms == ("balcony_0",)]
    walls = wall_boxes(home)
    for edge in outer:
        over = edge.box(edge.low + 0.2, edge.high - 0.2, PARAPET + 0.01, HEIGHT)
        assert not boxes_overlap(walls, over[None]).any()


def test_a_room_that_is_no_rectangle_is_refused():
    with pytest.raises(AssertionError, match="not a rectangle"):
        grid_rooms({"A": "kitchen", "B": "bedroom"}, (1.0, 1.0), (1.0, 1.0), "A A\nA B")


def test_edges_are_cut_where_a_neighbour_begins():
    rooms = grid_rooms({"A": "kitchen", "B": "bedroom", "C": "closet"}, (4.0, 2.0), (2.0, 2.0), "A B\nA C")
    shared = [edge for edge in make_edges(rooms) if not edge.outer]
    assert {frozenset(edge.rooms) for edge in shared} == {
        frozenset(pair) for pair in (("kitchen_0", "bedroom_0"), ("kitchen_0", "closet_0"), ("bedroom_0", "closet_0"))
    }
    assert all(edge.length == pytest.approx(2.0) for edge in shared)
