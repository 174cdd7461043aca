"""How states look, as in iGibson, and the viewer's overlay."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.sensors.tints import TINTS, UNTINTED
from ig2mj.viewer.interactive import ViewerState
from ig2mj.viewer.state_marks import Tinter, marks, tint_of_objects
from ig2mj.viewer.states_overlay import StatesOverlay, describe


@pytest.fixture
def world(tiny_home) -> ig2mj.Simulation:
    return ig2mj.Simulation(tiny_home)


def _tint(world, name: str) -> str | None:
    index = tint_of_objects(world.state_model, world.states)[world.scene.object_index(name)]
    return TINTS[index].predicate.name if index != UNTINTED else None


def test_the_state_of_highest_priority_colours_an_object(world):
    assert _tint(world, "apple") is None
    for name in ("cooked", "burnt", "frozen"):
        world.set_state(name, "apple", True)
        assert _tint(world, "apple") == name
    world.set_state("soaked", "sponge", True)
    world.set_state("toggled_on", "stove", True)
    assert (_tint(world, "sponge"), _tint(world, "stove"), _tint(world, "box")) == ("soaked", "toggled_on", None)


def test_tints_mix_and_are_taken_back(world):
    model, tables = world.model, world.scene.tables
    before = model.geom_rgba.copy()
    tint = np.full(tables.num_objects, -1)
    tint[world.scene.object_index("box")] = [t.predicate.name for t in TINTS].index("burnt")
    tint[world.scene.object_index("stove")] = [t.predicate.name for t in TINTS].index("toggled_on")
    with Tinter(model, tables.geom_object).shown(tint):
        box, stove = model.geom("box/visual_0").id, model.geom("stove/visual_0").id
        assert np.allclose(model.geom_rgba[box, :3], 0.2 * before[box, :3])
        assert np.allclose(model.geom_rgba[stove, :3], np.minimum(1.5 * before[stove, :3], 1.0))
    assert (model.geom_rgba == before).all()


def test_dust_stains_and_drops_are_drawn_where_they_are(world):
    world.set_state("stained", "table", True)
    world.set_state("dusty", "book", True)
    world.set_state("toggled_on", "sink", True)
    world.step(count=4)
    found = marks(world.state_model, world.states, world.view)
    kinds = [m.kind for m in found]
    drops = int(world.states.water.active.sum())
    assert drops > 0
    assert kinds.count(mujoco.mjtGeom.mjGEOM_BOX) == 20
    assert kinds.count(mujoco.mjtGeom.mjGEOM_SPHERE) == 20 + drops
    low, high = (np.array(v) for v in world.state("aabb", "table"))
    stains = np.array([m.pos for m in found if m.kind == mujoco.mjtGeom.mjGEOM_BOX])
    assert ((stains >= low - 1e-3) & (stains <= high + 1e-3)).all()
    for m in found:
        assert np.allclose(m.axes @ m.axes.T, np.eye(3), atol=1e-5)


def test_the_overlay_tells_what_is_unusual(world):
    overlay = StatesOverlay(world, world.model)
    assert overlay.labels(world.data) == []
    world.set_state("frozen", "apple", True)
    world.set_state("soaked", "sponge", True)
    told = {world.scene.object_names[o]: text for o, text in describe(world.state_model, world.states).items()}
    assert "frozen" in told["apple"] and " C" in told["apple"]
    assert told["sponge"] == "soaked, wet 1"
    assert {label.text for label in overlay.labels(world.data)} == set(told.values())


def test_the_viewer_draws_particles_while_the_overlay_is_on(world):
    world.set_state("stained", "table", True)
    world.set_state("toggled_on", "stove", True)
    overlay = StatesOverlay(world, world.model)
    before = world.model.geom_rgba.copy()
    state = ViewerState([overlay])
    scene = mujoco.MjvScene(world.model, maxgeom=500)
    state.draw_labels(world.data, scene)
    assert scene.ngeom == 20 + 2  # particles, and texts of table and stove
    assert not (world.model.geom_rgba == before).all()
    state.press(ord("6"))
    state.draw_labels(world.data, scene)
    assert scene.ngeom == 0
    assert (world.model.geom_rgba == before).all()


def test_a_full_scene_is_no_error(world):
    world.set_state("stained", "table", True)
    scene = mujoco.MjvScene(world.model, maxgeom=5)
    ViewerState([StatesOverlay(world, world.model)]).draw_labels(world.data, scene)
    assert scene.ngeom == 5
