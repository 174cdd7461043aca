"""`Journal`: finished pieces of a run on disk, so that a run that was broken off can go on.

Beside the output `FILE` lies a folder `FILE.pieces`, or in an output folder `.pieces`, as long as the run is not
complete: what was asked for (`request.json`), a line for each finished piece (`done.jsonl`), its bytes, and a lock: two
runs with one output cannot be. When all is done, the folder goes.

Nothing in it is pickled; a piece counts as finished only if its bytes have the hash that its line says.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import pathlib
import re
import shutil
from collections.abc import Callable, Collection, Mapping
from typing import Any

from ig2mj.cluster.locks import hold
from ig2mj.errors import InputError
from ig2mj.files.content import read_bytes, read_json

DONE = "done.jsonl"
"""File of a journal with a line for each finished piece."""

_HASH = re.compile(r"[0-9a-f]{64}")
_OTHER = re.compile(r"[/\0]")

Deliver = Callable[[str, bytes], None]
"""Puts the bytes of a finished piece, by its name, where they belong."""


class Memory:
    """Results of a run that leaves nothing behind."""

    def __init__(self) -> None:
        self._results: dict[str, bytes] = {}

    def names(self) -> Collection[str]:
        """Of the pieces that are finished."""
        return self._results.keys()

    def put(self, name: str, result: bytes) -> None:
        """A piece is finished."""
        self._results[name] = result

    def get(self, name: str) -> bytes:
        """What a finished piece gave."""
        return self._results[name]


class Journal:
    """See the module's text; a context manager, which holds the lock."""

    def __init__(
        self,
        out: str | os.PathLike,
        request: Mapping[str, Any],
        resume: bool = False,
        deliver: Deliver | None = None,
        there: Callable[[str], bool] = lambda name: True,
    ):
        """
        Args:
          out: the output: a file, or a folder, which must be there.
          request: what is asked for, for JSON: only a run of the same request can be resumed.
          resume: go on with the run that was broken off; without one, begin.
          deliver: where results go instead of into the journal. there: whether one that was delivered still is.

        Raises:
          ClusterError: another run is at it. InputError: an unfinished run is there and not to be resumed, or is of
            another request.
        """
        self.out = pathlib.Path(out)
        inside = self.out.is_dir()
        self.folder = self.out / ".pieces" if inside else self.out.with_name(self.out.name + ".pieces")
        self._request = json.loads(json.dumps(dict(request)))
        self._deliver, self._there, self._done = deliver, there, {}
        self.folder.mkdir(exist_ok=True)
        self._lock = hold(self.folder / "lock", self.out)
        try:
            self._begin(resume)
        except BaseException:
            self._unlock()
            raise

    def _begin(self, resume: bool) -> None:
        file = self.folder / "request.json"
        if (self.folder / DONE).exists():  # else there is nothing to go on with
            if not resume:
                fix = f"--resume continues it; to start over, remove {self.folder}"
                raise InputError(self.out, "an earlier run of this was interrupted", fix=fix)
            self._compare(file)
            self._read()
            self._mend()
            return
        beside = file.with_suffix(".part")
        beside.write_text(json.dumps(self._request), encoding="utf-8")
        beside.replace(file)

    def _compare(self, file: pathlib.Path) -> None:
        known = read_json(file, kind=dict, fix=f"remove {self.folder}")
        known, wanted = _flat(known), _flat(self._request)
        for name in {**known, **wanted}:
            if known.get(name) != wanted.get(name):
                was, now = (json.dumps(r.get(name))[:80] for r in (known, wanted))
                fix = f"to begin anew, remove {self.folder}"
                problem = f"the interrupted run had {name} = {was}, and here it is {now}"
                raise InputError(self.out, problem, fix=fix)

    def _read(self) -> None:
        for line in self._lines():
            with contextlib.suppress(ValueError, KeyError, TypeError, RecursionError):  # torn by a full disk or a kill
                entry = json.loads(line)
                if isinstance(entry["name"], str) and _HASH.fullmatch(entry["sha256"]):
                    self._done[entry["name"]] = entry["sha256"]
        for name, known in list(self._done.items()):
            if not (self._there(name) if self._deliver else self._whole(name, known)):
                del self._done[name]

    def _lines(self) -> list[bytes]:
        file = self.folder / DONE
        return read_bytes(file, fix=f"remove {self.folder}").split(b"\n") if file.exists() else []

    def _mend(self) -> None:
        """Ends a last line that was torn, so that the next one is not lost with it."""
        lines = self._lines()
        if lines and lines[-1]:
            with (self.folder / DONE).open("ab") as end:
                end.write(b"\n")

    def _whole(self, name: str, known: str) -> bool:
        try:
            return hashlib.sha256(self._file(name).read_bytes()).hexdigest() == known
        except (OSError, ValueError):  # of a name that no file can have
            return False

    def _file(self, name: str) -> pathlib.Path:
        """Of a finished piece; a name from a damaged line stays in the folder as well."""
        return self.folder / f"{_OTHER.sub('+', name)[:200]}.bin"

    def names(self) -> Collection[str]:
        """Of the pieces that are finished."""
        return self._done.keys()

    def put(self, name: str, result: bytes) -> None:
        """A piece is finished. Raises OSError: the disk of this machine is full."""
        if self._deliver is not None:
            self._deliver(name, result)
        else:
            beside = self.folder / ".part"
            beside.write_bytes(result)
            beside.replace(self._file(name))
        self._done[name] = hashlib.sha256(result).hexdigest()
        with (self.folder / DONE).open("a", encoding="utf-8") as lines:
            lines.write(json.dumps({"name": name, "sha256": self._done[name], "bytes": len(result)}) + "\n")

    def get(self, name: str) -> bytes:
        """What a finished piece gave, where nothing else was done with it."""
        return self._file(name).read_bytes()

    def finish(self) -> None:
        """The run is complete: the folder goes."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _unlock(self) -> None:
        self._lock.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *error: object) -> None:
        if not self._done:
            self.finish()  # nothing to go on with
        self._unlock()


def _flat(request: Mapping[str, Any]) -> dict[str, Any]:
    """The same with what is inside of tables by its own name, as "versions.numpy"."""
    found: dict[str, Any] = {}
    for name, value in request.items():
        found |= {f"{name}.{k}": v for k, v in value.items()} if isinstance(value, dict) else {name: value}
    return found
