"""Paper table A.1, row by row, with the differences between paper and code, and the bugs that are not copied."""

from __future__ import annotations

import functools

import jax
import numpy as np
import pytest
from hand_world import HandWorld, Item, shell

from ig2mj.predicates import PREDICATES, compile_expression
from ig2mj.states import WorldState, initial_states

FOOD = {"cookable": {}, "burnable": {}, "freezable": {}}
BALL = (((0, 0, 0), (0.05, 0.05, 0.05)),)
HOME = HandWorld(
    Item("fish", BALL, FOOD, pos=(0, 0, 3)),
    Item("table", (((0, 0, 0), (0.5, 0.5, 0.02)),), {"dustyable": {}, "stainable": {}}, pos=(0, 0, 1)),
    Item("fridge", shell(0.6, 0.6, 0.6), {"openable": {}, "toggleable": {}}, pos=(3, 0, 1), joints=[(0.0, 1.5)],
          fixed=True, rooms=("hall_0",)),
    Item("rag", BALL, {"soakable": {}}, pos=(0, 4, 1)),
    Item("loaf", BALL, {"sliceable": {}}, pos=(0, -4, 1)),
    Item("floor", (((0, 0, -0.5), (5, 5, 0.5)),), floor=True, fixed=True, category="floors"),
    Item("wall", (((0, 0, 0), (0.05, 2, 2)),), pos=(-1.5, 0, 1), fixed=True),
    rooms={"kitchen_0": (-5.0, 1.0), "hall_0": (1.0, 5.0)},
    agent=True,
)  # fmt: skip


def _world(view, states=None) -> WorldState:
    worlds = view.object_com.shape[0]
    states = initial_states(HOME.model(), worlds) if states is None else states
    zeros = np.zeros(worlds, np.float32)
    return WorldState(
        physics=None,
        view=view,
        states=states,
        key=np.zeros((worlds, 2), np.uint32),
        step=zeros.astype(np.int32),
        time=zeros,
    )


@functools.cache
def _compiled(text: str, compat: str):
    return compile_expression(HOME.model(compat=compat), text)


def _holds(text: str, view=None, states=None, compat: str = "paper") -> bool:
    return bool(_compiled(text, compat)(_world(HOME.view() if view is None else view, states))[0])


def _states(**fields):
    """Initial states with fields of single objects changed: `temperature={"fish": 3.0}`."""
    states = initial_states(HOME.model(), 1)
    for field, values in fields.items():
        for name, value in values.items():
            states = states.replace(**{field: getattr(states, field).at[0, HOME.index[name]].set(value)})
    return states


NAMES = (
    "inside", "on_top", "next_to", "in_contact_with", "under", "on_floor", "open", "cooked", "burnt", "frozen",
    "soaked", "dusty", "stained", "toggled_on", "sliced", "in_fov_of_agent", "in_hand_of_agent",
    "in_reach_of_agent", "in_same_room_as_agent",
)  # fmt: skip


def test_all_nineteen_predicates_of_the_table_are_there():
    assert tuple(PREDICATES)[:19] == NAMES


def test_inside_of():
    assert _holds("(inside fish fridge)", HOME.view({"fish": (3, 0, 1)}))
    assert not _holds("(inside fish fridge)", HOME.view({"fish": (3, 0, 1.5)}))
    assert not _holds("(inside fridge fish)", HOME.view({"fish": (3, 0, 1)}))


def test_on_top_of():
    rests = {"fish": (0, 0, 1.07)}
    touch = [("fish", "table")]
    assert _holds("(on_top fish table)", HOME.view(rests, touching=touch))
    assert not _holds("(on_top fish table)", HOME.view(rests))  # no contact
    assert not _holds("(on_top table fish)", HOME.view(rests, touching=touch))
    leaning = {"fish": (0.53, 0, 1.0)}
    assert not _holds("(on_top fish table)", HOME.view(leaning, touching=touch))  # nothing below its centre


def test_on_top_of_is_false_with_the_object_above_too():
    # On the floor of the fridge the fridge is below and above.
    view = HOME.view({"fish": (3, 0, 0.76)}, touching=[("fish", "fridge")])
    assert not _holds("(on_top fish fridge)", view)
    assert _holds("(inside fish fridge)", view)


