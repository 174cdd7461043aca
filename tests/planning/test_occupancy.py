"""Which floor of a home is free."""

import numpy as np
import pytest
import scipy.ndimage

import ig2mj
from ig2mj.planning.footprint import BaseFootprint, Disc
from ig2mj.planning.occupancy import Occupancy, door_objects
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.paths import shipped_homes


def largest_share(home: str) -> float:
    """Share of the free floor, doors left out, that is one part."""
    scene = ig2mj.load_scene(home)
    footprint = BaseFootprint((Disc(0.05, 0.55, 0.2), Disc(0.55, 1.3, 0.32)))
    free, _ = Occupancy(scene).free(SceneQuery(scene).view, footprint, door_objects(scene.tables).tolist())
    sizes = np.bincount(np.asarray(scipy.ndimage.label(free)[0]).ravel())[1:]
    return float(sizes.max() / sizes.sum())


def test_rooms_whose_floors_meet_in_a_doorway_are_one_floor():
    assert largest_share("hazel") > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("home", shipped_homes())
def test_all_rooms_of_a_home_can_be_driven_to(home):
    assert largest_share(home) > 0.9
