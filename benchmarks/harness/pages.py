"""Tables in pages: a program writes what stands between two marks, and nothing else."""

from __future__ import annotations


def between(text: str, begin: str, end: str, content: str) -> str:
    """A page with other content between its marks. Raises ValueError: the page does not have both, in this order."""
    before, rest = text.split(begin)
    return before + begin + content + end + rest.split(end)[1]
