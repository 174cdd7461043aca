"""Collision detection as a whole: contacts are checked, and pairs are counted in both passes.

MuJoCo Warp counts pairs again in the second pass of a step, which looks for pairs of what the first pass woke, and
compares only that number with the size of the buffer. Too many pairs in the first pass are not flagged.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false

from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import collision_driver

from ig2mj.engine.warp.patches.contacts import mend_contacts
from ig2mj.engine.warp.patches.replacements import original
from ig2mj.engine.warp.patches.table import runs


@wp.kernel(enable_backward=False)
@no_type_check
def _keep_larger(first: wp.array[int], ncollision: wp.array[int]):
    ncollision[0] = wp.max(first[0], ncollision[0])


def collision(m: Any, d: Any, awake_prev: Any = None) -> None:
    """Collision detection as upstream; afterwards `d.ncollision` is that of the larger pass, and contacts are checked
    against their geoms."""
    find = original(collision_driver, "collision")
    if awake_prev is None or not runs("pair_overflow"):
        find(m, d, awake_prev)
    else:
        first = wp.clone(d.ncollision)
        find(m, d, awake_prev)
        wp.launch(_keep_larger, dim=1, inputs=[first], outputs=[d.ncollision])
    if d.naconmax > 0 and runs("contacts"):
        mend_contacts(m, d)
