"""Ways of a hand around an obstacle, and the sides from which it takes things."""

import numpy as np

from ig2mj.planning import grasps
from ig2mj.planning.bodies import hand_spheres
from ig2mj.planning.clearance import HELD, Obstacles
from ig2mj.planning.grasps import UP, GraspPose, ordered, sides
from ig2mj.planning.hand_search import search_way


class Wall(Obstacles):
    """A wall at x = 0, as high and wide as `size`, m."""

    def __init__(self, size: float):
        self.size = size

    def clear(self, spheres):
        x, y, z, radius = spheres.T
        meets = (np.abs(x) < 0.02 + radius) & (np.abs(y) < self.size + radius) & (np.abs(z) < self.size + radius)
        return not meets.any()

    def clear_along(self, spheres, start, ahead, along):
        return all(self.clear(spheres + np.array([*(start + t * ahead), 0.0])) for t in along)


START, GOAL, BALL = np.array([-0.3, 0.0, 0.0]), np.array([0.3, 0.0, 0.0]), np.array([[0.0, 0.0, 0.0, 0.05]])


def test_a_way_around_a_wall_is_found_and_is_the_same_each_time():
    way = search_way(Wall(0.3), BALL, START, GOAL)
    assert way is not None and np.allclose(way[-1], GOAL)
    for a, b in zip([START, *way[:-1]], way, strict=True):
        for share in np.linspace(0, 1, 50):
            assert Wall(0.29).clear(np.array([[*(a + share * (b - a)), 0.05]]))
    assert np.array_equal(np.array(way), np.array(search_way(Wall(0.3), BALL, START, GOAL)))


def test_no_way_leads_through_a_wall_without_an_end_nor_to_where_the_hand_has_no_room():
    assert search_way(Wall(9.0), BALL, START, GOAL) is None
    assert search_way(Wall(0.3), BALL, START, np.zeros(3)) is None


def test_grasps_come_from_above_and_all_sides_with_fingers_along_the_face():
    for normal, ways in sides((1.0, 0.5)):
        assert np.isclose(np.linalg.norm(normal), 1) and normal[2] >= 0
        assert all(abs(way @ normal) < 1e-9 and np.isclose(np.linalg.norm(way), 1) for way in ways)


def test_a_hand_prefers_palm_down_and_fingers_ahead():
    poses = [GraspPose(np.zeros(3), way, -normal, 0.12) for normal, ways in sides() for way in ways]
    best = ordered(poses, 0.0)[0]
    assert np.allclose(best.palm, [0, 0, -1]) and np.allclose(best.fingers, [1, 0, 0])
    assert np.allclose(best.at(0.1), [0, 0, 0.1])


def test_spheres_of_a_hand_are_larger_than_points_of_what_it_holds():
    assert (hand_spheres((1.0, 0.0, 0.0), (0.0, 0.0, -1.0))[:, 3] > HELD).all()


def test_what_is_swept_is_as_comfortable_from_above_as_anything_else():
    from_above = GraspPose(np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0]), 0.12, deep=0.0)
    sloped = GraspPose(np.zeros(3), np.array([0.7, 0.0, 0.7]), np.array([0.7, 0.0, -0.7]), 0.12)
    assert ordered([sloped, from_above], 0.0)[0] is from_above


def test_a_gripper_on_an_arm_may_point_to_where_it_likes_to_point_best():
    palms = [-normal for normal, _ in grasps._ARM_SIDES]
    assert min(GraspPose(np.zeros(3), UP, palm, 0.12).discomfort(0.0, on_arm=True) for palm in palms) < 1e-3
    assert len(grasps._SIDES) == 17 and all(
        any(np.allclose(n, m) for m, _ in grasps._ARM_SIDES) for n, _ in grasps._SIDES
    )
