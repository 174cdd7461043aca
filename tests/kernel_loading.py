"""Kernels of a test, compiled on all processors before it needs them: one by one they take minutes on a GPU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import warp as wp

from ig2mj.engine.warp import kernels


def load_kernels_of(*acts: Callable[[], Any]) -> None:
    """Loads what these functions launch on the present CUDA device. Nothing is launched."""
    device = wp.get_device()
    if device.is_cuda:
        kernels.load([launch for act in acts for launch in kernels.launches_of(act)], device)
