"""Warp kernels that cost what is awake, not what could be: changes to MuJoCo Warp 3.17 for households.

Nearly everything in a home sleeps, but five parts of MuJoCo Warp's step cost as if nothing did. `use_awake_kernels`
puts these in their place; results are the same up to rounding:

- The factorisations of the compacted solver run over the buffer (`nvmax`, sized for the worst moment of the busiest
  world) though the rest of it is identity. Here they stop after the degrees of freedom awake in each world.
- The same for filling those matrices.
- The broad phase of collision detection goes through all pairs of geoms (`ig2mj.engine.warp_broadphase`).
- Gravity compensation is launched for every (world, body, degree of freedom). Here it is for every (world, body).
- The velocity stage runs again at the end of a step with sleep, only to renew derived quantities (`cvel`,
  `qfrc_bias`) that the next step computes anew from positions and velocities. Here they are those of the step's
  beginning, as they are without sleep.

Two more, for safety:

- In a world without any constraint the compacted solver reads constraint forces that were never written (its model says
  that it is dense, and the kernel that zeroes them is for sparse ones). Where that memory holds no numbers, the world
  is lost: one of ten thousand in a minute, as soon as all that moves is in the air. Here they are zeroed.
- Contacts are checked against their geoms (`ig2mj.engine.warp_contacts`).

On an H200 the first is a third to a half of a step, the third a fifth (docs/notes.md has the figures). The functions
replaced are private to MuJoCo Warp, which is pinned; a version without them is left as it is, with a warning.
"""

# Warp's kernels are not Python, whatever they look like, so nothing may check or wrap them:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportAssignmentType=false, reportReturnType=false, reportOperatorIssue=false
# pyright: reportPrivateUsage=false

import contextlib
import dataclasses
import functools
import threading
import warnings
from collections.abc import Iterator
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import (
    block_cholesky,
    collision_driver,
    forward,
    passive,
    solver,
    support,
    types,
)

from ig2mj.engine import warp_broadphase
from ig2mj.engine.warp_contacts import mend_contacts

TILE = 16
"""Rows of a block of the blocked factorisations (`types.TILE_SIZE_JTDAJ_DENSE`)."""

_NEEDED = {
    solver: (
        "_cholesky_factorize_solve",
        "_update_gradient_init_h_sparse",
        "_upper_triangle_index",
        "_sparse_compact",
        "_BLOCK_CHOLESKY_DIM",
        "smooth_solve_compact",
        "_gather_M_sparse",
        "_gather_rhs_compact",
        "_scatter_solution",
        "_solve_init_dof",
    ),
    block_cholesky: (
        "create_blocked_cholesky_factorize_solve_func",
        "create_blocked_cholesky_augmented_factorize_solve_newton_func",
        "create_blocked_cholesky_solve_newton_func",
    ),
    passive: ("passive",),
    collision_driver: ("collision", *warp_broadphase.NEEDED),
    forward: ("_advance", "fwd_velocity"),
}

_upstream: dict[tuple[Any, str], Any] = {}
_inside = threading.local()


def use_awake_kernels() -> bool:
    """Puts the kernels in place, once per process. Returns whether they are."""
    if _upstream:
        return True
    missing = [name for module, names in _NEEDED.items() for name in names if not hasattr(module, name)]
    if missing:
        warnings.warn(f"this MuJoCo Warp has no {', '.join(missing)}: its own, slower kernels run", stacklevel=2)
        return False
    for module, name, own in (
        (solver, "_cholesky_factorize_solve", _cholesky_factorize_solve),
        (solver, "_update_gradient_init_h_sparse", _init_hessian),
        (solver, "smooth_solve_compact", _smooth_solve_compact),
        (solver, "_solve_init_dof", _solve_init_dof),
        (passive, "passive", _passive),
        (collision_driver, "collision", _collision),
        (collision_driver, "nxn_broadphase", functools.partial(_broadphase, "nxn_broadphase")),
        (collision_driver, "sap_broadphase", functools.partial(_broadphase, "sap_broadphase")),
        (forward, "_advance", _advance),
        (forward, "fwd_velocity", _fwd_velocity),
    ):
        _upstream[module, name] = getattr(module, name)
        setattr(module, name, own)
    return True


@contextlib.contextmanager
def upstream_kernels() -> Iterator[None]:
    """MuJoCo Warp as it comes, for comparison. Programs traced or captured before keep what they have."""
    replaced = dict(_upstream)
    _upstream.clear()
    own = {key: getattr(*key) for key in replaced}
    for (module, name), function in replaced.items():
        setattr(module, name, function)
    try:
        yield
    finally:
        for (module, name), function in own.items():
            setattr(module, name, function)
        _upstream.update(replaced)


