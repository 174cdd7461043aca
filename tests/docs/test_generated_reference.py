"""The generated parts of docs/reference are what the code says."""

from __future__ import annotations

import importlib.util
import pathlib
import re

import msgspec
import pytest

from ig2mj import cli
from ig2mj.scene import manifest

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def hooks():
    spec = importlib.util.spec_from_file_location("docs_hooks", ROOT / "scripts" / "docs_hooks.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_every_command_and_option_is_on_the_page(hooks):
    page = hooks.on_page_markdown((ROOT / "docs/reference/cli.md").read_text("utf-8"))
    sections = re.split(r"^## ", page, flags=re.MULTILINE)[1:]
    assert [section.split("\n", 1)[0] for section in sections] == list(cli.COMMANDS)
    (view,) = [section for section in sections if section.startswith("view\n")]
    assert "| `SCENE` | folder of a converted scene" in view and "| `--seconds S` | simulate" in view
    assert "### convert object" in page and "│" not in page


def test_a_struct_lists_every_field_with_its_remark(hooks):
    table = hooks.struct("ObjectEntry")
    names = [field.name for field in msgspec.structs.fields(manifest.ObjectEntry)]
    assert re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE) == names
    assert "| `mass` | `float` | required |  |" in table
    assert '| `rooms` | `list[str]` | `[]` | room instances, e.g. "kitchen_0" |' in table


def test_every_structure_of_the_manifest_is_on_the_page():
    page = (ROOT / "docs/reference/scene_format.md").read_text("utf-8")
    structures = {name for name, value in vars(manifest).items() if isinstance(value, type(msgspec.Struct))}
    assert set(re.findall(r"<!-- generated: struct (\w+) -->", page)) == structures - {"Struct"}
