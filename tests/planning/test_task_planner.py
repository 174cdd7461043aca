"""Plans of the task planner, in the tiny home of the tests, carried out as PDDL and on the symbolic rung."""

import collections
import dataclasses
import json

import numpy as np
import pytest
from planning_domain import World

from ig2mj.cli import call
from ig2mj.errors import UnknownNameError
from ig2mj.planning import Domain, PlanningError, SymbolicRung, TaskPlanner, make_step, solve, summary
from ig2mj.planning.facts import Facts
from ig2mj.planning.pddl import domain_pddl, problem_pddl
from ig2mj.planning.solver import _Episode
from ig2mj.planning.step_order import ordered, supports_first
from ig2mj.planning.steps import PRIMITIVES, Outcome, Step
from ig2mj.predicates.compile import compile_expression
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import read_conditions
from ig2mj.sampling.many import make_sampler
from ig2mj.states.model import StateModel


@pytest.fixture(scope="module")
def sampler(tiny_home):
    return make_sampler(tiny_home)


@pytest.fixture(scope="module")
def model(sampler) -> StateModel:
    return sampler.model


@pytest.fixture(scope="module")
def start(sampler):
    return sampler.start


def planner_of(model, goal, hands=2):
    return TaskPlanner(Domain(model, hands), compile_expression(model, goal, questions=HostQueries.of(model)))


def plan_of(sampler, start, goal, hands=2):
    planner = planner_of(sampler.model, goal, hands)
    facts = SymbolicRung(planner.domain, sampler, [start]).facts(0)
    return planner.plan(facts), facts


def steps_of(sampler, start, goal, hands=2):
    return [str(step) for step in plan_of(sampler, start, goal, hands)[0].steps]


def started(sampler, start, *conditions):
    """A start in which conditions hold."""
    sampler.start_from(*start)
    row = sampler.sample(read_conditions(conditions), np.random.default_rng(0), Budget(), collections.Counter())
    sampler.start_from(*start)
    return row.physics, row.states


GOAL = (
    "(and (inside apple cabinet) (not (open cabinet)) (not (stained pan)) (sliced apple) (toggled_on stove)"
    " (on_top pan table) (not (dusty book)))"
)


@pytest.fixture(scope="module")
def dirty(sampler, start):
    return started(sampler, start, "(stained pan)", "(dusty book)")


def test_a_plan_has_what_its_steps_need_before_them(sampler, dirty):
    steps = steps_of(sampler, dirty, GOAL)
    order = {step: k for k, step in enumerate(steps)}
    assert order["grasp knife"] < order["slice apple knife"] < order["grasp apple"]
    assert order["toggle_on sink"] < order["soak sponge sink"] < order["scrub pan sponge"]
    assert order["open cabinet"] < order["place_inside apple cabinet"] < order["close cabinet"] == len(steps) - 1
    assert "wipe book sponge" in order and "toggle_on stove" in order


@pytest.mark.parametrize("hands", [1, 2])
def test_a_plan_reaches_the_goal_by_the_rules_of_the_exported_pddl(sampler, dirty, hands):
    plan, facts = plan_of(sampler, dirty, GOAL, hands)
    world = World(domain_pddl(), problem_pddl("test", facts, plan))
    assert set(world.actions) == set(PRIMITIVES) - {"navigate_to"}
    assert not world.done()
    for step in plan.steps:
        assert world.act(step.primitive, step.arguments), f"{step} with {world.facts}"
    assert world.done()


def test_one_hand_puts_down_its_tool_before_it_takes_something_else(sampler, dirty):
    steps = steps_of(sampler, dirty, GOAL, hands=1)
    assert steps.index("release knife") < steps.index("grasp sponge") < steps.index("release sponge")


@pytest.mark.parametrize("hands", [1, 2])
def test_the_only_hand_puts_down_a_tool_to_turn_a_tap_on(sampler, dirty, hands):
    planner = planner_of(sampler.model, "(not (stained pan))", hands)
    facts = SymbolicRung(planner.domain, sampler, [dirty]).facts(0)
    facts.held = ["sponge"]
    steps = [str(step) for step in planner.plan(facts).steps]
    soaks = ["toggle_on sink", "soak sponge sink", "scrub pan sponge"]
    assert steps == (soaks if hands == 2 else ["release sponge", soaks[0], "grasp sponge", *soaks[1:]])


