"""Objects of the user's own that a file was made with (a pool, a recording, a policy), found again by their hash."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec

from ig2mj.errors import InputError
from ig2mj.scene.additions import Addition
from ig2mj.scene.changes import added, read_change
from ig2mj.scene.library import LibraryModel, folder_of, own_library, read_model


class AdditionEntry(msgspec.Struct):
    """An `Addition` in the header of a file."""

    name: str
    category: str
    model: str
    sha256: str
    place: tuple[float, float, float, float] | None = None
    start: tuple[float, ...] | None = None
    folder: str | None = None
    named: bool = False

    def addition(self) -> Addition:
        """The addition itself."""
        return Addition(**{f.name: getattr(self, f.name) for f in dataclasses.fields(Addition)})


def entries_of(additions: Iterable[Addition]) -> list[dict[str, Any]]:
    """Additions for the header of a file."""
    return [dataclasses.asdict(a) for a in additions]


def find_again(additions: Sequence[Addition], file: str | os.PathLike) -> list[Addition]:
    """The same additions with the folders where their models are now; those of the library that ships as they are.

    A model is looked for in the folder where it was, and in the user's own libraries: first with the same hash, then
    by its name, in case only its looks have changed. Whether its physics have is for the caller to check.

    Args:
      file: what was made with them, for errors.

    Raises:
      InputError: a model is missing; says which, and where it was.
    """
    return [a if a.folder is None else _found(a, file) for a in additions]


def requests_again(
    requested: Sequence[str], entries: Sequence[Mapping[str, Any]], file: str | os.PathLike
) -> tuple[str, ...]:
    """Texts of `load_scene(objects=...)` in a file, with the folders where their models are now.

    Args:
      requested: the texts. entries: the additions that they gave, as of `entries_of`: what replaces objects of the
        home, where the file has it, and what was added. file: see `find_again`.

    Raises:
      InputError: a model is missing, or the entries do not belong to the texts.
    """
    try:
        known = [entry.addition() for entry in msgspec.convert(entries, list[AdditionEntry])]
        requested = msgspec.convert(requested, tuple[str, ...])
    except msgspec.ValidationError as e:
        raise InputError(file, str(e), element="objects") from e
    texts = added(requested)
    instead = {
        change.name: change for text in requested if (change := read_change(text)) is not None and change.instead
    }
    replaced = {a.name: a for a in known[: len(known) - len(texts)] if a.name in instead}
    known = known[len(replaced) :]
    if len(known) != len(texts):
        raise InputError(file, f"names {len(requested)} objects and describes {len(known)}", element="objects")
    found = [_replaced_again(text, replaced, file) for text in requested if text not in texts]
    for text, was, now in zip(texts, known, find_again(known, file), strict=True):
        moved = was.folder is not None and now.folder is not None and text.startswith(was.folder)
        found.append(f"{now.folder}{text.removeprefix(str(was.folder))}" if moved else text)
    return tuple(found)


def _replaced_again(text: str, replaced: Mapping[str, Addition], file: str | os.PathLike) -> str:
    """A change of the home with the folder where the model is now. Raises InputError: it is missing."""
    change = read_change(text)
    was = None if change is None else replaced.get(change.name)
    if change is None or was is None or was.folder is None:
        return text
    (now,) = find_again([dataclasses.replace(was, named=False)], file)  # its name is the old object's
    return dataclasses.replace(change, instead=now.folder).text


def _found(addition: Addition, file: str | os.PathLike) -> Addition:
    was = pathlib.Path(str(addition.folder))
    known = [read_model(was, named=addition.named)] if folder_of(str(was)) is not None else []
    if not known or known[0].sha256 != addition.sha256:
        for models in own_library().values():
            known += [read_model(m.folder, named=addition.named) for m in models.values()]
    fitting = [m for m in known if not addition.named or m.prefix == addition.name.rpartition("_")[0]]
    same = [m for m in fitting if m.sha256 == addition.sha256]
    called = [m for m in fitting if _reference(m) == (addition.category, addition.model)]
    if not (same or called):
        what = f"the object '{addition.name}' ({addition.category}/{addition.model}, hash {addition.sha256[:12]})"
        fix = f"`ig2mj objects add DIR` with the folder that holds its folder '{was.name}'"
        raise InputError(file, f"needs {what}, which is neither in {was} nor in a library", fix=fix)
    return dataclasses.replace(addition, folder=str((same or called)[0].folder))


def _reference(model: LibraryModel) -> tuple[str, str]:
    return model.category, model.model
