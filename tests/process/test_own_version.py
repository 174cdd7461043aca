"""The version of ig2mj is found where it is installed, and in a checkout that is only on the path."""

from __future__ import annotations

import importlib.metadata
import pathlib
import re

import pytest

from ig2mj.process import own_version as module
from ig2mj.process.own_version import UNKNOWN_VERSION, own_version

ROOT = pathlib.Path(__file__).resolve().parents[2]
ASKED = re.compile(r"""(version|metadata|distribution)\(["']ig2mj["']\)""")
ASKERS = {"src/ig2mj/process/own_version.py", "src/ig2mj/install_hint.py"}
"""`install_hint` reads the requirements, which have no other source; it handles their absence."""


@pytest.fixture
def not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(module.importlib.metadata, "version", version)


def test_of_a_checkout_the_version_is_that_of_its_pyproject(not_installed: None) -> None:
    assert f'version = "{own_version()}"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("text", [None, "[project", '[project]\nname = "another"\nversion = "7"', "[tool]"])
def test_without_a_pyproject_of_ig2mj_the_version_is_unknown(not_installed: None, tmp_path, text: str | None) -> None:
    file = tmp_path / "pyproject.toml"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    assert own_version(file) == UNKNOWN_VERSION


def test_nothing_else_asks_for_the_distribution_of_ig2mj() -> None:
    files = [file for folder in ("src", "converters", "homes", "benchmarks") for file in (ROOT / folder).rglob("*.py")]
    asking = {file.relative_to(ROOT).as_posix() for file in files if ASKED.search(file.read_text(encoding="utf-8"))}
    assert asking == ASKERS
