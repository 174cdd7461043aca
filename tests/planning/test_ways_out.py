"""Where a way begins, and from which height an object is dropped, where there is little room."""

from typing import cast

import numpy as np
import pytest

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.free_floor import POCKET, FreeFloor
from ig2mj.planning.grasping import _off_furniture, off_others_things
from ig2mj.planning.letting_go import drawn_back
from ig2mj.planning.moves import RETREAT, SLACK, as_close
from ig2mj.planning.occupancy import RESOLUTION, Occupancy
from ig2mj.planning.phases import Until
from ig2mj.planning.placing import DEEP_DROPS, _drop
from ig2mj.planning.spots import ends_down
from ig2mj.planning.world import PlannedWorld


class _Cells(Occupancy):
    """Cells of a floor that begins at the origin."""

    def __init__(self, still):
        self._still, self.origin, self.shape = still, np.zeros(2), still.shape

    def cells(self, xy):
        return np.floor(np.asarray(xy, float)[..., ::-1] / RESOLUTION).astype(int)

    def middles(self, cells):
        return (np.asarray(cells)[..., ::-1] + 0.5) * RESOLUTION

    def still(self, low, high):
        return self._still


def floor_with_pocket(still=False):
    """4 m by 4 m of free floor, but for a frame 3 cells thick around 25 cells; `still`: the frame cannot move."""
    free = np.ones((80, 80), bool)
    free[37:48, 37:48] = False
    free[40:45, 40:45] = True
    frame = ~free
    return FreeFloor(_Cells(frame if still else np.zeros_like(free)), free, np.where(free, 0.1, -0.1))


@pytest.mark.parametrize("still", [False, True])
def test_a_way_begins_outside_of_a_pocket_unless_furniture_shuts_it_off(still):
    floor, robot = floor_with_pocket(still), (42.5 * RESOLUTION, 42.5 * RESOLUTION)
    assert floor.free[40:45, 40:45].sum() < POCKET
    begin = floor.begin(robot, 0.5)
    assert (begin >= 40).all() and (begin < 45).all() if still else floor._sizes[floor._labels[tuple(begin)]] > POCKET
    assert np.isfinite(floor.distances(robot, 0.5)).sum() == (25 if still else floor.free.sum() - 25)


def test_floor_that_a_leaf_shuts_off_is_joined_to_itself_alone():
    """A way to it begins outside; a leaf that leaves it shut off is not the one that is in the way."""
    floor = floor_with_pocket()
    assert floor.joined((42.5 * RESOLUTION, 42.5 * RESOLUTION)).sum() == 25
    assert floor.joined((10.5 * RESOLUTION, 10.5 * RESOLUTION)).sum() == floor.free.sum() - 25


def test_a_robot_that_leans_on_furniture_begins_its_way_next_to_it():
    free = np.ones((80, 80), bool)
    free[30:50, 30:50] = False
    floor = FreeFloor(_Cells(~free), free, np.where(free, 0.1, -0.1))
    assert floor.begin((33.5 * RESOLUTION, 40.5 * RESOLUTION), 0.1) is not None


class _Bucket(Obstacles):
    """A bucket with its bottom at 0 whose rim, 0.25 m high, leaves room for spheres up to 0.1 m from its axis."""

    def __init__(self):
        pass

    def clear(self, spheres):
        across = np.hypot(spheres[:, 0], spheres[:, 1]) + spheres[:, 3]
        return not ((spheres[:, 2] < 0.25) & (across > 0.1)).any()

    def distance(self, points):
        across = np.hypot(points[:, 0], points[:, 1])
        return np.where(points[:, 2] < 0.25, 0.1 - across, np.inf)

    def clear_along(self, spheres, start, ahead, along):
        return all(self.clear(spheres + np.array([*(start + t * ahead), 0.0])) for t in along)


def test_an_object_falls_from_the_lowest_height_at_which_the_hand_has_room():
    hand, held = [0.12, 0.0, 0.06, 0.03], [0.0, 0.0, 0.0, 0.012]
    goal = np.array([0.0, 0.0, 0.05])
    assert _drop(_Bucket(), np.array([held]), goal, DEEP_DROPS) == 0.0
    assert _drop(_Bucket(), np.array([hand, held]), goal, DEEP_DROPS) == 0.16
    assert _drop(_Bucket(), np.array([hand, held]), goal, (0.0, 0.05)) is None


