"""Files and members of classes that docs/design and docs/guide name exist."""

from __future__ import annotations

import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [page for folder in ("design", "guide") for page in sorted((ROOT / "docs" / folder).glob("*.md"))]
FOLDERS = [ROOT, *(ROOT / "src" / name for name in ("", "ig2mj")), ROOT / "converters"]
FILE = re.compile(r"`([\w./-]+/[\w.-]+\.(?:py|json|toml|yaml|slurm))`")
MEMBER = re.compile(r"`([A-Z]\w*)\.(_?[a-z]\w*)[(`]")
CLASS = re.compile(r"^class (\w+)(.*?):$", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=[p.relative_to(ROOT).as_posix() for p in PAGES])
def test_files_of_a_page_exist(page):
    """A path is from the root, src/, src/ig2mj/ or converters/; words in capitals are placeholders."""
    found = FILE.findall(page.read_text(encoding="utf-8"))
    named = {name for name in found if not re.search(r"[A-Z]{4}|misc/|meta/", name)}
    assert not sorted(name for name in named if not any((folder / name).is_file() for folder in FOLDERS))


def test_members_of_classes_that_a_page_names_exist():
    """`Class.member` is a word of a file that defines the class, or one that it derives from."""
    files = [f.read_text(encoding="utf-8") for name in ("src", "converters") for f in (ROOT / name).rglob("*.py")]
    words: dict[str, set[str]] = {}
    bases: dict[str, set[str]] = {}
    for text in files:
        for name, derived in CLASS.findall(text):
            words.setdefault(name, set()).update(re.findall(r"\w+", text))
            bases.setdefault(name, set()).update(re.findall(r"\w+", derived))

    def has(name: str, member: str) -> bool:
        return member in words.get(name, ()) or any(has(base, member) for base in bases.get(name, ()) if base != name)

    named = {m for page in PAGES for m in MEMBER.findall(page.read_text(encoding="utf-8")) if m[0] in words}
    assert len(named) > 30
    assert not sorted(f"{name}.{member}" for name, member in named if not has(name, member))
