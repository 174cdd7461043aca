"""Containers are filled with water below a tap: what is planned, and what is refused."""

from __future__ import annotations

import pytest

from ig2mj.cli.common.planning import domain_of, expression_of
from ig2mj.planning.problem import problem_of
from ig2mj.planning.steps import PlanningError
from ig2mj.planning.symbolic import start_facts
from ig2mj.planning.task_planner import TaskPlanner


def planned(goal: str) -> list[str]:
    problem = problem_of("small_home", expression_of("small_home", goal, (), "humanoid"), ())
    domain = domain_of(problem, "humanoid")
    facts = start_facts(domain, problem.scene, problem.pool("held_out", 1), 0)
    return [step.primitive for step in TaskPlanner(domain, problem.goal).plan(facts).steps]


def test_a_bowl_is_filled_below_a_tap_that_runs():
    assert planned("(filled bowl_0 water)") == ["toggle_on", "grasp", "fill"]


def test_what_no_primitive_fills_is_refused_with_the_reason():
    with pytest.raises(PlanningError, match="with water only"):
        planned("(filled bowl_0 milk)")
