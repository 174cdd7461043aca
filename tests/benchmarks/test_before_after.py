"""The table of one core in docs/notes/benchmarks.md is that of its rows."""

from __future__ import annotations

import json

import before_after


def test_the_table_is_that_of_the_newest_rows():
    rows = [json.loads(line) for line in before_after.ROWS.read_text(encoding="utf-8").splitlines()]
    assert before_after.table(rows) in before_after.PAGE.read_text(encoding="utf-8"), "before_after.py write"


def test_the_newest_row_of_a_case_counts_and_old_names_are_known():
    def row(which, case, microseconds):
        return {"which": which, "benchmark": "states_step", "result": [{"rows": [{"case": case, **microseconds}]}]}

    rows = [row("before", "states and goal, one thing moves", {"microseconds": us}) for us in (3.0, 2.0)]
    rows.append(row("now", "the same, the goal is about it", {"microseconds": 1.0}))
    named = "states_step", "the same, the goal is about it"
    assert before_after.figures(rows, True)[named] == 2.0
    assert before_after.figures(rows, False)[named] == 1.0
