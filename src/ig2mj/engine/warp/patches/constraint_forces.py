"""Constraint forces of worlds without constraints, zeroed before they are read.

MuJoCo Warp's compacted solver says that its model is dense, and the kernel that zeroes these forces in worlds without
constraints is the sparse one. The forces are read all the same, from memory that was never written. Where that memory
holds no finite numbers the world is lost: one of 16,384 was, in eight seconds of pushing.
"""

# pyright: reportPrivateUsage=false

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import solver

from ig2mj.engine.warp.patches.replacements import original


def solve_init_dof(warmstart: bool, sparse: bool) -> wp.Kernel:
    """The kernel that begins a solve: always the one for sparse models, which zeroes these forces."""
    del sparse
    return original(solver, "_solve_init_dof")(warmstart, True)
