"""The table of trained policies in README.md, written from the cards in policies/.

python -m benchmarks.learning.readme_table             prints the table
python -m benchmarks.learning.readme_table --write     writes it between its marks in README.md
"""

from __future__ import annotations

import pathlib
import re
import sys

from benchmarks.harness.paths import ROOT

PAGE = ROOT / "README.md"
BEGIN, END = "<!-- begin: python -m benchmarks.learning.readme_table --write -->\n", "<!-- end of the policies -->"
EPISODES = "1,000 held-out episodes"


def table() -> str:
    """A row for each policy, Markdown. Cards of another number of episodes are an error: a table has one protocol."""
    lines = ["| task | robot, hands | sees | learns from | trained | success |", "|---|---|---|---|--:|--:|"]
    cards = [_card(file) for file in sorted((ROOT / "policies").glob("*.md")) if file.name != "README.md"]
    for card in cards:
        success = re.match(r"([\d.]+)% of ([\d,]+ held-out episodes)", card["success"])
        if success is None or success[2] != EPISODES:
            raise ValueError(f"{card['task']}: success is not of {EPISODES}: {card['success']}")
        sees = "images" if "rgb" in card["sees"] else "state"
        by = {"dagger": "expert"}.get(card["algorithm"], "reward")
        minutes = f"{float(card['minutes of training']):.1f} min, {_device(card['device'])}"
        engine = card["evaluated on"].split()[1]
        row = (card["task"], card["robot, grasping"], sees, by, minutes, f"{success[1]} % ({engine})")
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines) + "\n"


def page_with(text: str) -> str:
    """README.md with another table between the marks."""
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    return before + BEGIN + "\n" + text + "\n" + END + rest.split(END)[1]


def _card(file: pathlib.Path) -> dict[str, str]:
    rows = re.findall(r"^\| ([^|]+) \| (.+) \|$", file.read_text(encoding="utf-8"), re.MULTILINE)
    return {key.strip(): value.strip() for key, value in rows}


def _device(name: str) -> str:
    return next((card for card in ("H200", "H100") if card in name), "processor")


if __name__ == "__main__":
    if "--write" in sys.argv[1:]:
        PAGE.write_text(page_with(table()), encoding="utf-8")
    else:
        print(table())
