"""`warn_renamed`: a name of Python that still works, and will not in version 0.3."""

from __future__ import annotations

from ig2mj.process.user_warning import warn_user


def rename_text(old: str, new: str) -> str:
    """What is said of a name that was renamed, in Python and on the command line."""
    return f"'{old}' is now '{new}'; the old name will be removed in 0.3"


def warn_renamed(old: str, new: str, owner: str = "") -> None:
    """A FutureWarning, which Python shows by default, at the line of the caller's code outside of ig2mj.

    Args:
      owner: what the name belongs to, e.g. a class.
    """
    message = f"{owner}: {rename_text(old, new)}" if owner else rename_text(old, new)
    warn_user(message, FutureWarning)
