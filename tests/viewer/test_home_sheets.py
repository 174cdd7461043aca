"""Contact sheets have no more empty places than their rows need."""

from __future__ import annotations

import pytest
from PIL import Image

from ig2mj.viewer.home_sheet import TILE, _sheet


@pytest.mark.parametrize(("tiles", "across", "down"), [(1, 1, 1), (2, 2, 1), (4, 4, 1), (5, 3, 2), (9, 3, 3)])
def test_a_sheet_is_as_wide_as_its_tiles_need(tiles, across, down):
    sheet = _sheet([Image.new("RGB", TILE) for _ in range(tiles)], 4)
    assert sheet.size == (across * TILE[0], down * TILE[1])
