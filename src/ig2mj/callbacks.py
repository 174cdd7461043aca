"""The type of progress callbacks."""

from __future__ import annotations

from typing import Protocol, runtime_checkable


@runtime_checkable
class ProgressCallback(Protocol):
    """Reports how far long work is. A function `(done, total, text="")`, called after each unit of the work."""

    def __call__(self, done: float | int, total: float | int | None, text: str = "", /) -> None:
        """
        Args:
          done: finished units, of jobs, rows or episodes, or a share of `total`. total: all units; None: not known yet.
          text: what is being done, for people.
        """
        ...


def no_progress(done: float | int, total: float | int | None, text: str = "", /) -> None:
    """Reports nothing."""
