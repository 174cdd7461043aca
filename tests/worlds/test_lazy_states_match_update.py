"""`StateStepper` leaves work out and changes nothing: bitwise the states and statuses of `update` in every step."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, shell

from ig2mj.engine.view import SCHEMA, read_field, replace_fields
from ig2mj.predicates import compile_expression
from ig2mj.states import initial_states, update
from ig2mj.states.definitions import dust
from ig2mj.states.relations.asked import PairByPair
from ig2mj.states.update import HEAT_FIELDS, heat
from ig2mj.worlds.lazy.program import AHEAD, StateProgram
from ig2mj.worlds.lazy.relevance import EXACT, Relevance
from ig2mj.worlds.lazy.stepper import News, StateStepper

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
# Which view each step sees; runs of one view let the stepper take its short way.
STORY = [0] * 4 + [1] * 8 + [0] * 3 + [2] * 5 + [3] * 4 + [0] * 6 + [4] * 3 + [0] * 3


def _start(model):
    states = initial_states(model, 1)
    points = np.tile([0.0, 0.0, 0.02], (1, 20, 1)).astype(np.float32)
    rows, _ = dust.set_dusty(
        model, states.dust, 0, jnp.full((1, 20), 4), jnp.asarray(points), jnp.asarray(points), jnp.ones((1, 20), bool)
    )
    return states.replace(dust=rows)


@functools.cache
def _rules(text=GOAL, **options):
    """Model, program and the plain functions of a set of options and a goal; compiled once for all tests."""
    model = HOME.model(**options)
    goal = compile_expression(model, text)

    @jax.jit
    def reference(states, view):
        states, swap = update(model, states, view)
        return states, swap, goal.status(states, view)

    return model, StateProgram(model, goal), reference


def _assert_same(ours, theirs, status, expected, where):
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        assert np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True), where
    for field in dataclasses.fields(expected):
        assert np.array_equal(getattr(status, field.name), getattr(expected, field.name)), (where, field.name)


@pytest.mark.parametrize("options", [{}, {"contact_heat_rate": 0.1, "drying_rate": 0.5}])
@pytest.mark.slow
def test_every_step_is_bitwise_the_same(options):
    model, program, reference = _rules(**options)
    stepper = StateStepper(program)

    ours = theirs = _start(model)
    swaps, short = 0, 0
    for k, number in enumerate(STORY):
        if k == 20:  # a hand on the switch of the tap, from outside
            flip = theirs.toggled_on.at[0, HOME.index["tap"]].set(True)
            ours, theirs = ours.replace(toggled_on=flip), theirs.replace(toggled_on=flip)
        short += stepper._acts is not None and stepper._view is VIEWS[number]
        ours, swap, status = stepper.step(ours, VIEWS[number])
        theirs, expected_swap, expected = reference(theirs, VIEWS[number])
        _assert_same(ours, theirs, status, expected, f"step {k}")
        assert (swap is not None) == bool(expected_swap.mask.any())
        swaps += swap is not None
    assert swaps == 1
    assert ours.sliced[0, HOME.index["half"]]
    assert ours.wetness[0, HOME.index["rag"]] > 0 and int(ours.dust.alive.sum()) == 0
    if not options:
        assert short > 5


def _changed(view, rng):
    """The view with one number of one field changed: a little, or to somewhere near the oven or the fish."""
    name = str(rng.choice([name for name in SCHEMA if read_field(view, name).size]))
    array = np.array(read_field(view, name))
    places = {"agent.finger_pos": 1, "body_pos": 3, "body_quat": 3}.get(name, 1)
    for place in rng.integers(array.size, size=places):
        old = array.flat[place]
        array.flat[place] = ~old if array.dtype == bool else rng.choice([old + 1e-6, old + 1e-3, 0.0, 0.5, 3.0, 30.0])
    return name, replace_fields(view, {name: array})


ONLY_STATES = "(and (cooked fish) (soaked rag))"
"""A goal that asks nothing of where things are: then most of what moves cannot matter."""


PAIRS = [(a, b) for a in ("fish", "rag", "knife", "oven") for b in ("oven", "table", "fish", "tap") if a != b]
MANY_RELATIONS = "(or " + " ".join(f"(on_top {a} {b}) (inside {a} {b})" for a, b in PAIRS) + ")"
"""Of more relations than are laid out pair by pair in the program."""


@pytest.mark.parametrize(
    ("seed", "goal"),
    [
        pytest.param(0, GOAL, marks=pytest.mark.slow),
        *(pytest.param(s, GOAL, marks=pytest.mark.slow) for s in (1, 2)),
        (0, ONLY_STATES),
        (1, ONLY_STATES),
        pytest.param(0, MANY_RELATIONS, marks=pytest.mark.slow),
    ],
)
def test_whatever_changes_in_the_view_is_seen(seed, goal):
    model, program, reference = _rules(goal)
    assert isinstance(program.goal_plan, PairByPair) == (goal is MANY_RELATIONS)
    rng, stepper, ours, view = np.random.default_rng(seed), StateStepper(program), _start(model), VIEWS[0]
    seen, theirs = set(), ours
    for k in range(300):
        if rng.random() < 0.6:
            name, view = _changed(view, rng)
            seen.add(name)
        elif rng.random() < 0.3:  # back to where nothing happens
            view = VIEWS[int(rng.integers(len(VIEWS)))]
        ours, _, status = stepper.step(ours, view)
        theirs, _, expected = reference(theirs, view)
        _assert_same(ours, theirs, status, expected, (k, sorted(seen)))
    assert seen >= {"object_com", "body_pos", "touching", "link_pos", "agent.finger_pos", "aabb_low"}


def test_an_agent_that_moves_far_from_buttons_is_no_work_for_the_states():
    model, program, _ = _rules()
    stepper, states, view = StateStepper(program), _start(model), VIEWS[0]
    for _ in range(3):
        states, _, _ = stepper.step(states, view)
    whole = stepper._acts
    assert whole is not None
    for k in range(4):
        world = np.array(view.body_pos)
        world[:, 0] += 0.1 * k  # row 0 is no object's, as an agent's are not
        agent = {"agent.base_pos": view.agent.base_pos + 1, "agent.finger_pos": view.agent.finger_pos + k}
        view = replace_fields(view, {"body_pos": world, **agent})
        states, _, _ = stepper.step(states, view)
        assert stepper._acts is whole
    fingers = np.array([[[0, 0, 0.5]]], np.float32)
    states, _, _ = stepper.step(states, replace_fields(view, {"agent.finger_pos": fingers}))
    assert stepper._acts is None and int(states.press_count[0, HOME.index["oven"]]) == 1


def test_where_the_engine_says_that_only_agents_moved_only_they_are_looked_at(monkeypatch):
    _, program, _ = _rules()
    stepper, states, looked, before = StateStepper(program), _start(program.model), [], object()

    def moved(token, **fields):
        view = replace_fields(VIEWS[0], {f"agent.{name}": np.array([[at]], np.float32) for name, at in fields.items()})
        view.__dict__["_but_agents"] = token
        return view

    for _ in range(3):
        states, _, _ = stepper.step(states, moved(before))
    compare = stepper._differences
    monkeypatch.setattr(stepper, "_differences", lambda view, names: looked.append(names) or compare(view, names))
    states, _, _ = stepper.step(states, moved(before, base_pos=[1, 2, 3]))
    assert looked == [program.agent_reads] and "agent.finger_pos" in program.agent_reads
    states, _, _ = stepper.step(states, moved(object()))
    assert looked[1:] == [program.scene_reads, program.agent_reads]
    states, _, _ = stepper.step(states, moved(before, finger_pos=[0, 0, 0.5]))
    assert stepper._acts is None and int(states.press_count[0, HOME.index["oven"]]) == 1


def test_a_goal_about_the_agent_follows_it():
    model, program, _ = _rules("(in_reach_of_agent fish)")
    stepper, states = StateStepper(program), _start(model)
    for x, near in ((0.0, False), (2.0, True), (2.5, True), (9.0, False)):
        states, _, status = stepper.step(states, HOME.view(fingers=AWAY, agent_pos=(x, 0, 1)))
        assert bool(status.holds[0]) == near


def test_a_step_looks_only_at_what_it_depends_on():
    _, program, _ = _rules()
    StateStepper(program).step(_start(program.model), VIEWS[0])
    assert not {"agent.base_pos", "agent.eye_pos", "agent.eye_quat", "awake", "held"} & set(program.view_reads)
    assert {"object_com", "body_pos", "touching", "link_force", "agent.finger_pos"} <= set(program.view_reads)


def test_it_looks_at_every_number_that_always_matters():
    model, program, _ = _rules()
    stepper, states = StateStepper(program), _start(model)
    for _ in range(3):
        states, _, _ = stepper.step(states, VIEWS[0])
    exact = program.goal_reads | EXACT
    assert exact >= {"object_com", "body_pos", "body_quat", "aabb_low", "aabb_high", "touching", "link_force"}
    for name in exact:
        old = np.asarray(read_field(VIEWS[0], name))
        rows = old[:, 1:] if name in ("body_pos", "body_quat") else old  # row 0 is no object's body
        for place in np.ndindex(rows.shape):
            new = old.copy()
            at = place if rows is old else (place[0], place[1] + 1, *place[2:])
            new[at] = ~old[at] if old.dtype == bool else old[at] + 1e-6 + 1e-6 * abs(old[at])
            news = stepper._news(replace_fields(VIEWS[0], {name: new}))
            assert news is not News.NONE, (name, at)  # the goal names every object
            assert news is News.EVENTS or name not in EXACT, (name, at)


def test_a_settled_world_is_left_alone_and_a_cooling_one_is_not():
    model = HOME.model()
    stepper = StateStepper(StateProgram(model, compile_expression(model, "(cooked fish)")))
    states = _start(model)
    for _ in range(3):
        states, _, _ = stepper.step(states, VIEWS[0])
    again, _, status = stepper.step(states, VIEWS[0])
    assert again is states and not status.holds[0]
    states = states.replace(temperature=jnp.asarray(states.temperature).at[0, 1].set(80.0))
    for _ in range(3):
        cooler, _, status = stepper.step(states, VIEWS[0])
        assert cooler.temperature[0, 1] < states.temperature[0, 1] and status.holds[0]
        states = cooler
    # Near 23 C single precision comes to rest, and is noticed.
    states = states.replace(temperature=jnp.asarray(states.temperature).at[0, 1].set(23.00001))
    for _ in range(70):
        before, (states, _, _) = states, stepper.step(states, VIEWS[0])
    assert states is before


def test_steps_of_temperatures_in_one_call_are_those_of_one_after_the_other():
    model = HOME.model()
    stepper = StateStepper(StateProgram(model, compile_expression(model, "(cooked fish)")))
    states, _, _ = stepper.step(_start(model), VIEWS[0])
    states = states.replace(temperature=jnp.asarray(states.temperature).at[0, 1].set(80.0))
    objects = len(HOME.index)
    nothing = jnp.zeros((1, objects, len(model.parameters.heat_rate)), bool), jnp.zeros((1, objects, objects), bool)
    reference, expected, most = jax.jit(lambda s: heat(model, s, *nothing)), states, 0
    for k in range(45):
        view = VIEWS[3] if k in (5, 40) else VIEWS[0]  # at 5 and 40, and after it, steps are thrown away
        states, expected = stepper.step(states, view).states, reference(expected)
        for name in HEAT_FIELDS:
            assert np.array_equal(getattr(states, name), getattr(expected, name)), (k, name)
        most = max(most, stepper._ahead_count)
    assert most == AHEAD


def test_states_changed_from_outside_are_seen():
    model = HOME.model()
    goal = compile_expression(model, "(toggled_on oven)")
    stepper = StateStepper(StateProgram(model, goal))
    states = _start(model)
    for _ in range(3):
        states, _, status = stepper.step(states, VIEWS[0])
    assert not status.holds[0]
    states = states.replace(toggled_on=jnp.asarray(states.toggled_on).at[0, 0].set(True))
    states, _, status = stepper.step(states, VIEWS[0])
    assert status.holds[0]


def test_a_stepper_needs_no_goal():
    model = HOME.model()
    stepper = StateStepper(StateProgram(model))
    states = _start(model)
    for _ in range(3):
        states, swap, status = stepper.step(states, VIEWS[1])
    assert swap is None and status.literals.shape == (1, 0) and not status.holds[0]
    assert stepper._acts is None  # a finger is at the button: the count goes on


def test_the_short_way_computes_all_that_the_second_part_of_an_update_changes():
    """A state added to `update.HEAT` must be added here, too, or it would stand still while nothing else happens."""
    program, states = StateProgram(HOME.model()), initial_states(HOME.model(), 1)
    names = [tuple(key.name for key in path) for path, _ in jax.tree_util.tree_flatten_with_path(states)[0]]
    assert [names[place] for place in program.heats] == [(name,) for name in HEAT_FIELDS]


def test_what_moves_without_mattering_is_no_work_for_the_states():
    """The knife and the fish are pushed about, far from the oven that is on; in it the fish is warmed."""
    model, program, reference = _rules("(cooked fish)")
    stepper, view = StateStepper(program), VIEWS[0]
    ours = theirs = _start(model).replace(toggled_on=jnp.zeros((1, 7), bool).at[0, HOME.index["oven"]].set(True))
    for _ in range(3):
        ours, _, _ = stepper.step(ours, view)
        theirs, _, _ = reference(theirs, view)
    whole, moves = stepper._acts, []
    assert whole is not None
    for k in range(6):
        fish = (3, 0.01 * k, 1) if k < 5 else (0, 0, 0)
        view = jax.tree.map(np.asarray, HOME.view({"knife": (20 - 0.1 * k, 0, 0), "fish": fish}, fingers=AWAY))
        ours, _, status = stepper.step(ours, view)
        theirs, _, expected = reference(theirs, view)
        _assert_same(ours, theirs, status, expected, k)
        moves.append(stepper._acts is whole)
    assert moves == [True] * 5 + [False]


def test_what_moved_once_without_mattering_is_looked_at_once(monkeypatch):
    """The knife lies elsewhere than before and an agent moves; then the fish goes into the oven, and back."""
    asked, same = [], Relevance.same
    monkeypatch.setattr(Relevance, "same", lambda self, *a: asked.append(same(self, *a)) or asked[-1])
    model, program, reference = _rules("(cooked fish)")
    stepper, view = StateStepper(program), VIEWS[0]
    ours = theirs = _start(model).replace(toggled_on=jnp.zeros((1, 7), bool).at[0, HOME.index["oven"]].set(True))
    for k in range(12):
        fish = (0, 0, 0) if k == 9 else (3, 0, 1)
        if k >= 3:
            view = HOME.view({"knife": (19, 0, 0), "fish": fish}, fingers=AWAY, agent_pos=(0.1 * k, 0, 1))
            view = jax.tree.map(np.asarray, view)
        ours, _, status = stepper.step(ours, view)
        theirs, _, expected = reference(theirs, view)
        _assert_same(ours, theirs, status, expected, k)
        assert len(asked) == (0 if k < 3 else 1 if k < 9 else len(asked)), (k, asked)
    assert asked[:2] == [True, False]


def test_what_the_goal_does_not_name_is_no_work_for_it():
    model, program, _ = _rules("(and (on_top fish table) (cooked fish))")
    stepper, states, view = StateStepper(program), _start(model), VIEWS[0]
    for _ in range(3):
        states, _, _ = stepper.step(states, view)
    for moved, news in (("knife", News.NONE), ("rag", News.NONE), ("table", News.GOAL), ("fish", News.GOAL)):
        later = jax.tree.map(np.asarray, HOME.view({moved: (25, 0, 2)}, fingers=AWAY))
        assert stepper._news(later) is news, moved


@pytest.mark.slow
def test_what_matters_to_the_goal_alone_is_no_work_for_the_states():
    """The fish is put on the table, held above it, put back, taken off: the goal follows, and events are left out."""
    model, program, reference = _rules()
    stepper, view = StateStepper(program), VIEWS[0]
    ours = theirs = _start(model).replace(temperature=jnp.full((1, 7), 23.0).at[0, HOME.index["fish"]].set(90.0))
    for _ in range(3):
        ours, _, _ = stepper.step(ours, view)
        theirs, _, _ = reference(theirs, view)
    assert program.goal is not None
    atom = [a.predicate for a in program.goal.atoms].index("on_top")
    whole, on_top = stepper._acts, []
    assert whole is not None
    for k, height in enumerate([0.07, 0.07, 0.3, 1.0, 0.07, 1.0, 1.0]):
        touching = [("fish", "table")] if height == 0.07 else []
        if k not in (1, 6):  # there nothing but temperatures changes
            view = jax.tree.map(np.asarray, HOME.view({"fish": (3, 0, height)}, touching=touching, fingers=AWAY))
        ours, _, status = stepper.step(ours, view)
        theirs, _, expected = reference(theirs, view)
        _assert_same(ours, theirs, status, expected, k)
        assert stepper._acts is whole
        on_top.append(bool(status.literals[0, atom]))
    assert on_top == [True, True, False, False, True, False, False]
