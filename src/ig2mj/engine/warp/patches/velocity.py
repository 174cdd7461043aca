"""The velocity stage, not run a second time at the end of a step."""

from __future__ import annotations

import threading
from typing import Any

from mujoco.mjx.third_party.mujoco_warp._src import forward

from ig2mj.engine.warp.patches.replacements import original

_inside = threading.local()


def advance(*args: Any, **kwargs: Any) -> None:
    """The end of a step, as upstream but for the velocity stage."""
    _inside.advance = True
    try:
        original(forward, "_advance")(*args, **kwargs)
    finally:
        _inside.advance = False


def fwd_velocity(m: Any, d: Any) -> None:
    """The velocity stage, unless it is called from `advance`."""
    if not getattr(_inside, "advance", False):
        original(forward, "fwd_velocity")(m, d)
