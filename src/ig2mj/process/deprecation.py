"""`warn_renamed`: a name of Python that still works, and will not in version 0.3."""

from __future__ import annotations

import sys
import warnings

OURS = ("ig2mj", "ig2mj_converters", "ig2mj_homes", "jaxtyping", "beartype")
"""Packages whose frames are not the user's code; the last two wrap functions while tests run."""


def rename_text(old: str, new: str) -> str:
    """What is said of a name that was renamed, in Python and on the command line."""
    return f"'{old}' is now '{new}'; the old name will be removed in 0.3"


def warn_renamed(old: str, new: str, owner: str = "") -> None:
    """A FutureWarning, which Python shows by default, at the line of the caller's code outside of ig2mj.

    Args:
      owner: what the name belongs to, e.g. a class.
    """
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] in OURS:
        level, frame = level + 1, frame.f_back
    message = f"{owner}: {rename_text(old, new)}" if owner else rename_text(old, new)
    warnings.warn(message, FutureWarning, stacklevel=level)
