"""What `ig2mj.worlds.incremental` leaves out changes nothing: all is the plain path's after each step, bit for bit."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, shell
from story import OfABatch, tell
from tiny_home import home_manifest, scene_xml

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.view import SCHEMA, LazyFields, PhysicsView, read_field, replace_fields
from ig2mj.predicates import compile_expression
from ig2mj.scene import manifest as mf
from ig2mj.states import initial_states
from ig2mj.states.definitions.dust import DUST
from ig2mj.worlds import Core, Rules
from ig2mj.worlds.incremental import IncrementalRules
from ig2mj.worlds.incremental_goal import AHEAD, MANY

STORY: list[tuple] = [
    ("step", 6),
    ("set", "toggled_on", "stove", True),
    ("put", "apple", (0.0, 1.6, 0.861)),
    ("put", "box", (-1.6, 0.0, 0.751)),  # holds the sponge above where the sink takes drops
    ("put", "sponge", (-1.6, 0.0, 0.823)),
    ("step", 24),
    ("set", "toggled_on", "sink", True),
    ("step", 12),
    ("save", "before the cut"),
    ("set", "toggled_on", "stove", False),
    ("put", "knife", (-0.06, 1.6, 0.904)),
    ("step", 4),
    ("reset",),
    ("step", 12),
    ("restore", "before the cut"),
    ("set", "toggled_on", "sink", False),
    ("set", "toggled_on", "stove", False),
    ("step", 16),
]


class Told(OfABatch):
    """A core without a pool; every field of the view is looked at."""

    def __init__(self, core: Core):
        self.core, self.face, self.kept, self.status = core, core, {}, None
        self.batch = core.start(seed=3)

    def seen(self):
        world = self.batch.world
        view = {name: np.asarray(read_field(world.view, name)) for name in SCHEMA}
        leaves = jax.tree_util.tree_flatten_with_path((world.states, self.status, world.time))[0]
        time = np.array(self.core.engine.time(world.physics))
        return view | {jax.tree_util.keystr(p): np.asarray(leaf) for p, leaf in leaves} | {"time of physics": time}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The tiny home, with an apple that any touch of the blade cuts."""
    home, manifest = tmp_path_factory.mktemp("story") / "home", home_manifest()
    home.mkdir()
    (home / "scene.xml").write_text(scene_xml())
    apple = next(entry for entry in manifest.objects if entry.name == "apple")
    apple.abilities["sliceable"] = {"slice_force": 0.01}
    mf.save_manifest(manifest, home / "manifest.json")
    return home


@pytest.mark.parametrize(
    ("robot", "goal"),
    [
        (None, "(and (cooked apple) (sliced apple))"),
        pytest.param(FloatingHand(pos=(0.6, 0.6, 1.2)), None, marks=pytest.mark.slow),
        pytest.param(FloatingHand(pos=(0.6, 0.6, 1.2)), "(in_reach_of_agent apple)", marks=pytest.mark.slow),
    ],
    ids=["no robot", "an awake robot", "a goal about the robot"],
)
def test_the_switch_changes_no_bit_of_a_story(folder, robot, goal):
    """Writes, a cut, a reset, a restored moment, water, heat and rest, in two worlds."""
    scene = ig2mj.load_scene(folder, agents=[robot] if robot else [])
    rules = Rules.of_scene(scene).with_goal(goal)
    told, plain = (
        tell(Told(Core(NativeEngine(scene, 2, incremental=on, threads=1), rules)), STORY) for on in (True, False)
    )
    for moment, (ours, theirs) in enumerate(zip(told, plain, strict=True)):
        for name, array in theirs.items():
            np.testing.assert_array_equal(ours[name], array, f"{name} at moment {moment}")
    apple = scene.object_index("apple")
    temperature = np.array([seen["[0].temperature"][0, apple] for seen in told])
    assert temperature.max() > 30 and temperature[-1] < temperature.max(), "it was heated, and cools"
    assert np.array([seen["[0].sliced"][0, apple] for seen in told]).any(), "it was cut"


FOOD = {"cookable": {}, "burnable": {}, "freezable": {}, "sliceable": {}, "stainable": {}}
SMALL = (((0, 0, 0), (0.05, 0.05, 0.05)),)
HOME = HandWorld(
    Item("oven", shell(0.6, 0.6, 0.6), {"heatSource": {"temperature": 250.0, "requires_inside": True,
          "requires_toggled_on": True}, "toggleable": {}}, links={"toggle_button": (0, 0, 0.5)}),
    Item("fish", SMALL, FOOD, pos=(3, 0, 1), parts={"half": (0, 0, 0)}),
    Item("half", SMALL, FOOD, pos=(40, 0, 0), part_of="fish", parked=True),
    Item("table", (((0, 0, 0), (1, 1, 0.02)),), {"dustyable": {}}, pos=(3, 0, 0)),
    Item("rag", SMALL, {"cleaningTool": {}, "soakable": {}}, pos=(9, 0, 0)),
    Item("tap", SMALL, {"waterSource": {}, "toggleable": {}}, links={"water_source": (0, 0, -0.1)}, pos=(9, 0, 1)),
    Item("knife", SMALL, {"slicer": {}}, links={"slicer": ((0, 0, 0), (0.1, 0.1, 0.1))}, pos=(20, 0, 0)),
    fingers=1,
)  # fmt: skip
GOAL = """(and (cooked fish) (not (burnt fish)) (inside fish oven) (on_top fish table) (soaked rag) (dusty table)
               (sliced fish) (forn 1 (?x - thing) (in_contact_with ?x table)))"""