def test_a_hand_that_has_let_go_is_drawn_back_as_far_as_it_has_room_behind_it():
    hand, palm, up = np.array([[0.0, 0.0, 0.0, 0.03]]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    over, deep = np.array([0.0, 0.0, 0.3]), np.array([0.0, 0.0, 0.05])

    def back(target, palm):
        return list(np.round(drawn_back(_Bucket(), hand, target, palm) - target, 6))

    assert back(over, palm) == [-RETREAT, 0, 0]  # above the bucket
    assert back(deep, -up) == [0, 0, RETREAT]  # in it, with room above
    assert back(deep, palm) == [-RETREAT / 2, 0, 0]  # 7 cm from its side
    assert back(deep - 0.065 * palm, palm) == [0, 0, 0]  # at its side


class _Held(PlannedWorld):
    """A world in which a hand holds a box with sides along x, y and z (m), which lies askew, near its first end."""

    def __init__(self, *sides: float):
        turn = about_vertical(0.4)
        self._corners = (np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T * sides) @ turn.T + (0.3, 0.2, 0.8)
        self._grip = np.array([0.3, 0.2, 0.8]) - 0.35 * sides[0] * turn[:, 0]

    def vertices(self, name):
        return self._corners

    def com(self, name):
        return self._corners.mean(0)

    def grip(self, hand):
        return self._grip


def test_what_is_long_is_put_with_an_end_first_that_away_from_the_hand_before_the_other():
    world = _Held(0.2, 0.06, 0.04)
    first, second = ends_down(world, "", 0)
    for tilt, below in ((first, True), (second, False)):
        turned = (world.vertices("") - world.grip(0)) @ tilt.T
        assert np.ptp(turned[:, 2]) == pytest.approx(0.2) and np.hypot(*np.ptp(turned[:, :2], axis=0)) < 0.11
        assert (turned[:, 2].mean() < 0.0) == below


def test_what_is_not_longer_than_wide_has_no_end():
    assert ends_down(_Held(0.1, 0.1, 0.1), "", 0) == []


class _Caught:
    """A world in which the second hand has closed on furniture, until it is opened."""

    def __init__(self):
        self.held, self.domain = ["spoon_0", "cabinet_0"], self

    def fixed(self, name):
        return name == "cabinet_0"


def test_a_hand_that_has_closed_on_furniture_lets_go_of_it_and_others_hold_on():
    (program,) = _off_furniture(cast(PlannedWorld, _Caught()))
    assert {phase.hand for phase in program} == {1}
    assert program[0].close is False and program[0].until == Until.EMPTY and program[-1].reset


class _Twice:
    """A world in which hands hold things that one of them lifts, but for a chest."""

    def __init__(self, *held):
        self.held, self.domain = list(held), self

    def hands_for(self, name):
        return 1 + (name == "chest_0")


def test_a_hand_that_has_closed_on_what_the_other_holds_lets_go_of_it():
    holds = _Twice("plant_0", "plant_0")
    letting_go = off_others_things(cast(PlannedWorld, holds))
    program = next(letting_go)
    assert {phase.hand for phase in program} == {1}
    assert program[0].close is False and program[0].until == Until.EMPTY and program[-1].reset
    holds.held[1] = ""
    assert list(letting_go) == []


@pytest.mark.parametrize("held", [("chest_0", "chest_0"), ("plant_0", "spoon_0"), ("", ""), ("plant_0", ""), ()])
def test_hands_keep_what_they_mean_to_hold(held):
    assert list(off_others_things(cast(PlannedWorld, _Twice(*held)))) == []


class _Wall(Obstacles):
    """Everything beyond x = 0."""

    def __init__(self):
        pass

    def distance(self, points):
        return -points[..., 0]


def test_what_is_close_to_a_wall_comes_no_closer_and_what_is_in_it_does_not_count():
    spheres = np.array([[0.0, 0.0, 0.0, 0.05], [-0.03, 0.0, 0.0, 0.05], [0.04, 0.0, 0.0, 0.05], [-0.2, 0.0, 0.0, 0.05]])
    found = as_close(_Wall(), spheres, np.array([-0.02, 0.0, 0.0]))
    assert found[:, :3].tolist() == spheres[[0, 1, 3], :3].tolist()
    assert np.allclose(found[:, 3], [0.02 - SLACK, 0.05 - SLACK, 0.05])
