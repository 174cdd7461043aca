"""docs/guide/planning.md lists every primitive and every reason of a failure, as they are."""

import pathlib

from ig2mj.planning.steps import PRIMITIVES, REASONS, Step

PAGE = (pathlib.Path(__file__).resolve().parents[2] / "docs" / "guide" / "planning.md").read_text(encoding="utf-8")


def test_the_tables_of_the_page_are_what_the_code_says():
    rows = [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if "|" in line]
    for primitive in PRIMITIVES.values():
        assert [primitive.name, ", ".join(primitive.arguments), primitive.before, primitive.until] in rows
    for reason, meaning in REASONS.items():
        assert [reason, meaning] in rows


def test_what_a_step_adds_is_of_its_arguments():
    assert [*map(str, Step("place_inside", ("a", "b")).adds)] == ["(inside a b)"]
    assert [*map(str, Step("close", ("a",)).adds)] == ["(not (open a))"]
    assert all(p.adds or p.one_of or p.name in ("navigate_to", "grasp", "release") for p in PRIMITIVES.values())
