"""The speeds in README.md are those of the result files."""

from __future__ import annotations

import re

from benchmarks.speed import readme_table as readme_speed


def test_the_table_is_that_of_the_result_files():
    page = readme_speed.PAGE.read_text(encoding="utf-8")
    assert page == readme_speed.page_with(readme_speed.table()), "python -m benchmarks.speed.readme_table --write"


def test_the_speed_in_the_introduction_is_one_of_the_table():
    introduction = readme_speed.PAGE.read_text(encoding="utf-8").split("## Quick start")[0]
    [speed] = re.findall(r"([\d,]+) control steps a second", introduction)
    assert f"| {speed} " in readme_speed.table()
