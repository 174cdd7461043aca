"""Activities bound to homes, and compiled to goals."""

import numpy as np
import pytest

from ig2mj.predicates import logic
from ig2mj.scene.manifest import (
    FORMAT_VERSION,
    Manifest,
    ObjectEntry,
    OpenableEntry,
    PartEntry,
    RoomEntry,
    RoomsEntry,
    load_manifest,
)
from ig2mj.scene.paths import SHIPPED_HOMES
from ig2mj.scene.scene import load_scene
from ig2mj.simulation import Simulation
from ig2mj.tasks.bddl.bare_floor import on_carpets
from ig2mj.tasks.bddl.binding import BindingError, bind
from ig2mj.tasks.bddl.definitions import load_activity
from ig2mj.tasks.bddl.goal import conditions
from ig2mj.tasks.bddl.matching import clusters_of, match, search_rooms
from ig2mj.tasks.bddl.problem import parse_problem
from ig2mj.tasks.bddl.vocabulary import lower


def activity(objects: str, init: str = "", goal: str = "(and)"):
    text = f"(define (problem a-0) (:domain igibson) (:objects {objects}) (:init {init}) (:goal {goal}))"
    return lower(parse_problem(text), "a")


def entry(name: str, *rooms: str, fixed: bool = True, **fields) -> ObjectEntry:
    category = name.rpartition("_")[0]
    return ObjectEntry(name, category, f"{category}_00", [name], fixed, (1, 1, 1), 1.0, rooms=list(rooms), **fields)


def home(*objects: ObjectEntry, rooms=("kitchen_0", "bedroom_0", "bedroom_1")) -> Manifest:
    instances = {name: RoomEntry(type=name.rpartition("_")[0]) for name in rooms}
    return Manifest(
        FORMAT_VERSION, "made", [entry("floors_0"), *objects], rooms=RoomsEntry(file=None, instances=instances)
    )


BEDS = "bed.n.01_1 bed.n.01_2 - bed.n.01 "
IN_BEDROOMS = "(inroom bed.n.01_1 bedroom) (inroom bed.n.01_2 bedroom)"


def test_objects_of_one_kind_of_room_are_in_one_room_if_that_is_possible():
    beds = [entry("bed_0", "bedroom_0"), entry("bed_1", "bedroom_1"), entry("bed_2", "bedroom_1")]
    bound = bind(activity(BEDS, IN_BEDROOMS), home(*beds))
    assert set(bound.rooms.values()) == {"bedroom_1"}
    assert set(bound.objects.values()) == {"bed_1", "bed_2"}


def test_else_they_are_in_several_rooms():
    beds = [entry("bed_0", "bedroom_0"), entry("bed_1", "bedroom_1")]
    bound = bind(activity(BEDS, IN_BEDROOMS), home(*beds))
    assert bound.objects == {"bed.n.01_1": "bed_0", "bed.n.01_2": "bed_1"}


def test_what_the_start_relates_is_in_one_room():
    beds = [entry("bed_0", "bedroom_0"), entry("bed_1", "bedroom_1")]
    related = activity(BEDS, IN_BEDROOMS + "(nextto bed.n.01_1 bed.n.01_2)")
    with pytest.raises(BindingError, match=r"bedroom_0 lacks 1 bed.n.01"):
        bind(related, home(*beds))


def test_two_floors_of_one_kind_are_two_rooms():
    floors = activity(
        "floor.n.01_1 floor.n.01_2 - floor.n.01", "(inroom floor.n.01_1 bedroom) (inroom floor.n.01_2 bedroom)"
    )
    bound = bind(floors, home())
    assert bound.rooms == {"floor.n.01_1": "bedroom_0", "floor.n.01_2": "bedroom_1"}
    assert set(bound.objects.values()) == {"floors_0"}
    with pytest.raises(BindingError, match=r"lacks 1 floor.n.01"):
        bind(floors, home(rooms=("bedroom_0",)))


def test_synsets_are_bound_with_their_descendants_and_scarce_ones_first():
    fruit = activity("food.n.02_1 - food.n.02 apple.n.01_1 - apple.n.01")
    apple, fish = entry("apple_0", fixed=False), entry("fish_0", fixed=False)
    assert bind(fruit, home(apple, fish)).objects == {"food.n.02_1": "fish_0", "apple.n.01_1": "apple_0"}


