"""A base on wheels: what it is asked for while it carries something, and when it is stuck."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.engine.view import PhysicsView
from ig2mj.planning import execution
from ig2mj.planning.arm_kinds import FetchArmKind
from ig2mj.planning.bodies import MOST, WheeledBody
from ig2mj.planning.phases import Base, Phase
from ig2mj.planning.senses import Senses


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


def test_what_a_hand_holds_is_turned_and_driven_slowly(body):
    body.carrying = FetchArmKind.carrying
    ahead = execution.begin([[Phase(Base.DRIVE, xy=(5.0, 0.0))]]).rows
    behind = execution.begin([[Phase(Base.DRIVE, xy=(-5.0, 0.1))]]).rows
    for held, forward, turn in ((False, MOST, MOST), (True, *(FetchArmKind.carrying or ()))):
        assert body.command(senses(held=held), ahead)[0] == pytest.approx([forward, 0.0])
        assert body.command(senses(held=held), behind)[0] == pytest.approx([0.0, turn])
