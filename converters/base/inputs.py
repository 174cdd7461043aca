"""What a conversion looked at: which files it read, which it found absent, which folders it listed.

Every reader asks the disk through this file, so that a `Record` shows later, without a conversion, whether the same
conversion would see the same things again (see `output_cache`). Outside a `recording` block nothing is kept.
"""

from __future__ import annotations

import contextlib
import contextvars
import errno
import hashlib
import os
import pathlib
from collections.abc import Iterator, Mapping

Path = str | os.PathLike


class Record:
    """Questions and answers of one conversion.

    Attributes:
      answers: question -> answer, both text. A question is a kind and an absolute path.
      consistent: no question was answered in two ways: nothing changed while it was read.
    """

    def __init__(self, answers: Mapping[str, str] | None = None):
        self.answers: dict[str, str] = dict(answers or {})
        self.consistent = True

    def note(self, kind: str, path: Path, answer: str) -> None:
        """Keeps an answer."""
        self.add({f"{kind} {pathlib.Path(path).absolute()}": answer})

    def add(self, answers: Mapping[str, str]) -> None:
        """Takes over what another record holds."""
        for question, answer in answers.items():
            if self.answers.setdefault(question, answer) != answer:
                self.consistent = False

    def holds_still(self) -> bool:
        """Whether the disk gives the same answers now."""
        return all(_answer(*question.split(" ", 1)) == answer for question, answer in self.answers.items())


_active: contextvars.ContextVar[Record | None] = contextvars.ContextVar("ig2mj_inputs", default=None)


@contextlib.contextmanager
def recording() -> Iterator[Record]:
    """Keeps what is asked inside the block; blocks may be nested, and the inner one's answers are kept by the outer."""
    record, outer = Record(), _active.get()
    token = _active.set(record)
    try:
        yield record
    finally:
        _active.reset(token)
        if outer is not None:
            outer.add(record.answers)
            outer.consistent = outer.consistent and record.consistent


def add(answers: Mapping[str, str]) -> None:
    """Takes over what a worker process recorded."""
    record = _active.get()
    if record is not None:
        record.add(answers)


def content(path: Path) -> bytes:
    """A regular file's bytes. Raises OSError, also for a device or a pipe, on which reading might never end."""
    place = pathlib.Path(path)
    if place.exists() and not place.is_file():
        raise OSError(errno.EINVAL, "is not a regular file", str(place))
    raw = place.read_bytes()
    record = _active.get()
    if record is not None:
        record.note("content", path, hashlib.sha256(raw).hexdigest())
    return raw


def is_file(path: Path) -> bool:
    """As `pathlib.Path.is_file`."""
    return _ask("file", path) == "yes"


def is_folder(path: Path) -> bool:
    """As `pathlib.Path.is_dir`."""
    return _ask("folder", path) == "yes"


def folders_in(path: Path) -> list[str]:
    """Names of the folders in a folder, sorted, without hidden ones; [] where it is none."""
    return _ask("listing", path).split("/")[:-1]


def files_in(path: Path) -> list[str]:
    """Names of the files in a folder, sorted; [] where it is none."""
    return _ask("files", path).split("/")[:-1]


def namesakes(path: Path) -> list[pathlib.Path]:
    """Files next to where `path` would be whose names differ from its name in case only, sorted."""
    place = pathlib.Path(path)
    return [place.with_name(name) for name in files_in(place.parent) if name.casefold() == place.name.casefold()]


def real_path(path: Path) -> pathlib.Path:
    """As `pathlib.Path.resolve`; a symbolic link on the way is part of the record. Raises OSError, RuntimeError."""
    plain, real = pathlib.Path(path), pathlib.Path(path).resolve()
    record = _active.get()
    if record is not None and str(real) != os.path.normpath(plain.absolute()):
        record.note("link", plain, str(real))
    return real


def _ask(kind: str, path: Path) -> str:
    answer = _answer(kind, path)
    record = _active.get()
    if record is not None:
        record.note(kind, path, answer)
    return answer


def _answer(kind: str, path: Path) -> str:
    place = pathlib.Path(path)
    try:
        if kind == "content":
            return hashlib.sha256(place.read_bytes()).hexdigest()
        if kind in ("listing", "files"):
            wanted = pathlib.Path.is_dir if kind == "listing" else pathlib.Path.is_file
            names = sorted(f.name for f in place.iterdir() if wanted(f) and not f.name.startswith("."))
            return "".join(f"{name}/" for name in names)
        if kind == "link":
            return str(place.resolve())
        return "yes" if (place.is_file() if kind == "file" else place.is_dir()) else "no"
    except (OSError, RuntimeError, ValueError):
        return ""
