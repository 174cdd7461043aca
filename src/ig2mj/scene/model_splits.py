"""Which part of its category an object of the user's belongs to: `split.json` next to its manifest.

`ig2mj convert object --split held_out` writes it. What is divided by a hash of names otherwise is so by the user here.
"""

from __future__ import annotations

import os
import pathlib

import msgspec

from ig2mj.errors import EngineError, InputError, UnknownNameError
from ig2mj.scene.library import LibraryModel, library, own_library

SPLIT_FILE = "split.json"

PARTS = ("train", "held_out")
"""Parts of the models of a category."""


def check_part(part: str) -> None:
    """Raises UnknownNameError: there is no such part; with near matches."""
    if part not in PARTS:
        raise UnknownNameError("split of models", part, PARTS)


def check_joins(part: str, category: str, model: str, fixed: bool) -> None:
    """Whether a model that is to be converted may join a part of its category.

    Raises:
      UnknownNameError: there is no such part. EngineError: it is furniture, of which episodes never take another model;
      or a model that ships has its name.
    """
    check_part(part)
    if fixed:
        raise EngineError(f"--split {part}: models of furniture do not vary between episodes (leave --split out)")
    if model in library().get(category, ()):
        raise EngineError(f"--split {part}: '{category}/{model}' ships (name yours with --model NAME)")


def join_split(folder: str | os.PathLike, part: str) -> None:
    """Lets the object in a folder belong to a part. Raises UnknownNameError: there is no such part."""
    check_part(part)
    (pathlib.Path(folder) / SPLIT_FILE).write_bytes(msgspec.json.encode({"split": part}))


def part_of(model: LibraryModel) -> str | None:
    """The part that the user gave to a model; None: none. Raises InputError: the file is broken."""
    file = model.folder / SPLIT_FILE
    if not file.is_file():
        return None
    try:
        part = msgspec.json.decode(file.read_bytes(), type=dict[str, str])["split"]
        check_part(part)
    except (msgspec.DecodeError, KeyError, UnknownNameError) as e:
        raise InputError(file, f"names no split ({e})", fix=f'{{"split": "{PARTS[1]}"}} does') from e
    return part


def models_with_parts(category: str) -> tuple[list[str], dict[str, str]]:
    """Models of a category, the movable ones of the user's own libraries last; and the parts that these were given."""
    own = {name: model for name, model in own_library().get(category, {}).items() if not model.entry.fixed}
    joined = {name: part for name, model in own.items() if (part := part_of(model)) is not None}
    return [*library().get(category, {}), *own], joined
