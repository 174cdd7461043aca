"""The benchmark of placements in disturbed homes: its shares, and a run that is resumed."""

from __future__ import annotations

import json

import pytest

from benchmarks.sampling import placement_disturbed


def line(made: bool, possible: bool, **more):
    reasons = {} if made else {"moves others": 3, "budget spent": 1}
    return {"made": made, "possible": possible, "candidates": True, "s": 0.1, "reasons": reasons} | more


def test_shares_are_of_all_of_possible_ones_and_of_those_with_candidates():
    made = line(True, True, stayed=True, deepest_mm=0.1)
    row = placement_disturbed.summary("on_top", "moving", [made, made, line(False, True), line(False, False)])
    assert row["success"] == 0.5 and row["success_of_possible"] == pytest.approx(2 / 3)
    assert row["success_of_candidates"] == 0.5 and row["true_after_3_s"] == 2
    assert row["possible_refused_for"] == {"moves others": 1}


def test_a_request_has_candidates_if_an_object_was_let_go():
    assert placement_disturbed.has_candidates(line(False, False))
    assert not placement_disturbed.has_candidates({"made": False, "reasons": {"no room": 24, "no surface": 2}})


@pytest.mark.slow
def test_homes_are_measured_once_and_summed_up(tmp_path):
    args = placement_disturbed.Args(homes=("small_home",), rows=1, requests=2, predicates=("on_top",), out=tmp_path)
    placement_disturbed.main(args)
    file = tmp_path / "placement_disturbed" / "small_home.jsonl"
    before = file.read_bytes()
    assert {json.loads(x)["start"] for x in before.splitlines()} == set(placement_disturbed.STARTS)
    args.resume = True
    placement_disturbed.main(args)
    assert file.read_bytes() == before
    result = json.loads((tmp_path / "placement_disturbed" / "result.json").read_text())
    assert [row["requests"] for row in result["rows"]] == [2, 2]
