"""The Newton solver's later iterations as one kernel: a block of threads takes its world through all that are left.

MuJoCo Warp launches a dozen kernels for each iteration, for as many iterations as the slowest of all worlds needs. Half
of the worlds of `birch` need three, one in a hundred nine, so that most launches find next to nothing to do. Here the
first iterations, which most worlds need, are MuJoCo Warp's. Then what is done for a world in an iteration, from the
line search to the next direction, is done by one block, between barriers of its own, and a world that has converged
leaves at once. The first iterations are faster in kernels of their own: this one needs the registers of all its parts,
so that fewer threads run side by side.

The line search is MuJoCo Warp's source, made into a function; the factorisation is its function. Everything else is
written here for what households use: Newton, pyramidal cones, degrees of freedom compacted to those awake.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false, reportPrivateUsage=false, reportAssignmentType=false
# pyright: reportReturnType=false
# ruff: noqa: UP018 (variables of the kernel, not constants)

import functools
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import block_cholesky, math, solver, types

from ig2mj.engine.warp.patches import compact_solver
from ig2mj.engine.warp.patches.compact_solver import TILE
from ig2mj.engine.warp.patches.line_search import line_search as line_search_of
from ig2mj.engine.warp.patches.replacements import original

WIDE = 2
"""Iterations that MuJoCo Warp's own kernels make first."""

THREADS, REGISTERS = 128, 128
"""Threads of a world, and registers of each at most."""

GROUP = 32
"""Threads that add a constraint row to the Hessian together."""

QUADRATIC = int(types.ConstraintState.QUADRATIC)
ITERATIONS = int(types.OverflowType.ITERATIONS)


def solve(m: Any, d: Any, ctx: Any, compact: bool = False) -> None:
    """Finds constraint forces and accelerations; as upstream where the kernel does not serve."""
    if not (compact and _serves(m, ctx)):
        original(solver, "_solve")(m, d, ctx, compact)
        return
    warmstart = not (m.opt.disableflags & types.DisableBit.WARMSTART)
    wp.launch(
        solver._solve_init_dof(warmstart, m.is_sparse),
        dim=(d.nworld, m.nv),
        inputs=[d.nefc, d.qacc_warmstart, d.qacc_smooth],
        outputs=[d.qacc, d.qfrc_constraint],
    )
    solver.init_context(m, d, ctx, grad=False, compact=compact)
    solver._update_gradient(m, d, ctx, compact=compact)
    ctx.search_unchanged.zero_()
    solving = wp.full(shape=(1,), value=d.nworld, dtype=int)
    for _ in range(min(WIDE, m.opt.iterations)):
        solver._solver_iteration(m, d, ctx, solving, compact=compact)
    _go_on(m, d, ctx)
    wp.launch(
        solver._qfrc_constraint_from_grad,
        dim=(d.nworld, m.nv),
        inputs=[d.qfrc_smooth, d.efc.Ma, ctx.grad, ctx.grad_scale],
        outputs=[d.qfrc_constraint],
    )


def _serves(m: Any, ctx: Any) -> bool:
    """Whether the kernel is for this model: what it leaves out is not there."""
    return (
        solver._sparse_compact(ctx)
        and solver._use_incremental(m)
        and m.nv > solver._BLOCK_CHOLESKY_DIM
        and m.opt.integrator != types.IntegratorType.DISCRETE
    )


def _go_on(m: Any, d: Any, ctx: Any) -> None:
    """The iterations that are left, of the worlds that have not converged."""
    full, whole = ctx.compact_m_full, ctx.compact_d_full
    vectors = [array.reshape(shape=(d.nworld, array.shape[1], 1)) for array in (ctx.grad, ctx.search)]
    wp.launch_tiled(
        _loop_kernel(m.nv_pad, m.nv, m.opt.ls_iterations, int(m.opt.warn_overflow)),
        dim=d.nworld,
        inputs=[
            m.opt.iterations,
            m.opt.tolerance,
            m.opt.ls_tolerance,
            full.M_mulm_rowadr,
            full.M_mulm_col,
            full.M_mulm_madr,
            whole.M,
            whole.ncdof,
            whole.cdof_dof,
            whole.dof_cdof,
            d.ne,
            d.nf,
            d.nefc,
            whole.efc.J_rownnz,
            whole.efc.J_rowadr,
            whole.efc.J_colind,
            whole.efc.J,
            d.efc.D,
            d.efc.frictionloss,
            d.qfrc_smooth,
            ctx.inertia_scale,
        ],
        outputs=[
            d.qacc,
            d.efc.Ma,
            d.efc.force,
            d.efc.state,
            d.qfrc_constraint,
            d.solver_niter,
            d.overflow,
            ctx.Jaref,
            ctx.grad,
            ctx.search,
            *vectors,
            ctx.mv,
            ctx.jv,
            ctx.h,
            ctx.hfactor,
            ctx.search_dot,
            ctx.grad_dot,
            ctx.grad_scale,
            ctx.newton_decrement,
            ctx.search_unchanged,
            ctx.quad_changed_ids,
            ctx.quad_changed_count,
            ctx.state_changed_count,
            ctx.done,
        ],
        block_dim=THREADS,
    )


