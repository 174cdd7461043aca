"""Links between pages, and pages that the sources cite, lead somewhere."""

from __future__ import annotations

import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")
CITATION = re.compile(r"docs/[\w/.-]+\.md(?:#[\w-]+)?")
BLOCK = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


def anchors(page: pathlib.Path) -> set[str]:
    """Ids of a page: headings as MkDocs writes them, and those that the page names itself."""
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    found = set(re.findall(r'\bid="([\w-]+)"', text))
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        plain = re.sub(r"[^\w\s-]", "", heading).strip().lower()
        found.add(re.sub(r"[-\s]+", "-", plain))
    return found


def dead(target: str, folder: pathlib.Path, page: pathlib.Path | None) -> bool:
    """Whether a link of a page in `folder` leads to no file or no heading."""
    path, _, anchor = target.partition("#")
    file = (folder / path).resolve() if path else page
    assert file is not None
    if anchor.startswith("ig2mj."):  # of an object that mkdocstrings shows; `make docs` checks these
        return not file.exists()
    return not file.exists() or bool(anchor and file.suffix == ".md" and anchor not in anchors(file))


@pytest.mark.parametrize("page", PAGES, ids=[p.relative_to(ROOT).as_posix() for p in PAGES])
def test_links_of_a_page_lead_somewhere(page):
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    links = [link for link in LINK.findall(text) if not re.match(r"https?:|mailto:", link)]
    assert not [link for link in links if dead(link, page.parent, page)]


def test_pages_that_sources_cite_exist():
    folders = ("src", "converters", "homes", "benchmarks", "tests", "examples", "scripts")
    cited = {
        (match, file.relative_to(ROOT).as_posix())
        for folder in folders
        for file in (ROOT / folder).rglob("*.py")
        for match in CITATION.findall(file.read_text(encoding="utf-8"))
    }
    assert len(cited) > 20
    assert not sorted((match, file) for match, file in cited if dead(match, ROOT, None))
