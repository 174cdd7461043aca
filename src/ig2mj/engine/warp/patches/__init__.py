"""Functions that run in place of some of MuJoCo Warp's: kernels that cost what is awake, and repairs of faults.

Nearly everything in a home sleeps, but many parts of MuJoCo Warp's step cost as if nothing did. Programs of our engines
run these functions instead; results are the same up to rounding. Without them the simulator does the same, slower.

`table.GROUPS` lists the groups with their reasons, and `IG2MJ_PATCHES` leaves groups out. Each module's docstring
explains its own. `docs/notes/gpu.md` says what each gains on a GPU.

Who gets them: programs of our own engines (`traced_with`), and direct calls inside `awake_kernels()`. Everybody else in
the process, in any thread, gets MuJoCo Warp's own functions. An engine made inside `upstream_kernels()` gets
those, too. The functions replaced are private, so version and sources are pinned (`pins`). With others every engine
runs upstream's functions, and one warning says so; `IG2MJ_TRY_KERNELS=1` runs ours in spite of the pins.
"""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterator
from typing import Any

import warp as wp

from ig2mj.engine.warp.patches import pins, table
from ig2mj.engine.warp.patches.graphs import graphs_kept
from ig2mj.engine.warp.patches.programs import traced_with
from ig2mj.engine.warp.patches.replacements import KERNELS
from ig2mj.process.user_warning import warn_user

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
    wrong = pins.obstacles()
    with _lock:
        warn, _warned = bool(wrong) and not _warned, _warned or bool(wrong)
    if not wrong:
        _fill()
        return True
    if warn:
        first, *others = wrong
        more = f" (and {len(others)} more)" if others else ""
        warn_user(f"MuJoCo Warp's own, slower kernels run: {first}{more}", UserWarning)
    return False


@functools.cache
def _fill() -> None:
    from ig2mj.engine.warp.patches import launching, places, skipped_stages  # not before: names may not exist

    KERNELS.add(places.own())
    launching.replace_by(places.substitutes())
    if table.runs("skipped_stages"):
        skipped_stages.leave_out_derivatives()


def for_new_engines() -> bool:
    """Whether an engine made now in this thread runs our functions."""
    return not getattr(_here, "upstream", False) and bool(table.chosen()) and fit()


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
    if not (own and table.runs("contact_nnz")):
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
