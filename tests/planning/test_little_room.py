"""Grasps below furniture, stances for what is hardly in reach, places on what is thin, and what bars the way."""

import dataclasses
import types

import numpy as np
import pytest
from still_world import still_world

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning import clutter, grasping, grasps, letting_go, opening, placing, spots
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.free_floor import FreeFloor
from ig2mj.planning.joints import openable_joints
from ig2mj.planning.phases import Until
from ig2mj.planning.pushing import _ways_aside
from ig2mj.planning.spots import spots_upon
from ig2mj.planning.stances import stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.taking import spheres_of
from ig2mj.planning.world import AWAY, PlannedWorld, Stance
from ig2mj.sampling.query import SceneQuery


@pytest.fixture(scope="module")
def world(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(-0.9, -0.5, 0.0)])
    return still_world(scene, SceneQuery(scene))


class _Ceiling(Obstacles):
    """A floor and a ceiling above it, m."""

    def __init__(self, inner: Obstacles, floor: float, ceiling: float):
        self._inner, self._floor, self._ceiling = inner, floor, ceiling

    def entries(self, *args, **kwargs):
        return self._inner.entries(*args, **kwargs)

    def distance(self, points):
        return np.minimum(points[..., 2] - self._floor, self._ceiling - points[..., 2])


def test_a_hand_goes_in_between_a_thing_and_what_is_above_it(world):
    low, high = (float(corner[2]) for corner in (world.vertices("book").min(0), world.vertices("book").max(0)))

    def nearest(room):
        poses = grasps.grasp_poses(world, "book", _Ceiling(world.obstacles(["book"]), low, high + room))
        return {p.before for p in poses if p.palm[2] < -0.9}

    assert nearest(0.3) == {grasps.BEFORE[0]}
    assert nearest(0.075) == {grasps.FLAT}
    assert nearest(0.05) == set()


class _Slot(_Ceiling):
    """A floor with two walls along x to both sides of a line, m."""

    def __init__(self, inner: Obstacles, floor: float, middle: float, half: float):
        super().__init__(inner, floor, np.inf)
        self._middle, self._half = middle, half

    def distance(self, points):
        return np.minimum(super().distance(points), self._half - np.abs(points[..., 1] - self._middle))


@pytest.mark.parametrize("aside", [0.0, 0.02])
def test_a_hand_almost_touches_walls_on_its_way_where_there_is_no_more_room(world, aside):
    low, middle = float(world.vertices("book")[:, 2].min()), world.com("book")[1] + aside

    def found(half, room):
        poses = grasps.grasp_poses(world, "book", _Slot(world.obstacles(["book"]), low, middle, half), room)
        return [p for p in poses if p.palm[2] < -0.9]

    assert found(0.07, 1.0)
    assert not found(0.05, 1.0)
    narrow = found(0.05, grasps.AT_OBJECT)
    assert narrow and all(p.room == grasps.AT_OBJECT for p in narrow)
    assert any(abs(p.point[1] - middle) < 0.009 for p in narrow)
    spheres = spheres_of(world, narrow[0])
    assert np.allclose(spheres[:, 3], grasps.AT_OBJECT * world.spheres(narrow[0].fingers, narrow[0].palm)[:, 3])


@pytest.mark.parametrize("share", [1.0, grasps.AT_OBJECT])
def test_an_empty_hand_begins_its_way_next_to_the_body_however_little_room_it_needs(world, share):
    hand, stance = 0, world.stance
    spheres = world.spheres(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])) * (1.0, 1.0, 1.0, share)
    obstacles = world.standing(world.obstacles(), stance, hand, body=False)
    assert obstacles.clear(spheres + np.array([*world.resting(hand, stance), 0.0]))


def test_the_body_turns_its_shoulder_to_what_is_hardly_in_reach(world):
    whole = world.floor()
    cell = whole.nearest(world.base[0], 0.2)
    free = np.zeros_like(whole.free)
    free[tuple(cell)] = True
    floor = FreeFloor(whole.occupancy, free, np.where(free, 0.1, -0.1))
    middle = whole.occupancy.middles(cell)
    _, aside, height = world.body.shoulders[1]

    def found(beyond):
        away = world.body.reach + beyond
        point = np.array([middle[0], middle[1] - away, world.body.stands + height])
        return point, list(stances(world, 1, point, floor, AWAY))

    farthest = float(np.hypot(*world.body.shoulders[1][:2]))
    point, some = found((abs(aside) + farthest) / 2)
    assert some and all(world.reaches(1, stance, point) for stance in some)
    assert not found(farthest + 0.02)[1]


