"""A predicate of its arguments (`of_arguments`) holds as before when everything else moves."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from hand_world import HandWorld, Item, shell

from ig2mj.engine.view import SCHEMA, read_field, replace_fields
from ig2mj.predicates import compile_expression
from ig2mj.predicates.goal_rows import GoalRows
from ig2mj.predicates.registry import OF_SUBSTANCES, PREDICATES
from ig2mj.states import initial_states

SMALL = (((0, 0, 0), (0.1, 0.1, 0.1)),)
HOME = HandWorld(
    Item("floor", (((0, 0, 0), (5, 5, 0.01)),), fixed=True, floor=True, rooms=["hall"]),
    Item("box", shell(0.6, 0.6, 0.6), {"openable": {}}, joints=[(0.0, 1.0)]),
    Item("ball", SMALL),
    Item("other", SMALL),
    Item("chest", shell(0.6, 0.6, 0.6), {"openable": {}}, joints=[(0.0, 1.0)]),
    rooms={"hall": (-5, 0), "bath": (0, 5)},
    agent=True,
)
LITERALS = {
    "on_floor": "(on_floor {a} hall)",
    "in_contact_with": "(in_contact_with {a} {b})",
    "open": "(open box)",
    **{name: f"({name} {{a}} {{b}})" for name in ("inside", "on_top", "under", "next_to")},
    **{name: f"({name} {{a}})" for name in ("in_reach_of_agent", "in_hand_of_agent", "in_same_room_as_agent")},
}
PAIRS = (("ball", "box"), ("box", "ball"))
GOAL = "(or " + " ".join(text.format(a=a, b=b) for text in LITERALS.values() for a, b in PAIRS) + ")"
CASES = 40


def _view(rng):
    """Everything at random near the middle, on both sides of the wall between two rooms."""
    at = {name: rng.uniform((-0.6, -0.6, -0.3), (0.6, 0.6, 0.8)) for name in ("box", "ball", "other", "chest")}
    pairs = [("ball", "box"), ("ball", "floor"), ("box", "floor"), ("other", "ball"), ("other", "chest")]
    return HOME.view(
        at,
        touching=[pair for pair in pairs if rng.random() < 0.5],
        joints={"box": [rng.uniform(0, 0.2)], "chest": [rng.uniform(0, 0.2)]},
        held=[name for name in ("ball", "other") if rng.random() < 0.5],
        agent_pos=rng.uniform(-1.8, 1.8, 3),
    )


def test_every_predicate_of_objects_but_sight_is_one_of_its_arguments():
    every = PREDICATES.values()
    assert {p.name for p in every if p.per_object is None and not p.of_arguments} == {"in_fov_of_agent"}
    of_states = {
        "attached",
        *(p.name for p in OF_SUBSTANCES.values() if "substance" in p.arguments),
    }  # read states only
    assert {p.name for p in every if p.of_arguments} == set(LITERALS) | of_states


@pytest.mark.slow
def test_what_a_goal_does_not_name_may_move():
    model = HOME.model()
    goal = compile_expression(model, GOAL)
    rows, states = GoalRows(model, goal.literals), initial_states(model, 1)
    status = jax.jit(lambda view: goal.status(states, view).literals)
    rng, seen = np.random.default_rng(0), []
    for _ in range(CASES):
        one, other = (jax.tree.map(np.asarray, _view(rng)) for _ in range(2))
        mixed = _with_rows(other, one, rows)
        assert all(rows.same(name, read_field(mixed, name), read_field(one, name)) for name in SCHEMA)
        seen.append(np.asarray(status(one))[0])
        np.testing.assert_array_equal(status(mixed)[0], seen[-1])
    both = [len(set(column)) == 2 for column in np.stack(seen).T]
    varied = {atom.predicate for atom, varies in zip(goal.atoms, both, strict=True) if varies}
    assert varied == set(LITERALS), "each holds in some of these views and not in others"


def _with_rows(other, one, rows):
    """The view `other` with all of `one` that a goal can read, and with its agents."""
    mixed = {}
    for name in SCHEMA:
        new, chosen = np.array(read_field(other, name)), rows._rows[name]
        for axis, own in chosen:
            at = (slice(None),) * axis + (own,)
            new[at] = read_field(one, name)[at]
        mixed[name] = new if chosen else read_field(one, name)
    return replace_fields(one, mixed)


def test_a_row_that_a_goal_names_matters():
    model, rng = HOME.model(), np.random.default_rng(0)
    rows = GoalRows(model, compile_expression(model, "(inside ball box)").literals)
    view = jax.tree.map(np.asarray, _view(rng))
    for name, same in (("ball", False), ("box", False), ("other", True)):
        moved = view.object_com.copy()
        moved[0, HOME.index[name]] += 0.1
        assert rows.same("object_com", moved, view.object_com) == same