@wp.func_native(snippet="WP_TILE_SYNC();")
def _barrier(): ...


@functools.cache
@no_type_check
def _loop_kernel(size: int, vector_size: int, ls_iterations: int, warns: int) -> wp.Kernel:
    line_search = line_search_of(ls_iterations, warns)
    factorize = block_cholesky.create_blocked_cholesky_augmented_factorize_solve_newton_func(TILE, size, vector_size)

    @wp.kernel(
        module="unique",
        enable_backward=False,
        grid_stride=False,
        cuda_max_registers=REGISTERS,
        module_options={"enable_mathdx_gemm": False},
    )
    def solver_loop(
        iterations: int,
        tolerances: wp.array[float],
        ls_tolerances: wp.array[float],
        M_rowadr: wp.array[int],
        M_col: wp.array[int],
        M_madr: wp.array[int],
        M: wp.array2d[float],
        ncdof: wp.array[int],
        cdof_dof: wp.array2d[int],
        dof_cdof: wp.array2d[int],
        ne: wp.array[int],
        nf: wp.array[int],
        nefc: wp.array[int],
        J_rownnz: wp.array2d[int],
        J_rowadr: wp.array2d[int],
        J_colind: wp.array3d[int],
        J: wp.array3d[float],
        D: wp.array2d[float],
        frictionloss: wp.array2d[float],
        qfrc_smooth: wp.array2d[float],
        inertia_scale: wp.array[float],
        qacc: wp.array2d[float],
        Ma: wp.array2d[float],
        force: wp.array2d[float],
        state: wp.array2d[int],
        qfrc_constraint: wp.array2d[float],
        solver_niter: wp.array[int],
        overflow: wp.array[int],
        Jaref: wp.array2d[float],
        grad: wp.array2d[float],
        search: wp.array2d[float],
        grad_column: wp.array3d[float],
        search_column: wp.array3d[float],
        mv: wp.array2d[float],
        jv: wp.array2d[float],
        hessian: wp.array3d[float],
        factor: wp.array3d[float],
        search_dots: wp.array[float],
        grad_dots: wp.array[float],
        grad_scales: wp.array[float],
        decrements: wp.array[float],
        unchanged: wp.array[bool],
        flipped: wp.array2d[int],
        num_flipped: wp.array[int],
        num_changed: wp.array[int],
        done: wp.array[bool],
    ):
        world, tid = wp.tid()
        if done[world]:
            return
        threads = wp.block_dim()
        awake = wp.min(ncdof[world], search.shape[1])
        active = compact_solver._active_size(awake)
        rows = wp.min(nefc[world], Jaref.shape[1])
        equalities = ne[world]
        rows_of_two_sides = equalities + nf[world]
        tolerance = tolerances[world % tolerances.shape[0]]
        scale = inertia_scale[world]

        # The same in all threads of the block, as is everything that a branch with a barrier depends on:
        niter = int(solver_niter[world])
        fresh = not unchanged[world]
        grad_dot = float(grad_dots[world])
        grad_scale = float(grad_scales[world])
        decrement = float(decrements[world])
        converged = bool(False)
        if tid == 0:
            num_flipped[world] = 0
            num_changed[world] = 0
        _barrier()

        while niter < iterations:
            # Products with the direction, where it is new. Rows and degrees of freedom stay with their thread.
            if fresh:
                for i in range(tid, awake, threads):
                    dof = cdof_dof[world, i]
                    product = float(0.0)
                    for k in range(M_rowadr[dof], M_rowadr[dof + 1]):
                        j = dof_cdof[world, M_col[k]]
                        product += wp.where(j >= 0, M[world, M_madr[k]] * search[world, wp.max(j, 0)], 0.0)
                    mv[world, i] = product
                for row in range(tid, rows, threads):
                    first = J_rowadr[world, row]
                    product = float(0.0)
                    for k in range(first, first + J_rownnz[world, row]):
                        j = dof_cdof[world, J_colind[world, 0, k]]
                        product += wp.where(j >= 0, J[world, 0, k] * search[world, wp.max(j, 0)], 0.0)
                    jv[world, row] = product

            step = line_search(
                world,
                tid,
                awake,
                tolerances,
                ls_tolerances,
                ne,
                nf,
                nefc,
                qfrc_smooth,
                D,
                frictionloss,
                Jaref.shape[1],
                inertia_scale,
                Jaref,
                search,
                search_dots,
                mv,
                jv,
                qacc,
                Ma,
                overflow,
                Jaref,
            )
            alpha = step[0]

            # Forces and states. The counts are 0, and were last read before the line search, whose sums are barriers.
            for row in range(tid, rows, threads):
                friction = bool(row >= equalities and row < rows_of_two_sides)
                loss = float(0.0)
                if friction:
                    loss = frictionloss[world, row]
                before = state[world, row]
                found = solver._eval_constraint(
                    row < equalities,
                    friction,
                    False,
                    Jaref[world, row],
                    D[world, row],
                    loss,
                    row,
                    -1,
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                )
                now = int(found[1])
                force[world, row] = found[0]
                state[world, row] = now
                if before != now:
                    wp.atomic_add(num_changed, world, 1)
                    if before == wp.static(QUADRATIC) or now == wp.static(QUADRATIC):
                        flipped[world, wp.atomic_add(num_flipped, world, 1)] = row
            _barrier()
            flips = num_flipped[world]
            fresh = num_changed[world] > 0 or step[2] != 0.0

            if fresh:
                for i in range(tid, awake, threads):
                    qfrc_constraint[world, i] = 0.0
                _barrier()
                for row in range(tid, rows, threads):
                    pushes = force[world, row]
                    if pushes != 0.0:
                        first = J_rowadr[world, row]
                        for k in range(first, first + J_rownnz[world, row]):
                            j = dof_cdof[world, J_colind[world, 0, k]]
                            if j >= 0:
                                wp.atomic_add(qfrc_constraint, world, j, J[world, 0, k] * pushes)
                lanes = wp.min(threads, wp.static(GROUP))
                for flip in range(tid // lanes, flips, threads // lanes):
                    row = flipped[world, flip]
                    weight = D[world, row]
                    if state[world, row] != wp.static(QUADRATIC):
                        weight = -weight
                    first = J_rowadr[world, row]
                    nonzeros = J_rownnz[world, row]
                    for entry in range(tid % lanes, nonzeros * (nonzeros + 1) // 2, lanes):
                        a = int((wp.sqrt(float(8 * entry + 1)) - 1.0) * 0.5)
                        b = entry - a * (a + 1) // 2
                        value = weight * J[world, 0, first + a] * J[world, 0, first + b]
                        if value != 0.0:
                            i = dof_cdof[world, J_colind[world, 0, first + a]]
                            j = dof_cdof[world, J_colind[world, 0, first + b]]
                            if i >= 0 and j >= 0:
                                wp.atomic_add(hessian, world, wp.min(i, j), wp.max(i, j), value)
                _barrier()
                if tid == 0:
                    num_flipped[world] = 0
                    num_changed[world] = 0
                square = float(0.0)
                for i in range(tid, awake, threads):
                    slope = Ma[world, i] - qfrc_smooth[world, i] - qfrc_constraint[world, i]
                    grad[world, i] = slope
                    square += slope * slope
                grad_dot = wp.tile_reduce(wp.add, wp.tile(square))[0]
                grad_scale = 1.0
                _barrier()
                sums = factorize(hessian[world], grad_column[world], active, factor[world], search_column[world])
                search_dots[world] = sums[0]
                decrement = sums[1]
                _barrier()
            else:
                # Nothing changed sides, so that the cost is a parabola along the direction, which stays.
                left = grad_scale - alpha
                ratio = math.safe_div(left, grad_scale)
                grad_dot *= ratio * ratio
                decrement *= ratio * ratio
                grad_scale = left

            niter += 1
            gain = scale * step[1]
            converged = (
                alpha == 0.0
                or (gain > 0.0 and gain < tolerance)
                or scale * wp.sqrt(grad_dot) < tolerance
                or scale * 0.5 * decrement < tolerance
            )
            if converged:
                break

        if tid == 0:
            solver_niter[world] = niter
            grad_scales[world] = grad_scale
            if niter >= iterations and not converged:
                wp.atomic_or(overflow, world, wp.static(ITERATIONS))
                if wp.static(bool(warns & ITERATIONS)):
                    wp.printf("solver iterations limit reached - please increase iterations beyond %u\n", iterations)

    return solver_loop
