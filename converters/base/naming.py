"""Names: safe file names out of any text, and names that occur once."""

from __future__ import annotations

import re
import unicodedata

_UNSAFE = re.compile(r"[^A-Za-z0-9_-]+")


def file_slug(text: str, limit: int = 60) -> str:
    """A name any file system takes: ASCII letters, digits, `_` and `-`, at most `limit` characters, never empty.

    Different texts may give the same slug: code that writes files adds a content hash.
    """
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return _UNSAFE.sub("_", plain).strip("_")[:limit] or "unnamed"


class NamePool:
    """Gives out names, each once.

    iGibson's rule `<object>_<link>` can produce the same name twice (object `table_1` with a link `0`, and an object
    `table_1_0`); the later one gets a suffix.
    """

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def take(self, base: str) -> str:
        """`base`, or `base` with `__2`, `__3`, ... where that is taken."""
        name, count = base, 1
        while name in self._taken:
            count += 1
            name = f"{base}__{count}"
        self._taken.add(name)
        return name
