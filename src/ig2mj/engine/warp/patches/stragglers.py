"""The solver's later iterations for the worlds that need them only.

Half of the worlds converge in the first iteration, one in six needs five or more, and among thousands some need 14. As
long as one is not done, MuJoCo Warp launches a dozen kernels with threads for all: 0.2 ms an iteration with 8,192
worlds. Most of that is not threads that end at once but the time that one world's rows take one after the other. Here
the first iteration is as it was; each further one begins with a list of the worlds that are not done, which its kernels
go through with four times the threads for each.

On trial: IG2MJ_KERNELS=stragglers. With 512 worlds at a time and 64 threads each it was slower than without.
"""

# Warp's kernels are not Python, whatever they look like, so nothing may check or wrap them:
# pyright: reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false, reportPrivateUsage=false

import functools
from collections.abc import Callable, Sequence
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import solver

from ig2mj.engine.warp.patches import lanes, launching
from ig2mj.engine.warp.patches.guarded import listed
from ig2mj.engine.warp.patches.replacements import original
from ig2mj.process import on_trial

ON = on_trial("stragglers")
"""Whether engines made from now on do so."""

SLOTS = 1024
"""Worlds that a kernel takes at a time; with 256 threads each about one wave of a large GPU."""


@wp.kernel(enable_backward=False)
@no_type_check
def _nobody(count: wp.array[int]):
    count[0] = 0


@wp.kernel(enable_backward=False)
@no_type_check
def _list(done: wp.array[bool], count: wp.array[int], worlds: wp.array[int]):
    world = wp.tid()
    if not done[world]:
        worlds[wp.atomic_add(count, 0, 1)] = world


def solver_iteration(m: Any, d: Any, ctx: Any, nsolving: wp.array, compact: bool = False) -> None:
    """As upstream; after the first iteration of a solve for those worlds only that are not done."""
    iteration = original(solver, "_solver_iteration")
    if not (ON and solver._sparse_compact(ctx) and solver._use_incremental(m)):
        iteration(m, d, ctx, nsolving, compact=compact)
        return
    if not hasattr(ctx, "stragglers"):
        ctx.stragglers = wp.zeros(1, dtype=int), wp.empty(d.nworld, dtype=int)
        iteration(m, d, ctx, nsolving, compact=compact)
        return
    count, worlds = ctx.stragglers
    wp.launch(_nobody, dim=1, outputs=[count])
    wp.launch(_list, dim=d.nworld, inputs=[ctx.done], outputs=[count, worlds])
    with lanes.few_worlds(), launching.narrowing(functools.partial(_narrow, d.nworld, count, worlds)):
        iteration(m, d, ctx, nsolving, compact=compact)


def capture_while(condition: wp.array, while_body: Callable, *args: Any, **kwargs: Any) -> None:
    """As upstream; the solver's first iteration, which all worlds need, comes before its loop."""
    if ON and while_body is solver._solver_iteration:
        while_body(**{name: value for name, value in kwargs.items() if name != "stream"})
    original(wp, "capture_while")(condition, while_body, *args, **kwargs)


@functools.cache
def _of_list(kernel: wp.Kernel, slots: int) -> wp.Kernel:
    return listed(kernel, slots, f"ig2mj_listed_{kernel.module.name}_{kernel.key}")


def _narrow(
    num_worlds: int, count: wp.array, worlds: wp.array, kernel: wp.Kernel, dim: Any, inputs: Sequence[Any], tiled: bool
) -> launching.Launch:
    sizes = tuple(dim) if isinstance(dim, Sequence) else (dim,)
    assert sizes[0] == num_worlds, f"{kernel.key} is launched for {sizes}, not for each world"
    if tiled:  # a loop would double the code of factorisations, 5 MB; the blocks that have nothing to do are few
        return _of_list(kernel, 0), dim, [count, worlds, *inputs]
    return _of_list(kernel, SLOTS), (min(SLOTS, num_worlds), *sizes[1:]), [count, worlds, *inputs]
