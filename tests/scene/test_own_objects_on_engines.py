"""Objects of one's own on every engine: they stand where they start, are grasped, heat and are recorded."""

import numpy as np
import pytest
from own_objects import HALF

import ig2mj

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("own_configuration")]


@pytest.fixture(scope="module")
def top_of_box(tiny_home):
    """m: height of the box of the tiny home."""
    data = tiny_home.start_data()
    body = tiny_home.tables.object_root[tiny_home.object_index("box")]
    entry = tiny_home.object("box")
    return float(data.xpos[body, 2] + entry.base_link_offset[2] + entry.bounding_box[2] / 2), data.xpos[body, :2]


@pytest.mark.parametrize("engine", ["native", "warp"])
def test_a_cup_stays_on_the_box_on_both_engines(tiny_home_folder, cup, top_of_box, engine):
    z, (x, y) = top_of_box
    place = f"{cup}@{x},{y},{z + HALF},0"
    worlds = ig2mj.Worlds(tiny_home_folder, 2, engine, objects=place, goal="(on_top cup_0 box)")
    batch = worlds.start(0)
    for _ in range(30):
        batch, status = worlds.step(batch)
    assert np.asarray(status.holds).all()
