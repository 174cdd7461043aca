"""What hangs below a hand is carried over counters, and what is lost on the way to a tap is taken again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ig2mj.planning import grasping, taps
from ig2mj.planning.holding import STANCES, farther_ones
from ig2mj.planning.stances import SPREAD
from ig2mj.planning.steps import Outcome
from ig2mj.planning.world import HANGS, HIGHEST, RAISED, TALL, PlannedWorld, Stance

GRIP = np.array([0.5, 0.0, 0.9])


class Carrying(PlannedWorld):
    """A hand at `GRIP` that holds a column from `below` m under it to `above` m over it."""

    def __init__(self, below: float, above: float = 0.0, opening: float | None = None):
        body = SimpleNamespace(carry=np.array([[0.34, 0.16, 0.5]]), trunk=(0.2, 1.0), opening=opening, stands=0.5)
        self.body, self._corners = body, GRIP + np.array([[-0.05, -0.05, -below], [0.05, 0.05, above]])

    held = property(lambda self: ["vase"])  # pyright: ignore
    base = property(lambda self: (np.zeros(2), 0.0))  # pyright: ignore
    grip = lambda self, hand: GRIP  # noqa: E731  # pyright: ignore
    vertices = lambda self, name: self._corners  # noqa: E731  # pyright: ignore


def test_what_hangs_below_a_floating_hand_is_carried_higher():
    flat, hanging, low = (Carrying(b).carry(0)[2] for b in (0.9 * TALL, HANGS + TALL, 2.0))
    assert flat == pytest.approx(0.5)
    assert hanging == pytest.approx(0.7)
    assert low == pytest.approx(0.5 + RAISED)
    assert Carrying(0.4, opening=0.1).carry(0)[2] == pytest.approx(0.5)  # an arm has its own poses


def test_it_still_passes_below_the_heads_of_doors():
    above = HIGHEST - 1.0 - 0.1
    assert Carrying(0.4, above).carry(0)[2] == pytest.approx(0.6)
    assert Carrying(0.4, HIGHEST).carry(0)[2] == pytest.approx(0.5)


def world_with(**given: Any) -> PlannedWorld:
    """A world of which nothing else is asked; `facts` may be set."""
    members = {name: staticmethod(value) if callable(value) else value for name, value in given.items()}
    return object.__new__(type("World", (PlannedWorld,), {"facts": None, **members}))


def held_below_tap(monkeypatch, world: Any, **stand_ins: Any) -> Outcome:
    """How holding a cup below a tap ends. `stand_ins`: functions of `taps` in place of its own."""
    usual = {"wait_until": lambda *given: iter(()), "carry": lambda *given: None}
    usual["source_of"] = lambda world, tap: np.zeros(3)
    for name, stand_in in {**usual, **stand_ins}.items():
        monkeypatch.setattr(taps, name, stand_in)
    running = taps.hold_below_tap(world, "cup", "sink", lambda hand, source: [], ("soaked", "cup"), 1.0)
    with pytest.raises(StopIteration) as ended:
        while True:
            next(running)
    return ended.value.value


@pytest.mark.parametrize("losses", [1, 2])
def test_what_is_lost_on_the_way_to_a_tap_is_taken_again(monkeypatch, losses):
    world: Any = world_with(held=["cup", ""], index=lambda name: 0, base=(np.zeros(2), 0.0))
    wet = []
    world.facts = SimpleNamespace(holds=lambda *condition: bool(wet))
    taken = []

    def grasp(world, step):
        taken.append(step.object)
        world.held[len(taken) % 2] = "cup"  # by the other hand
        yield []
        return Outcome()

    def hold_at(world, name, hand, holds):
        assert world.held[hand] == name
        yield []
        if len(taken) < losses:
            world.held[:] = ["", ""]
            return "slipped", [], -1
        return "", [np.zeros(3)], 0

    def wait_until(world, condition, seconds, keeps):
        yield []
        wet.append(True)
        return ""

    monkeypatch.setattr(grasping, "grasp", grasp)
    assert held_below_tap(monkeypatch, world, hold_at=hold_at, wait_until=wait_until).done and len(taken) == losses


@pytest.mark.parametrize("cleared", [True, False])
def test_what_is_lost_while_a_basin_is_cleared_is_taken_again(monkeypatch, cleared):
    world: Any = world_with(held=["cup", ""], index=lambda name: 0, base=(np.zeros(2), 0.0))
    world.facts = SimpleNamespace(holds=lambda *condition: True)
    calls = []

    def grasp(world, step):
        calls.append("grasp")
        world.held[0] = "cup"
        yield []
        return Outcome()

    def hold_at(world, name, hand, holds):
        yield []
        return ("", [np.zeros(3)], 0) if calls else ("no_path", [], -1)

    def clear_basin(world, source, moved):
        yield []
        world.held[:] = ["", ""]
        return cleared

    def regrasp(world, name, hand):
        raise AssertionError("no hand holds it")
        yield

    monkeypatch.setattr(grasping, "grasp", grasp)
    outcome = held_below_tap(monkeypatch, world, hold_at=hold_at, clear_basin=clear_basin, regrasp=regrasp)
    assert outcome.done and calls == ["grasp"]


@pytest.mark.parametrize(("held", "out"), [(["cup", "plate"], ["plate"]), (["cup", ""], []), (["cup"], [])])
def test_what_the_other_hand_holds_is_brought_out_where_nothing_else_gives_room(monkeypatch, held, out):
    world: Any = world_with(held=held, index=lambda name: 0, base=(np.zeros(2), 0.0))
    world.facts = SimpleNamespace(holds=lambda *condition: not all(world.held))
    brought = []

    def bring_out(world, name):
        brought.append(name)
        world.held[world.held.index(name)] = ""
        yield []
        return Outcome()

    def hold_at(world, name, hand, holds):
        yield []
        return ("", [np.zeros(3)], 0) if "plate" not in world.held else ("no_path", [], -1)

    def clear_basin(world, source, moved):
        raise AssertionError("what the other hand holds comes first")
        yield

    outcome = held_below_tap(monkeypatch, world, hold_at=hold_at, clear_basin=clear_basin, bring_out=bring_out)
    assert brought == out and (outcome.done or held == ["cup"])


@pytest.mark.parametrize("opened", [True, False])
def test_what_is_put_down_for_a_free_hand_is_taken_again_whatever_came_of_it(monkeypatch, opened):
    world: Any = world_with(held=["rag"])

    def release(world, step):
        world.held[0] = ""
        yield []
        return Outcome()

    def grasp(world, step):
        world.held[0] = step.object
        yield []
        return Outcome()

    def action():
        assert world.held == [""]
        yield []
        return opened

    monkeypatch.setattr(grasping, "release", release)
    monkeypatch.setattr(grasping, "grasp", grasp)
    running = grasping.with_free_hand(world, action())
    with pytest.raises(StopIteration) as ended:
        while True:
            next(running)
    assert ended.value.value is opened and world.held == ["rag"]


def test_farther_stances_are_spread_out_and_leave_the_nearest_ones_out():
    nearest = [Stance((0.12 * k, 0.0), 0.0) for k in range(STANCES)]
    others = [Stance((0.12 * k, 0.0), 0.0) for k in range(STANCES, 24)]
    found = list(farther_ones([*nearest, *others]))
    assert found and not set(found) & set(nearest)
    apart = [abs(a.xy[0] - b.xy[0]) for a in found for b in (*nearest, *found) if a is not b]
    assert min(apart) >= SPREAD
    assert max(s.xy[0] for s in found) > max(s.xy[0] for s in others) - SPREAD, "to the other side"
