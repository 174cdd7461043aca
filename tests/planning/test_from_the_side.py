"""What is put under furniture comes in past the sides that look to the robot."""

import numpy as np
import pytest

from ig2mj.geometry.host_rotations import yaw_quat
from ig2mj.planning.letting_go import entries_to
from ig2mj.planning.spots import Spot, out_from
from ig2mj.planning.world import PlannedWorld


class World(PlannedWorld):
    """A table that is turned by `turn`, rad."""

    turn = 0.0

    def pose(self, name):
        return np.zeros(3), yaw_quat(self.turn)


@pytest.mark.parametrize("turn", [0.0, 0.5, 2.0])
def test_a_hand_comes_to_a_spot_under_a_table_off_its_sides(turn):
    """A table turned by `turn`, and a robot that stands before one of its corners and looks at its middle."""
    world = object.__new__(World)
    world.turn, quat = turn, yaw_quat(turn)
    outs = out_from(world, "table")
    yaw = turn + np.pi + 0.6
    entries = entries_to(Spot(np.zeros(3), quat, outs=outs), yaw)
    up, back = np.array([0.0, 0.0, 1.0]), -np.array([np.cos(yaw), np.sin(yaw), 0.0])
    sides = [np.array([np.cos(turn + a), np.sin(turn + a), 0.0]) for a in (0.0, np.pi / 2)]
    for expected in (up, back, *sides):
        assert any(np.allclose(expected, entry) for entry in entries)
    assert len(entries) == 4
    assert len(entries_to(Spot(np.zeros(3), quat), yaw)) == 2
