"""What a container holds is poured into others and over things: planned, said, offered, set and carried out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.registry import make_robot
from ig2mj.cli.common.planning import domain_of, expression_of
from ig2mj.planning import pouring
from ig2mj.planning.domain import Domain
from ig2mj.planning.grounding import ground_steps
from ig2mj.planning.kinematic import kinematic_episodes
from ig2mj.planning.pddl import write_pddl
from ig2mj.planning.problem import Problem, problem_of
from ig2mj.planning.requests import RequestSource
from ig2mj.planning.solver import solve
from ig2mj.planning.steps import Outcome, PlanningError, Step, UnsupportedPrimitive, make_step
from ig2mj.planning.symbolic import SymbolicRung, start_facts, symbolic_episodes
from ig2mj.planning.task_planner import TaskPlanner
from ig2mj.planning.words import NotUnderstoodError, tools
from ig2mj.planning.world import PlannedWorld
from ig2mj.states.substances.containers import Containers
from ig2mj.states.substances.volume import FILLED
from ig2mj.web.planning import offers

MILK = ("substances:milk@milk_0",)
JUG = ("carafe@on_top:breakfast_table_0", "substances:water@carafe_0")


def problem(goal: str, objects: tuple[str, ...]) -> tuple[Problem, Domain]:
    found = problem_of("small_home", expression_of("small_home", goal, objects, "humanoid"), objects)
    return found, domain_of(found, "humanoid")


def planned(goal: str, objects: tuple[str, ...] = MILK, folder=None) -> list[str]:
    found, known = problem(goal, objects)
    facts = start_facts(known, found.scene, found.pool("held_out", 1), 0)
    plan = TaskPlanner(known, found.goal).plan(facts)
    if folder is not None:
        write_pddl(folder, found.name, facts, plan)
    return [str(step) for step in plan.steps]


def rung(goal: str, objects: tuple[str, ...]) -> SymbolicRung:
    found, known = problem(goal, objects)
    ((_, made),) = symbolic_episodes(known, found.scene, None, [0])
    return made


def done(made: SymbolicRung, *words: str) -> Outcome:
    made.begin(0, make_step(words[0], words[1:]))
    return made.advance()[0]


def amounts(made: SymbolicRung) -> tuple[float, float]:
    """Litres in all containers, and litres that left them."""
    _, states = made.state(0)
    return float(np.asarray(states.volume).sum()), float(np.asarray(states.lost).sum())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("goal", "last"),
    [
        ("(filled mug_0 milk)", "pour milk_0 mug_0 milk"),
        ("(contains mug_0 milk)", "pour milk_0 mug_0 milk"),
        ("(and (contains mug_0 milk) (filled mug_0 milk))", "pour milk_0 mug_0 milk"),
        ("(covered coffee_table_0 milk)", "pour milk_0 coffee_table_0 milk"),
        ("pour the milk into the mug", "pour milk_0 mug_0 milk"),
        ("pour the milk from the milk over the coffee table", "pour milk_0 coffee_table_0 milk"),
    ],
)
def test_what_a_carton_holds_is_poured_out_of_it(goal, last):
    assert planned(goal) == ["open fridge_0", "grasp milk_0", last]


@pytest.mark.slow
def test_water_comes_from_where_it_takes_fewest_steps():
    assert planned("(filled mug_0 water)", JUG) == ["grasp carafe_0", "pour carafe_0 mug_0 water"]
    assert planned("(filled mug_0 water)", ()) == ["toggle_on sink_0", "grasp mug_0", "fill mug_0 sink_0"]


def test_a_jug_is_filled_first_where_nothing_holds_the_water():
    steps = planned("(covered coffee_table_0 water)", ())
    assert [s.split()[0] for s in steps] == ["toggle_on", "grasp", "fill", "pour"]
    assert steps[-1].endswith(" coffee_table_0 water") and steps[1].split()[1] == steps[-1].split()[1]


def test_what_the_goal_wants_in_a_container_stays_there():
    objects = (*MILK, "substances:milk@bowl_0")
    steps = planned("(and (filled milk_0 milk) (filled mug_0 milk))", objects)
    assert steps[-1] == "pour bowl_0 mug_0 milk"


@pytest.mark.parametrize(
    ("goal", "objects", "said"),
    [
        ("(filled mug_0 milk)", ("substances:milk",), "no container that can be carried holds enough milk"),
        ("(covered sofa_0 mud)", ("substances:mud",), "no container holds it"),
        ("(covered sofa_0 dust)", MILK, "only take dust off"),
        ("(filled sofa_0 milk)", MILK, "'sofa_0' is no container"),
        ("(saturated coffee_table_0 milk)", MILK, "does not absorb"),
        ("(not (filled milk_0 milk))", MILK, "no primitive takes milk out of"),
    ],
)
def test_what_cannot_be_poured_is_refused_with_the_reason(goal, objects, said):
    with pytest.raises(PlanningError, match=said):
        planned(goal, objects)


def test_words_that_nothing_can_be_poured_for_say_so():
    with pytest.raises(NotUnderstoodError, match="mug_0 does not contain"):
        planned("pour the mug into the bowl")
    with pytest.raises(NotUnderstoodError, match="'into' or 'over'"):
        planned("pour the milk")


def test_states_are_set_and_litres_stay_the_same():
    made = rung("(and)", JUG)
    assert "no hand holds carafe_0" in done(made, "pour", "carafe_0", "mug_0", "water").detail
    assert done(made, "grasp", "carafe_0").done
    before = amounts(made)
    assert done(made, "pour", "carafe_0", "mug_0", "water").done
    assert made.facts(0).holds("filled", "mug_0", "water")
    assert amounts(made) == pytest.approx(before, abs=1e-6)
    assert done(made, "pour", "carafe_0", "coffee_table_0", "water").done
    assert made.facts(0).holds("covered", "coffee_table_0", "water")
    assert sum(amounts(made)) == pytest.approx(sum(before), abs=1e-6) and amounts(made)[1] > 0
    assert done(made, "grasp", "bowl_0").done
    assert "bowl_0 contains no water" in done(made, "pour", "bowl_0", "mug_0", "water").detail


@pytest.mark.slow
def test_its_motion_is_planned_on_the_kinematic_rung():
    found, known = problem("(and (filled mug_0 water) (covered coffee_table_0 water))", JUG)
    ((_, made),) = kinematic_episodes(known, found, None, [0])
    (result,) = solve(TaskPlanner(known, found.goal), made)
    assert result.success, [(str(r.step), r.outcome) for r in result.steps]


def test_an_exported_plan_has_the_action_and_what_the_jug_contains(tmp_path):
    planned("(filled mug_0 milk)", folder=tmp_path)
    assert "(:action pour" in (tmp_path / "domain.pddl").read_text()
    text = (tmp_path / "problem.pddl").read_text()
    assert "(contains milk_0 milk)" in text and "milk - substance" in text


def test_pages_requests_functions_and_ground_steps_have_it():
    found, known = problem("(filled mug_0 water)", JUG)
    asked = ("pour", "carafe_0", "mug_0", "water")
    assert offers(known, "mug_0", ("carafe_0",), {"carafe_0": ["water"]})["Pour water out of carafe_0"] == asked
    assert Step("pour", asked[1:]) in set(ground_steps(known, found))
    (schema,) = [t for t in tools(found.scene.tables, ["water"]) if t["function"]["name"] == "pour"]
    properties = schema["function"]["parameters"]["properties"]
    assert properties["substance"]["enum"] == ["water"] and "mug_0" in properties["target"]["enum"]
    source = RequestSource(
        known, (*known.tools[:1], *known.knives[:1], "apple_0", "fish_0", "spray", "spoon", "bulb", "lamp")
    )
    drawn = [source.draw("pour", np.random.default_rng(seed)) for seed in range(20)]
    assert {request.step.arguments[0] for request in drawn if request is not None} <= set(known.pourable)


def test_one_container_stays_as_full_as_all_do_together():
    """The host's figure for one container is that of the states, at every tilt and direction."""
    scene = ig2mj.load_scene("small_home", substances=["water"])
    simulation = ig2mj.Simulation(scene)
    found = simulation.state_model.substances
    assert found is not None
    containers: Containers = found.containers
    expected = np.asarray(containers.holds(simulation.view))[0]
    frames = np.asarray(simulation.view.body_quat)[0, containers.body]
    w, x, y, z = frames.T
    up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1)  # R^T z
    rows = range(len(containers.body))
    assert [containers.stays_in(r, up[r]) for r in rows] == pytest.approx(expected.tolist(), rel=1e-4)
    tipped = containers.stays_in(0, np.asarray(-containers.normal[0], float))
    assert tipped < 0.05 * containers.litres[0] < containers.stays_in(0, np.asarray(containers.normal[0], float))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["humanoid", "fetch"])
