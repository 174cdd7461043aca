"""The pairs of convex collision, listed by kind and within a kind by geoms.

MuJoCo Warp has a kernel for each kind (pair of geom types), and each goes through the pairs of all kinds: of the 32
threads of a warp a few find a pair of theirs, and the warp takes as long as with 32. Here each kernel gets a list of
its own pairs. The same two geoms in many worlds follow each other in it, since they read the same hulls and take about
as many iterations. Three short launches count, add up and place.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false
# pyright: reportOperatorIssue=false, reportGeneralTypeIssues=false

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, no_type_check

import warp as wp

BUCKETS = 256
"""Of each kind; geoms share one now and then."""

THREADS = 1 << 16

Kinds = wp.types.matrix(shape=(9, 9), dtype=int)
"""By the types of two geoms: the number of their kind, or -1."""


class PairList(NamedTuple):
    """The pairs of one kind: how many [1], geoms [P], explicit pairs and sensors [P], worlds [P]."""

    count: wp.array
    pair: wp.array
    pairid: wp.array
    world: wp.array


@wp.func
@no_type_check
def _bucket(geoms: wp.vec2i) -> int:
    return (geoms[0] * 397 + geoms[1]) % wp.static(BUCKETS)


@wp.kernel(enable_backward=False)
@no_type_check
def _count(
    kinds: Kinds,
    geom_type: wp.array[int],
    ncollision: wp.array[int],
    pair: wp.array[wp.vec2i],
    stride: int,
    size: wp.array2d[int],
):
    first = wp.tid()
    for c in range(first, wp.min(ncollision[0], pair.shape[0]), stride):
        kind = kinds[geom_type[pair[c][0]], geom_type[pair[c][1]]]
        if kind >= 0:
            wp.atomic_add(size, kind, _bucket(pair[c]), 1)


@wp.kernel(enable_backward=False)
@no_type_check
def _begin_buckets(size: wp.array2d[int], begin: wp.array2d[int], count: wp.array[int]):
    kind, bucket = wp.tid()
    end = size[kind, bucket]
    for k in range(bucket):
        end += size[kind, k]
    begin[kind, bucket] = end - size[kind, bucket]
    if bucket == wp.static(BUCKETS - 1):
        count[kind] = end


@wp.kernel(enable_backward=False)
@no_type_check
def _place(
    kinds: Kinds,
    geom_type: wp.array[int],
    ncollision: wp.array[int],
    pair: wp.array[wp.vec2i],
    pairid: wp.array[wp.vec2i],
    worldid: wp.array[int],
    stride: int,
    begin: wp.array2d[int],
    own_pair: wp.array2d[wp.vec2i],
    own_pairid: wp.array2d[wp.vec2i],
    own_world: wp.array2d[int],
):
    first = wp.tid()
    for c in range(first, wp.min(ncollision[0], pair.shape[0]), stride):
        geoms = pair[c]
        kind = kinds[geom_type[geoms[0]], geom_type[geoms[1]]]
        if kind >= 0:
            place = wp.atomic_add(begin, kind, _bucket(geoms), 1)
            own_pair[kind, place] = geoms
            own_pairid[kind, place] = pairid[c]
            own_world[kind, place] = worldid[c]


def listed_by_kind(m: Any, d: Any, ctx: Any, kinds: Sequence[tuple[int, int]]) -> list[PairList]:
    """The pairs that the broad phase found, a list for each kind, each as large as the buffer of all.

    Args:
      m, d, ctx: MuJoCo Warp's model, data and collision context after the broad phase.
      kinds: pairs of types of geoms.
    """
    numbers = [[-1] * 9 for _ in range(9)]
    for number, (first, second) in enumerate(kinds):
        numbers[first][second] = number
    table = Kinds(*(n for row in numbers for n in row))
    threads = max(1, min(d.naconmax, THREADS))
    size = wp.zeros((len(kinds), BUCKETS), dtype=int)
    begin = wp.empty((len(kinds), BUCKETS), dtype=int)
    count = wp.empty(len(kinds), dtype=int)
    pairs = [table, m.geom_type, d.ncollision, ctx.collision_pair]
    wp.launch(_count, dim=threads, inputs=[*pairs, threads], outputs=[size])
    wp.launch(_begin_buckets, dim=size.shape, inputs=[size], outputs=[begin, count])
    shape = (len(kinds), d.naconmax)
    own = wp.empty(shape, dtype=wp.vec2i), wp.empty(shape, dtype=wp.vec2i), wp.empty(shape, dtype=int)
    wp.launch(
        _place,
        dim=threads,
        inputs=[*pairs, ctx.collision_pairid, ctx.collision_worldid, threads],
        outputs=[begin, *own],
    )
    return [PairList(count[k : k + 1], *(array[k] for array in own)) for k in range(len(kinds))]
