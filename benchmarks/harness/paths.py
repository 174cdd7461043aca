"""Folders of the checkout, and how a program of this folder is started as a process of its own."""

from __future__ import annotations

import os
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results"
WORK = ROOT / "out" / "benchmarks"
"""What a program makes on its way; git ignores it."""


def module(name: str) -> tuple[str, str]:
    """Words after `python` that run `benchmarks.<name>`."""
    return "-m", f"benchmarks.{name}"


def environment(**more: str) -> dict[str, str]:
    """This process's environment for another that finds `benchmarks`, wherever it is started."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, "PYTHONPATH": path, **more}


def command_line(argv: list[str]) -> list[str]:
    """`python -m benchmarks.<name>` and its words, folders reduced to their names: others have them elsewhere."""
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    program = ["-m", spec.name] if spec is not None else [pathlib.PurePath(argv[0]).name]
    return ["python", *program, *(pathlib.PurePath(word).name if "/" in word else word for word in argv[1:])]
