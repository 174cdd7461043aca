"""Which doors and drawers of a container are moved, in which order, until there is a way for a hand."""

import collections
import dataclasses
import types

import numpy as np
import pytest

from ig2mj.planning import doors, opening, opening_around
from ig2mj.planning.joints import OPEN_TO, OpenableJoint
from ig2mj.planning.opening_around import Tried, open_around, open_into
from ig2mj.planning.spots import _shut_away
from ig2mj.planning.steps import Step
from ig2mj.planning.world import PlannedWorld

OUT = np.array([0.0, -1.0, 0.0])


def _box(low, high):
    return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T


def _drawer(name, bottom, fraction=0.0):
    """A drawer 0.5 m wide and deep, 0.2 m high, that slides out to -y."""
    corners = _box((0.0, 0.0, bottom), (0.5, 0.5, bottom + 0.2)) + 0.4 * fraction * OUT
    return OpenableJoint(name, "cabinet", 0, False, np.zeros(3), OUT, 0.4 * fraction, 0.0, 0.4, corners, ())


def _door(fraction=0.0):
    corners = _box((0.0, -0.02, 0.0), (0.5, 0.0, 1.0))
    return OpenableJoint("door", "cabinet", 0, True, np.zeros(3), -OUT, 1.6 * fraction, 0.0, 1.6, corners, ())


@pytest.fixture
def moved(monkeypatch):
    """Joints of a container in place of a world's; each that is moved is noted, and gets to where it was to be."""
    noted = []

    def container(*joints):
        now = {joint.name: joint for joint in joints}

        def move_joint(world, joint, hand, value, tried=0, to=OPEN_TO):
            yield from ()
            noted.append((joint.name, to if value else 0.0))
            fraction = noted[-1][1]
            corners = joint.vertices if joint.hinge else joint.shut + 0.4 * fraction * OUT
            now[joint.name] = dataclasses.replace(joint, now=fraction * joint.open, vertices=corners)
            return "", ""

        for module in (opening, opening_around):
            monkeypatch.setattr(module, "joints_of", lambda world, name: list(now.values()))
            monkeypatch.setattr(module, "move_joint", move_joint)
            monkeypatch.setattr(module, "free_hand", lambda world, attempt: 0)
        domain = types.SimpleNamespace(opens=lambda name: True, openable=())
        facts = types.SimpleNamespace(containers=lambda name: ["cabinet"])
        com = np.array([0.25, 0.25, 0.5])
        return types.SimpleNamespace(
            held=["plate", ""],
            domain=domain,
            facts=facts,
            com=lambda name: com,
            body=types.SimpleNamespace(opening=None),
            missed=collections.Counter(),
        )

    return container, noted


def _all(generator):
    """The result of a generator that yields nothing."""
    with pytest.raises(StopIteration) as end:
        next(generator)
    return end.value.value


def test_a_full_drawer_is_shut_before_the_one_below_it_is_opened(moved):
    container, noted = moved
    world = container(_drawer("top", 0.6, OPEN_TO), _drawer("middle", 0.4), _drawer("bottom", 0.2))
    tried = Tried()
    for _ in range(4):
        assert _all(open_into(world, "cabinet", tried))
    assert noted == [("top", 0.0), ("middle", OPEN_TO), ("middle", 0.0), ("bottom", OPEN_TO)]
    assert not _all(open_into(world, "cabinet", tried))


def test_doors_are_opened_to_their_ends_at_last(moved):
    container, noted = moved
    world, tried = container(_door(0.3)), Tried()
    while _all(open_around(world, "plate", tried)):
        pass
    assert noted == [("door", OPEN_TO), ("door", 1.0)]


def test_nothing_is_put_behind_drawers_that_are_pulled_out_or_into_shut_ones():
    drawers = [_drawer("top", 0.6, 0.9), _drawer("bottom", 0.4)]
    positions = np.array([[0.25, 0.45, 0.65], [0.25, -0.1, 0.65], [0.25, 0.45, 0.45], [0.25, 0.45, 0.1]])
    assert _shut_away(positions, drawers).tolist() == [True, False, True, False]


