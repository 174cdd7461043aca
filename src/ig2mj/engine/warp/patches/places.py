"""Which function of MuJoCo Warp each of ours stands in for. Imported only where the pinned version is installed."""

from __future__ import annotations

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
    broadphase,
    collision,
    compact_solver,
    constraint_forces,
    gravity,
    grid_stride,
    launching,
    resting,
    skipped_stages,
    sleeping,
    solver_loop,
    velocity,
)
from ig2mj.engine.warp.patches.launching import Substitute
from ig2mj.engine.warp.patches.scope import Place
from ig2mj.engine.warp.patches.table import runs

Own = dict[Place, Callable[..., Any]]

OWN: dict[str, Own] = {
    "constraint_forces": {(solver, "_solve_init_dof"): constraint_forces.solve_init_dof},
    "gravity": {(passive, "passive"): gravity.passive_forces},
    "velocity": {(forward, "_advance"): velocity.advance, (forward, "fwd_velocity"): velocity.fwd_velocity},
    "skipped_stages": {
        (island, "compute_island_mapping"): skipped_stages.compute_island_mapping,
        (island, "update_active_dofs"): skipped_stages.update_active_dofs,
        (forward, "fwd_acceleration"): skipped_stages.fwd_acceleration,
        (solver, "solve"): skipped_stages.solve,
    },
    "sleeping": {(sleep_module, "sleep"): sleeping.sleep},
    "resting": {
        (sleep_module, "wake"): resting.wake,
        (sleep_module, "update_sleep"): resting.update_sleep,
        (forward, "forward"): resting.forward,
        (smooth, "crb"): resting.crb,
        (smooth, "factor_solve_i"): resting.factor_solve_i,
    },
    "broadphase": {
        (collision_driver, name): functools.partial(broadphase.choose_broadphase, name)
        for name in ("nxn_broadphase", "sap_broadphase")
    },
    "compact_solver": {
        (solver, "_cholesky_factorize_solve"): compact_solver.cholesky_factorize_solve,
        (solver, "_update_gradient_init_h_sparse"): compact_solver.init_hessian,
        (solver, "smooth_solve_compact"): compact_solver.smooth_solve_compact,
    },
    "solver_loop": {(solver, "_solve"): solver_loop.solve},
}
"""By group, of those that have places of their own."""

SHARED: list[tuple[tuple[str, ...], Own]] = [
    (("pair_overflow", "contacts"), {(collision_driver, "collision"): collision.collision}),
    (
        ("branches", "pair_lists", "phases"),
        {
            (collision_convex, "ccd_kernel_builder"): branches.ccd_kernel_builder,
            (collision_driver, "convex_narrowphase"): branches.convex_narrowphase,
            (collision_driver, "_narrowphase"): branches.narrowphase,
        },
    ),
    (
        ("resting", "grid_stride"),
        {(wp, "launch"): launching.launch, (wp, "launch_tiled"): launching.launch_tiled},
    ),
]
"""Functions that several groups share, which look for themselves which of the groups run."""

SUBSTITUTES: dict[str, Substitute] = {"resting": resting.substitute, "grid_stride": grid_stride.substitute}
"""Which launches become others (`ig2mj.engine.warp.patches.launching`), by group."""


def own() -> Own:
    """The functions of the groups that run in this process, by the place of the original."""
    found: Own = {}
    for group, functions in OWN.items():
        found |= functions if runs(group) else {}
    for groups, functions in SHARED:
        found |= functions if any(map(runs, groups)) else {}
    return found


def substitutes() -> list[Substitute]:
    """Those of the groups that run in this process, in the order in which they are asked."""
    return [substitute for group, substitute in SUBSTITUTES.items() if runs(group)]
