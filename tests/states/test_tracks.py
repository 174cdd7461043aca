"""Robots carry mud on under feet and wheels, where things get dirty."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from hand_world import HandWorld
from substance_world import FLOOR

from ig2mj.states import initial_states
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import coat, drying, tracks

HOME = HandWorld(FLOOR, agent=True, substances=("water", "mud"))
MODEL, PLAIN = HOME.model(soiling=True), HOME.model()
MUD = 1
POINTS = np.asarray(coat.positions(MODEL, HOME.view()))[0, 0]


@jax.jit
def _pass(states, view):
    return drying.update(EventStep.start(MODEL, states, view, None)).states


def _at(pos, **options):
    return HOME.view(agent_pos=(float(pos[0]), float(pos[1]), 0.1), **options)


def _muddy(*points: int):
    states = initial_states(MODEL, 1)
    bits = np.zeros(np.shape(states.coat), np.uint32)
    bits[0, 0, MUD] = sum(1 << p for p in points)
    return states.replace(coat=bits)


def _bits(states) -> int:
    return int(np.asarray(states.coat)[0, 0, MUD])


FIRST, FAR = 0, int(np.argmax(np.linalg.norm(POINTS[:, :2] - POINTS[0, :2], axis=1)))


def test_a_robot_that_passes_mud_leaves_it_where_it_goes_then():
    states = _pass(_muddy(FIRST), _at(POINTS[FIRST]))
    assert np.asarray(states.tracked)[0, 0].tolist() == [0.0, tracks.PRINTS]
    before = _bits(states)
    assert not before >> FAR & 1
    after = _pass(states, _at(POINTS[FAR]))
    assert _bits(after) >> FAR & 1 and _bits(after) & before == before
    new = (_bits(after) & ~before).bit_count()
    assert np.asarray(after.tracked)[0, 0, MUD] == pytest.approx(tracks.PRINTS - new)
    assert (np.asarray(after.coat)[0, 0, 0] == 0).all(), "no water"


def test_prints_end():
    states = _muddy(FIRST).replace(tracked=np.array([[[0.0, 1.0]]], np.float32))
    after = _pass(states, _at(POINTS[FAR]))
    assert _bits(after) >> FAR & 1 and np.asarray(after.tracked)[0, 0, MUD] == 0.0
    again = _pass(after.replace(coat=np.zeros_like(after.coat)), _at(POINTS[FAR]))
    assert _bits(again) == 0


def test_what_is_high_over_a_floor_passes_only_what_it_touches():
    high = (float(POINTS[FIRST, 0]), float(POINTS[FIRST, 1]), 0.9)
    states = _pass(_muddy(FIRST), HOME.view(agent_pos=high))
    assert not np.asarray(states.tracked).any()
    states = _pass(_muddy(FIRST), HOME.view(agent_pos=high, agent_touches=("floor",)))
    assert np.asarray(states.tracked)[0, 0, MUD] == tracks.PRINTS


@pytest.mark.parametrize("carries, at, rests", [(0.0, FAR, True), (0.0, FIRST, False), (3.0, FAR, False)])
def test_it_is_idle_where_a_step_changes_nothing(carries, at, rests):
    states = _muddy(FIRST).replace(tracked=np.array([[[0.0, carries]]], np.float32))
    step = EventStep.start(MODEL, states, _at(POINTS[at]), None)
    after = _pass(states, _at(POINTS[at]))
    same = all((np.asarray(getattr(after, n)) == np.asarray(getattr(states, n))).all() for n in ("coat", "tracked"))
    assert bool(tracks.idle(step)) == same == rests


def test_the_option_is_off_by_default_and_then_has_no_array():
    assert np.shape(initial_states(PLAIN, 1).tracked) == (1, 0, 0)
    assert np.shape(initial_states(MODEL, 1).tracked) == (1, 1, 2)
