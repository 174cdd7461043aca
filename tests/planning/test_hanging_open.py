"""A box that is held so that its flap sinks open."""

import numpy as np
import pytest

from ig2mj.geometry.host_rotations import turn_about
from ig2mj.planning import hanging_open
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.hanging_open import sinks
from ig2mj.planning.joints import OpenableJoint
from ig2mj.planning.phases import Phase
from ig2mj.planning.world import PlannedWorld

PLATE = np.array([[x, y, 0.0] for x in (0.0, 0.2) for y in (-0.15, 0.15)])
UP_AND_BACK = np.array([0.0, -1.0, 0.0])
"""Axis of a hinge at the origin about which a plate that is ahead along x turns up, and back."""


def _flap(share: float) -> OpenableJoint:
    now = share * 2.2
    return OpenableJoint(
        name="flap",
        object="box",
        object_index=0,
        hinge=True,
        anchor=np.zeros(3),
        axis=UP_AND_BACK,
        now=now,
        closed=0.0,
        open=2.2,
        vertices=PLATE @ turn_about(UP_AND_BACK, now).T,
        grips=(),
    )


def test_a_flap_on_top_of_a_box_that_stands_does_not_sink_open():
    assert sinks(_flap(0.0), np.eye(3)) == pytest.approx(-1.0)


def test_a_flap_that_is_past_upright_falls_open_when_its_box_stands():
    assert sinks(_flap(0.73), np.eye(3)) > 0.0


@pytest.mark.parametrize(("turned", "expected"), [(0.5, 0.0), (0.75, 0.648943), (1.0, np.cos(1.65))])
def test_it_sinks_with_the_box_on_the_side_of_the_hinge_but_not_to_its_end_with_the_box_head_down(turned, expected):
    """Turned by so many half turns over to the side of the hinge, the flap has this share of the torque at least."""
    assert sinks(_flap(0.0), turn_about(UP_AND_BACK, turned * np.pi)) == pytest.approx(expected, abs=1e-6)


class _Keyboard(Obstacles):
    """Everything up to 0.7 m above the floor and beyond x = 1."""

    def distance(self, points):
        return np.maximum(1.0 - points[:, 0], points[:, 2] - 0.7)


def test_a_box_has_more_room_where_nothing_is_below_it():
    obstacles = object.__new__(_Keyboard)
    room = [hanging_open._points_with_room(obstacles, np.array([x, 0.0, 1.15]), 0.4) for x in (1.2, 0.9, 0.5, 0.3, 0.0)]
    assert room[0] < room[1] < room[2] == room[3] == room[4]


@pytest.mark.parametrize(("downs", "falls"), [((), 0.8), ((1.11, 1.07), 0.72), ((0.75, 0.38), 0.03)])
def test_how_far_a_box_falls_that_is_lowered_and_let_go(monkeypatch, downs, falls):
    class World(PlannedWorld):
        def grip(self, hand):
            return np.array([0.8, 0.0, 1.15])

        def vertices(self, name):
            return np.array([[0.6, 0.0, 0.8], [0.6, 0.0, 1.2]])

    monkeypatch.setattr(hanging_open, "lowered", lambda *a: [Phase(hand=0, pos=(0.8, 0.0, z)) for z in downs])
    assert hanging_open._drop(object.__new__(World), "box", 0) == pytest.approx(falls)