def test_the_only_hand_puts_down_what_it_switches_on(sampler, start):
    for hands, steps in ((1, ["release stove", "toggle_on stove"]), (2, ["toggle_on stove"])):
        planner = planner_of(sampler.model, "(toggled_on stove)", hands)
        facts = SymbolicRung(planner.domain, sampler, [start]).facts(0)
        facts.held = ("stove",)
        assert [str(step) for step in planner.plan(facts).steps] == steps


def test_the_only_hand_puts_what_must_not_be_on_the_floor_onto_a_support(sampler, start):
    planner = planner_of(sampler.model, "(and (not (on_floor ball kitchen_0)) (open cabinet))", hands=1)
    facts = SymbolicRung(planner.domain, sampler, [start]).facts(0)
    facts.held = ("ball",)
    put, opens = planner.plan(facts).steps
    assert put.primitive == "place_on_top" and put.object == "ball" and str(opens) == "open cabinet"
    gone = read_conditions(["(not (on_floor ball kitchen_0))"])[0]
    assert put.serves == gone
    assert str(planner.plan(facts, {gone: 6}).steps[0]) == "release ball"


def test_what_failed_in_the_present_world_comes_after_the_rest(sampler, start):
    planner = planner_of(sampler.model, "(and (inside apple cabinet) (inside ball cabinet))")
    facts = SymbolicRung(planner.domain, sampler, [start]).facts(0)
    first = planner.plan(facts).steps[0].serves
    again = planner.plan(facts, {first: 1}, None, {first})
    assert again.steps[0].serves != first and again.steps[-1].serves == first, again.steps


def test_what_lies_on_an_object_goes_along_on_the_symbolic_rung(sampler, start):
    loaded = started(sampler, start, "(on_top knife book)")
    planner = planner_of(sampler.model, "(on_top book stove)")
    rung = SymbolicRung(planner.domain, sampler, [loaded])
    before = rung.facts(0)
    assert before.holds("on_top", "knife", "book")
    (result,) = solve(planner, rung)
    after = rung.facts(0)
    assert result.success and after.holds("on_top", "knife", "book")
    moved = [after.place(name) - before.place(name) for name in ("knife", "book")]
    assert np.linalg.norm(moved[1]) > 0.2 and abs(moved[0][2] - moved[1][2]) < 0.01


def test_what_leans_against_another_object_does_not_go_along(sampler, start):
    loaded = started(sampler, start, "(on_top knife book)")
    facts = SymbolicRung(planner_of(sampler.model, "(on_top book stove)").domain, sampler, [loaded]).facts(0)
    assert [(a.predicate, *a.arguments) for a in facts.borne("book")] == [("on_top", "knife", "book")]
    touching = np.array(facts.view.touching)
    knife, table = facts.domain.index("knife"), facts.domain.index("table")
    touching[0, knife, table] = touching[0, table, knife] = True
    leaning = Facts(facts.domain, facts.states, dataclasses.replace(facts.view, touching=touching))
    assert leaning.borne("book") == ()


def test_a_support_on_which_something_did_not_stay_is_laid_flat_if_it_is_not(sampler, start):
    planner = planner_of(sampler.model, "(on_top knife book)")
    failed = {"place_on_top knife book": 1}
    lying = SymbolicRung(planner.domain, sampler, [start])
    assert not any(step.flat for step in planner.plan(lying.facts(0), failed_steps=failed).steps)
    sampler.query.load(start[0])
    index = planner.domain.index("book")
    pos = np.asarray(sampler.query.view.object_pos)[0, index] + [0.0, 0.0, 0.041]
    sampler.query.place(index, pos, np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]))
    assert sampler.query.settle()
    standing = SymbolicRung(planner.domain, sampler, [(sampler.query.save(), start[1])])
    assert not any(step.flat for step in planner.plan(standing.facts(0)).steps)
    steps = planner.plan(standing.facts(0), failed_steps=failed).steps
    (flat,) = [k for k, step in enumerate(steps) if step.flat]
    assert steps[flat].object == "book" and str(steps[flat + 1]) == "grasp knife"
    assert solve(planner, standing)[0].success


