"""Requests that are drawn to measure primitives, and the figures that are made of their results."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from ig2mj.cli import call
from ig2mj.cli.common.plan_benchmark import _jobs, figure_cells, primitive_figures
from ig2mj.knowledge.substances import WATER
from ig2mj.planning.domain import Domain
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.requests import MEASURED, Request, RequestSource, added_to
from ig2mj.planning.steps import Outcome, Step
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.many import make_sampler
from ig2mj.scene.scene import load_scene
from ig2mj.simulation import requests
from ig2mj.simulation.requests import RequestBench
from ig2mj.states.model import StateModel


@pytest.fixture(scope="module")
def source(tiny_home):
    domain = Domain(StateModel.of_manifest(tiny_home.tables, tiny_home.manifest))
    return RequestSource(
        domain, (*domain.tools[:1], *domain.knives[:1], "apple", "apple", "spray", "spoon", "bulb", "lamp")
    )


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


@pytest.fixture(scope="module")
def kitted():
    """Requests in a home with what is added to it."""
    own = load_scene("small_home").object_names
    scene = load_scene("small_home", objects=added_to(own))
    domain = Domain(make_sampler(scene).model)
    wholes = np.flatnonzero(scene.tables.object_part_of < 0)
    names = [n for o in wholes if (n := scene.tables.object_names[o]) not in own]
    return RequestSource(domain, names)


def test_every_home_has_something_to_spray_with_and_something_to_attach(kitted):
    sprays, attached = drawn(kitted, "spray"), drawn(kitted, "attach")
    assert len(sprays) == len(attached) == 30
    for request in sprays:
        spray = request.step.arguments[1]
        assert request.taken == (spray,) and Condition("filled", (spray, WATER)) in request.before
    for request in attached:
        bulb, lamp = request.step.arguments
        placed = {c.arguments[0] for c in request.before if c.is_placement}
        assert request.taken == (bulb,) and placed == {bulb, lamp}


def test_every_home_has_a_spoon_and_what_is_stirred(kitted):
    found = drawn(kitted, "mix")
    assert len(found) == 30 and len({r.step.object for r in found}) > 1
    for request in found:
        container, spoon, substance = request.step.arguments
        assert substance == "seawater" and request.taken == (spoon,)
        assert {Condition("contains", (container, part)) for part in ("salt", WATER)} <= set(request.before)


def test_water_is_poured_onto_what_has_an_upper_side(kitted):
    targets = {r.step.arguments[1] for r in drawn(kitted, "pour", 200)}
    assert len(targets) > 10 and not any(n.startswith(("door", "window")) for n in targets)


def test_added_things_are_numbered_after_those_of_the_home():
    pair = next(text for text in added_to(["light_bulb_0", "table_lamp_4", "table_lamp_old"]) if "attached" in text)
    assert pair.endswith("light_bulb_1>table_lamp_5")


def test_a_request_is_not_prepared_if_what_must_hold_first_does_not_last(monkeypatch):
    bench = object.__new__(RequestBench)
    before = (Condition("filled", ("glass_0", WATER)),)
    request = Request(Step("pour", ("glass_0", "bowl_0", WATER)), before, ("glass_0",))
    holds = [True]
    facts = SimpleNamespace(holds=lambda *_: holds[0])
    rung = SimpleNamespace(begin=lambda *_: None, advance=lambda: {0: Outcome()}, facts=lambda world: facts)
    bench._seed, bench._source = 0, SimpleNamespace(draw=lambda *_: request)  # pyright: ignore
    monkeypatch.setattr(bench, "_start", lambda *_: (SimpleNamespace(), ""))
    monkeypatch.setattr(bench, "_symbolic", lambda *_: rung)
    monkeypatch.setattr(bench, "_rung", lambda *_: rung)
    assert bench.run("pour", 0)["prepared"]
    holds[0] = False
    row = bench.run("pour", 0)
    assert "prepared" not in row and row["detail"].startswith("(filled glass_0 water) does not last")


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
    assert figure_cells("open", found)[3:7] == ("-", "75.0 %", "33.3 %", "66.7 %")
    found = primitive_figures([{**row, "symbolic": row["reason"] != "no_base"} for row in rows], "open")
    assert figure_cells("open", found)[3] == "75.0 %"
    assert primitive_figures(rows, "close") == {}


def test_single_requests_are_asked_by_their_numbers():
    conditions = {"rung": "symbolic", "robot": "humanoid", "seed": 0}
    jobs = _jobs({("open", 7)}, ("open", "close"), (3, 7), conditions, 1.0)
    asked = sorted(tuple(request) for job in jobs for request in job.arguments["requests"])
    assert asked == [("close", 3), ("close", 7), ("open", 3)]


@pytest.mark.parametrize(
    ("arguments", "telling"),
    [
        (["--requests", "0"], "--requests: at least one"),
        (["--numbers", "-1"], "--numbers -1: requests are numbered from 0"),
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


def test_what_no_hand_takes_hold_of_or_reaches_is_no_solution(monkeypatch):
    bench = object.__new__(RequestBench)
    box = np.zeros(3), np.array([0.1, 0.1, 2.4])
    symbolic = SimpleNamespace(
        begin=lambda *_: None, advance=lambda: {0: Outcome()}, facts=lambda world: SimpleNamespace(box=lambda name: box)
    )
    monkeypatch.setattr(bench, "_symbolic", lambda *_: symbolic)
    bench._domain = SimpleNamespace(graspable=lambda name: name == "cup_0", loose=())  # pyright: ignore
    rung = object.__new__(PhysicsRung)
    monkeypatch.setattr(PhysicsRung, "world", lambda self, world: None)

    def solution(step, reach=2.0):
        above = lambda world, without: lambda points: np.where(points[:, 2] > reach, np.inf, 0.0)  # noqa: E731
        monkeypatch.setattr(requests, "out_of_reach", above)
        return bench._solution(SimpleNamespace(), Request(step), rung, 0)  # pyright: ignore

    assert solution(Step("grasp", ("cup_0",))) == (True, True)
    assert solution(Step("grasp", ("floor_lamp_0",))) == (True, False)
    onto = Step("place_on_top", ("cup_0", "top_cabinet_0"))
    assert solution(onto) == (True, True), "a part of it is low enough"
    assert solution(onto, reach=-1.0) == (True, False)
    assert solution(Step("open", ("top_cabinet_0",)), reach=-1.0) == (True, False)
    assert solution(Step("pour", ("cup_0", "top_cabinet_0", WATER)), reach=-1.0) == (True, True)
    symbolic.advance = lambda: {0: Outcome("not_true_after")}
    assert solution(onto) == (False, False)
