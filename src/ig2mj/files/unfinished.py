"""Names for what is not finished yet and takes its place when it is."""

from __future__ import annotations

import pathlib
import secrets


def unfinished(path: pathlib.Path) -> pathlib.Path:
    """A hidden name next to a path that no other process takes: two containers may have processes of one number."""
    return path.with_name(f".{path.name[:200]}.{secrets.token_hex(6)}.part")
