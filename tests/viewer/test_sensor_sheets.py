"""Contact sheets of sensors: a labelled tile for each reading."""

import numpy as np
import pytest

from ig2mj.sensors.base import Space
from ig2mj.viewer.sensor_sheet import TILE, false_colours, sensor_sheet

CASES = {
    "rgb": (np.full((4, 6, 3), 200, np.uint8), 0, 255),
    "depth": (np.linspace(0, 5, 24, dtype=np.float32).reshape(4, 6, 1), 0, 10),
    "seg": (np.arange(24, dtype=np.int32).reshape(4, 6, 1), 0, 511),
    "scene_flow": (np.ones((4, 6, 3), np.float32), -np.inf, np.inf),
    "scan": (np.linspace(0, 1, 9, dtype=np.float32)[:, None], 0, 1),
    "lidar": (np.arange(30, dtype=np.float32).reshape(10, 3), -100, 100),
    "proprioception": (np.arange(-3, 4, dtype=np.float32), -np.inf, np.inf),
}


@pytest.mark.parametrize("name", CASES)
def test_a_tile_is_square_and_shows_something(name):
    reading, low, high = CASES[name]
    tile = np.asarray(false_colours(name, reading, Space(reading.shape, reading.dtype.type, float(low), float(high))))
    assert tile.shape == (TILE, TILE, 3)
    assert len(np.unique(tile.reshape(-1, 3), axis=0)) > 1


def test_the_sheet_has_a_tile_for_each():
    spaces = {n: Space(r.shape, r.dtype.type, float(low), float(high)) for n, (r, low, high) in CASES.items()}
    sheet = sensor_sheet({n: r[None] for n, (r, _, _) in CASES.items()}, spaces)
    assert sheet.size == (4 * (TILE + 4), 2 * (TILE + 18))
