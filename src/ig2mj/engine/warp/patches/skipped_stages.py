"""Skips stages of a step whose results are not read.

- Islands' own numbering of degrees of freedom and constraints takes nine kernels after the solver. It serves solvers
  that work island by island, which neither ours nor MuJoCo Warp's compacted one does. Another function finds which
  trees form an island, which sleeping needs.
- The list of awake degrees of freedom is made before the smooth accelerations and again before the constraints are
  solved. Nothing wakes or falls asleep between the two.
- Island kernels work on integers. Compiling their derivatives takes as long as compiling a convex kernel.
"""

from __future__ import annotations

import threading
from typing import Any

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import forward, island, solver

from ig2mj.engine.warp.patches.replacements import original

_here = threading.local()


def leave_out_derivatives() -> None:
    """Islands' kernels are compiled without derivatives, in the whole process, unless they are compiled already."""
    for module in (wp.get_module(island.__name__), island._island_dsu.module):
        if module is not None and not module.execs:
            module.options |= {"enable_backward": False}
            module.mark_modified()


def compute_island_mapping(m: Any, d: Any) -> None:
    """Nothing."""


def fwd_acceleration(m: Any, d: Any, factorize: bool = False) -> None:
    """As upstream; a solver that follows finds the list of awake degrees of freedom."""
    original(forward, "fwd_acceleration")(m, d, factorize)
    _here.listed = d


def solve(m: Any, d: Any) -> None:
    """As upstream."""
    try:
        original(solver, "solve")(m, d)
    finally:
        _here.listed = None


def update_active_dofs(m: Any, d: Any) -> None:
    """As upstream, unless it was just done."""
    if getattr(_here, "listed", None) is not d:
        original(island, "update_active_dofs")(m, d)
