"""What is handed over hangs with the side down that cleans, held at a side, where there is room."""

from types import SimpleNamespace

import numpy as np
import pytest

from ig2mj.planning.handing_over import IN_FRONT, ROOM, cleaning_down, roomy
from ig2mj.planning.occupancy import RESOLUTION

DOWN, LEFT = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize("out", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -0.6, 0.8], [0.0, 0.0, -1.0]])
def test_a_tool_is_turned_with_its_side_that_cleans_down_and_its_held_edge_aside(out):
    out = np.array(out)
    edge = 0.2 * np.cross(out, [0.36, 0.48, 0.8]) / np.linalg.norm(np.cross(out, [0.36, 0.48, 0.8]))
    turned = cleaning_down(out, edge, LEFT)
    np.testing.assert_allclose(turned @ out, DOWN, atol=1e-6)
    np.testing.assert_allclose(turned @ edge, 0.2 * LEFT, atol=1e-6)


def _floor(spare, free):
    """A corridor along x with its first cell's middle at the origin."""
    far = RESOLUTION * np.arange(len(spare), dtype=float)
    cells = lambda xy: np.round(np.asarray(xy)[..., ::-1] / RESOLUTION).astype(int)  # noqa: E731
    middles = lambda cells: cells[:, ::-1] * RESOLUTION  # noqa: E731
    occupancy = SimpleNamespace(cells=cells, middles=middles)
    return SimpleNamespace(
        spare=spare[None], free=free[None], distances=lambda *_: far[None], occupancy=occupancy
    )  # fmt: skip


def test_the_nearest_place_with_room_is_one_with_floor_ahead():
    spare = np.full(80, 0.1)
    spare[30:40] = ROOM
    free = np.ones(80, bool)
    for blocked in (False, True):
        free[np.arange(30, 40) + round(IN_FRONT[0] / RESOLUTION)] = not blocked
        world = SimpleNamespace(floor=lambda: _floor(spare, free), base=(np.zeros(2), 0.0))
        place = roomy(world)  # pyright: ignore
        assert place is not None and place.xy == pytest.approx((30 * RESOLUTION, 0.0))
        assert np.cos(place.yaw) == pytest.approx(0.0 if blocked else 1.0, abs=1e-9), "it turns where it is blocked"


def test_without_such_a_place_there_is_none():
    floor = _floor(np.full(80, 0.5 * ROOM), np.ones(80, bool))
    assert roomy(SimpleNamespace(floor=lambda: floor, base=(np.zeros(2), 0.0))) is None  # pyright: ignore
