"""Paper tables A.2 (abilities and the states they need) and A.4 (states), row by row, by name."""

from __future__ import annotations

import copy

import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, step

from ig2mj.knowledge import ABILITIES, required_states
from ig2mj.states import StateModel, initial_states, registry, states_of_manifest
from ig2mj.states.registry import STATES


@pytest.mark.parametrize(
    ("row", "ability", "states"),
    [
        ("Can be Cooked", "cookable", {"max_temperature", "temperature"}),
        ("Can be Burnt", "burnable", {"max_temperature", "temperature"}),
        ("Can be Frozen", "freezable", {"temperature"}),
        ("Can be Soaked", "soakable", {"wetness"}),
        ("Can be Dusty", "dustyable", {"dust"}),
        ("Can be Stained", "stainable", {"stain"}),
        ("Can be ToggledOn", "toggleable", {"toggled_on"}),
        ("Can be Sliced", "sliceable", {"sliced"}),
    ],
)
def test_table_a2_an_ability_brings_its_states(row, ability, states):
    home = HandWorld(Item("it", abilities={ability: {}}), Item("rock"))
    model, world, view = home.model(), initial_states(home.model(), 1), home.view()
    assert set(required_states(ability)) == states, row
    for name in states:
        assert registry.find(name).belongs_to(model, 0), row
        assert not registry.find(name).belongs_to(model, 1)
        registry.find(name).get(model, world, view, 0, 0)


@pytest.mark.parametrize("ability", ["heatSource", "waterSource"])
def test_table_a2_a_heat_source_and_a_droplet_source_obey_the_toggled_state(ability):
    link = {"heatSource": "heat_source", "waterSource": "water_source"}[ability]
    parameters = {"requires_toggled_on": True, "temperature": 500.0} if ability == "heatSource" else {}
    home = HandWorld(
        Item("it", (((0, 0, 5), (0.1, 0.1, 0.1)),), {ability: parameters, "toggleable": {}}, links={link: (0, 0, 0)}),
        Item("fish", abilities={"cookable": {}}),
    )
    for on in (False, True):
        states = initial_states(home.model(), 1)
        states = states.replace(toggled_on=states.toggled_on.at[0, 0].set(on))
        for _ in range(3):
            states = step(home.model(), states, home.view())
        works = states.temperature[0, 1] > 23.1 if ability == "heatSource" else states.water.active.any()
        assert bool(works) == on
    assert "toggled_on" in required_states(ability)


ROWS = HandWorld(
    Item("cabinet", abilities={"openable": {}}, joints=[(0.0, 1.0), (0.0, 0.5)], pos=(1, 2, 3)),
    Item("cup", (((0, 0, 0), (0.05, 0.05, 0.1)),), {**{a: {} for a in ABILITIES}}, pos=(1, 2, 4)),
    Item("lamp", (((0, 0, 0), (0.05, 0.05, 0.1)),), pos=(1, 2, 6)),
)


def _value(name: str, of: str, states=None, **view):
    model = ROWS.model()
    states = initial_states(model, 1) if states is None else states
    return registry.find(name).get(model, states, ROWS.view(**view), ROWS.index[of], 0)


def test_table_a4_pose():
    quarter = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
    pos, quat = _value("Pose", "cup", quat={"cup": quarter})
    assert pos == [1, 2, 4] and np.allclose(quat, quarter)


def test_table_a4_aabb():
    low, high = _value("AABB", "cup")
    assert np.allclose(low, (0.95, 1.95, 3.9)) and np.allclose(high, (1.05, 2.05, 4.1))


def test_table_a4_joint_states():
    assert np.allclose(_value("joint_states", "cabinet", joints={"cabinet": [0.25, 0.5]}), [0.25, 0.5])
    assert _value("joint_states", "cup") == []


def test_table_a4_in_contact_objs():
    assert _value("in_contact_objs", "cup", touching=[("cup", "cabinet")]) == ["cabinet"]
    assert _value("contact_bodies", "lamp", touching=[("cup", "cabinet")]) == []


def test_table_a4_in_same_positive_and_negative_vertical_axis_objs_and_horizontal_plane_objs():
    assert _value("in_same_positive_vertical_axis_objs", "cup") == ["lamp"]
    assert _value("in_same_negative_vertical_axis_objs", "cup") == ["cabinet"]
    assert _value("in_same_horizontal_plane_objs", "cup", pos={"lamp": (3, 2, 4)}) == ["lamp"]


@pytest.mark.parametrize(
    ("row", "name", "field", "value"),
    [
        ("Temperature", "temperature", "temperature", 41.5),
        ("MaxTemperature", "max_temperature", "max_temperature", 99.5),
        ("WetnessLevel", "wetness_level", "wetness", 3.0),
        ("ToggledState", "toggled_state", "toggled_on", True),
        ("SlicedState", "sliced_state", "sliced", True),
    ],
)
def test_table_a4_scalar_states(row, name, field, value):
    states = initial_states(ROWS.model(), 1)
    states = states.replace(**{field: getattr(states, field).at[0, 1].set(value)})
    assert _value(name, "cup", states) == value, row


@pytest.mark.parametrize(("name", "field"), [("dustiness_level", "dust"), ("stain_level", "stain")])
def test_table_a4_dustiness_and_stain_level(name, field):
    states = initial_states(ROWS.model(), 1)
    rows = getattr(states, field)
    placed = np.arange(20) < 16
    rows = rows.replace(placed=rows.placed | placed, alive=rows.alive | (np.arange(20) < 4))
    assert _value(name, "cup", states.replace(**{field: rows})) == 0.25


def test_every_state_has_a_name_of_its_own():
    names = [n for s in STATES.values() for n in (s.name, *s.aliases)]
    assert len(names) == len(set(names))


def test_initial_states_of_a_manifest(tiny_home):
    manifest = copy.deepcopy(tiny_home.manifest)
    model = StateModel.of_manifest(tiny_home.tables, manifest)
    bodies = {tiny_home.model.body(b).name: b for b in range(tiny_home.model.nbody)}
    table, apple = tiny_home.object_index("table"), tiny_home.object_index("apple")
    sink = tiny_home.object_index("sink")
    side = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)  # z turned to x
    saved = {
        apple: {"temperature": -5.0, "max_temperature": 71.0, "sliced": False},
        table: {"dust": [None, {"body": "table", "pos": [0.1, 0.2, 0.5], "quat": side}]},
        sink: {
            "toggled_on": True,
            "press_count": 2,
            "water": {"steps_since_drop": 1, "drops": [None, [1.0, 2.0, 3.0]]},
        },
    }
    for index, state in saved.items():
        manifest.objects[index].state = state
    states = states_of_manifest(model, manifest, bodies, num_worlds=2)
    assert states.temperature[:, apple].tolist() == [-5.0, -5.0]
    assert states.max_temperature[1, apple] == 71.0
    assert states.max_temperature[1, apple + 1] == -np.inf
    assert bool(states.toggled_on[0, sink]) and int(states.press_count[0, sink]) == 2
    row = np.flatnonzero(model.parameters.dust_rows == table)[0]
    assert np.asarray(states.dust.alive[1, row]).tolist() == [False, True] + [False] * 18
    assert int(states.dust.body[0, row, 1]) == bodies["table"]
    assert jnp.allclose(states.dust.normal[0, row, 1], jnp.array([1.0, 0.0, 0.0]), atol=1e-6)
    assert np.asarray(states.water.active[0, 0]).tolist() == [False, True] + [False] * 8
    assert states.water.pos[0, 0, 1].tolist() == [1.0, 2.0, 3.0] and int(states.water.waited[0, 0]) == 1