def test_a_robot_pours_a_mug_full_and_spills_nothing(robot):
    scene = ig2mj.load_scene("small_home", agents=[make_robot(robot).at(-1.0, 0.0, 0.0)], objects=JUG)
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    found = simulation.state_model.substances
    assert found is not None
    mug = found.containers.row_of(scene.object_index("mug_0"))
    for request in ("grasp carafe_0", "pour carafe_0 mug_0 water"):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"
    volume = np.asarray(simulation.states.volume)[0, mug, 0]
    assert FILLED * found.containers.litres[mug] < volume < found.containers.litres[mug]
    assert np.asarray(simulation.states.lost).sum() < 1e-3
    if robot == "humanoid":
        assert simulation.agent.do("pour", "carafe_0", "coffee_table_0", "water").done
        assert simulation.predicate("covered", "coffee_table_0", "water")
    else:
        with pytest.raises(UnsupportedPrimitive, match="has one hand"):
            simulation.agent.do("spray", "coffee_table_0", "carafe_0", "water")


@pytest.mark.slow
def test_a_towel_in_a_drawer_is_brought_out_and_soaked_though_it_lies_upside_down():
    scene = ig2mj.load_scene("small_home", agents=[make_robot("humanoid").at(-1.0, 0.0, 0.0)], objects=JUG)
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    for request in ("open bottom_cabinet_0", "grasp carafe_0", "pour carafe_0 dishtowel_0 water"):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"
    assert simulation.predicate("saturated", "dishtowel_0", "water")


