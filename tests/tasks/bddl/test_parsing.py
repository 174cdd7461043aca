"""BDDL definitions: what they mean, and errors that name line and word."""

import sys

import pytest
from bddl_package import compare, package_says

from ig2mj.errors import InputError
from ig2mj.predicates import logic
from ig2mj.tasks.bddl.definitions import activity_names, read_problem
from ig2mj.tasks.bddl.problem import parse_problem
from ig2mj.tasks.bddl.syntax import BddlError

SMALL = """(define (problem washing-0)
    (:domain igibson)
    (:objects
        plate.n.04_1 plate.n.04_2 - plate.n.04
        sink.n.01_1 - sink.n.01   ; one sink
        rag.n.01_1 - rag.n.01)
    (:init
        (stained plate.n.04_1)
        (not (soaked rag.n.01_1))
        (inroom sink.n.01_1 kitchen))
    (:goal
        (and
            (forall (?plate.n.04 - plate.n.04) (not (stained ?plate.n.04)))
            (inside ?plate.n.04_1 ?sink.n.01_1))))
"""


def test_all_100_definitions_of_behavior_100_read_as_bddl_reads_them():
    names = activity_names()
    assert len(names) == 100
    compare(names, package_says(sys.executable, "", "igibson", names), behavior_1k=False)


def test_a_definition_becomes_expressions_over_its_own_names():
    problem = parse_problem(SMALL)
    assert problem.name == "washing-0" and problem.domain == "igibson"
    assert problem.objects["plate.n.04"] == ("plate.n.04_1", "plate.n.04_2")
    assert problem.rooms == {"sink.n.01_1": "kitchen"}
    assert problem.init == (logic.atom("stained", "plate.n.04_1"), ~logic.atom("soaked", "rag.n.01_1"))
    assert problem.goal == (
        logic.ForAll("?plate.n.04", "plate.n.04", ~logic.atom("stained", "?plate.n.04")),
        logic.atom("inside", "plate.n.04_1", "sink.n.01_1"),
    )


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        ("(imply (stained plate.n.04_1) (soaked rag.n.01_1))", "(or (not (stained plate.n.04_1)) (soaked rag.n.01_1))"),
        ("(exists (?p - plate.n.04) (dusty ?p))", "(exists (?p - plate.n.04) (dusty ?p))"),
        ("(forn (1) (?p - plate.n.04) (dusty ?p))", "(forn 1 (?p - plate.n.04) (dusty ?p))"),
        (
            "(forpairs (?p - plate.n.04) (?r - rag.n.01) (ontop ?p ?r))",
            "(forpairs (?p - plate.n.04) (?r - rag.n.01) (ontop ?p ?r))",
        ),
        (
            "(fornpairs (1) (?p - plate.n.04) (?r - rag.n.01) (ontop ?p ?r))",
            "(fornpairs 1 (?p - plate.n.04) (?r - rag.n.01) (ontop ?p ?r))",
        ),
    ],
)
def test_the_forms_of_goals(goal, expected):
    head, _ = SMALL.split("(:goal")
    problem = parse_problem(f"{head}(:goal {goal}))")
    assert logic.text(problem.goal[0]) == expected


@pytest.mark.parametrize(
    ("old", "new", "line", "word", "telling"),
    [
        (
            "(stained plate.n.04_1)",
            "(stained plate.n.04_9)",
            8,
            "plate.n.04_9",
            "is not an object of :objects; near matches",
        ),
        ("(stained plate.n.04_1)", "(staned plate.n.04_1)", 8, "staned", "is not a predicate .* near matches: stained"),
        ("(stained plate.n.04_1)", "(stained plate.n.04_1 rag.n.01_1)", 8, r"\(stained", "takes 1 arguments, has 2"),
        ("(stained plate.n.04_1)", "(stained (dusty plate.n.04_1))", 8, r"\(dusty", "is not an object"),
        ("(stained plate.n.04_1)", "(stained plate.n.04_1", 1, r"\(", "is never closed"),
        ("?sink.n.01_1))))", "?sink.n.01_1)))))", 14, r"\)", "is after the end"),
        ("(not (stained ?plate.n.04))", "(not (stained ?dish))", 13, r"\?dish", "is not a variable of a quantifier"),
        ("(?plate.n.04 - plate.n.04)", "(?plate.n.04 - dish.n.01)", 13, "dish.n.01", "is not a synset of :objects"),
        ("(?plate.n.04 - plate.n.04)", "(plate.n.04 - plate.n.04)", 13, r"\(plate.n.04", "is not a variable"),
        ("(forall", "(forall (stained plate.n.04_1)", 13, r"\(forall", "has 3 parts"),
        (":domain igibson", ":domain gibson", 2, r"\(:domain", "is not a known domain"),
        ("(:init", "(:inti", 7, ":inti", "is not a section; near matches: :init"),
        ("plate.n.04_2 -", "plate.n.04_1 -", 4, "plate.n.04_1", "is declared twice"),
        ("- rag.n.01)", ")", 6, "rag.n.01_1", "has no synset"),
        ("- sink.n.01", "- - sink.n.01", 5, "-", "is not followed by a synset"),
        ("(define", "(defined", 1, r"\(defined", r"begins with \(define"),
        ("(:goal\n", "(:goal (dusty rag.n.01_1)\n", 11, r"\(:goal", "takes one condition"),
        ("(inside ?plate", "(inroom ?plate", 14, "inroom", "is allowed in :init only"),
    ],
)
def test_errors_name_line_and_word(old, new, line, word, telling):
    assert old in SMALL
    with pytest.raises(BddlError, match=rf"kitchen.bddl: line {line}: '{word}': .*{telling}"):
        parse_problem(SMALL.replace(old, new, 1), "kitchen.bddl")


@pytest.mark.parametrize("text", ["", "; nothing", "define"])
def test_text_that_is_no_definition(text):
    with pytest.raises(BddlError, match="begins with"):
        parse_problem(text)


def test_deep_nesting_is_refused_instead_of_overflowing_the_stack():
    with pytest.raises(BddlError, match="nested deeper"):
        parse_problem("(" * 5000 + ")" * 5000)


def test_more_objects_than_any_activity_has_are_refused_before_they_are_bound(tmp_path):
    file = tmp_path / "many.bddl"
    names = " ".join(f"apple.n.01_{n}" for n in range(1, 2001))
    file.write_text(
        f"(define (problem many_0) (:domain igibson) (:objects {names} - apple.n.01)\n"
        "(:init (cooked apple.n.01_1)) (:goal (and (cooked ?apple.n.01_1))))"
    )
    with pytest.raises(InputError, match=r"many.bddl: :objects: names 2000 objects, .*IG2MJ_LIMIT_BDDL_OBJECTS"):
        read_problem(file)
