"""The documentation site builds without a warning, and every page of docs/ is in it."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import pytest
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]


def pages(entries: list) -> list[str]:
    found: list[str] = []
    for entry in entries:
        for target in entry.values():
            found += pages(target) if isinstance(target, list) else [target]
    return found


@pytest.mark.slow
def test_the_site_builds_strictly(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    reference = (tmp_path / "reference" / "simulation" / "index.html").read_text(encoding="utf-8")
    assert "set_object_pose" in reference


def test_every_page_is_in_the_navigation():
    listed = pages(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"])
    files = [p.relative_to(ROOT / "docs") for p in (ROOT / "docs").rglob("*.md")]
    there = [p.as_posix() for p in files if p.parts[0] != "upstream"]  # reports to other projects, no pages
    assert sorted(listed) == sorted(there)
