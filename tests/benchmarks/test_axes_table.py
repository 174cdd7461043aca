"""The table of axes in docs/notes/learning.md is made from its rows."""

from __future__ import annotations

import json

import pytest

from benchmarks.learning import axes_table


def test_the_page_has_the_table_of_the_rows():
    page = axes_table.PAGE.read_text(encoding="utf-8")
    assert page == axes_table.page_with(axes_table.table()), "python -m benchmarks.learning.axes_table --write"


def test_a_result_that_is_unfinished_or_uneven_is_not_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(axes_table, "ROWS", tmp_path / "rows.jsonl")
    file = tmp_path / "result.json"
    rate = {"success_rate": 0.5, "success_low": 0.2, "success_high": 0.8}
    whole = {"env": "GraspingBook", "robot": "fetch", "agent": "one", "engine": "native", "episode_file": "a"}
    for wrong in (
        {"axes": {"nominal": {**rate, "episodes": 3}}, "unfinished": ["all"]},
        {"axes": {"nominal": {**rate, "episodes": 3}, "all": {**rate, "episodes": 2}}},
    ):
        file.write_text(json.dumps({**whole, **wrong}))
        with pytest.raises(ValueError, match=r"finished|different numbers"):
            axes_table.take(file)
    file.write_text(json.dumps({**whole, "axes": {"nominal": {**rate, "episodes": 3}}}))
    axes_table.take(file)
    axes_table.take(file)
    assert len(axes_table.rows()) == 1
    assert "| `nominal` | 50.0 % (20 to 80) |" in axes_table.table()
