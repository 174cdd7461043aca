"""Factorisation of a Hessian of a few dozen rows by one block of threads, in panels of eight rows.

MuJoCo Warp's blocked factorisation goes in tiles of 16 by 16 through shared memory, with barriers within each tile's
factorisation. Here a thread takes columns: it brings eight rows of a column up to date with all panels before, which
needs no barrier, every thread factorises the panel's 8 by 8 block in its registers, and solves its columns with it. Two
barriers a panel are left, and rows beyond those that count are not gone through.
"""

# Warp's kernels are not Python, whatever they look like, so nothing may check or wrap them:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false, reportAssignmentType=false
# pyright: reportReturnType=false, reportInvalidTypeForm=false
# ruff: noqa: UP018 (variables of the kernel, not constants)

from typing import no_type_check

import warp as wp

ROWS = 8
"""Rows of a panel."""

column = wp.types.vector(length=ROWS, dtype=float)
square = wp.types.matrix(shape=(ROWS, ROWS), dtype=float)


@wp.func_native(snippet="WP_TILE_SYNC();")
def barrier(): ...


@wp.func
@no_type_check
def factorize_solve(
    hessian: wp.array2d[float],
    n: int,
    tid: int,
    factor: wp.array2d[float],
    inverse: wp.array[float],
    search: wp.array[float],
) -> wp.vec2:
    """Solves H x = g for search = -x, by all threads of a block. What they wrote before must be behind a barrier.

    Args:
      hessian: H in the upper triangle of the first n rows and columns, g in the column after them.
      factor: as large; its strict upper triangle becomes the factor's but for blocks on the diagonal, which are
        transposed. inverse: of the factor's diagonal.

    Returns:
      x.x and g.x, the same in all threads.
    """
    threads = wp.block_dim()
    for k in range(0, n, wp.static(ROWS)):
        # Eight rows of each column, less what the panels before take away.
        for j in range(k + tid, n + 1, threads):
            part = column()
            for p in range(k):
                u = factor[p, j]
                for r in range(wp.static(ROWS)):
                    part[r] += factor[p, k + r] * u
            for r in range(wp.static(ROWS)):
                if k + r < n:
                    factor[k + r, j] = hessian[k + r, j] - part[r]
        barrier()
        # The block on the diagonal, in every thread; identity beyond the last row.
        block = square()
        for r in range(wp.static(ROWS)):
            for c in range(r, wp.static(ROWS)):
                if k + c < n:
                    block[r, c] = factor[k + r, k + c]
                elif r == c:
                    block[r, c] = 1.0
        diagonal = column()
        for r in range(wp.static(ROWS)):
            scale = 1.0 / wp.sqrt(block[r, r])
            diagonal[r] = scale
            for c in range(r + 1, wp.static(ROWS)):
                block[r, c] = block[r, c] * scale
            for i in range(r + 1, wp.static(ROWS)):
                for c in range(i, wp.static(ROWS)):
                    block[i, c] = block[i, c] - block[r, i] * block[r, c]
        for j in range(wp.min(k + wp.static(ROWS), n) + tid, n + 1, threads):
            part = column()
            for r in range(wp.static(ROWS)):
                if k + r < n:
                    part[r] = factor[k + r, j]
            for r in range(wp.static(ROWS)):
                part[r] = part[r] * diagonal[r]
                for i in range(r + 1, wp.static(ROWS)):
                    part[i] = part[i] - block[r, i] * part[r]
            for r in range(wp.static(ROWS)):
                if k + r < n:
                    factor[k + r, j] = part[r]
        if tid == 0:  # others still read the upper triangle
            for r in range(wp.static(ROWS)):
                if k + r < n:
                    inverse[k + r] = diagonal[r]
                for c in range(r + 1, wp.static(ROWS)):
                    if k + c < n:
                        factor[k + c, k + r] = block[r, c]
        barrier()

    length = float(0.0)
    product = float(0.0)
    k = (n - 1) // wp.static(ROWS) * wp.static(ROWS)
    while k >= 0:
        part = column()
        for j in range(k + wp.static(ROWS) + tid, n, threads):
            s = search[j]
            for r in range(wp.static(ROWS)):
                part[r] += factor[k + r, j] * s
        sums = wp.tile_reduce(wp.add, wp.tile(part, preserve_type=True))[0]
        x = column()
        for back in range(wp.static(ROWS)):
            r = wp.static(ROWS - 1) - back
            if k + r < n:
                y = factor[k + r, n]
                product += y * y
                value = y + sums[r]
                for c in range(r + 1, wp.static(ROWS)):
                    if k + c < n:
                        value -= factor[k + c, k + r] * x[c]
                x[r] = value * inverse[k + r]
                length += x[r] * x[r]
        if tid == 0:
            for r in range(wp.static(ROWS)):
                if k + r < n:
                    search[k + r] = -x[r]
        barrier()
        k -= wp.static(ROWS)
    return wp.vec2(length, product)
