"""Paper table A.3, the annotated properties of object models, row by row: what each one does."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hand_world import HandWorld, Item, answers, shell, step

from ig2mj.scene.manifest import OrientationEntry
from ig2mj.states import RelationPlan, initial_states

SMALL = (((0, 0, 0), (0.05, 0.05, 0.05)),)


def _inside(container: Item) -> bool:
    home = HandWorld(Item("ball", SMALL), container)
    plan = RelationPlan.build(home.model(), [("inside", 0, 1)])
    return bool(answers(plan, home.view()).inside([(0, 1)])[0, 0])


def test_table_a3_shape():
    assert _inside(Item("box", shell(0.5, 0.5, 0.5)))
    assert not _inside(Item("box", (((0, 0, 0), (0.25, 0.25, 0.25)),)))  # solid


def test_table_a3_weight(tiny_home):
    assert np.allclose(tiny_home.tables.object_mass, [o.mass for o in tiny_home.manifest.objects])


def test_table_a3_center_of_mass(tiny_home):
    # A knife's lies towards its blade; rays start there, not at the frame.
    import ig2mj

    world = ig2mj.Simulation(tiny_home, states=None)
    knife = tiny_home.object_index("knife")
    body = tiny_home.tables.object_root[knife]
    assert np.allclose(world.view.object_com[0, knife], world.data.xipos[body], atol=1e-6)
    assert not np.allclose(world.view.object_com[0, knife], world.view.object_pos[0, knife], atol=1e-3)


def test_table_a3_moment_of_inertia(tiny_home):
    loose = tiny_home.tables.object_root[~tiny_home.tables.object_fixed]
    assert (tiny_home.model.body_inertia[loose] > 0).all()


def test_table_a3_kinematic_structure(tiny_home):
    model = tiny_home.model
    assert {joint.type for entry in tiny_home.manifest.objects for joint in entry.joints} == {"hinge", "slide"}
    for entry in tiny_home.manifest.objects:
        for joint in entry.joints:
            kind = mujoco.mjtJoint(int(model.joint(joint.name).type[0]))
            assert kind == {"hinge": mujoco.mjtJoint.mjJNT_HINGE, "slide": mujoco.mjtJoint.mjJNT_SLIDE}[joint.type]


def test_table_a3_stable_orientations():
    entry = OrientationEntry(quat=(1.0, 0.0, 0.0, 0.0), prob=0.7, size=(0.1, 0.2, 0.3))
    assert np.isclose(np.linalg.norm(entry.quat), 1.0) and 0 < entry.prob <= 1


@pytest.mark.parametrize("with_link", [True, False])
def test_table_a3_heat_source_sink_link(with_link):
    links = {"heat_source": (0, 0, 0)} if with_link else {}
    home = HandWorld(
        Item("stove", abilities={"heatSource": {"temperature": 500.0}}, links=links),
        Item("fish", abilities={"cookable": {}}),
    )
    states = step(home.model(), initial_states(home.model(), 1), home.view())
    assert bool(states.temperature[0, 1] > 23.0) == with_link


@pytest.mark.parametrize(("area", "left"), [((0.1, 0.1, 0.1), 0), ((0.001, 0.001, 0.001), 20)])
def test_table_a3_cleaning_tool_link(area, left):
    home = HandWorld(
        Item("table", abilities={"dustyable": {}}),
        Item("mop", abilities={"cleaningTool": {}}, links={"cleaning_tool_area": ((0, 0, 0), area)}),
    )
    states = initial_states(home.model(), 1)
    rows = states.dust
    rows = rows.replace(alive=rows.alive | True, placed=rows.placed | True, body=rows.body + 1, pos=rows.pos + 0.05)
    states = step(
        home.model(), states.replace(dust=rows), home.view(touching=[("mop", "table")], force={("mop", "table"): 1.0})
    )
    assert int(states.dust.alive.sum()) == left


@pytest.mark.parametrize("with_link", [True, False])
def test_table_a3_droplet_source_link(with_link):
    links = {"water_source": (0, 0, -2)} if with_link else {}
    home = HandWorld(Item("tap", abilities={"waterSource": {}}, links=links))
    states = initial_states(home.model(), 1)
    for _ in range(3):
        states = step(home.model(), states, home.view())
    assert bool(states.water.active.any()) == with_link


@pytest.mark.parametrize("with_link", [True, False])
def test_table_a3_droplet_sink_link(with_link):
    tap = Item("tap", (((0, 0, 5), (0.1, 0.1, 0.1)),), {"waterSource": {}}, links={"water_source": (0, 0, 0.5)})
    links = {"water_sink": ((0, 0, 0), (0.2, 0.2, 0.2))} if with_link else {}
    home = HandWorld(tap, Item("drain", (((3, 0, 0), (0.1, 0.1, 0.1)),), links=links))
    states = initial_states(home.model(), 1)
    for _ in range(30):
        states = step(home.model(), states, home.view())
    height = np.asarray(states.water.pos[0, 0, :, 2])[np.asarray(states.water.active[0, 0])]
    assert bool((height < 0.0).any()) != with_link


@pytest.mark.parametrize("with_link", [True, False])
def test_table_a3_toggling_link(with_link):
    links = {"toggle_button": (0, 0, 0)} if with_link else {}
    home = HandWorld(Item("lamp", abilities={"toggleable": {}}, links=links), fingers=1)
    states = initial_states(home.model(), 1)
    for _ in range(5):
        states = step(home.model(), states, home.view(fingers=[(0, 0, 0.05)]))
    assert bool(states.toggled_on[0, 0]) == with_link


@pytest.mark.parametrize("with_link", [True, False])
def test_table_a3_slicing_link(with_link):
    blade = {"slicer": ((0, 0, 0), (0.1, 0.1, 0.1))}
    other = {"cleaning_tool_area": ((0, 0, 0), (0.1, 0.1, 0.1))}
    home = HandWorld(
        Item("knife", abilities={"slicer": {}}, links=blade if with_link else other),
        Item("bread", abilities={"sliceable": {}}),
    )
    view = home.view(force={("knife", "bread"): 99.0})
    states = step(home.model(), initial_states(home.model(), 1), view)
    assert bool(states.sliced[0, 1]) == with_link


def test_table_a3_relevant_joints(tiny_home):
    # Those of the manifest's `openable`, and no others, count for Open.
    tables = tiny_home.tables
    named = [j.joint for o in tiny_home.manifest.objects for j in o.openable]
    addresses = [int(tiny_home.model.joint(n).qposadr[0]) for n in named]
    assert tables.openable_qposadr.tolist() == addresses
