"""A walk through a home: through every room, on the floor, and with words."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.scene.scene import load_scene
from ig2mj.viewer.captions import caption
from ig2mj.viewer.room_views import EYE_HEIGHT, room_view, standing_places
from ig2mj.viewer.sight_lines import SightLines
from ig2mj.viewer.tour import _eye, open_doors, path, tour


@pytest.fixture(scope="module")
def home():
    return load_scene("small_home")


def test_the_walk_sees_every_room_from_eye_height(home):
    shots = list(tour(home, home.start_data(), rate=5))
    words = {shot.words for shot in shots}
    assert words >= {"kitchen", "living room"}
    for shot in shots:
        if shot.words != home.name:
            tilt = np.radians(shot.view.elevation)
            assert shot.view.lookat[2] - shot.view.distance * np.sin(tilt) == pytest.approx(EYE_HEIGHT)
            assert home.rooms.room_at(_eye(shot.view)) is not None


def test_walls_do_not_fill_images(home):
    data = home.start_data()
    open_doors(home, data)
    lines, field, full = SightLines(home.model), np.radians(np.linspace(-45, 45, 13)), []
    for shot in list(tour(home, data, rate=2)):
        if shot.words != home.name:
            turn = np.radians(shot.view.azimuth) + field
            rays = np.stack([np.cos(turn), np.sin(turn), np.full(13, -0.25)], axis=1)
            rays /= np.linalg.norm(rays, axis=1, keepdims=True)
            full.append(np.median(lines.cast(data, np.array([*_eye(shot.view), EYE_HEIGHT]), rays)[1]) < 1.0)
    assert len(full) > 10 and np.mean(full) < 0.03


def test_ways_stay_on_the_free_floor(home):
    start, end = (_eye(room_view(home, name)) for name in home.rooms.names)
    way = path(home, start, end)
    assert way is not None
    np.testing.assert_allclose(way[[0, -1]], [start, end])
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() < 0.5


def test_doors_are_open(home):
    data = home.start_data()
    before = data.qpos.copy()
    open_doors(home, data)
    assert np.abs(data.qpos - before).max() > 0.5


def test_people_stand_clear_of_furniture(home):
    sofa = home.object("sofa_0")
    for x, y in standing_places(home, sofa.rooms[0]):
        assert home.rooms.room_at((x, y)) == sofa.rooms[0]


def test_an_unknown_room_and_a_home_without_rooms_are_refused(home, tiny_home):
    with pytest.raises(UnknownNameError, match="room"):
        room_view(home, "attic_0")
    import dataclasses

    with pytest.raises(Ig2mjError, match="no map of rooms"):
        list(tour(dataclasses.replace(tiny_home, rooms=None), tiny_home.start_data()))


def test_captions_are_written_in_the_lower_left_corner():
    image = np.zeros((120, 200, 3), np.uint8)
    written = caption(image, "kitchen")
    assert written.shape == image.shape and written[90:, :80].max() > 150
    assert (written[:80] == 0).all() and caption(image, "") is image
