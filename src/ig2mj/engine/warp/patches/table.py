"""Which function of MuJoCo Warp each of ours stands in for. Imported only where the pinned version is installed."""

import functools
from collections.abc import Callable
from typing import Any

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import (
    collision_convex,
    collision_driver,
    forward,
    island,
    passive,
    smooth,
    solver,
)
from mujoco.mjx.third_party.mujoco_warp._src import sleep as sleep_module

from ig2mj.engine.warp.patches import (
    branches,
    collision,
    compact_solver,
    gravity,
    lanes,
    launching,
    resting,
    sleeping,
    solver_loop,
    spared,
    velocity,
)
from ig2mj.engine.warp.patches.scope import Place

OWN: dict[Place, Callable[..., Any]] = {
    (solver, "_cholesky_factorize_solve"): compact_solver.cholesky_factorize_solve,
    (solver, "_update_gradient_init_h_sparse"): compact_solver.init_hessian,
    (solver, "_solve"): solver_loop.solve,
    (solver, "smooth_solve_compact"): compact_solver.smooth_solve_compact,
    (solver, "_solve_init_dof"): compact_solver.solve_init_dof,
    (passive, "passive"): gravity.passive_forces,
    (collision_driver, "collision"): collision.collision,
    (collision_driver, "nxn_broadphase"): functools.partial(collision.choose_broadphase, "nxn_broadphase"),
    (collision_driver, "sap_broadphase"): functools.partial(collision.choose_broadphase, "sap_broadphase"),
    (forward, "_advance"): velocity.advance,
    (forward, "fwd_velocity"): velocity.fwd_velocity,
    (sleep_module, "sleep"): sleeping.sleep,
    (sleep_module, "wake"): resting.wake,
    (sleep_module, "update_sleep"): resting.update_sleep,
    (forward, "forward"): resting.forward,
    (smooth, "crb"): resting.crb,
    (smooth, "factor_solve_i"): resting.factor_solve_i,
    (collision_convex, "ccd_kernel_builder"): branches.ccd_kernel_builder,
    (collision_driver, "convex_narrowphase"): branches.convex_narrowphase,
    (collision_driver, "_narrowphase"): branches.narrowphase,
    (island, "compute_island_mapping"): spared.compute_island_mapping,
    (island, "update_active_dofs"): spared.update_active_dofs,
    (forward, "fwd_acceleration"): spared.fwd_acceleration,
    (solver, "solve"): spared.solve,
    (wp, "launch"): launching.launch,
    (wp, "launch_tiled"): launching.launch_tiled,
}

SUBSTITUTES = (resting.substitute, lanes.substitute)
"""Which launches become others (`ig2mj.engine.warp.patches.launching`)."""
