"""Factorisations of tiles, made before the kernels that call them are written.

A kernel that factorises a tile calls functions that Warp takes from NVIDIA's cuSOLVERDx. Each takes about two seconds,
`birch` needs ten, and Warp makes them while it writes the first kernel that calls them, when no other kernel can be
written. It keeps them in files of their own. So they are made first, alongside the kernels that call none, and are
found there. The library makes one at a time in a process, regardless of threads, so that each has its own process.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import json
import os
import pathlib
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import warp as wp

from ig2mj.engine.warp.patches.compact_solver import TILE
from ig2mj.process import tile_maker
from ig2mj.process.worker_threads import ENDING


class Tile(NamedTuple):
    """A function of cuSOLVERDx: rows and columns of a matrix, what is done (Warp's number for it), on which side and
    with what diagonal (-1: it has none), how the two arrays are stored, which triangle, threads of a block."""

    rows: int
    columns: int
    name: str
    function: int
    side: int
    diagonal: int
    first: str
    second: str
    triangle: int
    threads: int


def tiles_of(launches: Iterable[tuple[wp.Kernel, int]]) -> list[Tile]:
    """What the kernels of a step call: those of the compacted solver, and of trees of several degrees of freedom."""
    found: dict[Tile, None] = {}
    for kernel, threads in launches:
        name = kernel.key.split("__locals__")[0]
        if name in ("_smooth_kernel", "_factorize_kernel", "_refactorize_kernel", "_loop_kernel"):
            found |= dict.fromkeys(_blocked(threads))
        elif name == "_tile_cholesky_factorize_solve_block":
            size = inspect.getclosurevars(kernel.func).nonlocals["block_size"]
            found[_cholesky(size, threads)] = None
            found[Tile(size, size, "potrs", 3, -1, -1, "rowmajor", "rowmajor", 0, threads)] = None
    return list(found)


def _cholesky(size: int, threads: int) -> Tile:
    return Tile(size, size, "potrf", 2, -1, -1, "rowmajor", "rowmajor", 0, threads)


def _blocked(threads: int) -> tuple[Tile, ...]:
    """Of a factorisation in blocks of `TILE` rows: a block's own, and triangular solves with it."""
    solve = functools.partial(Tile, TILE, name="trsm", function=4, side=0, diagonal=1, second="rowmajor")
    return (
        _cholesky(TILE, threads),
        solve(columns=TILE, first="colmajor", triangle=1, threads=threads),
        solve(columns=1, first="colmajor", triangle=1, threads=threads),
        solve(columns=1, first="rowmajor", triangle=0, threads=threads),
    )


def builder(
    launches: Iterable[tuple[wp.Kernel, int]], architecture: int, workers: int | None = None
) -> Callable[[], None]:
    """A function that puts what these kernels call into Warp's cache, where it is not there.

    What cannot be made (the processes call a function of Warp's that is not public) is left to the kernel that needs
    it: that takes longer, and reports what is wrong.

    Args:
      architecture: compute capability times ten. workers: processes at most; None: one for each processor.
    """
    tiles = tiles_of(launches)
    folder = str(wp.config.kernel_cache_dir)
    count = min(len(tiles), workers or len(os.sched_getaffinity(0)))

    def build() -> None:
        orders = [{"folder": folder, "architecture": architecture, "tiles": tiles[k::count]} for k in range(count)]
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            makers = [stack.enter_context(_maker(order)) for order in orders]
            while any(maker.poll() is None for maker in makers) and not ENDING.wait(0.02):
                pass

    return build


@contextlib.contextmanager
def _maker(order: dict[str, Any]) -> Iterator[subprocess.Popen]:
    """A process that makes tiles; it is ended with the block. It needs no GPU, and gets none."""
    command = [sys.executable, "-m", tile_maker.__name__]
    nothing = subprocess.DEVNULL
    cache = str(pathlib.Path(order["folder"]).parent)  # Warp adds its version
    environment = {**os.environ, "CUDA_VISIBLE_DEVICES": "", "WARP_CACHE_PATH": cache}
    maker = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=nothing, stderr=nothing, env=environment)
    try:
        assert maker.stdin is not None
        maker.stdin.write(json.dumps(order).encode())
        maker.stdin.close()
        yield maker
    finally:
        maker.kill()
        maker.wait()
