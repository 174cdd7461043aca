"""`warn_renamed`: a name of Python that still works, and will not in the next release."""

from __future__ import annotations

import sys
import warnings

_OURS = ("ig2mj", "ig2mj_converters", "ig2mj_homes", "jaxtyping", "beartype")
"""Packages whose frames are not the user's code; the last two wrap functions while tests run."""


def warn_renamed(old: str, new: str) -> None:
    """A DeprecationWarning at the line of the caller's code, outside of ig2mj, so that Python shows it there."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] in _OURS:
        level, frame = level + 1, frame.f_back
    message = f"'{old}' is now '{new}'; the old name will be removed in the next release"
    warnings.warn(message, DeprecationWarning, stacklevel=level)
