"""A base that moves in any direction turns only where there is room for what its hands hold."""

import types

import numpy as np

from ig2mj.planning.carrying import HEADINGS, carried_way
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.world import PlannedWorld


class _Corridor(Obstacles):
    """Walls along x at y = -0.5 and 0.5 m up to x = 2, and open floor beyond."""

    def __init__(self, opens: bool):
        self._end = 2.0 if opens else np.inf

    def within(self, low, high):
        return self

    def clear_at(self, spheres, points, together=64):
        return np.array([self.clear(spheres + np.array([*point, 0.0])) for point in points], bool)

    def clear(self, spheres):
        x, y, _, radius = spheres.T
        return not ((x < self._end) & (np.abs(y) + radius > 0.5)).any()


class _Pole(_Corridor):
    """A pole, 2 cm thick, 1.1 m from a place on the x axis, between two of the headings there; nothing else."""

    def __init__(self, at: float, between: float):
        self._xy = np.array([at + 1.1 * np.cos(between), 1.1 * np.sin(between)])

    def clear(self, spheres):
        return not (np.linalg.norm(spheres[:, :2] - self._xy, axis=1) < 0.01 + spheres[:, 3]).any()


class _World(PlannedWorld):
    """A robot at the origin that looks along x and holds a rod of 0.9 m before it."""

    def __init__(self, opens: bool = True, corridor: Obstacles | None = None):
        self._corridor = corridor or _Corridor(opens)
        self.domain = types.SimpleNamespace(fixed=lambda name: False)  # pyright: ignore[reportAttributeAccessIssue]

    @property
    def base(self):
        return np.zeros(2), 0.0

    @property
    def held(self):
        return ["rod"]

    def obstacles(self, without=(), at=None):
        assert list(without) == ["rod"]
        return self._corridor

    def hand_axes(self, hand, rotation=None):
        return np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])

    def grip(self, hand):
        return np.array([0.4, 0.0, 1.0])

    def spheres(self, fingers, palm=(0.0, 0.0, -1.0), holding="", hand=0, rotation=None):
        return np.array([[x, 0.0, 0.0, 0.02] for x in np.linspace(0.0, 0.9, 10)])


POINTS = np.array([[0.0, 0.0], [3.5, 0.0]])


def test_what_is_held_is_turned_where_the_corridor_ends():
    found = carried_way(_World(), POINTS, np.pi / 2)
    assert found is not None
    way, up = found
    assert up == 0.0
    assert way[-1].xy == (3.5, 0.0) and np.isclose(way[-1].yaw, np.pi / 2)
    turned = [s for s in way if abs(s.yaw) > 0.5]
    assert turned and all(s.xy[0] >= 2.0 for s in turned)


def test_there_is_no_way_that_turns_in_a_corridor_without_end():
    assert carried_way(_World(opens=False), POINTS, np.pi / 2) is None
    straight = carried_way(_World(opens=False), POINTS, 0.0)
    assert straight is not None and len({round(s.yaw, 6) for s in straight[0]}) == 1


def test_what_is_held_is_not_turned_through_what_is_thinner_than_a_turn_by_one_heading():
    """From one heading to the next the end of the rod moves by 0.5 m: neither meets the pole, the turn does."""
    pole, ahead = _Pole(0.0, 1.5 * 2 * np.pi / HEADINGS), np.array([[0.0, 0.0], [0.0, 0.0]])
    world = _World(corridor=pole)
    found = carried_way(world, ahead, np.pi / 2)
    assert found is not None
    yaws = np.unwrap([0.0, *(s.yaw for s in found[0])])
    assert yaws.min() < -np.pi  # the other way around


class _Chair(_Corridor):
    """Across all of the way, 1.1 m high."""

    def __init__(self):
        pass

    def clear(self, spheres):
        x, _, z, radius = spheres.T
        return not ((np.abs(x - 1.5) < 0.1) & (z - radius < 1.1)).any()


def test_what_is_held_is_raised_over_what_it_would_meet_up_to_the_heads_of_doors():
    found = carried_way(_World(corridor=_Chair()), POINTS, 0.0, (0.05, 0.15, 0.3))
    assert found is not None and found[1] == 0.15
    assert carried_way(_World(corridor=_Chair()), POINTS, 0.0, (0.05, 0.9)) is None
