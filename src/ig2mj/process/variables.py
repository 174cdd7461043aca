"""Environment variables of other libraries that have values which these refuse, while they are imported or started."""

from __future__ import annotations

import os
import re

from ig2mj.errors import EngineError

FIXES = {"MUJOCO_GL": "egl and osmesa draw without a display, glfw with one", "JAX_PLATFORMS": "cpu, or cuda on a GPU"}
"""Values that are allowed, by variable."""

_NAME = re.compile(r"\b(?:MUJOCO_GL|PYOPENGL_PLATFORM|XLA_FLAGS|JAX_\w+)\b")


def error_of_variable(error: BaseException) -> EngineError | None:
    """The user's error where a library refuses the value of an environment variable, else None."""
    text = " ".join(str(error).split())
    found = _NAME.search(text) if isinstance(error, RuntimeError | ValueError) else None
    value = os.environ.get(found[0]) if found else None
    if found is None or value is None:
        return None
    fix = f"{FIXES[found[0]]}, or unset it" if found[0] in FIXES else "unset it"
    return EngineError(f"the environment variable {found[0]} is '{value}': {text} ({fix})")
