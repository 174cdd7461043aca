"""Commands that play a few episodes do not sample all start states of a split first."""

from __future__ import annotations

import types

import pytest

from ig2mj.cli import vr
from ig2mj.cli.common.tasks import ROWS, few_rows


@pytest.fixture
def states(monkeypatch):
    """Start states of every task: `rows_at_hand` of them were sampled before."""
    found = types.SimpleNamespace(rows_at_hand=0)
    monkeypatch.setattr("ig2mj.tasks.pools.start_states", lambda task, split: found)
    return found


def test_as_many_are_sampled_as_there_are_episodes_where_none_ship(states):
    assert few_rows("CookingMeat", "train", 8) == 0, "these ship"
    assert few_rows("CookingMeat", "train", 8, ["apple"]) == few_rows("CookingMeat", "train", 8, variant=1) == 8
    states.rows_at_hand = 40
    assert few_rows("CookingMeat", "train", 8, ["apple"]) == 40
    states.rows_at_hand = 512
    assert few_rows("CookingMeat", "train", 8, ["apple"]) == 0
    assert few_rows("PointNavigation", "train", 8, ["apple"]) == 0, "navigation draws its own"


def test_a_person_does_not_wait_for_all_start_states_of_a_home_with_other_objects(states, monkeypatch):
    def made(task, grasping, *, pool_size, objects):
        raise InterruptedError(pool_size)

    monkeypatch.setattr("ig2mj.vr.session.person_environment", made)
    for row, count in ((0, ROWS), (20, 21)):
        with pytest.raises(InterruptedError, match=str(count)):
            vr._environment("CookingMeat", "assisted", 0, row, ("apple",))
