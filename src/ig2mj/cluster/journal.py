"""`Journal`: the finished jobs of a run on disk, so that an interrupted run can be resumed.

Until a run is complete there is a folder `FILE.jobs` next to its output `FILE`, or `.jobs` inside an output folder. It
holds the request (`request.json`), a line per finished job (`done.jsonl`), the jobs' bytes, and a lock that refuses a
second run with the same output. The folder is removed when the run is complete.

Nothing in it is pickled. A job counts as finished only if its bytes have the hash of its line.
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
"""File with one line per finished job."""

_HASH = re.compile(r"[0-9a-f]{64}")
_OTHER = re.compile(r"[/\0]")

Deliver = Callable[[str, bytes], None]
"""Writes the bytes of a finished job, by its name, to their destination."""


class MemoryStore:
    """Results in memory."""

    def __init__(self) -> None:
        self._results: dict[str, bytes] = {}

    def names(self) -> Collection[str]:
        """Names of the finished jobs."""
        return self._results.keys()

    def put(self, name: str, result: bytes) -> None:
        """Adds a finished job."""
        self._results[name] = result

    def get(self, name: str) -> bytes:
        """The bytes of a finished job."""
        return self._results[name]


class Journal:
    """See the module. A context manager that holds the lock."""

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
          out: the output, a file or an existing folder.
          request: the settings of the run, for JSON. Only a run with the same request can be resumed.
          resume: continue an interrupted run, if there is one.
          deliver: receives the results in place of the journal. there: whether a delivered result still exists.

        Raises:
          ClusterError: another run writes to this output. InputError: there is an interrupted run that is not to be
            resumed, has another request, or is one of ig2mj 0.1.0.
        """
        self.out = pathlib.Path(out)
        inside = self.out.is_dir()
        self.folder = self.out / ".jobs" if inside else self.out.with_name(self.out.name + ".jobs")
        self._request = json.loads(json.dumps(dict(request)))
        self._deliver, self._there, self._done = deliver, there, {}
        old = self.folder.with_name(self.folder.name.removesuffix("jobs") + "pieces")
        if (old / DONE).exists():
            fix = f"finish it with ig2mj 0.1.0, or remove {old}"
            raise InputError(self.out, "an interrupted run of ig2mj 0.1.0 is there", fix=fix)
        self.folder.mkdir(exist_ok=True)
        self._lock = hold(self.folder / "lock", self.out)
        try:
            self._begin(resume)
        except BaseException:
            self._unlock()
            raise

    def _begin(self, resume: bool) -> None:
        file = self.folder / "request.json"
        if (self.folder / DONE).exists():  # else nothing was finished
            if not resume:
                fix = f"--resume continues it; to start over, remove {self.folder}"
                raise InputError(self.out, "an earlier run was interrupted", fix=fix)
            self._compare(file)
            self._read()
            self._mend()
            return
        beside = file.with_suffix(".part")
        beside.write_text(json.dumps(self._request), encoding="utf-8")
        beside.replace(file)

    def _compare(self, file: pathlib.Path) -> None:
        known = read_json(file, kind=dict, fix=f"remove {self.folder}")
        known, requested = _flat(known), _flat(self._request)
        for name in {**known, **requested}:
            if known.get(name) != requested.get(name):
                was, now = (json.dumps(r.get(name))[:80] for r in (known, requested))
                fix = f"to start over, remove {self.folder}"
                problem = f"the interrupted run had {name} = {was}; this one has {now}"
                raise InputError(self.out, problem, fix=fix)

    def _read(self) -> None:
        for line in self._lines():
            with contextlib.suppress(ValueError, KeyError, TypeError, RecursionError):  # cut off
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
        """Ends an incomplete last line, so that the next one is not lost with it."""
        lines = self._lines()
        if lines and lines[-1]:
            with (self.folder / DONE).open("ab") as end:
                end.write(b"\n")

    def _whole(self, name: str, known: str) -> bool:
        try:
            return hashlib.sha256(self._file(name).read_bytes()).hexdigest() == known
        except (OSError, ValueError):  # a name that no file can have
            return False

    def _file(self, name: str) -> pathlib.Path:
        """Of a finished job; a name from a damaged line cannot leave the folder."""
        return self.folder / f"{_OTHER.sub('+', name)[:200]}.bin"

    def names(self) -> Collection[str]:
        """Names of the finished jobs."""
        return self._done.keys()

    def put(self, name: str, result: bytes) -> None:
        """Adds a finished job. Raises OSError: the disk is full."""
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
        """The bytes of a finished job that was not delivered elsewhere."""
        return self._file(name).read_bytes()

    def finish(self) -> None:
        """Removes the folder of a complete run."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _unlock(self) -> None:
        self._lock.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *error: object) -> None:
        if not self._done:
            self.finish()  # nothing to resume
        self._unlock()


def _flat(request: Mapping[str, Any]) -> dict[str, Any]:
    """Nested tables flattened to names such as "versions.numpy"."""
    found: dict[str, Any] = {}
    for name, value in request.items():
        found |= {f"{name}.{k}": v for k, v in value.items()} if isinstance(value, dict) else {name: value}
    return found
