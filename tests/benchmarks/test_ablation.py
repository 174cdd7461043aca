"""Variants of a row take turns; each is compared with the baseline's call of the same simulated seconds."""

from __future__ import annotations

import json

import pytest

from benchmarks.speed import ablation

WORKER = """
import json, os, sys
choice = os.environ["IG2MJ_PATCHES"]
if choice == "-gravity":
    sys.exit("out of memory")
print("a line of a library")
print("READY " + json.dumps({"ready_s": 1.0, "steps": 10}), flush=True)
calls = 0
for line in sys.stdin:
    calls += 1
    cost = {"all": 1.0, "-solver_loop": 1.25, "none": 3.0}[choice]
    answer = {"non_finite": 0} if "end" in line else {"seconds": 0.1 * calls * cost}
    print("DONE " + json.dumps(answer), flush=True)
"""


@pytest.fixture
def rows(tmp_path, monkeypatch):
    """The rows that the program writes for two groups and MuJoCo Warp as it comes."""
    worker = tmp_path / "worker.py"
    worker.write_text(WORKER)
    monkeypatch.setattr(ablation, "WORKER", (str(worker),))
    words = ["birch-physics", "--groups", "solver_loop", "gravity", "none", "--calls", "3", "--at-once", "3"]
    ablation.main([*words, "--worlds", "100", "--out", str(tmp_path)])
    return [json.loads(line) for line in (tmp_path / "ablation.jsonl").read_text().splitlines()]


def test_each_variant_is_compared_with_the_baselines_call_of_the_same_seconds(rows):
    assert [row["without"] for row in rows] == ["", "solver_loop", "gravity", "", "none"]
    loop, unpatched = rows[1], rows[4]
    assert loop["ms_of_calls"] == [37.5, 50.0, 62.5] and loop["steps_per_s"] == 2000
    assert loop["cost_percent"] == 25.0 and loop["cost_range"] == [25.0, 25.0]
    assert unpatched["cost_percent"] == 200.0 and unpatched["non_finite"] == 0


def test_a_variant_that_fails_costs_only_itself(rows):
    assert rows[2] | {"failed": ""} == {"row": "birch-physics", "without": "gravity", "worlds": 100, "failed": ""}
    assert rows[2]["failed"] == "ended with 1: out of memory"


def test_a_variant_that_is_late_is_ended(tmp_path, monkeypatch):
    worker = tmp_path / "worker.py"
    worker.write_text("import time; time.sleep(60)")
    monkeypatch.setattr(ablation, "WORKER", (str(worker),))
    words = ["made_60-full", "--groups", "none", "--worlds", "2", "--minutes", "0.01", "--out", str(tmp_path)]
    monkeypatch.setattr(ablation, "make_homes", lambda rows: None)
    ablation.main(words)
    rows = [json.loads(line) for line in (tmp_path / "ablation.jsonl").read_text().splitlines()]
    assert [row["failed"] for row in rows] == ["still at work: "] * 2


def test_the_table_has_a_line_for_each_group_and_empty_cells_where_nothing_was_measured():
    measured = {"row": "cooking", "without": "gravity", "cost_percent": -0.5, "ms_of_calls": [1.0, 2.0]}
    rows = [measured, {"row": "cooking", "without": ""}]
    lines = ablation.table(rows).splitlines()
    line = next(line for line in lines if line.startswith("| `gravity`"))
    assert [cell.strip() for cell in line.split("|")][3:8] == ["", "", "", "", "-0.5 %"]
    assert sum("repair: " in line for line in lines) == 4