@pytest.mark.parametrize("falls", [True, False])
def test_a_target_that_has_fallen_over_is_set_up_before_it_is_poured_into(monkeypatch, falls):
    class World(PlannedWorld):
        held = property(lambda self: ["bowl"])  # pyright: ignore
        facts = property(lambda self: None)  # pyright: ignore

    world = object.__new__(World)
    world.domain = SimpleNamespace(impossible=lambda wish: "")  # pyright: ignore
    lies, poured, righted = [True], [], []

    def set_upright(world, target):
        yield []
        righted.append(target)
        lies[0] = falls
        return not falls

    def hold_at(world, name, hand, left):
        yield []
        return "", [np.zeros(3)], left()[0].number

    def turned_over(world, step, hand, number):
        yield []
        poured.append(number)
        return ""

    changes = {
        "hand_with": lambda world, name: 0, "litres": lambda *_: 1.0, "set_upright": set_upright, "hold_at": hold_at,
        "_above": lambda *_: [] if lies[0] else [SimpleNamespace(number=0)], "_turned_over": turned_over,
        "_holds": lambda world, step: bool(poured), "carry": lambda *_: None,
    }  # fmt: skip
    for name, change in changes.items():
        monkeypatch.setattr(pouring, name, change)
    running = pouring.pour(world, Step("pour", ("bowl", "mug", "water")))
    with pytest.raises(StopIteration) as ended:
        while True:
            next(running)
    assert righted == ["mug"] and ended.value.value.done != falls and len(poured) == (not falls)
