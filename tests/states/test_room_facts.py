"""The room of an object: iGibson's rule, and a bug that is not copied."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item

from ig2mj.states.relations.rooms import in_room, room_at, rooms_of

HOME = HandWorld(
    Item("cup"),
    Item("fridge", fixed=True, rooms=("kitchen_0", "hall_0"), pos=(2, 0, 0)),
    Item("lamp", fixed=True, pos=(-2, 0, 0)),
    rooms={"kitchen_0": (-4.0, 0.0), "hall_0": (0.0, 3.0)},
)


@pytest.mark.parametrize(
    ("x", "room"), [(-2.0, 0), (1.0, 1), (3.5, -1), (-4.5, -1), (50.0, -1), (-50.0, -1), (np.nan, -1), (np.inf, -1)]
)
def test_the_pixel_under_a_point_names_the_room(x, room):
    assert int(room_at(HOME.tables, jnp.array([x, 0.3]))) == room


def test_pixels_are_truncated_towards_zero():
    home = HandWorld(Item("cup"), rooms={"hall_0": (-5.0, 5.0)})
    assert int(room_at(home.tables, jnp.array([-5.05, 0.0]))) == 0  # half a pixel outside is still pixel 0
    assert int(room_at(home.tables, jnp.array([5.05, 0.0]))) == -1


def test_fixed_objects_are_in_their_annotated_rooms_and_others_where_they_stand():
    view = HOME.view({"cup": (-1, 0, 0)})
    assert rooms_of(HOME.tables, view, 0) == ["kitchen_0"]
    assert rooms_of(HOME.tables, view, 1) == ["kitchen_0", "hall_0"]
    assert rooms_of(HOME.tables, view, 2) == ["kitchen_0"]


def test_a_movable_object_is_compared_by_room_instance():
    view = HOME.view({"cup": (-1, 0, 0)})
    rooms = jnp.array([[0, 0, 0], [1, 1, 1]])
    view = HOME.view({"cup": (-1, 0, 0)}, worlds=2)
    found = in_room(HOME.tables, view, np.arange(3), rooms)
    assert found.tolist() == [[True, True, True], [False, True, False]]


def test_without_rooms_nothing_is_in_a_room():
    home = HandWorld(Item("cup"))
    assert not in_room(home.tables, home.view(), np.array([0]), jnp.zeros((1, 1), jnp.int32)).any()
    assert rooms_of(home.tables, home.view(), 0) == []
    assert int(room_at(home.tables, jnp.zeros(2))) == -1