def test_an_object_is_put_upon_another_over_its_middle_first(world):
    spots = list(spots_upon(world, "apple", "book"))
    own = world.vertices("apple") - world.pose("apple")[0]
    assert np.allclose(spots[0].pos[:2], world.com("book")[:2], atol=0.01)
    top = world.vertices("book")[:, 2].max()
    assert spots[0].pos[2] + own[:, 2].min() == pytest.approx(top, abs=0.003)


def test_what_bars_the_way_is_pushed_as_little_as_frees_it_and_not_into_furniture(world):
    pos = world.com("ball")

    def frees(floor):
        return floor.nearest(pos[:2], 0.06) is not None

    assert not frees(world.floor())
    ways = _ways_aside(world, "ball", frees, [])
    assert ways and [far for _, far in ways] == sorted(far for _, far in ways)
    obstacles = world.obstacles(["ball"])
    for way, far in ways:
        assert obstacles.distance((pos + far * way)[None])[0] > 0.09
    assert _ways_aside(world, "ball", lambda floor: False, []) == []


def test_what_another_hand_holds_is_in_the_way_where_the_robot_will_stand(world, monkeypatch):
    (x, y), yaw = world.base
    stance = dataclasses.replace(world.stance, xy=(float(x), float(y) - 0.5), yaw=yaw - np.pi / 2)
    monkeypatch.setattr(PlannedWorld, "held", property(lambda self: ["", "can"]))
    ahead, left, up = world.com("can") - np.array([x, y, 0.0])
    there = np.array([*stance.xy, 0.0]) + np.array([left, -ahead, up])

    def clear(obstacles, point):
        return obstacles.clear(np.array([[*point, 0.01]]))

    empty, elsewhere = world.obstacles(), world.obstacles(stays=False)
    assert not clear(empty, world.com("can")) and clear(elsewhere, world.com("can"))
    assert not clear(world.standing(elsewhere, stance, 0), there)
    assert clear(world.standing(elsewhere, stance, 1), there)


def test_what_is_tiny_lies_below_the_fingers_of_a_palm_from_above_and_not_below_the_palm(world):
    fingers = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    palms = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    points = np.zeros((3, 3))
    bean = 0.02 * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
    stick = bean * (10.0, 1.0, 1.0)
    behind, count = -grasps.BEHIND_TINY * fingers, len(grasps.OFF_TINY)
    which, found, _ = grasps._under_fingers(bean, points, fingers, palms)
    assert which.tolist() == [*[0] * count, *[1] * count, 2]
    assert np.allclose(found[[0, count, -1]], [behind[0], behind[1], points[2]])
    aside = found[1:3] - behind[0]
    assert np.allclose(aside @ fingers[0], 0.0) and np.allclose(aside @ palms[0], 0.0)
    assert np.allclose(aside.sum(0), 0.0) and not np.allclose(aside[0], 0.0)
    assert found[:count, 1].min() < -0.03 and found[:count, 1].max() > 0.03  # a palm 8 cm wide, 1 cm from a wall
    which, found, swept = grasps._under_fingers(stick, points, fingers, palms)
    along = len(grasps.OFF_SLENDER)
    assert which.tolist() == [*[0] * along, *[1] * count, 2]
    assert np.allclose(found[[0, along, -1]], [points[0], behind[1], points[2]])
    assert np.allclose(found[:along] @ fingers[0], 0.0) and np.ptp(found[:along] @ fingers[1]) > 0.0
    assert not swept.any()
    half_a_nut = bean * (0.9, 0.7, 0.25)
    which, found, swept = grasps._under_fingers(half_a_nut, points, fingers, palms)
    count = len(grasps.OFF_SWEPT)
    assert which.tolist() == [*[0] * count, *[1] * count, 2] and swept.tolist() == [True] * 2 * count + [False]
    assert np.allclose(found[swept, 2], grasps.SWEEPS - 0.005) and np.allclose(found[-1], points[2])
    assert (found[:count] @ fingers[0] < -grasps.BEHIND_TINY).all()


