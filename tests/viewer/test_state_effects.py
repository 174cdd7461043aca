"""Steam, frost and drops: where states are, and only there."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.viewer.state_effects import FROST, PUFFS, STEAMS, _on_surface, effects


@pytest.fixture(scope="module")
def world(tiny_home):
    engine = NativeEngine(tiny_home, 1, threads=1)
    model = StateModel.of_manifest(tiny_home.tables, tiny_home.manifest)
    return model, initial_states(model, 1), engine.view(engine.reset())


def thing(model) -> int:
    loose = ~model.tables.object_fixed & ~model.tables.object_parked & model.parameters.thermal
    return int(np.flatnonzero(loose)[0])


def test_a_home_at_its_start_has_none(world):
    model, states, view = world
    assert effects(model, states, view) == []


def test_what_is_hot_steams_above_itself_and_the_steam_moves(world):
    model, states, view = world
    index = thing(model)
    hot = dataclasses.replace(states, temperature=states.temperature.at[0, index].set(STEAMS + 5))
    puffs, later = effects(model, hot, view, time=0.0), effects(model, hot, view, time=0.3)
    top = float(np.asarray(view.aabb_high)[0, index, 2])
    assert len(puffs) == PUFFS and all(p.pos[2] > top and p.rgba[3] < 0.5 for p in puffs)
    assert any(abs(a.pos[2] - b.pos[2]) > 0.01 for a, b in zip(puffs, later, strict=True))


@pytest.mark.parametrize("high", [(0.1, 0.12, 0.1), (0.4, 0.3, 0.1)])
def test_frost_and_drops_lie_on_the_object(high):
    found = _on_surface(np.zeros(3), np.array(high), 20, FROST, 1, frost=True)
    assert len(found) == 20
    for mark in found:
        assert (mark.pos > -1e-6).all() and (mark.pos < np.array(high) + 1e-6).all()
        np.testing.assert_allclose(mark.axes.T @ mark.axes, np.eye(3), atol=1e-6)