AWAY = [(0, 0, 9)]
VIEWS = [
    HOME.view(fingers=AWAY),
    HOME.view({"fish": (0, 0, 0)}, fingers=[(0, 0, 0.5)]),
    HOME.view({"rag": (3, 0, 0.06)}, touching=[("rag", "table")], fingers=AWAY),
    HOME.view({"fish": (3, 0, 0.08)}, touching=[("fish", "table")], fingers=AWAY),
    HOME.view(force={("knife", "fish"): 50.0}, fingers=AWAY),
]
VIEWS = [jax.tree.map(np.asarray, view) for view in VIEWS]  # as the native engine gives them
# Which view each step sees; in runs of one view work is left out.
SEEN = [0] * 4 + [1] * 8 + [0] * 3 + [2] * 5 + [3] * 4 + [0] * 6 + [4] * 3 + [0] * 3


def _start(model):
    states = initial_states(model, 1)
    points = np.tile([0.0, 0.0, 0.02], (1, 20, 1)).astype(np.float32)
    rows, _ = DUST.place(
        model, states.dust, 0, jnp.full((1, 20), 4), jnp.asarray(points), jnp.asarray(points), jnp.ones((1, 20), bool)
    )
    return states.replace(dust=rows)


@functools.cache
def _rules(text=GOAL, **options):
    """Rules, and the plain function, of a set of options and a goal; compiled once for all tests."""
    model = HOME.model(**options)
    rules = Rules(model, compile_expression(model, text) if text else None)
    return rules, jax.jit(rules.step)


def _assert_same(ours, expected, where):
    for a, b in zip(jax.tree.leaves(ours.states), jax.tree.leaves(expected.states), strict=True):
        assert np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True), where
    for field in dataclasses.fields(expected.status):
        assert np.array_equal(getattr(ours.status, field.name), getattr(expected.status, field.name)), (where, field)
    assert (ours.swap is not None) == bool(expected.swap.mask.any()), where
    if ours.swap is not None:
        assert all(map(np.array_equal, jax.tree.leaves(ours.swap), jax.tree.leaves(expected.swap))), where


def _skipped(rules, monkeypatch):
    """A stepper of the rules, and a list in which its whole steps are counted."""
    stepper, whole = IncrementalRules(rules, 1), []
    step = stepper._whole_step
    monkeypatch.setattr(stepper, "_whole_step", lambda *args: whole.append(None) or step(*args))
    return stepper, whole


@pytest.mark.parametrize("options", [{}, {"contact_heat_rate": 0.1, "drying_rate": 0.5}])
@pytest.mark.slow
def test_steps_are_those_of_the_rules(options):
    rules, reference = _rules(**options)
    stepper, swaps = IncrementalRules(rules, 1), 0
    ours = theirs = _start(rules.model)
    for k, number in enumerate(SEEN):
        if k == 20:  # a hand on the switch of the tap, from outside
            flip = jnp.asarray(theirs.toggled_on).at[0, HOME.index["tap"]].set(True)
            ours, theirs = ours.replace(toggled_on=flip), theirs.replace(toggled_on=flip)
        done, expected = stepper.step(ours, VIEWS[number]), reference(theirs, VIEWS[number])
        _assert_same(done, expected, f"step {k}")
        ours, theirs, swaps = done.states, expected.states, swaps + (done.swap is not None)
    assert swaps == 1
    assert ours.sliced[0, HOME.index["half"]]
    assert ours.wetness[0, HOME.index["rag"]] > 0 and int(ours.dust.alive.sum()) == 0


PAIRS = [(a, b) for a in ("fish", "rag", "knife", "oven") for b in ("oven", "table", "fish", "tap") if a != b]
MANY_RELATIONS = "(or " + " ".join(f"(on_top {a} {b}) (inside {a} {b})" for a, b in PAIRS) + ")"


@pytest.mark.slow
def test_a_goal_of_many_relations_is_answered_by_questions_with_the_same_truth():
    rules, reference = _rules(MANY_RELATIONS)
    assert rules.goal is not None and len(set(rules.goal.queries)) > MANY
    stepper = IncrementalRules(rules, 1)
    ours = theirs = _start(rules.model)
    for k, number in enumerate(SEEN):
        done, expected = stepper.step(ours, VIEWS[number]), reference(theirs, VIEWS[number])
        _assert_same(done, expected, f"step {k}")
        ours, theirs = done.states, expected.states
    programs = stepper._goal._programs
    assert programs._questions is not None and not programs.reads_agents