def test_a_try_is_a_motion_after_one_that_failed_not_one_of_another_joint(moved, monkeypatch):
    container, noted = moved
    world = container(_drawer("top", 0.6, 0.8), _drawer("middle", 0.4, 0.7), _drawer("bottom", 0.2, 0.9))
    world.facts.holds = lambda *_: any(j.fraction > 0.01 for j in opening.joints_of(world, "cabinet"))
    outcome = _all(opening.set_open(False)(world, Step("close", ("cabinet",))))
    assert outcome.done and outcome.attempts == 1 and len(noted) == 3

    world = container(_drawer("top", 0.6, 0.8), _drawer("bottom", 0.2, 0.9))
    world.facts.holds = lambda *_: any(j.fraction > 0.01 for j in opening.joints_of(world, "cabinet"))
    fails = iter([True, False, False])

    def move_joint(*arguments):
        if next(fails):
            yield from ()
            return "not_true_after", "it did not move far enough"
        return (yield from shut(*arguments))

    shut = opening.move_joint
    monkeypatch.setattr(opening, "move_joint", move_joint)
    outcome = _all(opening.set_open(False)(world, Step("close", ("cabinet",))))
    assert outcome.done and outcome.attempts == 2


def test_fingers_that_push_a_door_point_to_its_hinge_and_turn_with_it():
    door = dataclasses.replace(_door(0.5), axis=np.array([0.0, 0.0, 1.0]))
    face, normal = np.array([0.4, -0.02, 0.5]), OUT
    for hand in (0, 1):
        assert np.allclose(opening._fingers(door, (face, normal), False, hand, True), [-1.0, 0.0, 0.0])
    fingers, turned = np.array([-1.0, 0.0, 0.0]), np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    plan = opening._JointPlan(None, [(face, normal)], False, fingers, 0.0)  # pyright: ignore
    world = types.SimpleNamespace(body=types.SimpleNamespace(turned=lambda hand, fingers, palm: (fingers, palm)))
    along, palm = opening._turned(world, 0, plan, turned)  # pyright: ignore
    assert np.allclose(palm, -turned) and abs(along @ palm) < 1e-9 and along @ fingers > 0.7


def test_a_door_between_rooms_that_is_ajar_is_pushed_open_from_its_inner_side():
    def pulls(fraction, between_rooms=True, gap=None):
        domain = types.SimpleNamespace(is_door=lambda name: between_rooms, fixed=lambda name: True)
        world = types.SimpleNamespace(domain=domain, body=types.SimpleNamespace(opening=gap))
        return [way[2] for way in opening._ways(world, _door(fraction), True)]

    assert pulls(0.3) == [False, True, True]
    assert pulls(0.1) == pulls(0.3, between_rooms=False) == pulls(0.3, gap=0.1) == [True, True, False]


@pytest.mark.parametrize("opens_to, swings", [(1.0, 4), (0.5, 3)])
def test_a_door_in_the_way_is_opened_as_wide_as_it_goes(monkeypatch, opens_to, swings):
    """Where it ends before that, it does if it is in the way no longer."""
    door, asked = [_door(0.0)], []

    def move_joint(world, joint, hand, value, tried, to):
        asked.append(to)
        door[0] = _door(min(to, opens_to))
        yield []

    monkeypatch.setattr(doors, "joints_of", lambda world, name: door)
    monkeypatch.setattr(doors, "move_joint", move_joint)
    monkeypatch.setattr(doors, "free_hand", lambda world, attempt: 0)
    monkeypatch.setattr(doors, "door_in_the_way", lambda world, step: None if door[0].fraction > 0.4 else "door")
    monkeypatch.setattr(doors, "HandedBody", types.SimpleNamespace)
    world = object.__new__(PlannedWorld)
    world.body = types.SimpleNamespace()  # pyright: ignore
    swung = doors._swing(world, "door", Step("navigate_to", ("plate",)))
    with pytest.raises(StopIteration) as end:
        while True:
            next(swung)
    assert end.value.value is None and len(asked) == swings
