"""Files that docs/design and docs/guide name exist."""

from __future__ import annotations

import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [page for folder in ("design", "guide") for page in sorted((ROOT / "docs" / folder).glob("*.md"))]
FOLDERS = [ROOT, *(ROOT / "src" / name for name in ("", "ig2mj")), ROOT / "converters"]
FILE = re.compile(r"`([\w./-]+/[\w.-]+\.(?:py|json|toml|yaml|slurm))`")


@pytest.mark.parametrize("page", PAGES, ids=[p.relative_to(ROOT).as_posix() for p in PAGES])
def test_files_of_a_page_exist(page):
    """A path is from the root, src/, src/ig2mj/ or converters/; words in capitals are placeholders."""
    found = FILE.findall(page.read_text(encoding="utf-8"))
    named = {name for name in found if not re.search(r"[A-Z]{4}|misc/|meta/", name)}
    assert not sorted(name for name in named if not any((folder / name).is_file() for folder in FOLDERS))
