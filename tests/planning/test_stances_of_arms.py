"""Stances from which a gripper on an arm puts something down: it points ahead, and to few of the nearest ones."""

from __future__ import annotations

import itertools
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from ig2mj.planning import driving, placing
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.phases import Base
from ig2mj.planning.placing import AROUND, STANCES, Spot
from ig2mj.planning.world import PlannedWorld, Stance

SPOT = Spot(np.array([1.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0]))


class _World(PlannedWorld):
    """Nothing is in the way of a hand at the origin that points along x."""

    def __init__(self, opening):
        self.body = SimpleNamespace(opening=opening)  # pyright: ignore[reportAttributeAccessIssue]
        self.missed = Counter[str]()

    def obstacles(self, without=(), at=None, stays=True):
        return Obstacles.__new__(Obstacles)

    def floor(self, *args, **kwargs):
        return None  # pyright: ignore[reportReturnType]

    def hand_axes(self, hand, rotation=None):
        return np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])

    def away(self, spheres, palm):
        return 0.6

    def standing(self, obstacles, stance, hand):
        return obstacles

    def carried(self, hand, stance):
        return np.zeros(3)

    def follows(self, hand, quat, obstacles, stance=None):
        return None


@pytest.fixture
def plan(monkeypatch):
    """Plans of a placement; `tried` has the stances of the ways that were looked for, nearest first `yaws`."""

    def plan(opening: float | None, yaws: list[float], way: bool):
        tried, most_asked = list[float](), list[int]()

        def stances(world, hand, target, floor, away, most):
            most_asked.append(most)
            yield from (Stance((0.0, 0.0), yaw) for yaw in itertools.islice(yaws, most))

        def hand_path(standing, spheres, start, *args, **kwargs):
            tried.append(float(start[0]))
            return [np.zeros(3)] if way else None

        monkeypatch.setattr(placing, "stances", stances)
        monkeypatch.setattr(placing, "hand_path", hand_path)
        monkeypatch.setattr(placing, "turning_point", lambda o, s, start, yaw: np.array([yaw, 0.0, 0.0]))
        monkeypatch.setattr(placing, "grip_for", lambda *_: (np.zeros(3), SPOT.quat, np.eye(3)))
        monkeypatch.setattr(placing, "spheres_at", lambda *_: np.zeros((1, 4)))
        monkeypatch.setattr(placing, "_drop", lambda *_: 0.0)
        found = placing._plan(_World(opening), "on_top", "box", 0, [SPOT])
        return found, tried, most_asked

    return plan


def test_a_gripper_looks_past_the_nearest_stances_for_one_to_which_it_points_ahead(plan):
    yaws = [np.pi / 2] * (AROUND - 1) + [0.1]
    found, tried, most = plan(0.1, yaws, way=True)
    assert not isinstance(found, str) and found[0].yaw == 0.1
    assert tried == [0.1] and most == [AROUND] and AROUND > STANCES
    found, _, _ = plan(0.1, [np.pi / 2] * AROUND + [0.1], way=True)
    assert isinstance(found, str), "and no farther than that"


def test_only_few_stances_are_tried_for_a_spot(plan):
    _, tried, _ = plan(0.1, [0.0] * AROUND, way=False)
    assert len(tried) == STANCES
    _, tried, most = plan(None, [np.pi / 2] * AROUND, way=False)
    assert len(tried) == STANCES and most == [STANCES], "a hand that floats may point anywhere"


@pytest.mark.parametrize(("reaches", "free", "goes"), [(False, True, True), (True, True, False), (False, False, False)])
def test_a_base_that_stopped_short_of_where_its_arm_reaches_goes_on(reaches, free, goes):
    """A robot at x = 1 m that looks along y; there is floor 4 cm ahead, or none."""
    asked = []

    class World(PlannedWorld):
        base = property(lambda self: (np.array([1.0, 0.0]), np.pi / 2))  # pyright: ignore
        held = property(lambda self: [""])  # pyright: ignore

        def follows(self, *_):  # pyright: ignore
            return SimpleNamespace(reaches=lambda point: reaches)

        def obstacles(self, *_):  # pyright: ignore
            return None

        def floor(self, *_):  # pyright: ignore
            return SimpleNamespace(nearest=lambda xy, reach: asked.append(xy) or (xy if free else None))

    world = object.__new__(World)
    running, phases = driving.nearer(world, 0, (1.0, 0.0, 0.0, 0.0), np.array([1.0, 1.0, 0.8])), []
    with pytest.raises(StopIteration) as ended:
        while True:
            phases += next(running)
    assert ended.value.value == goes and len(phases) == goes
    assert all(p.base == Base.SHIFT and p.xy == pytest.approx((1.0, 0.1)) and p.tolerance == 0.06 for p in phases)
    assert asked == ([] if reaches else [pytest.approx([1.0, 0.04])])
