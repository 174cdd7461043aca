"""What is thrown about a home stays in it, and without its ceiling much of it does not."""

from __future__ import annotations

import throws

import ig2mj


def test_throws_begin_over_floor_of_a_room():
    scene = ig2mj.load_scene("small_home")
    places = throws.free_places(scene)
    assert scene.rooms is not None and len(places) > 50
    assert all(scene.rooms.room_at(place) is not None for place in places)


def test_a_bowl_stays_in_and_without_the_ceiling_flies_out():
    closed, opened = (throws.run(throws.Args(home="small_home", throws=25, open=o), "bowl") for o in (False, True))
    assert closed["ceiling"] and closed["lost"] == 0
    assert not opened["ceiling"] and opened["lost"] > 0