def test_a_settled_world_is_left_alone_and_a_cooling_one_is_not(monkeypatch):
    rules, reference = _rules("(cooked fish)")
    stepper, whole = _skipped(rules, monkeypatch)
    states = _start(rules.model)
    for _ in range(3):
        states, _, _ = stepper.step(states, VIEWS[0])
    assert len(whole) == 1
    again, _, status = stepper.step(states, VIEWS[0])
    assert again is states and not status.holds[0]
    states = states.replace(temperature=jnp.asarray(states.temperature).at[0, 1].set(80.0))
    for _ in range(2 * AHEAD + 3):
        done, expected = stepper.step(states, VIEWS[0]), reference(states, VIEWS[0])
        _assert_same(done, expected, "cooling")
        assert done.states.temperature[0, 1] < states.temperature[0, 1] and done.status.holds[0]
        states = done.states
    assert len(whole) == 2, "only states from outside ask for a whole step"


def test_states_changed_from_outside_are_seen():
    rules, _ = _rules("(toggled_on oven)")
    stepper, states = IncrementalRules(rules, 1), _start(rules.model)
    for _ in range(3):
        states, _, status = stepper.step(states, VIEWS[0])
    assert not status.holds[0]
    states = states.replace(toggled_on=jnp.asarray(states.toggled_on).at[0, 0].set(True))
    assert stepper.step(states, VIEWS[0]).status.holds[0]


def _moved(scene, **fields):
    """A view in which only agents are elsewhere, if `scene` is that of the last one."""
    view = replace_fields(VIEWS[0], {f"agent.{name}": np.array([[at]], np.float32) for name, at in fields.items()})
    return PhysicsView.over(LazyFields({}, lambda name: getattr(view, name), scene))


def test_agents_that_move_away_from_buttons_are_no_work_for_the_states(monkeypatch):
    rules, _ = _rules()
    stepper, whole = _skipped(rules, monkeypatch)
    states, scene = _start(rules.model), object()
    for x in range(4):
        states, _, _ = stepper.step(states, _moved(scene, base_pos=[x, 2, 3], finger_pos=[0, x, 9]))
    assert len(whole) == 1
    states, _, _ = stepper.step(states, _moved(object(), base_pos=[1, 2, 3], finger_pos=[0, 0, 9]))
    assert len(whole) == 1, "the engine says that something else has moved, and it has not"
    states, _, _ = stepper.step(states, _moved(scene, finger_pos=[0, 0, 0.5]))
    assert len(whole) == 2 and int(states.press_count[0, HOME.index["oven"]]) == 1
    states, _, _ = stepper.step(states, _moved(scene, finger_pos=[0, 0, 9]))
    assert len(whole) == 3 and int(states.press_count[0, HOME.index["oven"]]) == 0


def test_a_goal_about_the_agent_follows_it():
    rules, _ = _rules("(in_reach_of_agent fish)")
    stepper, states, scene = IncrementalRules(rules, 1), _start(rules.model), object()
    for x, near in ((0.0, False), (2.0, True), (2.5, True), (9.0, False)):
        states, _, status = stepper.step(states, _moved(scene, base_pos=[x, 0, 1]))
        assert bool(status.holds[0]) == near


def test_no_goal_is_needed():
    rules, _ = _rules(None)
    _, swap, status = IncrementalRules(rules, 1).step(_start(rules.model), VIEWS[1])
    assert swap is None and status.literals.shape == (1, 0) and not status.holds[0]


@pytest.mark.slow
def test_what_moves_and_is_idle_is_no_whole_step(monkeypatch):
    """A rag slides, a fish is carried into the oven and out again; both while temperatures change."""
    rules, reference = _rules()
    stepper, whole = _skipped(rules, monkeypatch)
    on = jnp.asarray(_start(rules.model).toggled_on).at[0, HOME.index["oven"]].set(True)
    ours = theirs = _start(rules.model).replace(toggled_on=on)
    ways = [{"rag": (9, 0, 0.01 * k)} for k in range(6)]
    ways += [{"fish": (0.001 * k, 0, 0)} for k in range(AHEAD + 3)]
    ways += [{"fish": (3, 0, 1), "rag": (9, 0, 0.01 * k)} for k in range(6)]
    for k, at in enumerate(ways):
        view = jax.tree.map(np.asarray, HOME.view(at, fingers=AWAY))
        done, expected = stepper.step(ours, view), reference(theirs, view)
        _assert_same(done, expected, f"step {k}")
        ours, theirs = done.states, expected.states
    fish = HOME.index["fish"]
    assert ours.max_temperature[0, fish] > ours.temperature[0, fish] > 23, "it was heated in the oven, and cools"
    assert len(whole) == 1
