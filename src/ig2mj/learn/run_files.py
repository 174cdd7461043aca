"""Files of training runs: where they are and what they say. Nothing that takes long to import is needed for that."""

from __future__ import annotations

import os
import pathlib
import tomllib
from typing import Any

from ig2mj.errors import InputError, UnknownNameError

_HERE = pathlib.Path(__file__).resolve()

CHECKOUT, INSTALLED = _HERE.parents[3] / "policies", _HERE.parents[2] / "ig2mj_policies"

FIX = "policies/CookingMeat.toml of the project is such a file"


def shipped_runs() -> dict[str, pathlib.Path]:
    """Files of the runs that the policies that ship come from, by name."""
    folders = [folder for folder in (INSTALLED, CHECKOUT) if folder.is_dir()]
    return {file.stem: file for folder in folders for file in sorted(folder.glob("*.toml"))}


def run_table(file: str | os.PathLike) -> dict[str, Any]:
    """What a file says, unchecked. The name of a policy that ships stands for its file.

    Raises:
      InputError: no such file, no TOML, or settings that are no table. UnknownNameError: no such policy.
    """
    path = pathlib.Path(file)
    if not path.exists() and len(path.parts) == 1:
        known = shipped_runs()
        path = known.get(path.stem, path)
        if not path.suffix:
            raise UnknownNameError("training file", path.name, known)
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as e:
        raise InputError(file, "there is no such file", fix=FIX) from e
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, IsADirectoryError) as e:
        raise InputError(file, f"is not TOML ({e})", fix=FIX) from e
    if not isinstance(found.setdefault("settings", {}), dict):
        raise InputError(file, "is not a table", element="settings", fix=FIX)
    return found