def test_what_slides_is_taken_by_its_sides_at_several_heights_and_places(world):
    joints = openable_joints(world.stage.scene, world.view, world.index("cabinet"))
    (drawer,) = [joint for joint in joints if not joint.hinge]
    low, high = drawer.vertices.min(0), drawer.vertices.max(0)
    for point, normal in drawer.edges:
        assert (low - 1e-6 <= point).all() and (point <= high + 1e-6).all() and abs(normal @ drawer.axis) < 1e-6
        assert np.isclose((point - (low if normal.sum() < 0 else high)) @ normal, 0.0)
    points = np.array([point for point, _ in drawer.edges])
    assert len(np.unique(points[:, 2].round(3))) == 3 and len(np.unique((points @ drawer.axis).round(3))) == 3


def test_a_hand_goes_off_a_drawer_while_it_lets_go_of_it(world):
    joints = openable_joints(world.stage.scene, world.view, world.index("cabinet"))
    (drawer,) = [joint for joint in joints if not joint.hinge]
    plan = opening._plan(world, drawer, 1, True, 0)
    program = opening._program(world, drawer, 1, plan)
    (lets_go,) = [phase for phase in program if phase.until == Until.EMPTY]
    point, normal = plan.places[-1]
    assert plan.pulls and (np.array(lets_go.pos) - point) @ normal > 0.1


def test_floor_from_where_hands_reach_with_ease_comes_first(world, monkeypatch):
    point = world.com("apple")
    step = Step("grasp", ("apple",))
    assert clutter._nearer(world, step, point) < world.body.reach - clutter.GAIN
    assert clutter.clutter_in_the_way(world, step) is None
    monkeypatch.setattr(clutter, "_loose", lambda world, step: [])
    whole = PlannedWorld.floor

    def shut(self, **options):
        floor = whole(self, **options)
        return FreeFloor(floor.occupancy, np.zeros_like(floor.free), floor.spare) if not options else floor

    monkeypatch.setattr(PlannedWorld, "floor", shut)
    assert clutter._nearer(world, step, point) == world.body.reach


def test_what_lies_upon_a_thing_is_known_and_what_stands_next_to_it_is_not(world, monkeypatch):
    boxes = {
        "book": ([0.0, 0.0, 0.0], [0.2, 0.2, 0.02]),
        "apple": ([0.1, 0.1, 0.02], [0.18, 0.18, 0.1]),
        "ball": ([0.25, 0.0, 0.0], [0.3, 0.1, 0.1]),
    }
    facts = types.SimpleNamespace(box=lambda name: tuple(map(np.array, boxes[name])))
    monkeypatch.setattr(PlannedWorld, "facts", facts)
    monkeypatch.setattr(clutter, "_loose", lambda world, step: [n for n in boxes if n not in step.things])
    assert clutter.lying_upon(world, Step("grasp", ("book",))) == "apple"
    assert clutter.lying_upon(world, Step("grasp", ("apple",))) is None
    assert clutter.lying_upon(world, Step("open", ("book",))) is None


def test_lids_and_flaps_are_no_part_of_what_is_taken_hold_of(world):
    tables = world.domain.model.tables
    book, apple, cabinet = (world.index(name) for name in ("book", "apple", "cabinet"))
    own = np.flatnonzero(tables.piece_object == book)
    flapped = dataclasses.replace(
        tables, piece_object=np.where(tables.piece_object == apple, book, tables.piece_object)
    )
    assert (flapped.piece_object == book).sum() > len(own)
    assert np.array_equal(grasps.main_pieces(flapped, book), own)
    assert np.array_equal(grasps.main_pieces(tables, cabinet), np.flatnonzero(tables.piece_object == cabinet))


def test_what_has_no_place_inside_in_the_nearest_orientations_is_turned_further(world, monkeypatch):
    half = np.sqrt(0.5)
    quats = [(1, 0, 0, 0), (0, 1, 0, 0), (half, half, 0, 0), (half, -half, 0, 0), (half, 0, half, 0)]
    monkeypatch.setattr(spots, "_orientations", lambda *_: [types.SimpleNamespace(quat=q) for q in quats])
    few, every = (spots._upright(world, "book", every=every) for every in (False, True))
    assert len(few) == spots.ORIENTATIONS and len(every) == len(quats)
    assert all(np.array_equal(a, b) for a, b in zip(few, every[: len(few)], strict=True))
    below = {tuple(matrices_on_host(quat[None])[0][2].round(3)) for quat in every}
    assert len(below) == len(quats)


