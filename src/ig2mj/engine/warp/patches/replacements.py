"""MuJoCo Warp's functions, replaced for threads inside a block of `KERNELS`."""

from __future__ import annotations

from types import ModuleType
from typing import Any, no_type_check

from ig2mj.engine.warp.patches.scope import ScopedReplacement

KERNELS = ScopedReplacement()
"""Our functions in place of MuJoCo Warp's; filled when they are found to fit (`ig2mj.engine.warp.patches.fit`)."""


@no_type_check
def original(module: ModuleType, name: str) -> Any:
    """MuJoCo Warp's own function of a replaced name."""
    return KERNELS.original(module, name)
