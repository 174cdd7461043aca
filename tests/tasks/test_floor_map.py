"""Maps of free floor: ways around walls, looked up from anywhere."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from ig2mj.tasks.navigation.floor import FloorMap
from ig2mj.tasks.navigation.floor import look_up as plain_look_up


def look_up(fields, row, pos, origin, resolution):
    """As one program: operation by operation it would be sixty."""
    return jax.jit(lambda *arrays: plain_look_up(*arrays, origin, resolution))(fields, row, pos)


WALL = """
..........
.########.
.########.
.####.###.
.####.###.
.####.###.
.########.
..........
...#......
..........
"""


@pytest.fixture(scope="module")
def floor():
    """A room of 8 x 6 cells whose lower half a wall of three cells divides, and one cell apart from it."""
    free = np.array([[c == "#" for c in line] for line in WALL.split()])
    return FloorMap.of_cells(free, 0.1)


def test_only_the_largest_connected_part_counts(floor):
    assert floor.free.shape == (6, 8)
    assert floor.origin == pytest.approx([-0.4, -0.4])
    assert floor.centres(np.array([[0, 0]]))[0] == pytest.approx([-0.35, -0.35])


def test_a_way_leads_around_a_wall_and_not_through_its_corners(floor):
    goal, start = np.array([3, 3]), (3, 5)
    field = floor.distances(goal[None])[0]
    assert field[tuple(goal)] == 0
    assert field[4, 3] == pytest.approx(0.1)
    assert field[start] == pytest.approx(0.6, abs=0.05)  # up, over, down: straight it would be 0.2
    assert np.isinf(field[3, 4])


def test_distances_are_looked_up_between_cells_and_the_next_point_is_in_sight(floor):
    fields = floor.distances(np.array([[0, 0], [3, 3]]))
    pos = np.array([[0.12, -0.35], [0.17, -0.03]], np.float32)  # in the upper row; right of the wall
    way, ahead = look_up(fields, np.array([0, 1]), pos, floor.origin, floor.resolution)
    assert float(way[0]) == pytest.approx(0.47, abs=0.02)
    assert float(ahead[0, 0]) < -0.2 and float(ahead[0, 1]) == pytest.approx(-0.35, abs=0.01)
    assert float(way[1]) == pytest.approx(0.62, abs=0.08)
    assert abs(float(ahead[1, 1])) > 0.1  # around an end of the wall, not through it to the left


def test_the_next_point_can_be_driven_to_straight(floor):
    """Also at the ends of the wall, where the point nearest to the goal would lead into a corner."""
    goal = np.array([[3, 3]])
    pos = floor.centres(floor.cells).astype(np.float32)
    pos = pos[pos[:, 0] > 0.1]  # right of the wall
    row = np.zeros(len(pos), int)
    _, ahead = look_up(floor.distances(goal), row, pos, floor.origin, floor.resolution)
    for share in (0.35, 0.55, 0.75, 1.0):
        places = pos + share * (np.asarray(ahead) - pos)
        columns, rows = np.floor((places - floor.origin) / floor.resolution).astype(int).T
        assert floor.free[rows, columns].all(), share
    assert (np.linalg.norm(np.asarray(ahead) - pos, axis=1) > 0.05).all()


def test_off_the_map_there_is_no_way(floor):
    way, ahead = look_up(
        floor.distances(np.array([[0, 0]])), np.array([0]), np.array([[3.0, 3.0]], np.float32), floor.origin, 0.1
    )
    assert np.isinf(way[0]) and ahead[0].tolist() == [3.0, 3.0]


def test_of_parts_of_a_floor_the_one_with_most_points_in_reach_is_taken():
    free = np.zeros((60, 60), bool)
    free[5:55, 5:30], free[5:15, 40:55] = True, True  # the second part, at x > 1 m, is smaller
    points = np.array([[1.5, -2.0], [2.0, -2.2], [-1.0, 0.0]])
    assert FloorMap.of_cells(free, 0.1).free.sum() == 50 * 25
    assert FloorMap.of_cells(free, 0.1, points).free.sum() == 10 * 15
    assert FloorMap.of_cells(free, 0.1, points[:0]).free.sum() == 50 * 25
