"""Commands of benchmarks that pages show are those of programs that exist."""

from __future__ import annotations

import pathlib
import re

import pytest

from benchmarks.harness.paths import ROOT, module

PAGES = sorted([ROOT / "README.md", ROOT / "benchmarks" / "README.md", *(ROOT / "docs").rglob("*.md")])
TABLE = re.compile(r"`((?:speed|peers|learning|soak|sampling|planning)\.[a-z_0-9]+)\b")
COMMAND = re.compile(r"python (?:-m )?(benchmarks[./][\w./]+)")


def _programs() -> set[str]:
    folder = ROOT / "benchmarks"
    files = [f for f in folder.rglob("*.py") if 'if __name__ == "__main__":' in f.read_text(encoding="utf-8")]
    return {".".join(f.relative_to(ROOT).with_suffix("").parts) for f in files}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_command_on_a_page_is_a_programs(page: pathlib.Path):
    lines = page.read_text(encoding="utf-8").splitlines()
    text = "\n".join(line for line in lines if ", commit " not in line)  # a row's command is of its commit
    commands = {command.rstrip(".") for command in COMMAND.findall(text)} - {"benchmarks"}
    assert commands <= _programs(), page


def test_the_readme_of_benchmarks_names_every_program():
    named = set(TABLE.findall((ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")))
    assert {f"benchmarks.{name}" for name in named} == {p for p in _programs() if ".harness." not in p}


def test_a_program_is_named_by_its_module():
    assert module("speed.batch") == ("-m", "benchmarks.speed.batch")
