"""Memory that MuJoCo Warp leaves unwritten in data is zero, so that programs which hold data are found in caches.

Programs of JAX contain the arrays they close over as constants. Unwritten memory holds other numbers in each
process, so no cache of programs would recognise them.
"""

from __future__ import annotations

import contextlib

import warp as wp

from ig2mj.engine.warp.patches.scope import ScopedReplacement

_ZEROED = ScopedReplacement()
_ZEROED.add({(wp, "empty"): wp.zeros})


def unwritten_is_zero() -> contextlib.AbstractContextManager[None]:
    """Inside the block, Warp arrays that are made without values are zeros."""
    return _ZEROED.entered()
