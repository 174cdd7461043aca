"""Constraint rows and entries of the Hessian in grid-stride loops: a few threads of each world go over what there is.

MuJoCo Warp starts a thread for each row that fits into a world's buffer, and for each entry of the largest Hessian. Of
some hundred rows a few dozen are used, and next to none when most worlds have converged, but starting and ending a
thread costs as much. Here each world has `LANES` threads for its rows and `ENTRIES` for its Hessian.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false, reportPrivateUsage=false, reportAssignmentType=false
# pyright: reportReturnType=false

import functools
from collections.abc import Sequence
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import solver

from ig2mj.engine.warp.patches import compact_solver
from ig2mj.engine.warp.patches.guarded import strided
from ig2mj.engine.warp.patches.launching import Launch

LANES, ENTRIES = 64, 128
"""Threads of a world."""

ROWS = {
    "_update_constraint_efc": "efc_force_out",
    "_update_constraint_init_qfrc_constraint_sparse": "efc_force_in",
    "_linesearch_jv_fused_kernel": "ctx_jv_out",
    "_solve_init_jaref_kernel": "efc_aref_in",
}
"""Functions of the solver that make kernels with a thread for each row, and an argument as long as the buffer (some are
padded): where rows overflow it, their number is larger."""


@functools.cache
def _by_lanes(kernel: wp.Kernel) -> wp.Kernel:
    # The first row has something to do where there is none, too: it counts.
    room = ROWS[kernel.key.split("__locals__")[0]]
    rows = f"wp.min(wp.max(nefc_in[worldid], 1), {room}.shape[1])"
    return strided(kernel, "efcid", rows, LANES, f"ig2mj_grid_stride_{LANES}_{kernel.module.name}")


@wp.kernel(enable_backward=False)
@no_type_check
def _init_hessian(
    nv: int,
    M_elemid: wp.array2d[int],
    inertia: wp.array2d[float],
    cdof_dof: wp.array2d[int],
    done: wp.array[bool],
    hessian: wp.array3d[float],
):
    world, lane = wp.tid()
    if done[world]:
        return
    size = hessian.shape[1]
    awake = int(0)  # noqa: RUF046, UP018 (variables of the kernel, not constants)
    end = int(size)
    while awake < end:  # awake degrees of freedom come first
        middle = (awake + end) // 2
        if cdof_dof[world, middle] >= 0:
            awake = middle + 1
        else:
            end = middle
    active = wp.min(compact_solver._active_size(awake), size)
    for element in range(lane, active * (active + 1) // 2, wp.static(ENTRIES)):
        i, j = solver._upper_triangle_index(element, active)
        value = float(0.0)  # noqa: UP018
        dof = cdof_dof[world, j]
        if dof < 0:
            if i == j:
                value = 1.0
        else:
            entry = M_elemid[dof, cdof_dof[world, i]]
            if entry >= 0:
                value = inertia[world, entry]
        hessian[world, i, j] = value


@no_type_check
def substitute(kernel: wp.Kernel, dim: Any, inputs: Sequence[Any]) -> Launch | None:
    """The kernel of few threads in place of one of `ROWS`, or of the one that begins the Hessian."""
    if kernel is compact_solver._init_hessian_kernel():
        return _init_hessian, (dim[0], ENTRIES), list(inputs)
    if isinstance(dim, tuple) and kernel.key.split("__locals__")[0] in ROWS and (len(dim) < 3 or dim[2] == 1):
        return _by_lanes(kernel), (dim[0], LANES), list(inputs)
    return None
