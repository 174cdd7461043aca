"""The successes in README.md are those of the cards of the policies that ship."""

from __future__ import annotations

import pathlib
import re

from benchmarks.learning import readme_table as readme_policies


def test_the_table_is_that_of_the_cards():
    page = readme_policies.PAGE.read_text(encoding="utf-8")
    assert page == readme_policies.page_with(readme_policies.table()), (
        "python -m benchmarks.learning.readme_table --write"
    )


def test_there_is_a_cell_for_each_policy():
    policies = list(pathlib.Path(readme_policies.ROOT / "policies").glob("*.npz"))
    assert readme_policies.table().count(" %") == len(policies)
    page = " ".join(readme_policies.PAGE.read_text(encoding="utf-8").split())
    assert len(policies) == 18 and "Eighteen trained policies ship" in page


def test_no_success_stands_in_readme_but_in_the_tables_and_next_to_its_conditions():
    """Text that repeats a card's figure goes stale."""
    page = readme_policies.PAGE.read_text(encoding="utf-8")
    before, rest = page.split(readme_policies.BEGIN)
    text = before + rest.split(readme_policies.END)[1]
    successes = set(re.findall(r"([\d.]+) %", readme_policies.table()))
    assert not [each for each in successes if f"{each} %" in text and each not in ("100.0",)]
