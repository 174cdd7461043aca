"""What `ig2mj demo` says of the home that it converts."""

from __future__ import annotations

import pytest

import ig2mj
from ig2mj.showcase.first_home import what_stands_where


@pytest.mark.slow
def test_every_loose_object_stands_somewhere():
    world = ig2mj.Simulation("small_home", states=None)
    world.step(count=60)
    found = {place.object: (place.relation, place.support, place.room) for place in what_stands_where(world)}
    assert found["fish_0"] == ("inside", "frying_pan_0", "kitchen_0")
    assert found["apple_0"] == ("inside", "bowl_0", "living_room_0")
    assert found["mug_0"] == ("on top", "breakfast_table_0", "living_room_0")
    assert "loose" not in {relation for relation, *_ in found.values()}
