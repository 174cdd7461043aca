"""The compacted solver's matrices, filled and factorised as far as degrees of freedom are awake.

Awake degrees of freedom come first and are `ncdof`; the rest of the matrix is identity. One row after them must stay,
as upstream keeps one: the factorisation borders the matrix with the right-hand side there.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportAssignmentType=false, reportReturnType=false, reportOperatorIssue=false
# pyright: reportPrivateUsage=false

import functools
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import block_cholesky, solver

from ig2mj.engine.warp.patches.replacements import original

TILE = 16
"""Rows of a block of the blocked factorisations (`types.TILE_SIZE_JTDAJ_DENSE`)."""


@wp.func
@no_type_check
def _active_size(awake: int) -> int:
    return (awake // TILE + 1) * TILE


@functools.cache
@no_type_check
def _factorize_kernel(size: int, vector_size: int) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options={"enable_mathdx_gemm": False})
    def factorize(
        awake: wp.array[int],
        done: wp.array[bool],
        grad: wp.array3d[float],
        hessian: wp.array3d[float],
        factor: wp.array3d[float],
        search: wp.array3d[float],
        search_dot: wp.array[float],
        newton_decrement: wp.array[float],
    ):
        world = wp.tid()
        if done[world]:
            return
        sums = wp.static(
            block_cholesky.create_blocked_cholesky_augmented_factorize_solve_newton_func(TILE, size, vector_size)
        )(hessian[world], grad[world], _active_size(awake[world]), factor[world], search[world])
        search_dot[world] = sums[0]
        newton_decrement[world] = sums[1]

    return factorize


@functools.cache
@no_type_check
def _refactorize_kernel(size: int, vector_size: int, skip_noflip: bool) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options={"enable_mathdx_gemm": False})
    def refactorize(
        awake: wp.array[int],
        done: wp.array[bool],
        grad: wp.array3d[float],
        hessian: wp.array3d[float],
        quad_changed: wp.array[int],
        state_changed: wp.array[int],
        factor: wp.array3d[float],
        search: wp.array3d[float],
        search_dot: wp.array[float],
        newton_decrement: wp.array[float],
    ):
        world = wp.tid()
        if done[world]:
            return
        if wp.static(skip_noflip) and state_changed[world] == 0:
            return
        active = _active_size(awake[world])
        if quad_changed[world] > 0:
            sums = wp.static(
                block_cholesky.create_blocked_cholesky_augmented_factorize_solve_newton_func(TILE, size, vector_size)
            )(hessian[world], grad[world], active, factor[world], search[world])
        else:
            sums = wp.static(block_cholesky.create_blocked_cholesky_solve_newton_func(TILE, size, vector_size))(
                factor[world], grad[world], active, search[world]
            )
        search_dot[world] = sums[0]
        newton_decrement[world] = sums[1]

    return refactorize


@functools.cache
@no_type_check
def _smooth_kernel(size: int) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options={"enable_mathdx_gemm": False})
    def factorize_smooth(
        awake: wp.array[int],
        inertia: wp.array3d[float],
        force: wp.array3d[float],
        factor: wp.array3d[float],
        acceleration: wp.array3d[float],
    ):
        world = wp.tid()
        wp.static(block_cholesky.create_blocked_cholesky_factorize_solve_func(TILE, size))(
            inertia[world], force[world], _active_size(awake[world]), factor[world], acceleration[world]
        )

    return factorize_smooth


@wp.kernel(enable_backward=False)
@no_type_check
def _init_inertia(awake: wp.array[int], inertia: wp.array3d[float]):
    world, column = wp.tid()
    active = _active_size(awake[world])
    if column >= active:
        return
    for row in range(active):
        inertia[world, row, column] = wp.where(row == column and row >= awake[world], 1.0, 0.0)


@functools.cache
@no_type_check
def _init_hessian_kernel() -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False, grid_stride=True)
    def init_hessian(
        nv: int,
        M_elemid: wp.array2d[int],
        M: wp.array2d[float],
        cdof_dof: wp.array2d[int],
        done: wp.array[bool],
        hessian: wp.array3d[float],
    ):
        world, element = wp.tid()
        if done[world]:
            return
        i, j = solver._upper_triangle_index(element, hessian.shape[1])
        block = (j // TILE) * TILE  # the first block past the awake ones is still needed, for the border
        if cdof_dof[world, wp.max(block - 1, 0)] < 0 and block > 0:
            return
        value = float(0.0)  # noqa: UP018 (a variable of the kernel, not a constant)
        dof_j = cdof_dof[world, j]
        if dof_j < 0:
            if i == j:
                value = 1.0
        else:
            entry = M_elemid[dof_j, cdof_dof[world, i]]
            if entry >= 0:
                value = M[world, entry]
        hessian[world, i, j] = value

    return init_hessian


def init_hessian(compact: bool) -> wp.Kernel:
    """The kernel that begins a Hessian with the inertia; upstream's where the solver is not compacted."""
    if not compact:
        return original(solver, "_update_gradient_init_h_sparse")(compact)
    return _init_hessian_kernel()


def cholesky_factorize_solve(m: Any, d: Any, ctx: Any, skip_unchanged: bool = False, skip_noflip: bool = False) -> None:
    """Factorises the Hessian and solves for the search direction, of what is awake."""
    if not solver._sparse_compact(ctx) or m.nv <= solver._BLOCK_CHOLESKY_DIM:
        original(solver, "_cholesky_factorize_solve")(m, d, ctx, skip_unchanged, skip_noflip)
        return
    grad = ctx.grad.reshape(shape=(d.nworld, ctx.grad.shape[1], 1))
    outputs = [ctx.search.reshape(shape=(d.nworld, m.nv, 1)), ctx.search_dot, ctx.newton_decrement]
    block_dim = m.block_dim.update_gradient_cholesky_blocked
    awake = ctx.compact_d_full.ncdof
    if skip_unchanged:
        counts = [ctx.quad_changed_count, ctx.state_changed_count if skip_noflip else ctx.quad_changed_count]
        kernel = _refactorize_kernel(m.nv_pad, m.nv, skip_noflip)
        inputs = [awake, ctx.done, grad, ctx.h, *counts, ctx.hfactor]
    else:
        kernel = _factorize_kernel(m.nv_pad, m.nv)
        inputs = [awake, ctx.done, grad, ctx.h, ctx.hfactor]
    wp.launch_tiled(kernel, dim=d.nworld, inputs=inputs, outputs=outputs, block_dim=block_dim)


def smooth_solve_compact(m: Any, d: Any) -> None:
    """Accelerations without constraints, of what is awake."""
    size = d.nvmax_pad
    wp.launch(_init_inertia, dim=(d.nworld, size), inputs=[d.ncdof], outputs=[d.cM])
    wp.launch(
        solver._gather_M_sparse,
        dim=(d.nworld, m.nv),
        inputs=[m.M_rownnz, m.M_rowadr, m.M_colind, d.M, d.dof_cdof],
        outputs=[d.cM],
    )
    wp.launch(solver._gather_rhs_compact, dim=(d.nworld, size), inputs=[d.cdof_dof, d.qfrc_smooth], outputs=[d.crhs])
    wp.launch_tiled(
        _smooth_kernel(size),
        dim=d.nworld,
        inputs=[d.ncdof, d.cM, d.crhs],
        outputs=[d.cqLD, d.cx],
        block_dim=m.block_dim.update_gradient_cholesky_blocked,
    )
    wp.launch(solver._scatter_solution, dim=(d.nworld, m.nv), inputs=[d.dof_cdof, d.cx], outputs=[d.qacc_smooth])
