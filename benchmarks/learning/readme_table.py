"""The table of trained policies in README.md, written from the cards in policies/.

python -m benchmarks.learning.readme_table             prints the table
python -m benchmarks.learning.readme_table --write     writes it between its marks in README.md
"""

from __future__ import annotations

import pathlib
import re
import sys

from benchmarks.harness.pages import between
from benchmarks.harness.paths import ROOT
from ig2mj.tasks.spots import home_and_place

PAGE = ROOT / "README.md"
BEGIN, END = "<!-- begin: python -m benchmarks.learning.readme_table --write -->\n", "<!-- end of the policies -->"
EPISODES = "1,000 held-out episodes"


COLUMNS = (("humanoid", "mitten"), ("fetch", "mitten"), ("fetch", "physical"), ("turtlebot", "physical"))
"""Robot and grasping of each column, in order."""


def table() -> str:
    """A row for each task and a column for each robot, Markdown. Success of the cards, with what they learn from.

    Raises ValueError: a card is of another number of episodes (a table has one protocol), or fits no column.
    """
    cells = dict[str, dict[tuple[str, str], str]]()
    for file in sorted((ROOT / "policies").glob("*.md")):
        if file.name == "README.md":
            continue
        card = _card(file)
        success = re.match(r"([\d.]+)% of ([\d,]+ held-out episodes)", card["success"])
        if success is None or success[2] != EPISODES:
            raise ValueError(f"{file.name}: success is not of {EPISODES}: {card['success']}")
        robot, grasping = card["robot, grasping"].split(", ")
        if (robot, grasping) not in COLUMNS:
            raise ValueError(f"{file.name}: there is no column for {robot}, {grasping}")
        homes = {home_and_place(place)[0] for place in card.get("homes of training", "").split(", ") if place}
        row = f"{card['task']}, {len(homes)} homes" if homes else card["task"]
        cells.setdefault(row, {})[robot, grasping] = f"{success[1]} %{_remarks(card)}"
    head = " | ".join(f"{robot}, {grasping}" for robot, grasping in COLUMNS)
    lines = [f"| task | {head} |", "|---" + "|--:" * len(COLUMNS) + "|"]
    lines += [f"| {task} | " + " | ".join(row.get(c, "") for c in COLUMNS) + " |" for task, row in cells.items()]
    return "\n".join(lines) + "\n"


def _remarks(card: dict[str, str]) -> str:
    """What differs from the usual: images, reward alone, evaluated on the native engine."""
    remarks = [] if "rgb" in card["sees"] else ["state"]
    remarks += ["expert"] if card["algorithm"] == "dagger" else []
    engine = card["evaluated on"].split()[1]
    remarks += [engine] if engine != "native" else []
    return f" ({', '.join(remarks)})" if remarks else ""


def page_with(text: str) -> str:
    """README.md with another table between the marks."""
    return between(PAGE.read_text(encoding="utf-8"), BEGIN, END, text)


def _card(file: pathlib.Path) -> dict[str, str]:
    rows = re.findall(r"^\| ([^|]+) \| (.+) \|$", file.read_text(encoding="utf-8"), re.MULTILINE)
    return {key.strip(): value.strip() for key, value in rows}


if __name__ == "__main__":
    if "--write" in sys.argv[1:]:
        PAGE.write_text(page_with(table()), encoding="utf-8")
    else:
        print(table())
