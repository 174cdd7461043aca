"""Bytes of text files -> text, whatever byte-order mark they begin with."""

from __future__ import annotations

import codecs

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),  # begins with UTF-16's mark, so it comes first
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


LFS_POINTER = b"version https://git-lfs"
"""How the file begins that a checkout without Git LFS has instead of a large one."""
LFS_FIX = "it is a Git LFS pointer: run git lfs pull"


def marked_encoding(raw: bytes) -> tuple[str, int] | None:
    """(encoding, length of the mark) of bytes that begin with a byte-order mark, else None.

    UTF-16 without a mark is known by a first "<" of two bytes.
    """
    for mark, encoding in _MARKS:
        if raw.startswith(mark):
            return encoding, len(mark)
    return {b"<\0": ("utf-16-le", 0), b"\0<": ("utf-16-be", 0)}.get(raw[:2])


def decoded(raw: bytes) -> str:
    """Text of a file in UTF-8, or in what its byte-order mark says; the mark is left out, bad bytes are replaced."""
    encoding, length = marked_encoding(raw) or ("utf-8", 0)
    return raw[length:].decode(encoding, errors="replace")


def without_mark(raw: bytes) -> bytes:
    """The file in UTF-8 without byte-order mark; the same bytes where there is none."""
    return raw if marked_encoding(raw) is None else decoded(raw).encode("utf-8", errors="replace")