def test_a_partner_that_belongs_in_a_room_is_placed_there_again(sampler, start):
    room = sampler.model.tables.room_names[0]
    planner = planner_of(sampler.model, f"(and (on_floor ball {room}) (on_floor apple {room}) (next_to ball apple))")
    facts = SymbolicRung(planner.domain, sampler, [start]).facts(0)
    assert facts.containers(room) == ()
    near = next(c for c in planner.plan(facts).required if c.predicate == "next_to")
    steps = [str(step) for step in planner.plan(facts, {near: 2}).steps]
    assert sum(step.startswith("place_on_floor") and step.endswith(room) for step in steps) == 2, steps


@pytest.mark.slow
def test_halves_are_moved_after_a_cut(sampler, start):
    cut = started(sampler, start, "(sliced apple)")
    steps = steps_of(sampler, cut, "(on_top apple table)")
    moved = {s for s in steps if s.startswith("place")}
    assert moved <= {"place_on_top apple_half_0 table", "place_on_top apple_half_1 table"}


def test_what_a_plan_opens_or_switches_on_is_shut_and_switched_off_where_the_goal_says_so(sampler, dirty):
    goal = "(and (inside ball cabinet) (not (open cabinet)) (not (stained pan)) (not (toggled_on sink)))"
    steps = steps_of(sampler, dirty, goal)
    assert {"open cabinet", "toggle_on sink"} < set(steps)
    assert set(steps[-2:]) == {"close cabinet", "toggle_off sink"}


def test_what_holds_needs_no_step_and_a_disjunction_takes_what_is_cheaper(sampler, start):
    assert steps_of(sampler, start, "(not (open cabinet))") == []
    assert steps_of(sampler, start, "(or (and (open cabinet) (sliced apple)) (toggled_on sink))") == ["toggle_on sink"]


def test_failures_choose_another_object(sampler, start):
    planner = planner_of(sampler.model, "(or (inside ball cabinet) (inside can cabinet))")
    facts = SymbolicRung(planner.domain, sampler, [start]).facts(0)
    first = planner.plan(facts).missing[0]
    second = planner.plan(facts, {first: 1}).missing[0]
    assert {first.arguments[0], second.arguments[0]} == {"ball", "can"}


@pytest.mark.parametrize(
    ("goal", "telling"),
    [
        ("(on_top table cabinet)", "(on_top table cabinet) is false, and 'table' is fixed"),
        ("(frozen apple)", "(frozen apple) is false, and nothing in the scene is cold enough for 'apple'"),
        ("(dusty book)", "(dusty book) is false, and no primitive makes 'book' dusty"),
        ("(cooked ball)", "(cooked ball) is false, and 'ball' is not cookable"),
        ("(and (open cabinet) (not (open cabinet)))", "(open cabinet) would have to be both true and false"),
        ("(and (inside ball cabinet) (on_top ball stove))", "(on_top ball stove) cannot be true together"),
        ("(and (inside ball pan) (on_top pan ball))", "(on_top pan ball) cannot be true together"),
    ],
)
@pytest.mark.filterwarnings("ignore::ig2mj.predicates.AbilityWarning")
def test_a_goal_that_cannot_be_is_refused_with_the_literal_and_why(sampler, start, goal, telling):
    with pytest.raises(PlanningError, match="cannot become true") as error:
        plan_of(sampler, start, goal)
    assert telling in str(error.value)


def test_a_robot_without_hands_and_requests_that_are_none_are_refused(model):
    with pytest.raises(PlanningError, match="without hands"):
        planner_of(model, "(open cabinet)", hands=0)
    with pytest.raises(UnknownNameError, match="near matches: grasp"):
        make_step("grsp", ["apple"])
    with pytest.raises(PlanningError, match="place_inside' takes object and container, not 1 argument"):
        make_step("place_inside", ["apple"])


