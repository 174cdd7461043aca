"""`hold`: one writer for each output; a second one is refused, with the name of the first."""

from __future__ import annotations

import fcntl
import os
import pathlib
import socket
from typing import IO

from ig2mj.errors import ClusterError


def hold(file: pathlib.Path, out: object) -> IO[str]:
    """Locks a file, which is made where it is not there, until it is closed or this process ends, however it ends.

    Args:
      file: the lock. out: the output that it stands for, for the message.

    Raises:
      ClusterError: another process holds it.
    """
    opened = file.open("a+")
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        opened.seek(0)
        who = opened.read().strip() or "another run"
        opened.close()
        raise ClusterError(f"{out}: {who} is writing there; wait for it, or choose another place") from None
    opened.truncate(0)
    opened.write(f"process {os.getpid()} on {socket.gethostname()}")
    opened.flush()
    return opened
