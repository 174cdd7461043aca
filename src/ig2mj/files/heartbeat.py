"""Signs of life: whether the process that makes a folder, or holds an output, still runs, here or on another machine.

A sign is a small file that says who works (machine, process) and is touched every `BEAT` seconds. Of a process of this
machine and of this process namespace the kernel knows whether it lives. Any other, in another container or on another
machine that shares the disk, is alive as long as its sign is younger than `DEAD`; ages are measured by the disk's own
clock, so that clocks of machines need not agree.

    with Heartbeat(folder / ".alive"):
        ...                                   # elsewhere: is_alive(folder / ".alive") is True
"""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
import secrets
import socket
import threading
import time
from typing import Any

BEAT = 10.0
"""Seconds between two touches."""

DEAD = 120.0
"""Seconds without a touch after which a sign is a dead one's: twelve beats, more than network disks keep attributes."""


class Heartbeat:
    """A sign of life, as long as it is open; a context manager, which removes it."""

    def __init__(self, file: str | os.PathLike):
        """Writes the sign. Raises OSError."""
        self.file = pathlib.Path(file)
        self.file.write_text(json.dumps(identity()), encoding="utf-8")
        _beating.add(self)

    def close(self) -> None:
        """Removes the sign; may be called twice."""
        _beating.remove(self)
        self.file.unlink(missing_ok=True)

    def touch(self) -> None:
        """One beat. A sign that was removed is not made again."""
        with contextlib.suppress(OSError):
            os.utime(self.file)

    def __enter__(self) -> Heartbeat:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class _Beating:
    """The thread that touches the signs of this process; it runs while there is one."""

    def __init__(self) -> None:
        self._signs: list[Any] = []
        self._lock = threading.Lock()
        self._process = 0

    def add(self, sign: Any) -> None:
        """`sign`: something with a method `touch`."""
        with self._lock:
            self._signs.append(sign)
            if self._process != os.getpid():  # a forked process has no threads of its parent's
                self._process = os.getpid()
                self._signs = [sign]
                threading.Thread(target=self._run, name="ig2mj-heartbeat", daemon=True).start()

    def remove(self, sign: Any) -> None:
        """It is touched no more."""
        with self._lock:
            self._signs = [s for s in self._signs if s is not sign]

    def _run(self) -> None:
        while True:
            time.sleep(BEAT)
            with self._lock:
                if not self._signs:
                    self._process = 0
                    return
                signs = list(self._signs)
            for sign in signs:
                sign.touch()


_beating = _Beating()


def keep_touching(sign: Any) -> None:
    """Calls `sign.touch()` every `BEAT` seconds, until `stop_touching`."""
    _beating.add(sign)


def stop_touching(sign: Any) -> None:
    """See `keep_touching`."""
    _beating.remove(sign)


def identity() -> dict[str, Any]:
    """Who this process is: its number, when it was started, in which process namespace, since which start of which
    machine; what a system does not say is None."""
    return {
        "host": socket.gethostname(),
        "boot": _read("/proc/sys/kernel/random/boot_id"),
        "namespace": _namespace(),
        "process": os.getpid(),
        "started": _started(os.getpid()),
    }


def is_alive(sign: str | os.PathLike, made: str | os.PathLike | None = None) -> bool:
    """Whether who wrote a sign of life still works.

    Args:
      made: what the sign is of; judged by its age alone where there is no sign yet, or none that can be read.
    """
    file = pathlib.Path(sign)
    try:
        who = json.loads(file.read_bytes()[:4096])
    except FileNotFoundError:
        return made is not None and age(made) < DEAD
    except (OSError, ValueError, RecursionError):
        who = None
    known = lives(who)
    return age(file) < DEAD if known is None else known


def lives(who: Any) -> bool | None:
    """Whether a process of this machine and namespace lives, by its `identity`; None: it is another's, or unknown."""
    own = identity()
    if not isinstance(who, dict) or not isinstance(who.get("process"), int):
        return None
    if own["boot"] is None or own["namespace"] is None or any(who.get(k) != own[k] for k in ("boot", "namespace")):
        return None
    started = _started(who["process"])
    return started is not None and started == who.get("started")


def is_of_this_machine(who: Any) -> bool:
    """Whether an `identity` is of this very start of this machine, in whatever namespace."""
    boot = _read("/proc/sys/kernel/random/boot_id")
    return isinstance(who, dict) and boot is not None and who.get("boot") == boot


def age(file: str | os.PathLike) -> float:
    """Seconds since a file or folder was last written, by the clock of its disk; infinite where there is none."""
    path = pathlib.Path(file)
    probe = path.with_name(f".{secrets.token_hex(6)}.clock")
    try:
        written = path.stat().st_mtime
    except OSError:
        return float("inf")
    try:
        probe.touch()
        now = probe.stat().st_mtime
        probe.unlink()
    except OSError:  # nothing can be written there
        now = time.time()
    return now - written


def _read(file: str) -> str | None:
    try:
        return pathlib.Path(file).read_text(encoding="utf-8").strip() or None
    except (OSError, UnicodeDecodeError):
        return None


def _namespace() -> str | None:
    try:
        return str(pathlib.Path("/proc/self/ns/pid").readlink())
    except OSError:
        return None


def _started(process: int) -> str | None:
    """Of a process of this namespace, in ticks since the machine's start; None: there is no such process."""
    text = _read(f"/proc/{process}/stat")
    fields = text.rpartition(")")[2].split() if text else []
    return fields[19] if len(fields) > 19 and fields[0] not in "ZX" else None