def test_what_the_home_lacks_is_added_and_numbered_on():
    apples = activity("apple.n.01_1 apple.n.01_2 apple.n.01_3 - apple.n.01")
    bound = bind(apples, home(entry("apple_0", fixed=False)))
    assert bound.additions == ("apple/apple_00", "apple/apple_00")
    assert list(bound.objects.values()) == ["apple_0", "apple_1", "apple_2"]


def test_additions_of_a_general_synset_differ():
    bound = bind(activity("meat.n.01_1 meat.n.01_2 meat.n.01_3 - meat.n.01"), home())
    assert len(set(bound.additions)) == 3


def test_halves_are_never_taken_for_a_whole():
    half = entry("apple_0_part_0", fixed=False, part_of="apple_0")
    half.category = "apple"
    bound = bind(activity("apple.n.01_1 - apple.n.01"), home(half))
    assert bound.additions == ("apple/apple_00",)


def test_an_object_must_be_able_to_do_what_the_activity_wants():
    shut = entry("jar_0", fixed=False)
    opened = entry("jar_1", fixed=False, abilities={"openable": {}}, openable=[OpenableEntry("jar_1_lid", 0.0, 1.0)])
    jar = activity("jar.n.01_1 - jar.n.01", goal="(open jar.n.01_1)")
    assert jar.needs == {"jar.n.01_1": {"open"}}
    assert bind(jar, home(shut, opened)).objects == {"jar.n.01_1": "jar_1"}
    assert bind(jar, home(shut)).additions == ("jar/articulated_jar_00",)
    unwanted = activity("jar.n.01_1 - jar.n.01", goal="(not (open jar.n.01_1))")
    assert bind(unwanted, home(shut)).objects == {"jar.n.01_1": "jar_0"}


def test_halves_to_come_are_the_parts_of_the_object_bound():
    text = """(define (problem a-0) (:domain omnigibson)
        (:objects apple.n.01_1 - apple.n.01 half__apple.n.01_1 half__apple.n.01_2 - half__apple.n.01)
        (:init (future half__apple.n.01_1) (future half__apple.n.01_2))
        (:goal (cooked half__apple.n.01_2)))"""
    cut = lower(parse_problem(text), "a")
    parts = [PartEntry(f"apple_3_part_{n}", (0, 0, 0), (1, 0, 0, 0)) for n in (0, 1)]
    whole = entry("apple_3", fixed=False, abilities={"sliceable": {}}, parts=parts)
    # A synset of ours: nothing of BEHAVIOR-1K's taxonomy is looked up.
    assert bind(cut, home(whole)).objects["half__apple.n.01_2"] == "apple_3_part_1"
    assert bind(cut, home()).objects["half__apple.n.01_2"] == "apple_0_part_1"


def test_reasons_name_everything_that_is_missing():
    lacking = activity(
        "electric_refrigerator.n.01_1 electric_refrigerator.n.01_2 - electric_refrigerator.n.01 "
        "shelf.n.01_1 - shelf.n.01 bathtub.n.01_1 - bathtub.n.01",
        "(inroom electric_refrigerator.n.01_1 kitchen) (inroom electric_refrigerator.n.01_2 kitchen)"
        "(inroom shelf.n.01_1 garage)",
    )
    with pytest.raises(BindingError) as caught:
        bind(lacking, home(entry("fridge_0", "kitchen_0")))
    assert caught.value.reasons == (
        "kitchen_0 lacks 1 electric_refrigerator.n.01 (fridge)",
        "has no garage",
        "the home lacks 1 bathtub.n.01",
    )


def test_matching_finds_the_largest_assignment():
    assert match({"a": ["x", "y"], "b": ["x"], "c": ["y", "z"]}) == {"a": "y", "b": "x", "c": "z"}
    assert match({"a": ["x"], "b": ["x"]}) == {"a": "x"}


def test_clusters_are_what_pairs_join():
    assert clusters_of(["a", "b", "c", "d"], [("a", "c"), ("c", "x")]) == [["a", "c"], ["b"], ["d"]]


