"""`warn_user`: a warning at the line of the user's code that caused it."""

from __future__ import annotations

import sys
import warnings

OURS = ("ig2mj", "ig2mj_converters", "ig2mj_homes", "jaxtyping", "beartype")
"""Packages whose frames are not the user's code; the last two wrap functions while tests run."""


def warn_user(message: str, category: type[Warning]) -> None:
    """Warns at the innermost line of code outside of ig2mj."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] in OURS:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, category, stacklevel=level)
