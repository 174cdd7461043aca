"""What is not finished yet, and takes its place when it is."""

from __future__ import annotations

import contextlib
import pathlib
import secrets
from collections.abc import Iterator


def unfinished(path: pathlib.Path) -> pathlib.Path:
    """A hidden name next to a path that no other process takes: two containers may have processes of one number."""
    return path.with_name(f".{path.name[:200]}.{secrets.token_hex(6)}.part")


@contextlib.contextmanager
def replacing(path: pathlib.Path) -> Iterator[pathlib.Path]:
    """A name to write a file under, which takes the path's place at the end; after an error nothing is left of it.

    A process that reads the path at the same time finds all of one file or of the other.
    """
    part = unfinished(path)
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
