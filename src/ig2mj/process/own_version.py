"""The version of ig2mj itself, also of a checkout whose `src/` is on PYTHONPATH and that no installer knows."""

from __future__ import annotations

import importlib.metadata
import pathlib
import tomllib

UNKNOWN_VERSION = "0+unknown"
"""Of a copy of the package that is not installed and has no `pyproject.toml` (a local version, PEP 440)."""


def own_version(project: pathlib.Path = pathlib.Path(__file__).parents[3] / "pyproject.toml") -> str:
    """The version as the installed distribution says it; where none is installed, as the checkout's file does."""
    try:
        return importlib.metadata.version("ig2mj")
    except importlib.metadata.PackageNotFoundError:
        pass
    try:
        found = tomllib.loads(project.read_text(encoding="utf-8"))["project"]
    except (OSError, ValueError, KeyError):
        return UNKNOWN_VERSION
    return found["version"] if found.get("name") == "ig2mj" else UNKNOWN_VERSION
