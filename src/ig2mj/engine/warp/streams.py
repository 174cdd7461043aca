"""A mend for Warp 1.18 under JAX: CUDA streams that belong to JAX stay known to Warp.

Warp wraps JAX's stream in an object for each call and forgets the stream when the object goes away. Two calls that
overlap on one stream, as they do when JAX dispatches ahead, then fail with "unknown stream": the first to end takes the
stream from the other. Nothing is lost by never forgetting: JAX has a handful of streams, and they live as long as it.
"""

from __future__ import annotations

from typing import Any

import warp as wp

_MENDED = "_ig2mj_keeps_external_streams"


def keep_external_streams() -> None:
    """Applies the mend, once per process."""
    if getattr(wp.Stream, _MENDED, False):
        return
    forget = wp.Stream.__del__

    def forget_own(self: Any) -> None:
        if self.owner:
            forget(self)

    wp.Stream.__del__ = forget_own
    setattr(wp.Stream, _MENDED, True)
