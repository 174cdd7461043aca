"""Requests that are drawn to measure primitives, and the figures that are made of their results."""

import json

import numpy as np
import pytest

from ig2mj.cli import call
from ig2mj.cli.common.plan_benchmark import figure_cells, primitive_figures
from ig2mj.planning.domain import Domain
from ig2mj.planning.requests import MEASURED, RequestSource
from ig2mj.simulation.requests import RequestBench
from ig2mj.states.model import StateModel


@pytest.fixture(scope="module")
def source(tiny_home):
    domain = Domain(StateModel.of_manifest(tiny_home.tables, tiny_home.manifest))
    return RequestSource(domain, (*domain.tools[:1], *domain.knives[:1], "apple", "apple"))


def drawn(source, primitive, count=30):
    rng = np.random.default_rng(0)
    return [r for _ in range(count) if (r := source.draw(primitive, rng)) is not None]


@pytest.mark.parametrize(
    "primitive", [p for p in MEASURED if p not in ("freeze", "fill", "pour", "spray", "attach", "mix")]
)
def test_requests_are_the_same_for_a_seed_and_name_things_of_the_right_kind(source, primitive):
    found = drawn(source, primitive)
    assert found and found == drawn(source, primitive)
    assert all(r.step.primitive == primitive for r in found)


def test_what_must_hold_first_is_part_of_a_request(source):
    for request in drawn(source, "scrub"):
        name, tool = request.step.arguments
        assert {"stained", "soaked"} <= {c.predicate for c in request.before} and request.taken == (tool,)
        assert any(c.predicate == "stained" and c.arguments == (name,) and c.value for c in request.before)
    assert all(not c.value for r in drawn(source, "open") for c in r.before)
    assert all(c.value for r in drawn(source, "close") for c in r.before)


def test_shares_are_of_requests_that_are_prepared_and_have_a_solution():
    common = {"primitive": "open", "prepared": True, "solution": True, "attempts": 1, "planning": 0.1, "reason": ""}
    rows = [common, {**common, "attempts": 3, "planning": 0.5}, {**common, "reason": "no_path"}]
    rows += [{**common, "solution": False, "reason": "no_base"}, {**common, "prepared": False}]
    found = primitive_figures(rows, "open")
    assert (found["asked"], found["prepared"], found["feasible"]) == (5, 4, 3)
    assert (found["first_try"], found["with_retries"], found["failures"]) == (1, 2, {"no_path": 1})
    assert figure_cells("open", found)[3:6] == ("75.0 %", "33.3 %", "66.7 %")
    assert primitive_figures(rows, "close") == {}


@pytest.mark.parametrize(
    ("arguments", "telling"),
    [
        (["--requests", "0"], "--requests 0: at least one"),
        (["--primitives", "opn"], "near matches: open"),
        (["--seconds", "0"], "must be above 0"),
        (["making_tea"], "draws its own requests"),
    ],
)
def test_bad_options_of_a_benchmark_are_refused_at_once(arguments, telling, capsys):
    assert call(["plan", *arguments, "--benchmark"]) == 2
    assert telling in capsys.readouterr().err


def test_a_plan_needs_something_to_plan_for(capsys):
    assert call(["plan"]) == 2
    assert "name an activity" in capsys.readouterr().err


def test_results_of_something_else_are_refused(tmp_path, capsys):
    file = tmp_path / "rows.jsonl"
    file.write_text(json.dumps({"a": 1}) + "\n")
    assert call(["plan", "--benchmark", "--out", str(file)]) == 2
    assert "is not a result of a request" in capsys.readouterr().err


@pytest.mark.slow
def test_requests_are_carried_out_on_the_kinematic_rung():
    bench = RequestBench("small_home", "kinematic")
    row = bench.run("open", 0)
    assert row["prepared"] and row["solution"] and row["reason"] == "" and row["planning"] > 0
