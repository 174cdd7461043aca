"""Rows of planned activities: what a crash leaves, what is repeated, and the page that is made of them."""

import argparse
import json

import pytest

from benchmarks.planning import page as pages
from benchmarks.planning.activities import CONDITIONS, _Run, read_rows
from ig2mj.cluster.reporting import ProcessEnded

DONE = {"success": True, "q": 1.0, "replans": 0, "planned": 1, "seconds": 1.0, "time": 2.0, "ended": ""}
STEP = {"primitive": "open", "arguments": ["fridge_0"], "reason": "", "detail": "", "time": 2.0, "attempts": 2}


@pytest.fixture
def arguments(tmp_path):
    options = dict.fromkeys(CONDITIONS, "x") | {"rung": "physics", "again": False, "until": float("inf")}
    return argparse.Namespace(**options, starts=3, jobs=1, out=tmp_path, record=None)


def run(arguments, crashes=()):
    """A run whose processes die at some starts."""
    found = _Run(arguments, ["making_tea"])

    def told(job, *words):
        if not job.starts:
            yield {"event": "pool", "size": 3, "home": "fir"}
            return
        for start in map(int, words[1 : words.index("--count")]):
            yield {"event": "begin", "start": start}
            yield {"event": "step", "start": start, "step": "open fridge_0"}
            if start in crashes:
                raise ProcessEnded("the process ended with status -11")
            row = {**DONE, "steps": [STEP]}
            yield {"event": "row", "start": start, "home": "fir", "processor": 1.0, "result": row}

    found.told = told
    found.all()
    return {row["start"]: row for row in read_rows([found.file])}


def test_a_start_at_which_a_process_crashes_has_a_row_and_the_others_go_on(arguments):
    rows = run(arguments, crashes=(1,))
    assert [rows[n]["success"] for n in range(3)] == [True, False, True]
    assert rows[1]["crashed"] and rows[1]["ended"] == "the process ended with status -11, in open fridge_0"
    assert all(row["commit"] and row["command"] and row["versions"] for row in rows.values())


def test_rows_that_are_there_are_not_repeated_unless_a_crash_is(arguments):
    run(arguments, crashes=(1,))
    file = arguments.out / "physics.jsonl"
    run(arguments)
    assert len(file.read_text().splitlines()) == 3
    arguments.again = True
    assert run(arguments)[1]["success"]
    assert len(file.read_text().splitlines()) == 4


def test_the_page_has_each_rung_and_the_reasons_by_primitive(arguments, tmp_path):
    rows = list(run(arguments, crashes=(1,)).values())
    slipped = {**STEP, "reason": "slipped"}
    rows[2] |= {"success": False, "q": 0.5, "steps": [STEP, slipped], "ended": "3 steps were not enough"}
    pages.take_in(rows, tmp_path / "taken.jsonl")
    pages.take_in(rows, tmp_path / "taken.jsonl")
    (line,) = pages.read_lines(tmp_path / "taken.jsonl")
    assert line["success"] == [1, 0, 0] and line["primitives"]["open"]["tried"] == 3
    text = pages.page({"symbolic": [], "kinematic": [], "physics": [line]})
    assert "| making_tea | fir | 1 | 1 of 3 | 0.50 | 2 | open: slipped (1) |" in text
    assert "| physics | open | 3 | 0.0 % | 66.7 % |" in text


def test_rows_of_two_protocols_are_not_mixed(arguments):
    rows = list(run(arguments).values())
    rows[0] = json.loads(json.dumps(rows[0]))
    rows[0]["conditions"]["doors"] = "shut"
    with pytest.raises(ValueError, match="different conditions"):
        pages.condensed("making_tea", rows)


def test_other_agents_are_compared_on_the_same_starts_and_leave_the_main_rows_alone(arguments, tmp_path):
    arguments.doors, arguments.robot = "open", "humanoid"
    main = list(run(arguments).values())
    arguments.agent = "random"
    other = [row for row in run(arguments).values() if "agent" in row["conditions"]]
    assert len(other) == 3 and not any(pages.condition_of(row) for row in main)
    other[0] |= {"success": False, "q": 0.0, "steps": [{**STEP, "reason": "no_grasp"}]}
    pages.take_in(main, tmp_path / "physics.jsonl")
    main = pages.read_lines(tmp_path / "physics.jsonl")
    pages.take_in_comparisons(other, main, tmp_path / "comparisons.jsonl")
    (line,) = pages.read_lines(tmp_path / "comparisons.jsonl")
    commit = other[0]["commit"]
    assert line["solved_activities"] == [other[0]["activity"]]
    text = pages.page({"physics": []}, (), [line])
    assert f"| `--agent random` | {commit} | 1 | 3 | 2 | 3 of 3 | 0.67 | open: no_grasp (1) |" in text
    again = [{**row, "commit": "0abcdef0"} for row in other[1:]]
    pages.take_in_comparisons(again, main, tmp_path / "comparisons.jsonl")
    lines = pages.read_lines(tmp_path / "comparisons.jsonl")
    assert sorted((x["commits"], x["starts"]) for x in lines) == sorted([([commit], 3), (["0abcdef0"], 2)])


def test_another_robot_has_rows_and_columns_of_its_own_and_its_comparisons_stay_apart(arguments, tmp_path, monkeypatch):
    arguments.doors, arguments.robot = "open", "humanoid"
    run(arguments)
    arguments.robot = "fetch"
    run(arguments)
    arguments.doors = "shut"
    rows = list(read_rows([arguments.out / "physics.jsonl"]))
    run(arguments)
    assert {pages.lane_of(row, "physics") for row in rows} == {"physics", "physics, fetch"}
    shut = [row for row in read_rows([arguments.out / "physics.jsonl"]) if row["conditions"]["doors"] == "shut"]
    assert {pages.lane_of(row, "physics") for row in shut} == {""}
    results, page = tmp_path / "results", tmp_path / "page.md"
    file = arguments.out / "physics.jsonl"
    longer = [row | ({"planned": 9} if row["conditions"]["robot"] == "fetch" else {}) for row in read_rows([file])]
    file.write_text("".join(json.dumps(row) + "\n" for row in longer))
    told = ["page", "--rows", str(arguments.out), "--results", str(results), "--page", str(page)]
    monkeypatch.setattr("sys.argv", told)
    pages.main()
    assert {file.name for file in results.iterdir()} == {"physics.jsonl", "physics_fetch.jsonl", "comparisons.jsonl"}
    text = page.read_text()
    assert "| making_tea | fir | 1 | 3 of 3 | 1.00 | 3 of 3 | 1.00 | 2 |  |" in text
    assert "| `--robot fetch --doors shut` |" in text


def test_a_long_list_of_activities_is_counted():
    command = "python -m benchmarks.planning.activities --out plan --activities"
    assert pages._short(f"{command} a b") == f"{command} a b"
    assert pages._short(f"{command} a b c d e") == f"{command} (5 names)"
