"""Poses of a gripper on an object: those count for which the arm has a posture, which is few of those that fit it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ig2mj.planning import grasping
from ig2mj.planning.grasps import BEFORE, GraspPose
from ig2mj.planning.world import PlannedWorld, Stance

FITTING = 200
"""Poses that fit around the object, more than are tried from a stance."""

STANCE = Stance((0.0, 0.0), 0.0)


def poses() -> list[GraspPose]:
    """Poses along x at heights 1 cm apart."""
    across, ahead = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    return [GraspPose(np.array([0.7, 0.0, 0.01 * k]), across, ahead, BEFORE[0]) for k in range(FITTING)]


class _World(PlannedWorld):
    """Nothing is in the way of a hand on an arm that reaches heights from `lowest` (m) on."""

    def __init__(self, lowest: float):
        self.body = SimpleNamespace(  # pyright: ignore[reportAttributeAccessIssue]
            opening=0.1, turned=lambda *_: (1.0, 0.0, 0.0, 0.0)
        )
        self._lowest = lowest

    def obstacles(self, without=(), at=None, stays=True):
        return None  # pyright: ignore[reportReturnType]

    def floor(self, *args, **kwargs):
        return None  # pyright: ignore[reportReturnType]

    def com(self, name):
        return np.array([0.7, 0.0, 1.0])

    def reaches(self, hand, stance, point):
        return True

    def resting(self, hand, stance):
        return np.zeros(3)

    def standing(self, obstacles, stance, hand, body=True):
        return obstacles

    def follows(self, hand, quat, obstacles, stance=None):
        return SimpleNamespace(reaches=lambda point: point[2] >= self._lowest)  # pyright: ignore


@pytest.fixture
def plan(monkeypatch):
    """Plans a grasp of a hand that has a way wherever the arm reaches; counts ways that are looked for."""

    def plan(lowest: float):
        ways = []

        def hand_path(obstacles, spheres, start, goal, *args, **kwargs):
            ways.append(goal)
            return [goal] if goal[2] >= lowest else None

        monkeypatch.setattr(grasping, "grasp_poses", lambda *_: poses())
        monkeypatch.setattr(grasping, "_nearest", lambda world, floor, points: points[0])
        monkeypatch.setattr(grasping, "stances", lambda *_: iter([STANCE]))
        monkeypatch.setattr(grasping, "ordered", lambda found, yaw, on_arm: found)
        monkeypatch.setattr(grasping, "spheres_of", lambda *_: None)
        monkeypatch.setattr(grasping, "hand_path", hand_path)
        monkeypatch.setattr(grasping, "goes_on", lambda way, *args, **kwargs: way is not None)
        return grasping._plan(_World(lowest), "book", 0, []), ways

    return plan


@pytest.mark.parametrize("height", [0, 1, FITTING - 1])
def test_a_pose_is_found_behind_all_those_for_which_the_arm_has_no_posture(plan, height):
    found, _ = plan(0.01 * height)
    assert found is not None and found[1].point[2] == pytest.approx(0.01 * height)


def test_of_poses_behind_the_first_ones_no_way_is_looked_for_where_the_arm_has_no_posture(plan):
    found, ways = plan(0.01 * FITTING)
    assert found is None and max(way[2] for way in ways) < 0.01 * grasping.ARM_POSES
