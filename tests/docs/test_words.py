"""Pages use the words of the glossary, and their lines are short."""

from __future__ import annotations

import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = (".", "guide", "design")
NOTES = ("gpu", "learning", "lost", "sampling", "start", "native", "benchmarks", "rules", "experiments", "upgrade")
"""Without pages that programs write."""
PAGES = [ROOT / "README.md", *(page for name in FOLDERS for page in sorted((ROOT / "docs" / name).glob("*.md")))]
PAGES += [ROOT / "docs" / "notes" / f"{name}.md" for name in NOTES]
REPLACED = {
    "anew": "again",
    "beside": "next to",
    "natively": "on the native engine",
    "reckoned": "computed",
    "dear": "expensive",
    "picture": "image",
    "pictures": "images",
    "film": "video",
    "films": "videos",
    "likeliest": "most likely",
    "learnt": "learned",
    "whoever": "a name of what does it",
    "nobody": "no, with a name",
}
CODE = re.compile(r"^```.*?^```|`[^`]*`|\]\([^)]*\)", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=[p.relative_to(ROOT).as_posix() for p in PAGES])
def test_words_of_a_page_are_those_of_the_glossary(page):
    words = re.findall(r"[a-z]+", CODE.sub("", page.read_text(encoding="utf-8")).lower())
    assert not {word: REPLACED[word] for word in words if word in REPLACED}


@pytest.mark.parametrize("page", PAGES, ids=[p.relative_to(ROOT).as_posix() for p in PAGES])
def test_lines_of_prose_have_at_most_100_characters(page):
    """Rows of tables, code, images, and generated tables of README may be longer."""
    text = re.sub(r"<!-- begin: .*?<!-- end of [\w ]+ -->", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    lines = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL).splitlines()
    assert not [line for line in lines if len(line) > 100 and not line.startswith(("|", "    ", "!["))]
