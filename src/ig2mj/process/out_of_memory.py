"""Errors of XLA, Warp and NumPy that say that memory is used up, as one line with the remedy."""

from __future__ import annotations

OUT_OF_MEMORY = (
    "RESOURCE_EXHAUSTED",
    "Out of memory",
    "Failed to allocate",
    "Cannot allocate memory",
    "failed to map segment from shared object",
)
"""What errors of XLA, Warp, the system and its loader of libraries say, which have no type of their own."""

REMEDY = (
    "use fewer worlds, smaller images or fewer of them, or end other programs that use this device "
    "(XLA_PYTHON_CLIENT_PREALLOCATE=false lets them share it)"
)

MOST = 160
"""Characters of an error's own text that are shown."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether a device or the machine had too little memory."""
    return isinstance(error, MemoryError) or any(sign in str(error) for sign in OUT_OF_MEMORY)


def out_of_memory_text(error: BaseException) -> str:
    """One line: what was asked for, and what helps."""
    asked = " ".join(str(error).split())
    if len(asked) > MOST:
        asked = f"{asked[:MOST].rsplit(' ', 1)[0]} ..."
    return f"Out of memory: {REMEDY}" + (f"; the error was: {asked}" if asked else "")
