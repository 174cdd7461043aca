"""What is long is turned upright where there is no way with it lying in the hand."""

import types

import numpy as np
import pytest

from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning import driving
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.free_floor import FreeFloor
from ig2mj.planning.long_things import LOWEST, stood_up
from ig2mj.planning.world import HIGHEST, PlannedWorld, Stance

CARRIED = np.array([0.6, 0.2, 0.8])


class _Room(Obstacles):
    """A wall at y = -`wall`, m, and a ceiling."""

    def __init__(self, wall: float, ceiling: float = 2.5):
        self._wall, self._ceiling = wall, ceiling

    def clear(self, spheres):
        _, y, z, radius = spheres.T
        return not ((y - radius < -self._wall) | (z + radius > self._ceiling) | (z - radius < 0.0)).any()


class _World(PlannedWorld):
    """A robot at the origin that looks along x; one hand holds a rod along y by its middle."""

    def __init__(self, room: Obstacles, length: float = 1.2):
        self._room, self._length = room, length
        self.domain = types.SimpleNamespace(fixed=lambda name: False)  # pyright: ignore[reportAttributeAccessIssue]
        self.body = types.SimpleNamespace(
            trunk=(0.2, 2.0), carry=np.array([[0.34, 0.16, 0.5], [0.34, -0.16, 0.5]]), stands=0.0, opening=None
        )

    held = property(lambda self: ["rod", ""])  # pyright: ignore
    stance = property(lambda self: Stance((0.0, 0.0), 0.0))  # pyright: ignore

    def index(self, name):
        return 7

    def obstacles(self, without=(), at=None):
        assert list(without) == ["rod"]
        return self._room

    def reaches(self, hand, stance, point):
        return False

    def hand_axes(self, hand, rotation=None):
        return np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0])

    def hand_quat(self, hand):
        return np.array([1.0, 0.0, 0.0, 0.0])

    def grip(self, hand):
        return CARRIED

    def vertices(self, name):
        ends = np.array([[x, y, z] for x in (-0.01, 0.01) for y in (-0.5, 0.5) for z in (-0.01, 0.01)])
        return CARRIED + ends * (1.0, self._length, 1.0)

    def spheres(self, fingers, palm=(0.0, 0.0, -1.0), holding="", hand=0, rotation=None):
        return np.array([[0.0, y, 0.0, 0.02] for y in np.linspace(-self._length / 2, self._length / 2, 13)])


def stands(world):
    """Corners of the rod where a program leaves it."""
    goes, turns = stood_up(world, 0)
    assert goes.quat is None and turns.pos == goes.pos and {goes.keeps, turns.keeps} == {7}
    assert turns.quat is not None
    return (world.vertices("rod") - CARRIED) @ matrices_on_host(np.array([turns.quat]))[0].T + np.array(turns.pos)


def test_a_rod_is_turned_upright_above_the_floor():
    corners = stands(_World(_Room(0.7)))
    assert np.ptp(corners[:, 2]) == pytest.approx(1.2, abs=0.02)
    assert corners[:, 2].min() >= LOWEST - 1e-6 and corners[:, 2].max() <= HIGHEST + 1e-6


def test_it_is_taken_aside_where_a_wall_is_in_the_way_of_the_turn():
    near, far = (stands(_World(_Room(wall)))[:, 1].mean() for wall in (0.35, 0.7))
    assert near > far + 0.05


@pytest.mark.parametrize(
    "world", [_World(_Room(0.7), length=0.5), _World(_Room(0.7), length=1.9), _World(_Room(0.7, ceiling=1.0))]
)
def test_what_is_short_or_has_no_room_upright_stays_as_it_is(world):
    assert stood_up(world, 0) == []


def test_a_base_without_a_way_with_a_rod_turns_it_upright_and_looks_again(monkeypatch):
    """Its floor has a way once the rod stands."""
    world, lies = _World(_Room(0.7)), [True]

    class Floor(FreeFloor):
        def __init__(self):
            pass

        def way(self, start, goal):
            return None if lies[0] else np.array([[0.0, 0.0], [2.0, 0.0]])

        def nearest(self, xy, within):
            return np.zeros(2, int)

    floor = Floor()
    world.floor = lambda **kwargs: floor  # pyright: ignore[reportAttributeAccessIssue]
    world.body.tucked, world.body.sideways, world.crosses = None, True, False
    monkeypatch.setattr(type(world), "base", property(lambda self: (np.zeros(2), 0.0)), raising=False)
    monkeypatch.setattr(driving, "strayed", lambda world, hand: False)
    monkeypatch.setattr(driving, "clear_with_held", lambda world, stances: True)
    programs = []
    running = driving.go(world, Stance((2.0, 0.0), 0.0))
    with pytest.raises(StopIteration) as ended:
        program = next(running)
        while True:
            programs.append(program)
            lies[0] = lies[0] and not any(phase.quat is not None for phase in program)
            program = running.send("")
    assert ended.value.value == ""
    assert [p[0].hand for p in programs] == [0, -1]
