"""Collision detection: a broad phase for what is awake, contacts looked through, and pairs counted in both passes."""

# Warp's kernels are not Python, whatever they look like, so nothing may check or wrap them:
# pyright: reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false

from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import collision_driver

from ig2mj.engine.warp.patches.broadphase import awake_broadphase, serves
from ig2mj.engine.warp.patches.contacts import mend_contacts
from ig2mj.engine.warp.patches.ignored import drop_ignored
from ig2mj.engine.warp.patches.replacements import original


def choose_broadphase(name: str, m: Any, d: Any, ctx: Any, awake_prev: Any = None) -> None:
    """The broad phase of what is awake where it finds all pairs; else `name`, the one that MuJoCo Warp chose."""
    if serves(m):
        awake_broadphase(m, d, ctx, awake_prev)
    else:
        original(collision_driver, name)(m, d, ctx, awake_prev)


@wp.kernel(enable_backward=False)
@no_type_check
def _keep_larger(first: wp.array[int], ncollision: wp.array[int]):
    ncollision[0] = wp.max(first[0], ncollision[0])


def collision(m: Any, d: Any, awake_prev: Any = None) -> None:
    """Collision detection as upstream; then contacts are checked against their geoms and ignored ones dropped.

    Upstream counts pairs anew in the second pass, of what the first woke, and looks only at that number for an
    overflow; afterwards `d.ncollision` is that of the larger pass here.
    """
    if awake_prev is None:
        original(collision_driver, "collision")(m, d)
    else:
        first = wp.clone(d.ncollision)
        original(collision_driver, "collision")(m, d, awake_prev)
        wp.launch(_keep_larger, dim=1, inputs=[first], outputs=[d.ncollision])
    if d.naconmax > 0:
        mend_contacts(m, d)
        drop_ignored(m, d)