def test_few_rooms_come_before_few_additions():
    cost = {("r", 1): 0, ("r", 2): 1, ("s", 1): 0, ("s", 2): 3}

    def fits(given):
        return sum(cost[room, len(names)] for room, names in given.items())

    assert search_rooms([["a"], ["b"]], ["s", "r"], fits) == {"r": ["a", "b"]}
    assert search_rooms([["a"]], ["s"], lambda given: None if given else 0) is None


@pytest.fixture(scope="module")
def windows():
    """BEHAVIOR-100's cleaning_windows in the small home."""
    bound = bind(load_activity("cleaning_windows"), load_manifest(SHIPPED_HOMES / "small_home"))
    return bound, Simulation(load_scene("small_home", objects=bound.additions))


def test_the_names_of_a_binding_are_those_of_the_loaded_scene(windows):
    bound, sim = windows
    assert set(bound.objects.values()) <= set(sim.scene.object_names)
    assert tuple(f"{a.category}/{a.model}" for a in sim.scene.additions) == bound.additions


def test_a_goal_says_whether_how_far_and_what_is_missing(windows):
    bound, sim = windows
    found = conditions(bound)
    goal = found.compile_goal(sim.state_model)
    rags = [bound.objects[f"rag.n.01_{n}"] for n in (1, 2)]
    panes = [bound.objects[f"window.n.01_{n}"] for n in (1, 2)]
    for pane in panes:
        sim.set_state("dusty", pane, True)
    assert not bool(goal(sim.world)[0])
    assert "does not hold" in goal.explain(sim.world) and rags[0] in goal.explain(sim.world)
    before = float(goal.fraction(sim.world)[0])
    sim.set_state("dusty", panes[0], False)
    assert before < float(goal.fraction(sim.world)[0]) < 1
    sim.set_state("dusty", panes[1], False)
    for rag in rags:
        sim.set_state("soaked", rag, True)
    assert bool(goal(sim.world)[0])
    assert np.isclose(float(goal.fraction(sim.world)[0]), 1)


def test_conditions_of_the_start_speak_of_rooms_and_leave_absent_agents_out(windows):
    bound, sim = windows
    found = conditions(bound)
    assert [logic.text(c) for c in found.left_out] == ["(on_floor agent.n.01_1 floor.n.01_1)"]
    assert len(found.init) + 1 == len(bound.activity.init)
    found.compile_init(sim.state_model)
    carpets = bind(load_activity("bringing_in_wood"), load_manifest(SHIPPED_HOMES / "small_home"))
    assert any("_0)" in logic.text(c) and "on_floor" in logic.text(c) for c in conditions(carpets).init)
    with_agent = bind(load_activity("cleaning_windows"), load_manifest(SHIPPED_HOMES / "small_home"), ["robot"])
    assert not conditions(with_agent).left_out
    assert any(logic.text(c) == "(on_floor robot kitchen_0)" for c in conditions(with_agent).init)


def test_a_tool_that_the_goal_takes_and_the_home_lacks_is_added_and_lies_on_a_floor_with_water():
    meal = load_activity("cleaning_up_after_a_meal")
    bound = bind(meal, load_manifest(SHIPPED_HOMES / "linden"))
    assert bound.tools == {"rag_0": "kitchen_0"}
    assert bound.additions[-1] == "rag/rag_00" and "rag_0" not in bound.objects.values()
    assert bind(meal, load_manifest(SHIPPED_HOMES / "maple")).tools == {}, "maple has a tool"


def test_what_is_to_lie_on_the_floor_under_a_table_gets_one_that_stands_on_no_carpet():
    assert "coffee_table_0" in on_carpets("maple") and "console_table_0" not in on_carpets("maple")
    assert not on_carpets("no_such_home")
    shoes = "gym_shoe.n.01_1 - gym_shoe.n.01 table.n.02_1 - table.n.02 floor.n.01_1 - floor.n.01"
    rooms = "(inroom table.n.02_1 living_room) (inroom floor.n.01_1 living_room)"
    under, floor = "(under gym_shoe.n.01_1 table.n.02_1)", "(onfloor gym_shoe.n.01_1 floor.n.01_1)"
    maple = load_manifest(SHIPPED_HOMES / "maple")
    for goal, table in ((f"(and {under} {floor})", "console_table_0"), (f"(and {under})", "coffee_table_0")):
        binding = bind(activity(shoes, rooms, goal), maple)
        assert binding.objects["table.n.02_1"] == table
