"""Warp kernels that cost what is awake, not what could be: changes to MuJoCo Warp 3.17 for households.

Nearly everything in a home sleeps, but five parts of MuJoCo Warp's step cost as if nothing did. `use_awake_kernels`
puts these in their place; results are the same up to rounding:

- The factorisations of the compacted solver run over the buffer (`nvmax`, sized for the worst moment of the busiest
  world) though the rest of it is identity. Here they stop after the degrees of freedom awake in each world.
- The same for filling those matrices.
- The broad phase of collision detection goes through all pairs of geoms (`broadphase`).
- Gravity compensation is launched for every (world, body, degree of freedom). Here it is for every (world, body).
- The velocity stage runs again at the end of a step with sleep, only to renew derived quantities (`cvel`,
  `qfrc_bias`) that the next step computes anew from positions and velocities. Here they are those of the step's
  beginning, as they are without sleep.

Three more, for safety:

- In a world without any constraint the compacted solver reads constraint forces that were never written (its model says
  that it is dense, and the kernel that zeroes them is for sparse ones). Where that memory holds no numbers, the world
  is lost; one of 16,384 was, in eight seconds of pushing. Here they are zeroed.
- Contacts are checked against their geoms (`contacts`).
- Too many pairs in the first of a step's two passes of collision detection are flagged (`collision`).

What each was of a step on an H200 stands in docs/notes.md. The functions
replaced are private to MuJoCo Warp, which is pinned; a version without them is left as it is, with a warning.
"""

from __future__ import annotations

import functools

from mujoco.mjx.third_party.mujoco_warp._src import collision_driver, forward, passive, solver

from ig2mj.engine.warp.patches import broadphase, collision, compact_solver, gravity, velocity
from ig2mj.engine.warp.patches.originals import replace, upstream_kernels

__all__ = ["upstream_kernels", "use_awake_kernels"]

_NEEDED = {
    **compact_solver.NEEDED,
    passive: ("passive",),
    collision_driver: ("collision", *broadphase.NEEDED),
    forward: ("_advance", "fwd_velocity"),
}

_OWN = {
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
}


def use_awake_kernels() -> bool:
    """Puts the kernels in place, once per process. Returns whether they are; a warning says why not."""
    return replace(_NEEDED, _OWN)
