"""Warp kernels that cost what is awake, not what could be: changes to MuJoCo Warp 3.17.0 for households.

Nearly everything in a home sleeps, but many parts of MuJoCo Warp's step cost as if nothing did. Engines of ours run
these in their place; results are the same up to rounding:

- The factorisations of the compacted solver run over the buffer (`nvmax`, sized for the worst moment of the busiest
  world) though the rest of it is identity. Here they stop after the degrees of freedom awake in each world.
- The same for filling those matrices.
- Poses, inertias, velocities and bias forces of all bodies are computed in every step. Here those of bodies that sleep
  stay as they are (`resting`).
- Constraint rows and entries of the Hessian have a thread for each that fits into a buffer, in every iteration of the
  solver. Here a few threads of each world go through those that there are (`lanes`).
- Each iteration of the solver is a dozen kernels, as often as the slowest world needs. Here one kernel takes each world
  through all iterations after the second (`solver_loop`).
- The broad phase of collision detection goes through all pairs of geoms (`broadphase`).
- The kernels of convex pairs follow each other, and each waits for its slowest pair. Here they run side by side
  (`branches`), each goes through a list of the pairs of its own kind only, sorted by geoms (`pair_lists`), and depths
  and several contacts of what touches are for a second kernel (`phases`).
- One thread of each world puts its trees to sleep, one after the other (`sleeping`).
- Gravity compensation is launched for every (world, body, degree of freedom). Here it is for every (world, body).
- Islands get a numbering that nobody reads (`spared`).
- Each captured CUDA graph has memory of its own for a step's arrays. Here they lie in one block (`scratch`).
- A graph is captured anew where an array without elements lies elsewhere, too. Here those do not count (`graphs`).
- The velocity stage runs again at the end of a step with sleep, only to renew derived quantities (`cvel`,
  `qfrc_bias`) that the next step computes anew from positions and velocities. Here they are those of the step's
  beginning, as they are without sleep.

Three more, for safety:

- In a world without any constraint the compacted solver reads constraint forces that were never written (its model says
  that it is dense, and the kernel that zeroes them is for sparse ones). Where that memory holds no numbers, the world
  is lost; one of 16,384 was, in eight seconds of pushing. Here they are zeroed.
- Contacts are checked against their geoms (`contacts`).
- Too many pairs in the first of a step's two passes of collision detection are flagged (`collision`).

What each was of a step on an H200 is in docs/notes/gpu.md.

Who gets them: programs of our own engines (`traced_with`), and direct calls inside `awake_kernels()`. Everybody else in
the process, in whatever thread, gets MuJoCo Warp's own functions. An engine made inside `upstream_kernels()` gets
those, too. The functions replaced are private, so version and sources are pinned (`pins`); with others every engine
runs upstream's functions, and one warning says so.
"""

from __future__ import annotations

import contextlib
import functools
import threading
import warnings
from collections.abc import Iterator
from typing import Any

import warp as wp

from ig2mj.engine.warp.patches import pins
from ig2mj.engine.warp.patches.graphs import graphs_kept
from ig2mj.engine.warp.patches.programs import traced_with
from ig2mj.engine.warp.patches.replacements import KERNELS

__all__ = [
    "awake_kernels",
    "counted_quickly",
    "engine_kernels",
    "fit",
    "for_new_engines",
    "graphs_kept",
    "launched",
    "traced_with",
    "upstream_kernels",
]

_here = threading.local()
_lock = threading.Lock()
_warned = False


def fit() -> bool:
    """Whether our functions fit the MuJoCo Warp that is installed. The first time they do not, a warning says why."""
    global _warned
    wrong = pins.mismatches()
    with _lock:
        warn, _warned = bool(wrong) and not _warned, _warned or bool(wrong)
    if not wrong:
        _fill()
        return True
    if warn:
        first, *others = wrong
        more = f" (and {len(others)} more)" if others else ""
        warnings.warn(f"MuJoCo Warp's own, slower kernels run: {first}{more}", stacklevel=3)
    return False


@functools.cache
def _fill() -> None:
    from ig2mj.engine.warp.patches import launching, spared  # not before: its modules need names that may not exist
    from ig2mj.engine.warp.patches.table import OWN, SUBSTITUTES

    KERNELS.add(OWN)
    launching.replace_by(SUBSTITUTES)
    spared.leave_out_derivatives()


def for_new_engines() -> bool:
    """Whether an engine made now in this thread runs our functions."""
    return not getattr(_here, "upstream", False) and fit()


@contextlib.contextmanager
def awake_kernels() -> Iterator[None]:
    """Inside the block this thread's direct calls of MuJoCo Warp run our functions, where they fit.

    Engines need no such block.
    """
    with KERNELS.entered(fit()):
        yield


@contextlib.contextmanager
def engine_kernels() -> Iterator[None]:
    """Likewise, and steps pass over what rests (`ig2mj.engine.warp.patches.resting`), which data of engines allow."""
    with awake_kernels():
        if not KERNELS.active:
            yield
            return
        from ig2mj.engine.warp.patches.resting import noted

        with noted():
            yield


@contextlib.contextmanager
def counted_quickly(own: bool) -> Iterator[None]:
    """Inside the block this thread makes data with sizes counted by our function (`contact_nnz`), where `own`."""
    if not own:
        yield
        return
    from ig2mj.engine.warp.patches.contact_nnz import COUNTED

    with COUNTED.entered():
        yield


def launched(kernel: wp.Kernel, dim: Any = 1, tiled: bool = False) -> wp.Kernel:
    """The kernel that is launched now, in this thread, in place of one of MuJoCo Warp's; that one where it stays."""
    if not KERNELS.active:
        return kernel
    from ig2mj.engine.warp.patches.launching import resolved

    return resolved(kernel, dim, (), tiled)[0]


@contextlib.contextmanager
def upstream_kernels() -> Iterator[None]:
    """Inside the block this thread makes engines that run MuJoCo Warp as it comes, for comparison.

    They go on doing so after the block, and engines made before go on with our functions inside it. Direct calls of
    MuJoCo Warp from this thread run its own functions.
    """
    before = getattr(_here, "upstream", False)
    _here.upstream = True
    try:
        with KERNELS.entered(False):
            yield
    finally:
        _here.upstream = before
