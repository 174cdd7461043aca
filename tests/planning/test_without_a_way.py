"""What is done where a hand has no way: put down where the robot stands, and pushed where it cannot be taken."""

import collections
import types

import numpy as np
import pytest

from ig2mj.planning import clutter, grasping, placing
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import PlannedWorld


def ended(running):
    """What a generator returns; its programs succeed."""
    with pytest.raises(StopIteration) as end:
        while True:
            next(running)
    return end.value.value


class World(PlannedWorld):
    """A hand holds a book; rooms are asked for at `room`."""

    room = "kitchen_0"
    held = property(lambda self: self.__dict__["holding"])  # pyright: ignore
    facts = property(lambda self: types.SimpleNamespace(room=lambda name: self.room))  # pyright: ignore


def world_in(room: str, graspable: bool = True) -> World:
    found = object.__new__(World)
    found.__dict__["holding"], found.room, found.missed = ["book"], room, collections.Counter()
    found.domain = types.SimpleNamespace(  # pyright: ignore
        hands_for=lambda name: 1, graspable=lambda name: graspable, loose=["book", "rug"]
    )
    return found


@pytest.mark.parametrize(("predicate", "room", "lets_go"), [
    ("on_floor", "kitchen_0", True), ("on_floor", "bath_0", False), ("on_top", "kitchen_0", False),
])  # fmt: skip
def test_what_has_no_way_to_its_place_on_a_floor_is_let_go_in_that_room_and_nothing_else(
    monkeypatch, predicate, room, lets_go
):
    world = world_in(room)

    def find(*_):
        yield []
        return placing._NO_WAY, ()

    def no(*_):
        yield []
        return False

    def release(world, step):
        yield []
        world.held.remove(step.object)
        return Outcome()

    for name, change in {"_find": find, "set_upright": no, "regrasp": no, "release": release}.items():
        monkeypatch.setattr(placing, name, change)
    monkeypatch.setattr(placing, "put_there", lambda *_: (True, ""))
    outcome = ended(placing.place(predicate)(world, Step(f"place_{predicate}", ("book", "kitchen_0"))))
    assert outcome.done == lets_go and world.held == ([] if lets_go else ["book"])
    assert lets_go or outcome.reason == "no_path"


@pytest.mark.parametrize(("graspable", "taken", "pushed"), [(True, True, 0), (True, False, 1), (False, False, 1)])
def test_what_cannot_be_taken_out_of_the_way_is_pushed_aside(monkeypatch, graspable, taken, pushed):
    world, pushes = world_in("kitchen_0", graspable), []
    world.held.clear()

    def bring_out(world, name):
        yield []
        return Outcome("" if taken else "no_base")

    def push_aside(world, name, opens, others):
        yield []
        pushes.append((name, others))
        return True

    monkeypatch.setattr(clutter, "bring_out", bring_out)
    monkeypatch.setattr(clutter, "push_aside", push_aside)
    monkeypatch.setattr(clutter, "target_of", lambda *_: (0.0, 0.0, 0.0))
    monkeypatch.setattr(clutter, "_nearer", lambda *_: 1.0)
    monkeypatch.setattr(clutter, "_barring", lambda *_: ("rug", ["book"]))
    assert ended(clutter._moved(world, Step("grasp", ("cup",)), "rug"))
    assert pushes == [("rug", ["book"])] * pushed
    monkeypatch.setattr(clutter, "_barring", lambda *_: None)  # it lies upon the cup
    assert ended(clutter._moved(world, Step("grasp", ("cup",)), "rug")) == taken
    assert len(pushes) == pushed


@pytest.mark.parametrize(
    ("bars", "found"),
    [({"chair"}, "chair"), ({"stool", "chair"}, "chair"), ({"basket", "lamp"}, "lamp"), (set(), None)],
)
def test_what_is_in_the_way_is_what_bars_it_with_what_comes_before_not_what_stands_beside_it(monkeypatch, bars, found):
    """Things along a way from x = 0 to x = 2, a lamp far from it, and a picture above it.

    bars: those that bar it together.
    """
    at = {"basket": 0.5, "stool": 1.0, "chair": 1.5, "lamp": 1.0, "picture": 0.1}
    boxes = {
        name: (np.array([x, y, z]), np.array([x, y, z + 0.2]))
        for name, x in at.items()
        for y, z in [(3.0 * (name == "lamp"), 2.0 * (name == "picture"))]
    }
    world, names = world_in("kitchen_0"), list(at)
    way = types.SimpleNamespace(way=lambda here, goal: np.array([[0.0, 0.0], [2.0, 0.0]]))
    monkeypatch.setattr(World, "facts", property(lambda self: types.SimpleNamespace(box=boxes.__getitem__)))
    monkeypatch.setattr(World, "floor", lambda self, without: types.SimpleNamespace(without=set(without), **vars(way)))
    monkeypatch.setattr(World, "base", property(lambda self: (np.zeros(2), 0.0)))
    monkeypatch.setattr(World, "index", lambda self, name: names.index(name))
    monkeypatch.setattr(clutter, "target_of", lambda *_: (2.0, 0.0, 0.0))
    monkeypatch.setattr(clutter, "_nearer", lambda *_: 1.0)
    monkeypatch.setattr(clutter, "_loose", lambda *_: names)
    stand = {names.index(n) for n in bars}
    shut = lambda floor: bool(stand) and not stand & floor.without  # noqa: E731
    monkeypatch.setattr(
        clutter, "nearest_floor", lambda world, floor, *_: None if shut(floor) else np.array([2.0, 0.0])
    )
    assert clutter.clutter_in_the_way(world, Step("grasp", ("cup",))) == found
    barring = clutter._barring(world, Step("grasp", ("cup",)))
    assert barring is None or (found not in barring[1] and not (bars - {found}) & set(barring[1]))


