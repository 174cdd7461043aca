"""Demonstrations that ship: episodes of the scripted experts, with disturbances and recoveries, for each activity.

The recordings are compact (`ig2mj.demos.compact`): actions, labels, and the first and last frame of each run.
"""

from __future__ import annotations

import os
import pathlib

from ig2mj.errors import UnknownNameError

_HERE = pathlib.Path(__file__).resolve()

CHECKOUT, INSTALLED = _HERE.parents[3] / "demonstrations", _HERE.parents[2] / "ig2mj_demonstrations"

ENDING = ".h5"


def folder() -> pathlib.Path:
    """The folder of the demonstrations, in a checkout or installed."""
    return CHECKOUT if CHECKOUT.is_dir() else INSTALLED


def shipped() -> list[str]:
    """Names of the demonstrations that ship."""
    return sorted(file.stem for file in folder().glob(f"*{ENDING}"))


def find_recording(name: str | os.PathLike) -> pathlib.Path:
    """The file of this name, or that of demonstrations that ship. Raises UnknownNameError: there is neither."""
    path = pathlib.Path(name)
    if path.exists() or path.suffix or len(path.parts) > 1:
        return path
    if path.name not in shipped():
        raise UnknownNameError("recording", path.name, shipped())
    return folder() / f"{path.name}{ENDING}"
