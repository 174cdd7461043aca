"""Contacts of hands with objects that they ignore, dropped where contacts are found (`Write.ignored_contacts`).

MuJoCo Warp calls a contact filter at the end of each collision pass (`Callback.contactfilter`); `filter_contacts` puts
one into MJX's steps. MJX passes the fields of its model to MuJoCo Warp and nothing else. Two that say how sticky geoms
are (`flg_adhesion` is off in every household) carry what the filter needs: `geom_adhesion` says which hand or object a
geom is part of, as `encode` writes it; `pair_adhesion`, which is empty without `<pair>`, says what each world's hands
ignore. In models without them the filter does nothing, so that other users of MJX in the process notice none of it.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false, reportReturnType=false, reportPrivateUsage=false

from typing import Any, no_type_check

import numpy as np
import warp as wp
from mujoco.mjx.warp import forward

from ig2mj.engine.contact_filter import DROPPED_DISTANCE


def encode(geom_hand: np.ndarray, geom_object: np.ndarray, num_objects: int) -> np.ndarray:
    """One number for each geom [G]: above zero for a hand's, below for an object's; see `_drop`."""
    of_hand = np.where(geom_hand >= 0, geom_hand * num_objects + 1, 0)
    return np.where(geom_object >= 0, -(geom_object + 1), of_hand).astype(np.float32)


@wp.kernel(enable_backward=False)
@no_type_check
def _drop(
    code: wp.array2d[float],
    ignored: wp.array2d[float],
    count: wp.array[int],
    worldid: wp.array[int],
    stride: int,
    geom: wp.array[wp.vec2i],
    dist: wp.array[float],
):
    first = wp.tid()
    for contact in range(first, wp.min(count[0], dist.shape[0]), stride):
        pair = geom[contact]
        if pair[0] >= 0 and pair[1] >= 0:
            one = code[0, pair[0]]
            other = code[0, pair[1]]
            if one * other < 0.0:
                place = int(wp.max(one, other)) - 1 - int(wp.min(one, other)) - 1
                world = worldid[contact] % ignored.shape[0]
                if ignored[world, place] > 0.0:
                    dist[contact] = wp.static(DROPPED_DISTANCE)  # no constraint and no touch
                    geom[contact] = wp.vec2i(-1, -1)  # and wakes nothing


DROP = _drop
"""The kernel that takes ignored contacts out, where there are hands."""


def _drop_ignored(m: Any, d: Any) -> None:
    """Takes ignored contacts of all worlds out; after a pass of collision detection."""
    if m.npair or m.flg_adhesion or not m.pair_adhesion.shape[1]:
        return
    threads = max(1, min(d.naconmax, 1 << 17))
    wp.launch(
        _drop,
        dim=threads,
        inputs=[m.geom_adhesion, m.pair_adhesion, d.nacon, d.contact.worldid, threads],
        outputs=[d.contact.geom, d.contact.dist],
    )


def filter_contacts() -> None:
    """Lets the steps of MJX in this process drop ignored contacts. A filter that is there already runs first."""
    callback = forward._cb
    before = callback.contactfilter
    if getattr(before, "_drops_ignored", False):
        return

    def contactfilter(m: Any, d: Any) -> None:
        if before is not None:
            before(m, d)
        _drop_ignored(m, d)

    setattr(contactfilter, "_drops_ignored", True)  # noqa: B010
    callback.contactfilter = contactfilter