@pytest.mark.parametrize("stays", [True, False])
def test_what_is_lost_while_its_container_is_opened_is_taken_again(monkeypatch, stays):
    """A door that the other hand opens meets what the hand holds; `stays`: it is taken again and then kept."""
    hands, taken = ["can"], []

    class World(PlannedWorld):
        held = property(lambda self: hands)  # pyright: ignore
        facts = property(lambda self: None)  # pyright: ignore

    def find(world, predicate, step, hand, opened, until):
        yield []
        if stays and taken:
            return (None, placing.Spot(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))), ()
        hands[0] = ""
        return placing._NO_WAY, ()

    def grasp(world, step):
        yield []
        hands[0] = step.object
        taken.append(step.object)
        return Outcome()

    def nothing(*_):
        yield []
        return ""

    world = object.__new__(World)
    world.domain = types.SimpleNamespace(hands_for=lambda name: 1, loose=())  # pyright: ignore
    world.body = types.SimpleNamespace(opening=None)  # pyright: ignore
    changes = {
        "is_thrown_over": lambda *_: False, "steadied": lambda world, name, hand, action: action,
        "_find": find, "grasp": grasp, "go": nothing, "set_upright": nothing, "from_home": lambda *_: nothing(),
        "letting_go": lambda *_, falls: [], "put_there": lambda *_: (True, ""),
    }  # fmt: skip
    for name, change in changes.items():
        monkeypatch.setattr(placing, name, change)
    running = placing.place("inside")(world, Step("place_inside", ("can", "cabinet")))
    with pytest.raises(StopIteration) as ended:
        while True:
            next(running)
    outcome = ended.value.value
    assert outcome.done == stays and len(taken) == (1 if stays else 3)
    assert stays or (outcome.reason, outcome.detail) == ("slipped", "the hand lost can")


def test_what_a_hand_has_let_go_bars_its_way_back_where_it_stands_there(world):
    low, high = world.vertices("book").min(0), world.vertices("book").max(0)
    beside = np.array([high[0] + 0.15, (low[1] + high[1]) / 2, high[2]])
    at = dataclasses.replace(world)
    at.grip = lambda hand: beside
    at.hand_axes = lambda hand, rotation=None: (np.array([0.0, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0]))
    up, across = (beside + np.array(way) for way in ((0.0, 0.0, 0.4), (-0.4, 0.0, 0.0)))
    assert not letting_go.is_caught(at, "book", 1, [up])
    assert letting_go.is_caught(at, "book", 1, [across, up])
    assert not letting_go.is_caught(at, "ball", 1, [across, up])


class _BetweenWalls(Obstacles):
    """Two slabs, of which a hand at a point touches one, 0.3 m high above it; the other is behind the hand."""

    behind = 0.12, 0.14
    """m from the point."""

    def __init__(self, point):
        self._point = point

    def distance(self, points):
        along, _, up = np.moveaxis(points - self._point, -1, 0)
        slabs = ((-0.06, 0.0), self.behind)
        aside = np.min([np.maximum(low - along, along - high) for low, high in slabs], axis=0)
        return np.maximum(aside, up - 0.3)

    def clear_along(self, spheres, start, ahead, along):
        places = start + along[:, None] * ahead
        return bool((self.distance(places[:, None] + spheres[:, :3]) > spheres[:, 3]).all())


@pytest.mark.parametrize("among_walls", [False, True])
def test_a_hand_goes_off_what_it_touches_and_not_through_the_wall_behind_it(world, among_walls):
    point = np.array([0.0, 0.0, 1.0])
    at = dataclasses.replace(world)
    at.grip = lambda hand: point
    at.hand_axes = lambda hand, rotation=None: (np.array([0.0, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0]))
    at.obstacles = lambda *_: _BetweenWalls(point)
    at.resting = lambda hand, stance: point + np.array([0.3, 0.0, 0.8])
    way = opening.way_off(at, 1, among_walls)
    first = next((phase.pos for phase in way if phase.pos is not None), tuple(point))
    assert (first[0] < _BetweenWalls.behind[0]) == among_walls


def test_a_robot_stands_beside_what_it_takes_and_above_it_at_last(world):
    """A board that it stood on, it would raise against its body."""
    (x, y, _), far = world.com("book"), world.body.trunk[0] + 0.5
    above, beside = Stance((float(x), float(y)), 0.0), Stance((float(x) - far, float(y)), 0.0)
    assert list(grasping._beside_first(world, "book", [above, beside])) == [beside, above]