def test_next_to():
    assert _holds("(next_to fish table)", HOME.view({"fish": (0.6, 0, 1)}))
    assert not _holds("(next_to fish table)", HOME.view({"fish": (0.6, 0, 1.1)}))  # not in the plane
    assert not _holds("(next_to fish table)", HOME.view({"fish": (0.9, 0, 1)}))  # not near


def test_next_to_is_symmetric_in_igibsons_code_only():
    # The fish is in the plane of the table's centre; the table, low and wide, is not in the fish's.
    view = HOME.view({"fish": (0.6, 0, 1.04)})
    assert not _holds("(next_to fish table)", view)
    assert _holds("(next_to table fish)", view)
    assert _holds("(next_to fish table)", view, compat="igibson")


def test_in_contact_with():
    view = HOME.view(touching=[("fish", "table")])
    assert _holds("(in_contact_with fish table)", view) and _holds("(touching table fish)", view)
    assert not _holds("(in_contact_with fish fridge)", view)


def test_under():
    assert _holds("(under fish table)", HOME.view({"fish": (0, 0, 0.1)}))
    assert not _holds("(under fish table)", HOME.view({"fish": (0, 0, 3)}))
    assert not _holds("(under fish table)", HOME.view({"fish": (2, 0, 0.1)}))
    assert not _holds("(under fish fridge)", HOME.view({"fish": (3, 0, 1)}))  # also below


def test_on_floor():
    lies = HOME.view({"fish": (0, 0, 0.05)}, touching=[("fish", "floor")])
    assert _holds("(on_floor fish kitchen_0)", lies)
    assert not _holds("(on_floor fish hall_0)", lies)
    assert not _holds("(on_floor fish kitchen_0)", HOME.view({"fish": (0, 0, 0.05)}))


def test_on_floor_of_the_floor_itself_is_any_room_in_the_paper():
    lies = HOME.view({"fish": (0, 0, 0.05)}, touching=[("fish", "floor")])
    assert _holds("(on_floor fish floor)", lies)
    assert not _holds("(on_floor fish floor)", lies, compat="igibson")


def test_open():
    assert not _holds("(open fridge)")
    assert not _holds("(open fridge)", HOME.view(joints={"fridge": [0.07]}))
    assert _holds("(open fridge)", HOME.view(joints={"fridge": [0.08]}))


@pytest.mark.parametrize(
    ("highest", "paper", "code"), [(69.9, False, False), (70.0, True, True), (199.9, True, True), (200.0, False, True)]
)
def test_cooked(highest, paper, code):
    states = _states(max_temperature={"fish": highest})
    assert _holds("(cooked fish)", states=states) == paper
    assert _holds("(cooked fish)", states=states, compat="igibson") == code


@pytest.mark.parametrize(("highest", "burnt"), [(199.9, False), (200.0, True), (900.0, True), (np.nan, False)])
def test_burnt(highest, burnt):
    assert _holds("(burnt fish)", states=_states(max_temperature={"fish": highest})) == burnt


@pytest.mark.parametrize(("now", "frozen"), [(0.0, True), (0.1, False), (-18.0, True), (np.nan, False)])
def test_frozen(now, frozen):
    assert _holds("(frozen fish)", states=_states(temperature={"fish": now})) == frozen


@pytest.mark.parametrize(("droplets", "soaked"), [(0.0, False), (0.5, False), (1.0, True), (7.0, True)])
def test_soaked(droplets, soaked):
    assert _holds("(soaked rag)", states=_states(wetness={"rag": droplets})) == soaked


@pytest.mark.parametrize("kind", ["dust", "stain"])
@pytest.mark.parametrize(("alive", "dirty"), [(0, False), (10, False), (11, True), (20, True)])
def test_dusty_and_stained(kind, alive, dirty):
    states = initial_states(HOME.model(), 1)
    rows = getattr(states, kind)
    rows = rows.replace(placed=rows.placed | True, alive=rows.alive | (np.arange(20) < alive))
    text = "(dusty table)" if kind == "dust" else "(stained table)"
    assert _holds(text, states=states.replace(**{kind: rows})) == dirty
    other = "(stained table)" if kind == "dust" else "(dusty table)"
    assert not _holds(other, states=states.replace(**{kind: rows}))


def test_toggled_on():
    assert not _holds("(toggled_on fridge)")
    assert _holds("(toggled_on fridge)", states=_states(toggled_on={"fridge": True}))


def test_sliced():
    assert not _holds("(sliced loaf)")
    assert _holds("(sliced loaf)", states=_states(sliced={"loaf": True}))