# The compacted solver. Awake degrees of freedom come first and are `ncdof`; the rest of the matrix is identity. One row
# after them must stay, as upstream keeps one: the factorisation borders the matrix with the right-hand side there.


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


@wp.kernel
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


def _init_hessian(compact: bool) -> wp.Kernel:
    if not compact:
        return _upstream[solver, "_update_gradient_init_h_sparse"](compact)
    return _init_hessian_kernel()


def _cholesky_factorize_solve(
    m: Any, d: Any, ctx: Any, skip_unchanged: bool = False, skip_noflip: bool = False
) -> None:
    if not solver._sparse_compact(ctx) or m.nv <= solver._BLOCK_CHOLESKY_DIM:
        _upstream[solver, "_cholesky_factorize_solve"](m, d, ctx, skip_unchanged, skip_noflip)
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


def _solve_init_dof(warmstart: bool, sparse: bool) -> wp.Kernel:
    """Start of a solve; also zeroes the constraint forces of worlds without constraints, which a dense model needs as
    much as a sparse one."""
    del sparse
    return _upstream[solver, "_solve_init_dof"](warmstart, True)


def _smooth_solve_compact(m: Any, d: Any) -> None:
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


# Gravity compensation.


@wp.kernel
@no_type_check
def _gravity_compensation(
    gravity: wp.array[wp.vec3],
    body_parentid: wp.array[int],
    body_rootid: wp.array[int],
    body_mass: wp.array2d[float],
    body_gravcomp: wp.array2d[float],
    dof_bodyid: wp.array[int],
    body_isdofancestor: wp.array2d[int],
    xipos: wp.array2d[wp.vec3],
    subtree_com: wp.array2d[wp.vec3],
    cdof: wp.array2d[wp.spatial_vector],
    jnt_actgravcomp: wp.array[int],
    dof_jntid: wp.array[int],
    qfrc_gravcomp: wp.array2d[float],
    qfrc_passive: wp.array2d[float],
):
    world, body = wp.tid()
    body += 1
    share = body_gravcomp[world % body_gravcomp.shape[0], body]
    if share == 0.0:
        return
    force = -gravity[world % gravity.shape[0]] * body_mass[world % body_mass.shape[0], body] * share
    place = xipos[world, body]
    for dof in range(dof_bodyid.shape[0]):
        if body_isdofancestor[body, dof] != 0:
            along, _turn = support.jac_dof(
                body_parentid, body_rootid, dof_bodyid, body_isdofancestor, subtree_com, cdof, place, body, dof, world
            )
            wp.atomic_add(qfrc_gravcomp[world], dof, wp.dot(along, force))
            if jnt_actgravcomp[dof_jntid[dof]] == 0:  # else the actuators carry it
                wp.atomic_add(qfrc_passive[world], dof, wp.dot(along, force))


def _passive(m: Any, d: Any) -> None:
    """Passive forces without gravity compensation, as upstream; then that."""
    gravity = types.DisableBit.GRAVITY
    if m.opt.disableflags & gravity or m.callback.passive:
        _upstream[passive, "passive"](m, d)
        return
    opt = dataclasses.replace(m.opt, disableflags=m.opt.disableflags | gravity)
    _upstream[passive, "passive"](dataclasses.replace(m, opt=opt), d)
    wp.launch(
        _gravity_compensation,
        dim=(d.nworld, m.nbody - 1),
        inputs=[
            m.opt.gravity,
            m.body_parentid,
            m.body_rootid,
            m.body_mass,
            m.body_gravcomp,
            m.dof_bodyid,
            m.body_isdofancestor,
            d.xipos,
            d.subtree_com,
            d.cdof,
            m.jnt_actgravcomp,
            m.dof_jntid,
        ],
        outputs=[d.qfrc_gravcomp, d.qfrc_passive],
    )


# Collision detection.


def _broadphase(name: str, m: Any, d: Any, ctx: Any, awake_prev: Any = None) -> None:
    """`name`: the broad phase that MuJoCo Warp chose."""
    if warp_broadphase.serves(m):
        warp_broadphase.awake_broadphase(m, d, ctx, awake_prev)
    else:
        _upstream[collision_driver, name](m, d, ctx, awake_prev)


def _collision(m: Any, d: Any, awake_prev: Any = None) -> None:
    _upstream[collision_driver, "collision"](m, d, awake_prev)
    if d.naconmax > 0:
        mend_contacts(m, d)


# The velocity stage.


def _advance(*args: Any, **kwargs: Any) -> None:
    _inside.advance = True
    try:
        _upstream[forward, "_advance"](*args, **kwargs)
    finally:
        _inside.advance = False


def _fwd_velocity(m: Any, d: Any) -> None:
    if not getattr(_inside, "advance", False):
        _upstream[forward, "fwd_velocity"](m, d)