@pytest.mark.slow
def test_the_symbolic_rung_reaches_a_goal_in_two_worlds_that_then_differ(sampler, dirty, start):
    planner = planner_of(sampler.model, GOAL)
    results = solve(planner, SymbolicRung(planner.domain, sampler, [dirty, start], seed=3))
    assert [r.success for r in results] == [True, True] and [r.q for r in results] == [1.0, 1.0]
    assert len(results[1].steps) < len(results[0].steps)
    figures = summary(results, 1.0)
    assert figures["success_rate"] == 1.0 and figures["episodes"] == 2 and figures["failures"] == {}


def test_the_symbolic_rung_checks_what_a_primitive_needs(sampler, dirty):
    domain = Domain(sampler.model, 1)

    def outcome(*steps):
        rung = SymbolicRung(domain, sampler, [dirty])
        found = []
        for primitive, *arguments in steps:
            rung.begin(0, make_step(primitive, arguments))
            found.append(rung.advance()[0])
        return found[-1]

    assert outcome(["grasp", "apple"]).done
    assert "no hand holds apple" in outcome(["place_on_top", "apple", "table"]).detail
    assert "hands are full: ball" in outcome(["grasp", "ball"], ["grasp", "apple"]).detail
    assert "hands are full" in outcome(["grasp", "ball"], ["open", "cabinet"]).detail
    assert "cabinet is not open" in outcome(["grasp", "ball"], ["place_inside", "ball", "cabinet"]).detail
    assert "sponge is not soaked" in outcome(["grasp", "sponge"], ["scrub", "pan", "sponge"]).detail
    assert "sink is not toggled on" in outcome(["grasp", "sponge"], ["soak", "sponge", "sink"]).detail
    assert "stove is not toggled on" in outcome(["grasp", "apple"], ["cook", "apple", "stove"]).detail


@pytest.mark.slow
def test_an_episode_that_fails_ends_with_the_reason_and_its_partial_credit(sampler, start):
    planner = planner_of(sampler.model, "(and (toggled_on stove) (inside rod pan))")
    result = solve(planner, SymbolicRung(planner.domain, sampler, [start]))[0]
    assert not result.success and result.q == 0.5
    assert "(inside rod pan) failed 6 times" in result.ended
    failures = summary([result], 0.0)["failures"]  # between them the pan is brought out onto the floor
    assert failures == {"place_inside": {"not_true_after": 4}, "place_on_floor": {"not_true_after": 2}}


