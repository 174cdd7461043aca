"""Where a placement is asked for: candidates that are not right do not keep others from being asked."""

import numpy as np
import pytest

from ig2mj.planning.spots import EACH, FAR_SPOTS, SPREAD, _varied


def _right(positions, cost, holds, refused=()):
    """What is found among positions, and how many are asked."""
    found, asked = [], 0
    for k in _varied(positions, cost, found, list(refused)):
        asked += 1
        if holds(positions[k]):
            found.append(positions[k])
    return found, asked


@pytest.fixture
def door_and_rack():
    """Positions upon the open door of a dishwasher, which come first, and in its rack."""
    door = np.stack(np.meshgrid(np.linspace(0.0, 0.7, 36), np.linspace(-0.3, 0.3, 31), [0.17]), -1).reshape(-1, 3)
    rack = np.stack(np.meshgrid(np.linspace(0.8, 1.0, 11), np.linspace(-0.2, 0.2, 21), [0.49]), -1).reshape(-1, 3)
    return np.concatenate([door, rack])


def test_a_rack_is_asked_behind_a_door_that_is_full_of_candidates(door_and_rack):
    cost = door_and_rack[:, 0]
    nearest = np.argsort(cost, kind="stable")[:FAR_SPOTS]
    assert (door_and_rack[nearest, 2] < 0.2).all()
    found, asked = _right(door_and_rack, cost, lambda pos: pos[2] > 0.3)
    assert found and asked <= FAR_SPOTS


def test_what_is_found_lies_apart_and_in_order_of_cost(door_and_rack):
    cost = door_and_rack[:, 0]
    found, asked = _right(door_and_rack, cost, lambda pos: True)
    assert len(found) == EACH == asked
    assert all(np.linalg.norm(a - b) >= SPREAD for i, a in enumerate(found) for b in found[:i])
    assert [p[0] for p in found] == sorted(p[0] for p in found)


def test_a_small_place_between_others_is_found_in_the_end():
    positions = np.column_stack([np.linspace(0.0, 0.09, 10), np.zeros(10), np.zeros(10)])
    found, _ = _right(positions, positions[:, 0], lambda pos: abs(pos[0] - 0.07) < 0.005)
    assert len(found) == 1


def test_nothing_is_asked_where_no_hand_reaches():
    positions = np.zeros((5, 3))
    assert _right(positions, np.full(5, np.inf), lambda pos: True) == ([], 0)


def test_places_next_to_those_that_were_refused_are_asked_last(door_and_rack):
    cost = door_and_rack[:, 0]
    upon = [p for p in door_and_rack if p[2] < 0.3]
    found, asked = _right(door_and_rack, cost, lambda pos: pos[2] > 0.3, upon)
    assert len(found) == EACH == asked
