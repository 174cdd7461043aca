"""Functions of changed source text: MuJoCo Warp's, with other lines or names in them."""

from __future__ import annotations

import itertools
import linecache
from collections.abc import Mapping
from typing import Any

_numbers = itertools.count()
"""Of sources: functions that differ in constants only have one name, and copies of copies are made from sources."""


def defined(name: str, text: str, space: Mapping[str, Any]) -> Any:
    """What a source text defines under a name.

    Tracebacks, Warp and later copies of the function find its text as that of any other function.

    Args:
      space: names that the text uses; "__name__" is the module that it becomes a part of.
    """
    file = f"<{name} {next(_numbers)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    own = dict(space)
    exec(compile(text, file, "exec", dont_inherit=True), own)
    return own[name]
