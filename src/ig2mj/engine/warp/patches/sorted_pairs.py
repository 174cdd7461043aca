"""Pairs of geoms sorted by the types of their geoms, before the narrow phase looks at them.

MuJoCo Warp launches a kernel for each pair of types, and each passes over all pairs for its own. In the order in which
a broad phase finds them nearly every warp of 32 threads holds one or two that matter, and takes as long as if all did.
Sorted, a warp either computes or passes on.

It is a counting sort. Pairs are counted in chunks, so that few threads add to one number at a time; within a chunk and
type the order is that in which threads come by.
"""

# Warp's kernels are not Python, whatever they look like, so nothing may check or wrap them:
# pyright: reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false, reportGeneralTypeIssues=false
# pyright: reportOperatorIssue=false, reportReturnType=false

from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import types

TYPES = wp.constant(int(types.GeomType.SDF) + 1)
"""Types that collide; what comes after them is drawn only."""

KEYS = wp.constant(int(TYPES) ** 2)
CHUNKS = wp.constant(32)

THREADS = 1 << 17
"""At most so many threads pass over the pairs: about what a card runs at a time."""


@wp.func
@no_type_check
def _bin(pair: wp.vec2i, geom_type: wp.array[int], place: int, count: int) -> wp.vec2i:
    """Key and chunk of a pair."""
    chunk = place / ((count + CHUNKS - 1) / CHUNKS)
    return wp.vec2i(geom_type[pair[0]] * TYPES + geom_type[pair[1]], chunk)


@wp.kernel(enable_backward=False)
@no_type_check
def _count(
    threads: int,
    room: int,
    geom_type: wp.array[int],
    ncollision: wp.array[int],
    pairs: wp.array[wp.vec2i],
    bins: wp.array2d[int],
):
    thread = wp.tid()
    count = wp.min(ncollision[0], room)
    for place in range(thread, count, threads):
        at = _bin(pairs[place], geom_type, place, count)
        wp.atomic_add(bins, at[0], at[1], 1)


@wp.kernel(enable_backward=False)
@no_type_check
def _totals(bins: wp.array2d[int], totals: wp.array[int]):
    key = wp.tid()
    total = int(0)  # noqa: RUF046, UP018 (a variable of the kernel, not a constant)
    for chunk in range(CHUNKS):
        total += bins[key, chunk]
    totals[key] = total


@wp.kernel(enable_backward=False)
@no_type_check
def _starts(counts: wp.array2d[int], totals: wp.array[int], starts: wp.array2d[int]):
    """Where each bin begins."""
    key, chunk = wp.tid()
    start = int(0)  # noqa: RUF046, UP018 (a variable of the kernel, not a constant)
    for earlier in range(key):
        start += totals[earlier]
    for earlier in range(chunk):
        start += counts[key, earlier]
    starts[key, chunk] = start


@wp.kernel(enable_backward=False)
@no_type_check
def _scatter(
    threads: int,
    room: int,
    geom_type: wp.array[int],
    ncollision: wp.array[int],
    pairs: wp.array[wp.vec2i],
    ids: wp.array[wp.vec2i],
    worlds: wp.array[int],
    bins: wp.array2d[int],
    pairs_out: wp.array[wp.vec2i],
    ids_out: wp.array[wp.vec2i],
    worlds_out: wp.array[int],
):
    thread = wp.tid()
    count = wp.min(ncollision[0], room)
    for place in range(thread, count, threads):
        at = _bin(pairs[place], geom_type, place, count)
        to = wp.atomic_add(bins, at[0], at[1], 1)
        pairs_out[to] = pairs[place]
        ids_out[to] = ids[place]
        worlds_out[to] = worlds[place]


def sort_pairs(m: Any, d: Any, ctx: Any) -> None:
    """Sorts the pairs in a collision context by the types of their geoms; the context gets new arrays."""
    threads = min(d.naconmax, THREADS)
    counts = wp.zeros((int(KEYS), int(CHUNKS)), dtype=int)
    bins = wp.empty_like(counts)
    totals = wp.empty(int(KEYS), dtype=int)
    found = [threads, d.naconmax, m.geom_type, d.ncollision, ctx.collision_pair]
    wp.launch(_count, dim=threads, inputs=found, outputs=[counts])
    wp.launch(_totals, dim=int(KEYS), inputs=[counts], outputs=[totals])
    wp.launch(_starts, dim=(int(KEYS), int(CHUNKS)), inputs=[counts, totals], outputs=[bins])
    out = [wp.empty_like(a) for a in (ctx.collision_pair, ctx.collision_pairid, ctx.collision_worldid)]
    inputs = [*found, ctx.collision_pairid, ctx.collision_worldid, bins]
    wp.launch(_scatter, dim=threads, inputs=inputs, outputs=out)
    ctx.collision_pair, ctx.collision_pairid, ctx.collision_worldid = out
