"""Levels of contents, streams and spots: where substances are, at the right height and place."""

from __future__ import annotations

import numpy as np
import pytest
from substance_world import GLASS, JUG, SUBSTANCES, tilted, world

from ig2mj.sensors.substance_shapes import levels, mixed_colour, spots, streams_of
from ig2mj.states import initial_states
from ig2mj.states.substances import coat, volume
from ig2mj.viewer.substance_marks import substance_marks

HOME = world()
MODEL, VIEW = HOME.model(), HOME.view()


def _with(**litres: float):
    states = initial_states(MODEL, 1)
    for key, value in litres.items():
        name, _, substance = key.partition("_")
        states = volume.set_volume(MODEL, states, HOME.index[name], substance or "water", value)
    return states


def test_where_there_is_nothing_nothing_is_drawn():
    states = _with()
    assert substance_marks(MODEL, states, VIEW) == []


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_level_is_as_high_as_its_container_is_full(share):
    (level,) = levels(MODEL, _with(jug=2 * share), VIEW)
    assert level.pos[2] == pytest.approx(0.5 - JUG[2] + 2 * JUG[2] * share, abs=0.012)
    assert level.half == pytest.approx((0.05, 0.05), abs=0.006) and level.rectangle


def test_a_mixture_has_the_mean_colour():
    (level,) = levels(MODEL, _with(jug_water=0.5, jug_olive_oil=0.5), VIEW)
    water, oil = (np.array(MODEL.substances.substances[SUBSTANCES.index(n)].colour) for n in ("water", "olive_oil"))
    assert level.rgb == pytest.approx((water + oil) / 2)
    assert mixed_colour(MODEL.substances, np.array([1.0, 0, 0, 0, 0])) == pytest.approx(tuple(water))


def test_a_stream_falls_from_the_rim_into_the_glass():
    view = HOME.view({"jug": (0.0, 0.0, 0.5)}, quat={"jug": tilted(110)})
    (stream,) = streams_of(MODEL, _with(jug=1.0), view)
    glass = np.array(HOME.things[HOME.index["glass"]].pos)
    assert np.all(np.diff(stream.points[:, 2]) < 0) and stream.points[-1, 2] < glass[2] + GLASS[2] + 0.05
    assert np.abs(stream.points[-1, :2] - glass[:2]).max() < 0.05
    assert streams_of(MODEL, _with(jug=1.0), VIEW) == []


def test_what_covers_an_object_lies_on_its_surface():
    states = coat.set_covered(MODEL, _with(), HOME.index["sponge"], "mud", True)
    (spot,) = spots(MODEL, states)
    assert spot.substance == "mud" and len(spot.pos) == 20 and np.abs(spot.pos).max() <= 0.0501
    assert len(substance_marks(MODEL, states, VIEW)) == 20
