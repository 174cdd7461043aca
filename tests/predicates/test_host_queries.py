"""Queries with arguments as data answer as goals compiled for their objects do; agents; fixed furniture."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, shell

from ig2mj.engine.view import SCHEMA, PhysicsView, assemble, read_field
from ig2mj.errors import Ig2mjError
from ig2mj.predicates import PREDICATES, compile_expression, find
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.logic import And, atom
from ig2mj.states import initial_states
from ig2mj.states.world import WorldState

BALL = (((0, 0, 0), (0.05, 0.05, 0.05)),)
NUM_LOOSE = 6
HOME = HandWorld(
    *[Item(f"ball_{i}", BALL) for i in range(NUM_LOOSE)],
    Item("slab", (((0, 0, 0), (0.5, 0.5, 0.02)),), pos=(0, 0, 0.5)),
    Item("crate", shell(0.6, 0.6, 0.6), pos=(0.3, 0, 1.0)),
    Item("basket", shell(0.4, 0.4, 0.4, top=False), pos=(-0.4, 0.2, 0.8)),
    Item("rack", [((0, 0, 0.2 * k), (0.3, 0.3, 0.01)) for k in range(9)], pos=(0.5, 0.5, 0)),
)
RELATIONS = ("inside", "on_top", "under", "next_to", "in_contact_with")


def _cluttered(seed: int):
    """A view of the home with balls and containers thrown into one cubic metre, and random contacts."""
    rng = np.random.default_rng(seed)
    names = list(HOME.index)
    turned = rng.normal(size=(len(names), 4))
    return HOME.view(
        {name: rng.uniform((-0.6, -0.6, 0.2), (0.8, 0.8, 1.6)) for name in names},
        quat={n: q / np.linalg.norm(q) for n, q in zip(names, turned, strict=True) if rng.random() < 0.5},
        touching=[tuple(rng.choice(names, 2, replace=False)) for _ in range(12)],
    )


def _with_others_elsewhere(view: PhysicsView, other: PhysicsView, objects: tuple[int, ...]) -> PhysicsView:
    """The view, but all that it says of other objects and their bodies is what `other` says."""
    tables, fields = HOME.model().tables, {}
    keep = {"O": np.isin(np.arange(tables.num_objects), objects), "B": np.isin(tables.body_object, objects)}
    for name, field in SCHEMA.items():
        own, mine = np.array(read_field(view, name)), None
        for k, axis in enumerate(field.axes):
            if axis in keep:
                rows = keep[str(axis)].reshape([-1 if j == k else 1 for j in range(len(field.axes))])
                mine = rows if mine is None else mine | rows
        fields[name] = own if mine is None else np.where(mine, own, np.asarray(read_field(other, name)))
    return assemble(fields)


@pytest.mark.parametrize("compat", [pytest.param("paper", marks=pytest.mark.slow), "igibson"])
def test_questions_and_goals_agree_on_every_pair_of_a_cluttered_scene(compat):
    model = HOME.model(compat=compat)
    names = list(HOME.index)
    pairs = [(a, b) for a in names for b in names if a != b]
    goal = compile_expression(model, And(tuple(atom(r, a, b) for r in RELATIONS for a, b in pairs)))
    fused = jax.jit(lambda states, view: goal.status(states, view).literals)
    questions, states = HostQueries(model), initial_states(model, 1)
    seen: set[tuple[str, bool]] = set()
    rng = np.random.default_rng(1)
    for seed in range(6):
        view = _cluttered(seed)
        expected = np.asarray(fused(states, view))[0]
        place = {literal.atom: i for i, literal in enumerate(goal.literals.literals)}
        for relation in RELATIONS:
            rows = [(HOME.index[a], HOME.index[b]) for a, b in pairs]
            found = questions.holds(find(relation), rows, states, view)[0]
            requested = expected[[place[atom(relation, a, b)] for a, b in pairs]]
            np.testing.assert_array_equal(found, requested, err_msg=f"{relation}, seed {seed}")
            seen |= {(relation, bool(value)) for value in found}
            for k in rng.choice(len(rows), 6, replace=False):
                alone = _with_others_elsewhere(view, _cluttered(seed + 100), rows[k])
                assert questions.holds(find(relation), [rows[k]], states, alone)[0, 0] == found[k], (relation, pairs[k])
    assert seen == {(r, v) for r in RELATIONS for v in (True, False)}, "both answers of every relation shall occur"


def test_one_program_serves_all_pairs_and_many_rows_at_once():
    model = HOME.model()
    questions, states, view = HostQueries(model), initial_states(model, 1), _cluttered(0)
    rows = [(a, b) for a in range(len(HOME.index)) for b in range(len(HOME.index))]  # more than a program takes
    together = questions.holds(PREDICATES["under"], rows, states, view)
    single = [questions.holds(PREDICATES["under"], [row], states, view)[0, 0] for row in rows]
    assert together[0].tolist() == single
    assert len(questions._programs) == 1 and questions._programs["under"]._call._cache_size() == 1


def test_what_a_predicate_reads_is_found_by_tracing():
    questions = HostQueries(HOME.model())
    assert questions.reads(PREDICATES["cooked"]) == ("states.max_temperature",)
    assert set(questions.reads(PREDICATES["in_contact_with"])) == {"view.object_com", "view.touching"}
    on_top = {"object_com", "aabb_low", "aabb_high", "body_pos", "body_quat", "touching"}
    assert set(questions.reads(PREDICATES["on_top"])) == {f"view.{name}" for name in on_top}


@pytest.mark.slow
def test_a_single_world_is_answered_as_a_batch_is():
    model = HOME.model()
    states, view = initial_states(model, 1), _cluttered(1)
    world = WorldState(
        physics=None,
        view=view,
        states=states,
        key=jnp.zeros((1, 2), jnp.uint32),
        step=jnp.zeros(1, int),
        time=jnp.zeros(1),
    )
    text = "(or (not (under ball_0 rack)) (and (on_top ball_1 slab) (next_to ball_2 crate)))"
    fused = compile_expression(model, text)
    asked = compile_expression(model, text, questions=HostQueries(model))
    assert fused(world)[0] == asked(world)[0]
    assert fused.fraction(world)[0] == asked.fraction(world)[0]
    assert np.asarray(fused.literals_of(world)).tolist() == asked.literals_of(world).tolist()


AGENT_HOME = HandWorld(Item("ball", BALL), Item("cup", BALL), agent=True)


@pytest.mark.parametrize("text", ["(in_contact_with {0} agent)", "(in_contact_with agent {0})"])
def test_contact_with_an_agent_by_its_name(text):
    model = AGENT_HOME.model()
    states, view = initial_states(model, 1), AGENT_HOME.view(agent_touches=["cup"])
    for name, expected in (("ball", False), ("cup", True)):
        goal = compile_expression(model, text.format(name))
        assert bool(goal.status(states, view).holds[0]) == expected
        assert HostQueries(model).facts(goal.literals, states, view)[0, 0] == expected
    assert not compile_expression(model, "(in_contact_with ball cup)").status(states, view).holds[0]


def test_agents_are_named_only_where_the_view_knows_of_them():
    model = AGENT_HOME.model()
    with pytest.raises(Ig2mjError, match="of two agents"):
        compile_expression(model, "(in_contact_with agent agent)")
    with pytest.raises(Ig2mjError, match="no object or agent is named 'hand'"):
        compile_expression(model, "(in_contact_with ball hand)")
    with pytest.raises(Ig2mjError, match="no object is named 'agent'"):
        compile_expression(model, "(on_top ball agent)")


FLOOR = (((0, 0, -0.1), (4, 4, 0.1)),)


@pytest.mark.parametrize(
    ("height", "expected"), [(0.5, True), (0.502, True), (0.51, False), (0.48, True), (-0.6, False)]
)
@pytest.mark.parametrize("touches", [True, False])
def test_fixed_furniture_is_on_the_floor_where_its_box_reaches_it_whatever_it_touches(height, expected, touches):
    block = (((0, 0, 0), (0.3, 0.3, 0.5)),)
    home = HandWorld(
        Item("fridge", block, fixed=True), Item("floor", FLOOR, floor=True, fixed=True), Item("box", block)
    )
    touching = [("fridge", "floor"), ("box", "floor")] if touches else []
    view = home.view({"fridge": (0, 0, height), "box": (1, 0, height)}, touching=touching)
    states = initial_states(home.model(), 1)
    answers = compile_expression(home.model(), "(and (on_floor fridge floor) (on_floor box floor))")
    # What can move is on the floor where it touches it.
    assert answers.status(states, view).literals[0].tolist() == [expected, touches]


def test_furniture_beside_a_floor_is_not_on_it():
    home = HandWorld(Item("fridge", BALL, fixed=True), Item("floor", FLOOR, floor=True, fixed=True))
    goal = compile_expression(home.model(), "(on_floor fridge floor)")
    states = initial_states(home.model(), 1)
    assert goal.status(states, home.view({"fridge": (3.9, 0, 0.05)})).holds[0]
    assert not goal.status(states, home.view({"fridge": (4.1, 0, 0.05)})).holds[0]
    assert not goal.status(states, home.view({"fridge": (np.nan, 0, 0.05)})).holds[0]
