"""Factorisations of tiles, made before the kernels that call them are written.

A kernel that factorises a tile calls functions that Warp takes from NVIDIA's cuSOLVERDx. Each takes about two seconds,
`birch` needs ten, and Warp makes them while it writes the first kernel that calls them, when no other kernel can be
written. It keeps them in files of their own. So they are made first, beside the kernels that call none, and are found
there; one after the other, since the library makes one at a time, whatever threads there are.
"""

from __future__ import annotations

import functools
import inspect
import types
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import warp as wp

from ig2mj.engine.warp.patches.compact_solver import TILE

FLOAT32 = 5
"""cuSOLVERDx's number for single precision."""


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


def builder(launches: Iterable[tuple[wp.Kernel, int]], architecture: int) -> Callable[[], None]:
    """A function that puts what these kernels call into Warp's cache, where it is not there.

    It calls a function of Warp's that is not public: where that is another one nothing is made, and kernels take
    longer.

    Args:
      architecture: compute capability times ten.
    """
    tiles = tiles_of(launches)

    def build() -> None:
        for tile in tiles:
            _build(tile, architecture)

    return build


def _build(tile: Tile, architecture: int) -> None:
    from warp._src import build  # private: used where it is as in the Warp that is known

    nowhere: Any = types.SimpleNamespace(ltoirs={}, ltoirs_decl={}, fatbins={})
    try:
        build.build_lto_solver(
            tile.rows,
            tile.columns,
            1,
            tile.name,
            tile.function,
            tile.side,
            tile.diagonal,
            tile.first,
            tile.second,
            tile.triangle,
            architecture,
            FLOAT32,
            tile.threads,
            "",
            nowhere,
        )
    except Exception:  # whatever it is, the kernel that needs the tile will meet and report it
        return
