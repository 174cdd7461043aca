"""Commands that messages name, as a shell takes them."""

from __future__ import annotations

import shlex


def command(*words: object) -> str:
    """`ig2mj` with words, of which those that a shell would split or change are quoted (names with spaces)."""
    return shlex.join(["ig2mj", *map(str, words)])
