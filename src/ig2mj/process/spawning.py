"""How many processes may be started without being asked for.

A spawned process imports the main script again. A user's script without the guard `if __name__ == "__main__"` would
begin again in each of them, so that the library starts none by itself; ig2mj's own commands may.
"""

from __future__ import annotations

import os

_allowed = False


def allow_spawning() -> None:
    """Called by ig2mj's commands, whose main module can be imported again."""
    global _allowed
    _allowed = True


def processes_for(parts: int) -> int:
    """Number of processes that share so many equal parts of a work: in a command of ig2mj at most one per processor,
    elsewhere 1."""
    return max(1, min(parts, os.cpu_count() or 1)) if _allowed else 1
