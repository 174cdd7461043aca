"""Weak scaling: what is told of processes that are slow, die or overflow, and what their speeds are compared with."""

from __future__ import annotations

import json
import pathlib
from typing import Any

import pytest

pytest.importorskip("tyro")

from benchmarks.harness.waiting import Process
from benchmarks.speed import scale_tables, scaling

WORKER = """
import json, sys
about = json.loads(sys.argv[1])
if about["late"]:
    sys.stdin.read()
    sys.exit()
print("READY " + json.dumps({"device": "a device"}), flush=True)
for line in sys.stdin:
    if about["dies"]:
        sys.exit("it died")
    wish = json.loads(line)
    if "kernels" in wish:
        open(wish["kernels"], "w").close()
    row = {"seconds": 2.0, "steps": about["steps"], "overflow": about["overflow"], "non_finite": 0}
    row |= about.get("more", {})
    print("DONE " + json.dumps(row), flush=True)
"""

GOOD = {"late": False, "dies": False, "steps": 100, "overflow": 0}


def measured(tmp_path: pathlib.Path, monkeypatch, workers: dict[str, list[dict]], **options) -> list[dict]:
    """Rows of a run in which the processes of each case are these."""
    script = tmp_path / "worker.py"
    script.write_text(WORKER)

    def start(case: str, count: int, args: scaling.Args, way: str = "") -> list[Process]:
        name = "-".join([case, str(count), *([way] if way and way != "processes" else [])])
        about = workers[case if case != "learner" else name]
        return [Process([str(script), json.dumps(a)], tmp_path / f"{name}-{k}", {}) for k, a in enumerate(about)]

    monkeypatch.setattr(scaling, "start", start)
    rows = tmp_path / "rows.jsonl"
    cases: Any = tuple(sorted({name.split("-")[0] for name in workers}))
    scaling.main(scaling.Args(gpus=(1, 2), cases=cases, seconds=0.1, rows=rows, logs=tmp_path, **options))
    return [json.loads(line) for line in rows.read_text().splitlines()]


def test_speeds_are_compared_with_one_gpu(tmp_path, monkeypatch):
    slow = {**GOOD, "steps": 90}
    rows = measured(tmp_path, monkeypatch, {"birch_pictures": [GOOD, slow]}, limit=30.0)
    shares = [(r["gpus"], r.get("gpu"), r["steps_per_s"], r.get("weak_scaling")) for r in rows]
    assert shares == [(1, None, 50.0, 1.0), (1, 1, 45.0, None), (2, None, 95.0, 1.9)]
    assert rows[2]["of_these_gpus_alone"] == 1.0  # the second one is slower by itself
    assert all(r["counts"] and r["device"] == "a device" for r in rows)
    monkeypatch.setattr(scale_tables, "RESULTS", tmp_path)
    for name in ("scaling", "multi_gpu"):
        (tmp_path / name).mkdir()
    (tmp_path / "scaling" / "rows.jsonl").write_text("\n".join(map(json.dumps, [*rows, {**rows[2], "counts": False}])))
    two = {"devices": 2, "speedup": 1.99, "device": "another"}
    (tmp_path / "multi_gpu" / "result.json").write_text(json.dumps(two))
    assert scale_tables.scaling()["birch_pictures"] == {1: (1.0, "a device"), 2: (1.9, "a device, 100 % of each alone")}


def test_a_row_that_overflowed_counts_not_and_is_no_measure_for_others(tmp_path, monkeypatch):
    rows = measured(tmp_path, monkeypatch, {"birch_pictures": [{**GOOD, "overflow": 3}, GOOD]}, limit=30.0)
    assert [(r["counts"], r["overflow"]) for r in rows] == [(False, 3), (True, 0), (False, 3)]
    assert not any("weak_scaling" in r for r in rows)


def test_what_dies_or_is_late_costs_its_own_rows(tmp_path, monkeypatch):
    workers = {
        "birch_pictures": [GOOD, {**GOOD, "dies": True}],
        "learner-1": [{**GOOD, "late": True}],
        "learner-2": [GOOD, GOOD],
    }
    every = measured(tmp_path, monkeypatch, workers, limit=5 * 4.1 + 2.0)
    rows = {(r["case"], r["gpus"]): r for r in every if "gpu" not in r}
    assert rows["birch_pictures", 1]["weak_scaling"] == 1.0
    assert "no answer, ended with 1: it died" in rows["birch_pictures", 2]["error"]
    assert "not ready, still at work" in rows["learner", 1]["error"]
    assert rows["learner", 2]["counts"] and "weak_scaling" not in rows["learner", 2], "there is no row of one GPU"


def test_a_learner_of_two_gpus_is_compared_with_that_of_one(tmp_path, monkeypatch):
    workers = {"learner-1": [GOOD], "learner-2": [{**GOOD, "steps": 85}, {**GOOD, "steps": 85}]}
    rows = measured(tmp_path, monkeypatch, workers, limit=30.0)
    assert [(r["gpus"], r.get("weak_scaling")) for r in rows] == [(1, 1.0), (2, 1.7)]


def test_ways_to_learn_on_two_gpus_are_told_apart(tmp_path, monkeypatch):
    parts, others = ({"updates": 4, "worlds_each": each} for each in ([1.0, 0.5], [0.75, 0.75]))
    workers = {
        "learner-1": [GOOD],
        "learner-1-apart": [{**GOOD, "steps": 90, "more": parts}],
        "learner-2": [{**GOOD, "steps": 80, "more": parts}, {**GOOD, "steps": 80, "more": others}],
        "learner-2-together": [{**GOOD, "steps": 190, "more": parts}],
    }
    kernels = tmp_path / "kernels"
    kernels.mkdir()
    rows = measured(tmp_path, monkeypatch, workers, limit=40.0, ways=("processes", "together"), kernels=kernels)
    shares = [(r["gpus"], r.get("way"), r["weak_scaling"], r.get("learning_ms_per_update")) for r in rows]
    two = [(2, "processes", 1.6, 62.5), (2, "together", 1.9, 125.0)]
    assert shares == [(1, None, 1.0, None), (1, "apart", 0.9, 125.0), *two]
    waiting = [r.get("waiting_ms_per_update") for r in rows]
    assert waiting == [None, 0.0, 62.5, 0.0], "in each iteration the slower one's worlds are waited for"
    named = {file.name for file in kernels.iterdir()}
    assert named == {f"learner-{n}.json" for n in ("1-apart-0", "2-processes-0", "2-processes-1", "2-together-0")}
    told = [(r["gpus"], r.get("way")) for r in scale_tables.runs(tmp_path / "rows.jsonl")]
    assert told == [(1, None), (2, "processes")], "the tables tell what a GPU's own process does"