@pytest.mark.parametrize(("driven", "pushed", "came"), [(0.0, 0.0, False), (1.5, 0.5, True), (1.5, 0.0, False)])
def test_a_base_on_wheels_that_is_shut_in_pushes_through_what_it_cannot_move(monkeypatch, driven, pushed, came):
    """A robot at x = 0 is to go to x = 2; it gets as far as `driven` (m), and what stands there is `pushed` (m)."""
    world, at, stands = world_in("kitchen_0"), [0.0], [1.0]
    world.body = types.SimpleNamespace(opening=0.1)  # pyright: ignore
    floor = types.SimpleNamespace(way=lambda here, goal: np.array([[at[0], 0.0], [2.0, 0.0]]))
    monkeypatch.setattr(World, "floor", lambda *_, **__: floor)
    monkeypatch.setattr(World, "base", property(lambda self: (np.array([at[0], 0.0]), 0.0)))
    monkeypatch.setattr(World, "index", lambda self, name: 0)
    monkeypatch.setattr(clutter, "target_of", lambda *_: (2.0, 0.0, 0.0))
    monkeypatch.setattr(clutter, "_nearer", lambda *_: 1.0)
    monkeypatch.setattr(clutter, "nearest_floor", lambda *_: np.array([2.0, 0.0]))
    monkeypatch.setattr(World, "com", lambda self, name: np.array([stands[0], 0.0, 0.0]))
    running = clutter._pushed_through(world, Step("grasp", ("cup",)))
    (phase,) = next(running)
    assert phase.xy == (2.0, 0.0) and phase.speed == clutter.PUSHING
    at[0], stands[0] = driven, stands[0] + pushed
    assert ended(running) == came


def test_where_what_is_in_the_way_cannot_be_moved_a_fallen_container_is_set_up(monkeypatch):
    world, tried = world_in("kitchen_0"), []
    world.body = object.__new__(clutter.HandedBody)  # pyright: ignore
    world.holding[:] = [""]  # pyright: ignore

    def moved(world, step, name):
        yield []
        tried.append(name)
        return name == "box"

    def pushed(*_):
        yield []
        raise AssertionError

    monkeypatch.setattr(clutter, "_moved", moved)
    monkeypatch.setattr(clutter, "_pushed_through", pushed)
    monkeypatch.setattr(clutter, "clutter_in_the_way", lambda *_: "lamp")
    monkeypatch.setattr(clutter, "lying_upon", lambda *_: None)
    monkeypatch.setattr(clutter, "fallen_around", lambda *_: "box")
    assert ended(clutter.moved_out_of_the_way(world, Step("grasp", ("cup",))))
    assert tried == ["lamp", "box"]


@pytest.mark.parametrize(("primitive", "tipped", "found"), [
    ("grasp", True, "box"), ("grasp", False, None), ("open", True, None),
])  # fmt: skip
def test_a_container_that_fell_over_with_what_is_to_be_taken_is_set_up(monkeypatch, primitive, tipped, found):
    world = world_in("kitchen_0")
    world.domain.loose = ["book", "rug", "box"]  # pyright: ignore
    monkeypatch.setattr(World, "facts", types.SimpleNamespace(containers=lambda name: ("fridge", "box")))
    monkeypatch.setattr(clutter, "is_tipped", lambda world, name: tipped)
    assert clutter.fallen_around(world, Step(primitive, ("cup",))) == found


def test_poses_that_have_failed_are_remembered_until_the_object_lies_elsewhere():
    class Lying(PlannedWorld):
        corners = np.zeros((8, 3))

        def vertices(self, name):
            return self.corners

    world = object.__new__(Lying)
    world.vain, world.body = {}, types.SimpleNamespace(opening=None)  # pyright: ignore
    tried = grasping.tried_in_vain(world, "pen")
    tried.append("pose")  # pyright: ignore
    assert grasping.tried_in_vain(world, "pen") == ["pose"] and grasping.tried_in_vain(world, "book") == []
    world.corners = np.full((8, 3), 2 * grasping.SAME)
    assert grasping.tried_in_vain(world, "pen") == []
    grasping.tried_in_vain(world, "pen").append("pose")  # pyright: ignore
    world.body.opening = 0.1  # a gripper has fewer tries in later requests
    assert grasping.tried_in_vain(world, "pen") == []
