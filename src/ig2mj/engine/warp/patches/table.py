"""Which function of MuJoCo Warp each of ours stands in for. Imported only where the pinned version is installed."""

import functools

from mujoco.mjx.third_party.mujoco_warp._src import collision_driver, forward, passive, solver
from mujoco.mjx.third_party.mujoco_warp._src import sleep as sleep_module

from ig2mj.engine.warp.patches import collision, compact_solver, gravity, sleeping, velocity

OWN = {
    (solver, "_cholesky_factorize_solve"): compact_solver.cholesky_factorize_solve,
    (solver, "_update_gradient_init_h_sparse"): compact_solver.init_hessian,
    (solver, "smooth_solve_compact"): compact_solver.smooth_solve_compact,
    (solver, "_solve_init_dof"): compact_solver.solve_init_dof,
    (passive, "passive"): gravity.passive_forces,
    (collision_driver, "collision"): collision.collision,
    (collision_driver, "nxn_broadphase"): functools.partial(collision.choose_broadphase, "nxn_broadphase"),
    (collision_driver, "sap_broadphase"): functools.partial(collision.choose_broadphase, "sap_broadphase"),
    (forward, "_advance"): velocity.advance,
    (forward, "fwd_velocity"): velocity.fwd_velocity,
    (sleep_module, "sleep"): sleeping.sleep,
}
