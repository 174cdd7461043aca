"""A base on wheels: what it is asked for while it carries something, and when it is stuck."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.engine.view import PhysicsView
from ig2mj.planning import driving, execution
from ig2mj.planning.arm_kinds import FetchArmKind
from ig2mj.planning.bodies import MOST, WheeledBody
from ig2mj.planning.free_floor import FreeFloor
from ig2mj.planning.phases import Base, Phase, Until
from ig2mj.planning.senses import Senses
from ig2mj.planning.world import PlannedWorld, Stance


@pytest.fixture
def body():
    found = WheeledBody.__new__(WheeledBody)
    found._names, found.size, found._rest = ("forward", "turn_left"), 2, np.zeros(2, np.float32)
    found.hands, found.grips, found.friction = np.zeros(0, int), np.zeros((0, 3)), None
    return found


def senses(x: float = 0.0, held: bool = False) -> Senses:
    quat, none = np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros((1, 1, 3))
    return Senses(np.array([[x, 0.0, 0.0]]), quat, none, quat[None], np.array([[[held]]]), np.zeros((1, 1), bool))


def reason_after(body, monkeypatch, speed: float, steps: int) -> str:
    """Why a drive of 5 m has failed after some agent steps, of a base that moves by `speed` (m) in each."""
    carry = execution.begin([[Phase(Base.DRIVE, xy=(5.0, 0.0))]])
    for step in range(steps):
        monkeypatch.setattr(execution, "sense", lambda *_, x=step * speed: senses(x))
        _, carry = execution.advance(body, 0, carry, PhysicsView.__new__(PhysicsView))
    return "" if carry.running[0] else carry.reason(0)


def test_a_base_that_something_has_stopped_does_not_wait_for_the_limit(body, monkeypatch):
    assert reason_after(body, monkeypatch, 0.0, execution.STUCK) == ""
    assert reason_after(body, monkeypatch, 0.0, execution.STUCK + 2) == "timeout"
    assert reason_after(body, monkeypatch, 0.01, execution.STUCK + 2) == ""


def test_where_a_base_stays_is_where_it_last_drove_to(body, monkeypatch):
    """Until somebody else moves it far."""
    carry = execution.begin([[Phase(Base.DRIVE, xy=(0.5, 0.0)), Phase(until=Until.WAITED, limit=50)]])
    found = []
    for x in (0.0, 0.3, 0.49, 0.5, 0.53, 0.56, 1.5):
        monkeypatch.setattr(execution, "sense", lambda *_, x=x: senses(x))
        _, carry = execution.advance(body, 0, carry, PhysicsView.__new__(PhysicsView))
        found.append(carry.stays[0, 0])
    assert found == pytest.approx([0.0, 0.3, 0.49, 0.49, 0.49, 0.49, 1.5])


def test_what_a_hand_holds_is_turned_and_driven_slowly(body):
    body.carrying = FetchArmKind.carrying
    ahead = execution.begin([[Phase(Base.DRIVE, xy=(5.0, 0.0))]]).rows
    behind = execution.begin([[Phase(Base.DRIVE, xy=(-5.0, 0.1))]]).rows
    for held, forward, turn in ((False, MOST, MOST), (True, *(FetchArmKind.carrying or ()))):
        assert body.command(senses(held=held), ahead)[0] == pytest.approx([forward, 0.0])
        assert body.command(senses(held=held), behind)[0] == pytest.approx([0.0, turn])


class _Open(FreeFloor):
    """Floor without obstacles: ways are straight."""

    def __init__(self):
        pass

    def way(self, start, goal):
        return np.array([start, goal], float)

    def nearest(self, xy, within):
        return np.zeros(2, int)


class _Carries(PlannedWorld):
    """A robot that looks along x, with no room for a whole turn with what it holds."""

    def __init__(self):
        pass

    @property
    def base(self):
        return np.zeros(2), 0.0

    def floor(self, **_):
        return _Open()


def swung(monkeypatch, blocked, goal: Stance) -> list[Phase]:
    monkeypatch.setattr(driving, "clear_with_held", lambda _, stances, share=1.0: not any(blocked(s) for s in stances))
    return driving._swung(_Carries(), _Open(), goal)


def test_a_base_turns_by_the_longer_side_where_what_it_holds_has_no_room_on_the_shorter_one(monkeypatch):
    goal = Stance((0.0, 2.0), np.pi / 2)
    wall = lambda s: s.xy == (0.0, 0.0) and 0.5 < s.yaw % (2 * np.pi) < 1.0  # noqa: E731
    program = swung(monkeypatch, wall, goal)
    turns = [p.yaw for p in program if p.base == Base.TURN]
    assert turns[:3] == pytest.approx([-np.pi / 2, -np.pi, -3 * np.pi / 2]), "each part is less than half a turn"
    assert [p.xy for p in program if p.base == Base.DRIVE] == [(0.0, 2.0)]


def test_a_base_backs_off_until_what_it_holds_has_room_to_turn(monkeypatch):
    near = lambda s: s.xy[0] > -0.25 and 0.5 < s.yaw % (2 * np.pi) < 5.5  # noqa: E731
    program = swung(monkeypatch, near, Stance((-2.0, 2.0), np.pi))
    assert program[0].base == Base.SHIFT and program[0].xy == pytest.approx((-0.3, 0.0)) and program[0].yaw == 0.0
    assert [p.base for p in program[1:]] == [Base.TURN, Base.DRIVE, Base.TURN]


def test_a_base_comes_from_behind_where_what_it_holds_has_no_room_to_turn_at_the_end(monkeypatch):
    goal = Stance((2.0, 2.0), np.pi / 2)
    corner = lambda s: s.xy[1] > 1.75 and s.yaw < 1.5  # noqa: E731
    program = swung(monkeypatch, corner, goal)
    assert program[-1].base == Base.SHIFT and program[-1].xy == pytest.approx(goal.xy)
    assert [p.xy for p in program if p.base == Base.DRIVE] == [pytest.approx((2.0, 1.7))]
    assert not swung(monkeypatch, lambda s: abs(s.yaw) > 0.2, goal)
    nowhere = swung(monkeypatch, lambda s: s.xy[1] > 1.0 and s.yaw > 1.2, goal)
    assert [p.base for p in nowhere] == [Base.TURN, Base.DRIVE, Base.TURN], "it turns there in any case"


def test_a_way_begins_where_a_base_has_to_turn_to():
    """Points of a way are middles of cells: the first one is next to where the robot is, to any side."""
    assert driving._heading(np.array([[0.0, 0.0], [-0.02, 0.03], [1.0, 0.0]]), 2.0) == 0.0
    assert driving._heading(np.array([[0.0, 0.0], [-0.02, 0.03]]), 2.0) == 2.0
