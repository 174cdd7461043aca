"""`hold`: one writer for each output; a second one is refused, with the name of the first.

An output is held by a lock of the operating system, which ends with its process, and by a heartbeat in the same file
(`ig2mj.files.heartbeat`). Processes of one machine, also in several containers, see each other's locks. Machines that
share a network disk see them only if its file system has locks (NFS 4 does; others may accept locks and keep them
local). There a heartbeat younger than two minutes holds the output as well. The output of a process that was killed on
another machine is therefore held for up to two minutes. On a disk without locks, two processes that begin in the same
second can both begin.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import pathlib
from typing import IO, Any

from ig2mj.errors import ClusterError
from ig2mj.files.heartbeat import DEAD, age, identity, is_of_this_machine, keep_touching, lives, stop_touching

_NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS}
"""What systems say of a disk without locks."""


class Hold:
    """An output that this process has, until it is closed."""

    def __init__(self, file: pathlib.Path, opened: IO[str]):
        """Writes the sign of life into an open file."""
        self._file, self._opened = file, opened
        opened.seek(0)
        opened.truncate(0)
        json.dump(identity(), opened)
        opened.flush()
        keep_touching(self)

    def touch(self) -> None:
        """Writes a heartbeat."""
        if not self._opened.closed:
            os.utime(self._opened.fileno())

    def close(self) -> None:
        """Releases the output; may be called twice."""
        stop_touching(self)
        if not self._opened.closed:
            self._opened.truncate(0)
            self._opened.close()

    def __enter__(self) -> Hold:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def hold(file: pathlib.Path, out: object) -> Hold:
    """Keeps an output for this process, until it is closed or this process ends, however it ends.

    Args:
      file: the lock, which is made where it is not there. out: the output that it stands for, for the message.

    Raises:
      ClusterError: another process has it, or one of another machine had it less than two minutes ago.
    """
    opened = file.open("a+", encoding="utf-8", errors="replace")
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        locks = True
    except OSError as e:
        locks = False
        if e.errno not in _NO_LOCKS:
            who = _named(_holder(opened))
            opened.close()
            raise ClusterError(f"{out}: {who} is writing there; wait for it, or choose another path") from None
    who = _holder(opened)
    if who is not None and not (locks and is_of_this_machine(who)):
        since = age(file)
        if lives(who) or (lives(who) is None and since < DEAD):
            opened.close()
            raise ClusterError(
                f"{out}: {_named(who)} was writing there {since:.0f} s ago; the output becomes available after "
                f"{DEAD:.0f} s without a heartbeat"
            )
    return Hold(file, opened)


def _holder(opened: IO[str]) -> dict[str, Any] | None:
    """The process that wrote into a lock; None: it has let go of it, or an earlier version of this package."""
    opened.seek(0)
    try:
        found = json.loads(opened.read(4096))
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _named(who: dict[str, Any] | None) -> str:
    return f"process {who.get('process')} on {who.get('host')}" if who else "another run"