LOOK_ALONG_X = (np.sqrt(0.25), np.sqrt(0.25), -np.sqrt(0.25), -np.sqrt(0.25))


@pytest.mark.parametrize(
    ("fish", "seen"),
    [((2, 0, 1), True), ((-1.2, 0, 1), False), ((2, 3, 1), False), ((2, 1.9, 1), True), ((2, 0, 1.9), True)],
)
def test_in_fov_of_agent(fish, seen):
    view = HOME.view({"fish": fish, "table": (9, 9, 9), "fridge": (9, 9, 9)}, eye=((0, 0, 1), LOOK_ALONG_X))
    assert _holds("(in_fov_of_agent fish)", view) == seen


def test_in_fov_of_agent_needs_a_free_line_of_sight():
    behind = {"fish": (2, 0, 1), "table": (9, 9, 9), "fridge": (9, 9, 9), "wall": (1, 0, 1)}
    view = HOME.view(behind, eye=((0, 0, 1), LOOK_ALONG_X))
    assert not _holds("(in_fov_of_agent fish)", view)
    assert _holds("(in_fov_of_agent wall)", view)
    halfway = {**behind, "wall": (1, 2, 1)}  # its edge crosses the line
    assert _holds("(in_fov_of_agent fish)", HOME.view(halfway, eye=((0, 0, 1), LOOK_ALONG_X)))


def test_in_hand_of_agent_is_about_the_object_held():
    view = HOME.view(held=["rag"])
    assert _holds("(in_hand_of_agent rag)", view)
    assert not _holds("(in_hand_of_agent fish)", view)  # bug 19.4: in iGibson's physical mode everything is


@pytest.mark.parametrize(("x", "within"), [(1.99, True), (2.0, False), (2.5, False)])
def test_in_reach_of_agent(x, within):
    assert _holds("(in_reach_of_agent fish)", HOME.view({"fish": (x, 0, 0)})) == within


def test_in_same_room_as_agent():
    view = HOME.view({"fish": (0.5, 0, 0)}, agent_pos=(-2, 0, 0))
    assert _holds("(in_same_room_as_agent fish)", view)  # bug 19.3: for movable objects never, in iGibson
    assert not _holds("(in_same_room_as_agent fridge)", view)
    assert not _holds("(in_same_room_as_agent fish)", HOME.view({"fish": (2, 0, 0)}, agent_pos=(-2, 0, 0)))
    assert _holds("(in_same_room_as_agent fridge)", HOME.view(agent_pos=(4, 0, 0)))


def test_without_an_agent_every_agent_predicate_is_false():
    home = HandWorld(Item("fish", BALL), rooms={"kitchen_0": (-5.0, 5.0)})
    for name in ("in_fov_of_agent", "in_hand_of_agent", "in_reach_of_agent", "in_same_room_as_agent"):
        goal = compile_expression(home.model(), f"({name} fish)")
        assert not goal(_world(home.view(), initial_states(home.model(), 1)))[0]


@pytest.mark.parametrize(
    "name", [n for n in NAMES if PREDICATES[n].per_object is None and n not in ("dusty", "stained")]
)
def test_nan_poses_never_make_a_predicate_true(name):
    nowhere = (np.nan, np.nan, np.nan)
    view = HOME.view(
        {"fish": nowhere, "fridge": (3, 0, 1)},
        joints={"fridge": [np.nan]},
        touching=[("fish", "fridge"), ("fish", "floor")],
        held=["fish"],
        agent_pos=(3, 0, 1),
    )
    first = "fridge" if name == "open" else "fish"
    second = " kitchen_0" if PREDICATES[name].arguments[-1] == "room" else " fridge"
    text = f"({name} {first}{second if PREDICATES[name].arity == 2 else ''})"
    assert not _holds(text, view)


def test_predicates_hold_world_by_world():
    views = [HOME.view({"fish": (3, 0, z)}) for z in (1.0, 2.0)]
    view = jax.tree.map(lambda *leaves: np.concatenate(leaves), *views)
    goal = compile_expression(HOME.model(), "(inside fish fridge)")
    assert goal(_world(view))[:].tolist() == [True, False]


def test_touching_needs_no_rays():
    assert _compiled("(in_contact_with fish table)", "paper").queries == []
    assert _compiled("(inside fish fridge)", "paper").queries == [("inside", 0, 2)]
