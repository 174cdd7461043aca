"""ig2mj as its user calls it, with the project's own interpreter."""

from __future__ import annotations

import os
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[3]


def ig2mj(*arguments: object) -> str:
    """What `ig2mj ...` prints. `IG2MJ_PYTHON` names the interpreter that has it."""
    return run("-m", "ig2mj", *arguments)


def run(*arguments: object) -> str:
    """What that interpreter prints."""
    command = [os.environ["IG2MJ_PYTHON"], *map(str, arguments)]
    own = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, env=own)
    assert done.returncode == 0, done.stderr
    return done.stdout
