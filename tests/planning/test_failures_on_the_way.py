"""What a primitive does beforehand, such as to open doors, may fail: that is its outcome, never an error."""

import pytest

from ig2mj.planning import doors
from ig2mj.planning.moves import PrimitiveFailed
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import PlannedWorld


def test_a_thing_that_is_lost_while_a_leaf_is_swung_aside_ends_the_primitive(monkeypatch):
    def no_floor(world, step):
        return Outcome("no_base", "no floor is near")
        yield

    def lost(world, step):
        raise PrimitiveFailed("no_grasp", "no hand holds towel_0")
        yield

    monkeypatch.setattr(doors, "door_in_the_way", lambda world, step: None)
    monkeypatch.setattr(doors, "_leaf_swung_aside", lost)
    world = PlannedWorld.__new__(PlannedWorld)  # nothing of it is asked
    running = doors.through_doors(world, Step("wipe", ("shelf_0", "towel_0")), no_floor)
    with pytest.raises(StopIteration) as ended:
        next(running)
    assert ended.value.value == Outcome("no_grasp", "no hand holds towel_0")
