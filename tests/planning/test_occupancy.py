"""Which floor of a home is free."""

import numpy as np
import pytest
import scipy.ndimage

import ig2mj
from ig2mj.planning.footprint import BaseFootprint, Disc
from ig2mj.planning.occupancy import Occupancy, door_objects
from ig2mj.planning.starts import open_doors
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.paths import shipped_homes


def largest_share(home: str) -> float:
    """Share of the free floor, doors left out, that is one part where doors between rooms stand wide open."""
    scene = ig2mj.load_scene(home)
    footprint = BaseFootprint((Disc(0.05, 0.55, 0.2), Disc(0.55, 0.8, 0.32), Disc(0.8, 1.05, 0.2)))
    query, occupancy = SceneQuery(scene), Occupancy(scene)
    everywhere, _ = occupancy.free(query.view, footprint, door_objects(scene.tables).tolist())
    write = open_doors(scene)
    assert write is not None
    query.write(write)
    free, _ = occupancy.free(query.view, footprint)
    return float(np.bincount(np.asarray(scipy.ndimage.label(free)[0]).ravel())[1:].max() / everywhere.sum())


def test_rooms_whose_floors_meet_in_a_doorway_are_one_floor():
    assert largest_share("hazel") > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("home", shipped_homes())
def test_open_doors_cut_no_room_off(home):
    assert largest_share(home) > 0.9