@pytest.mark.slow
def test_commands_print_the_plan_and_solve_it(tiny_home_folder, tmp_path, capsys):
    goal = "(and (on_top ball table) (open cabinet))"
    assert call(["plan", str(tiny_home_folder), goal, "--json", "--pddl", str(tmp_path / "pddl")]) == 0
    steps = json.loads(capsys.readouterr().out)["steps"]
    assert [s["primitive"] for s in steps] == ["open", "grasp", "place_on_top"]
    assert "(on_top ball table)" in (tmp_path / "pddl" / "problem.pddl").read_text()
    results = tmp_path / "results.jsonl"
    command = ["solve", str(tiny_home_folder), goal, "--episodes", "2", "--out", str(results), "--rung", "symbolic"]
    assert call([*command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["success_rate"] == 1.0
    lines = results.read_text()
    assert call(command) == 0 and results.read_text() == lines  # nothing is repeated
    assert "2 of 2 episodes reach the goal" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "telling"),
    [
        (["plan", "storing_foot"], "near matches: storing_food"),
        (["plan", "HOME"], "is a scene: give a goal"),
        (["plan", "HOME", "(inside aple box)"], "no object is named 'aple'; near matches: apple"),
        (["plan", "HOME", "(inside ball box)", "--robot", "turtlebot"], "without hands"),
        (["solve", "HOME", "(inside ball box)", "--episodes", "0"], "--episodes 0"),
        (["solve", "PointNavigation"], "PointNavigation has no goal expression"),
        (["plan", "storing_food", "--object", "cup"], "an activity has its own objects"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(tiny_home_folder, arguments, telling, capsys):
    assert call([str(tiny_home_folder) if a == "HOME" else a for a in arguments]) == 2
    said = capsys.readouterr().err
    assert telling in said and said.count("\n") == 1


def test_large_things_are_put_into_a_container_before_small_ones(sampler, start):
    steps = steps_of(sampler, start, "(and (inside knife cabinet) (inside box cabinet) (inside ball cabinet))")
    placed = [s.split()[1] for s in steps if s.startswith("place_inside")]
    volumes = [Domain(sampler.model).volume(name) for name in placed]
    assert len(placed) == 3 and volumes == sorted(volumes, reverse=True)


def test_what_was_taken_for_a_condition_is_first_put_where_that_becomes_true(model):
    floor, beside = read_conditions(["(on_floor book kitchen_0)", "(next_to book box)"])
    domain = Domain(model, 2)

    def first(held, begun):
        return ordered([floor, beside], {}, held, lambda c: "", domain, begun)[0]

    assert first(["book"], beside) == beside
    assert first(["book"], None) == floor
    assert first([], beside) == floor


def test_of_doors_between_rooms_those_that_are_least_open_are_shut_first(model):
    conditions = read_conditions(["(not (open cabinet))", "(not (open box))", "(not (open fridge))"])
    share = {"cabinet": 0.9, "box": 0.1, "fridge": 0.5}.__getitem__
    order = ordered(conditions, {}, [], lambda c: "", Domain(model, 2), ajar=share)
    assert [c.arguments[0] for c in order] == ["box", "fridge", "cabinet"]


def test_what_is_next_to_a_container_comes_after_what_goes_into_it():
    texts = ["(next_to book bag)", "(inside pen bag)", "(on_top bag bed)", "(next_to bag lamp)"]
    order = [str(c) for c in supports_first(read_conditions(texts))]
    assert order == ["(on_top bag bed)", "(next_to bag lamp)", "(inside pen bag)", "(next_to book bag)"]


@pytest.mark.parametrize(("step", "serves", "counts"), [
    (("place_on_floor", ("pan", "kitchen_0")), "(inside apple pan)", 1),
    (("place_on_floor", ("pan", "kitchen_0")), "(on_floor pan kitchen_0)", 0),
    (("place_inside", ("apple", "pan")), "(inside apple pan)", 0),
])  # fmt: skip
def test_a_container_is_not_brought_out_again_and_again(step, serves, counts):
    (condition,) = read_conditions([serves])
    episode = _Episode({}, 0.0)
    for _ in range(3):
        episode.learn(Step(*step, (), condition), Outcome())
    assert sum(episode.failed_steps.values()) == 3 * counts and not episode.failed


def test_what_had_no_place_in_a_container_is_put_there_where_that_is_now():
    episode = _Episode({}, 0.0)
    for words in ("place_inside apple pan", "place_inside apple box", "grasp pan"):
        primitive, *arguments = words.split()
        episode.learn(Step(primitive, tuple(arguments)), Outcome("no_path"))
    episode.learn(Step("place_on_top", ("pan", "stove")), Outcome())
    assert dict(episode.failed_steps) == {"place_inside apple box": 1, "grasp pan": 1}


def test_a_container_that_is_carried_out_of_a_narrow_place_is_put_on_the_floor_not_released_where_it_was(
    sampler, start
):
    planner = planner_of(sampler.model, "(inside apple pan)")
    facts = SymbolicRung(planner.domain, sampler, [start]).facts(0)
    failed, room = {"place_inside apple pan": 1}, facts.room("pan")
    taken_out = ["grasp pan", f"place_on_floor pan {room}", "grasp apple", "place_inside apple pan"]
    assert [str(s) for s in planner.plan(facts, failed_steps=failed).steps] == taken_out
    other = {"place_inside ball pan": 1}  # where something else had no place
    assert [str(s) for s in planner.plan(facts, failed_steps=other).steps] == taken_out
    facts.held = ["pan"]
    assert [str(s) for s in planner.plan(facts, failed_steps=failed).steps] == taken_out[1:]
    steps = planner.plan(facts, failed_steps={**failed, f"place_on_floor pan {room}": 3}).steps
    assert [s.primitive for s in steps] == ["place_on_top", "grasp", "place_inside"] and steps[0].object == "pan"
