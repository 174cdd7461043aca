"""What states change in the looks of a home: tinted textures, and the light of lamps."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.looks import visual_of
from ig2mj.looks.light import NIGHT, Bulb, shade
from ig2mj.looks.state_looks import MIXTURES, OF_MATERIAL, lamp_geoms, tinted_materials
from ig2mj.scene.scene import load_scene
from ig2mj.sensors.render_model import mean_colours
from ig2mj.sensors.tints import STATES, SWITCHED_ON, TINTS, UNTINTED, tinted
from ig2mj.viewer.state_marks import Tinter


@pytest.fixture(scope="module")
def home():
    return load_scene("small_home", objects=["floor_lamp"])


@pytest.fixture(scope="module")
def visual(home):
    return visual_of(home)


def test_a_state_tints_objects_of_the_ability_that_its_predicate_needs():
    assert [(tint.ability, tint.weight) for tint in TINTS] == [
        (tint.predicate.ability, MIXTURES[tint.predicate.name].weight) for tint in TINTS
    ]


def test_a_tinted_object_keeps_its_texture_and_has_the_tints_mean_colour(visual):
    model, in_tint = visual.model, tinted_materials(visual.model, STATES)
    pairs = np.argwhere(in_tint >= 0)
    assert len(pairs)
    for state, geom in pairs:
        plain = mean_colours(model, np.array([geom]))[:, :3]
        texture = model.mat_texid[in_tint[state, geom], 1]
        assert texture >= 0 and texture != model.mat_texid[model.geom_matid[geom], 1]
        tinter = Tinter(model, visual.owner)
        tint = np.full(visual.owner.max() + 1, UNTINTED)
        tint[visual.owner[geom]] = state
        with tinter.shown(tint):
            assert model.geom_matid[geom] == in_tint[state, geom]
            assert np.allclose(model.geom_rgba[geom], OF_MATERIAL)
            shown = mean_colours(model, np.array([geom]))[0, :3]
        if STATES[state] != "toggled_on":  # what is brighter than white is cut off, texel by texel
            assert shown == pytest.approx(np.asarray(tinted(plain, np.array([[state]])))[0, 0], abs=0.01)


def test_a_lamp_lights_the_home_while_it_is_on_and_where_it_is(home, visual):
    model, (light, geom) = visual.model, lamp_geoms(visual.model)[0]
    lamp = int(visual.owner[geom])
    assert home.object_names[lamp].startswith("floor_lamp") and not model.light_active[light]
    tint = np.full(home.tables.num_objects, UNTINTED)
    tint[lamp] = SWITCHED_ON
    with Tinter(model, visual.owner).shown(tint):
        assert model.light_active[light]
    assert not model.light_active[light]
    data = home.start_data()
    root = int(home.tables.object_root[lamp])
    data.xpos[root] = (3.0, 2.0, 1.0)
    assert visual.data(home.model, data).light_xpos[light][2] > 1.5


def test_the_light_of_a_bulb_fades_and_falls_on_what_faces_it():
    bulb = Bulb((0.0, 0.0, 2.0), (0.02, 0.02, 0.01), (1.0, 0.0, 1.0))
    up = np.array([[0.0, 0.0, 1.0]])
    dark = shade(up, NIGHT)
    below, farther = (shade(up, NIGHT, 0.0, np.array([[0.0, 0.0, z]]), [bulb]) - dark for z in (1.0, -1.0))
    assert below == pytest.approx(np.array([[0.01, 0.01, 0.005]])) and farther == pytest.approx(0.2 * below)
    assert shade(-up, NIGHT, 0.0, np.zeros((1, 3)), [bulb]) == pytest.approx(shade(-up, NIGHT))
