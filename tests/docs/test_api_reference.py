"""Reference pages name what exists, and the page of `import ig2mj` names everything that is public."""

from __future__ import annotations

import pathlib
import pkgutil
import re

import pytest

import ig2mj

FOLDER = pathlib.Path(__file__).parents[2] / "docs" / "reference"

DOCUMENTED = {page.name: re.findall(r"^::: (\S+)", page.read_text(), re.M) for page in FOLDER.glob("*.md")}


@pytest.mark.parametrize("page", [name for name, paths in DOCUMENTED.items() if paths])
def test_what_a_page_documents_exists(page):
    for path in DOCUMENTED[page]:
        assert pkgutil.resolve_name(path).__doc__, path


def test_the_page_of_ig2mj_has_every_public_name_and_links_to_its_description():
    rows = re.findall(r"^\| \[?`(\w+)`\]?(?:\(([^)]*)\))? \|", (FOLDER / "api.md").read_text(), re.M)
    assert sorted(name for name, _ in rows) == sorted([*ig2mj.__all__, "__version__"])
    for name, link in rows:
        page, _, anchor = link.partition("#")
        if anchor:
            documented = DOCUMENTED[page or "api.md"]
            assert anchor in documented or anchor.rpartition(".")[0] in documented, name
            assert pkgutil.resolve_name(anchor) is getattr(ig2mj, name)
