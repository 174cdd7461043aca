"""The table of the experts: made of rows, in step with its page, and parts that were played are not played again."""

from __future__ import annotations

import argparse
import json

from benchmarks.learning import experts


def row(**changes) -> dict:
    base = {"task": "CookingMeat", "robot": "fetch", "grasping": "mitten", "first": 0, "count": 25, "failed": []}
    return base | {"date": "2026-11-22"} | changes


def test_parts_of_a_case_are_added_up():
    lines = experts.table([row(failed=[3]), row(first=25), row(robot="humanoid", failed=[0, 1])])
    assert "| CookingMeat, variant 1 | - | 25 of 25 |" in experts.table([row(variant=1), row(robot="humanoid")])
    assert lines[0] == "| | humanoid, mitten | fetch, mitten |"
    assert "| CookingMeat | 23 of 25 | 49 of 50 |" in lines
    assert "| BimanualPickAndPlace | - | n/a |" in lines


def test_of_two_rows_of_one_part_the_later_counts(tmp_path):
    file = tmp_path / "rows.jsonl"
    file.write_text("".join(json.dumps(r) + "\n" for r in (row(failed=[1]), row(first=25), row(failed=[1, 2]))))
    assert [r["failed"] for r in experts.read_rows(file)] == [[1, 2], []]


def test_the_page_has_the_table_of_the_rows():
    """Write it with `python -m benchmarks.learning.experts --table`."""
    text = experts.PAGE.read_text(encoding="utf-8")
    assert experts.page_with(text, experts.read_rows(experts.ROWS)) == text


def test_every_held_out_state_is_in_one_part():
    options = argparse.Namespace(
        tasks=["SlicingFruit"], robots=["fetch"], grasping=["mitten"], variants=[0], episodes=60, worlds=25
    )
    played = [n for part in experts.parts(options) for n in range(part.first, part.first + part.count)]
    assert sorted(played) == list(range(60))


def test_parts_on_file_are_not_played_again_even_those_of_before_there_were_variants(tmp_path, capsys):
    rows = [row(task="SlicingFruit", grasping="mitten", first=first) for first in (0, 25)]
    (tmp_path / "rows.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    options = argparse.Namespace(
        tasks=["SlicingFruit"], robots=["fetch"], grasping=["mitten"], variants=[0], episodes=50, worlds=25
    )
    options.out, options.minutes, options.jobs, options.force = tmp_path, 1.0, 1, False
    assert experts.measure(options) == 0
    assert "0 of 0 parts played" in capsys.readouterr().out
