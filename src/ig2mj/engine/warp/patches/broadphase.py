"""A broad phase for homes where nearly everything sleeps: only geoms of awake bodies look for partners.

MuJoCo Warp's two broad phases go through all pairs of geoms, or sort all geoms, of every world in every step, twice; in
a home of 60 objects with 600 colliding geoms that is more than half of its physics. What sleeps or stands meets nothing
new. Here each geom of an awake body is held against all others: bounding spheres first, then MuJoCo Warp's own filter.
The pairs found are the same, in another order.
"""

# Warp's kernels are not Python, whatever they look like, so nothing may check or wrap them:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false, reportPrivateUsage=false, reportReturnType=false
# pyright: reportAssignmentType=false

import functools
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import collision_driver, types
from mujoco.mjx.third_party.mujoco_warp._src.math import upper_tri_index

LANES = 16
"""Threads that share the partners of one geom in one world."""

AWAKE = int(types.SleepState.AWAKE)


@functools.cache
@no_type_check
def _kernel(
    rules: int,
    aabbs: int,
    rbounds: int,
    margins: int,
    gaps: int,
    pair_margins: int,
    pair_gaps: int,
    dataids: int,
    incremental: bool,
) -> wp.Kernel:
    """The kernel for a model whose arrays have so many rows (1, or one for each world)."""
    close = collision_driver._broadphase_filter(rules, aabbs, rbounds, margins, gaps, pair_margins, pair_gaps)

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False)
    def awake_broadphase(
        ngeom: int,
        geom_type: wp.array[int],
        geom_bodyid: wp.array[int],
        geom_dataid: wp.array2d[int],
        geom_aabb: wp.array3d[wp.vec3],
        geom_rbound: wp.array2d[float],
        geom_margin: wp.array2d[float],
        geom_gap: wp.array2d[float],
        pair_margin: wp.array2d[float],
        pair_gap: wp.array2d[float],
        nxn_pairid: wp.array[wp.vec2i],
        geom_xpos: wp.array2d[wp.vec3],
        geom_xmat: wp.array2d[wp.mat33],
        body_awake: wp.array2d[int],
        body_awake_before: wp.array2d[int],
        naconmax: int,
        ncollision: wp.array[int],
        collision_pair: wp.array[wp.vec2i],
        collision_pairid: wp.array[wp.vec2i],
        collision_worldid: wp.array[int],
    ):
        world, geom, lane = wp.tid()
        body = geom_bodyid[geom]
        if body_awake[world, body] != wp.static(AWAKE):
            return
        if wp.static(incremental) and body_awake_before[world, body] == wp.static(AWAKE):
            return  # the first pass had all pairs of what was awake then
        place = geom_xpos[world, geom]
        bound = geom_rbound[world % geom_rbound.shape[0], geom]
        slack = geom_margin[world % geom_margin.shape[0], geom] + geom_gap[world % geom_gap.shape[0], geom]
        for other in range(lane, ngeom, wp.static(LANES)):
            other_bound = geom_rbound[world % geom_rbound.shape[0], other]
            if bound > 0.0 and other_bound > 0.0:  # planes have none
                apart = geom_xpos[world, other] - place
                reach = bound + other_bound + slack
                reach += geom_margin[world % geom_margin.shape[0], other] + geom_gap[world % geom_gap.shape[0], other]
                if wp.dot(apart, apart) > reach * reach:
                    continue
            other_body = geom_bodyid[other]
            if other <= geom and body_awake[world, other_body] == wp.static(AWAKE):
                continue  # a pair of two that are awake is found by its first geom
            if wp.static(incremental) and body_awake_before[world, other_body] == wp.static(AWAKE):
                continue
            first = wp.min(geom, other)
            second = wp.max(geom, other)
            pairid = nxn_pairid[upper_tri_index(ngeom, first, second)]
            if pairid[0] < -1 and pairid[1] < 0:
                continue
            first_type = geom_type[first]
            second_type = geom_type[second]
            if wp.static(dataids > 1):
                row = world % geom_dataid.shape[0]
                if collision_driver._mesh_missing(geom_dataid, first, first_type, row):
                    continue
                if collision_driver._mesh_missing(geom_dataid, second, second_type, row):
                    continue
            near = close(
                geom_aabb,
                geom_rbound,
                geom_margin,
                geom_gap,
                pair_margin,
                pair_gap,
                geom_xpos,
                geom_xmat,
                first,
                second,
                pairid[0],
                world,
            )
            if near or pairid[1] >= 0:
                collision_driver._add_geom_pair(
                    naconmax,
                    first,
                    second,
                    first_type,
                    second_type,
                    world,
                    pairid,
                    ncollision,
                    collision_pair,
                    collision_pairid,
                    collision_worldid,
                )

    return awake_broadphase


def awake_broadphase(m: Any, d: Any, ctx: Any, awake_prev: Any = None) -> None:
    """Finds pairs of geoms that may touch, where at least one is awake.

    Args:
      m, d, ctx: MuJoCo Warp's model, data and collision context. The model must have sleep on, no explicit contact
        pairs (`<pair>`) and no distance sensors: those reach further than bounding spheres say.
      awake_prev: which bodies were awake in the first pass of this step; given in the second pass, which looks for the
        pairs of what that pass woke.
    """
    arrays = (m.geom_aabb, m.geom_rbound, m.geom_margin, m.geom_gap, m.pair_margin, m.pair_gap, m.geom_dataid)
    kernel = _kernel(m.opt.broadphase_filter, *(a.shape[0] for a in arrays), awake_prev is not None)
    wp.launch(
        kernel,
        dim=(d.nworld, m.ngeom, LANES),
        inputs=[
            m.ngeom,
            m.geom_type,
            m.geom_bodyid,
            m.geom_dataid,
            m.geom_aabb,
            m.geom_rbound,
            m.geom_margin,
            m.geom_gap,
            m.pair_margin,
            m.pair_gap,
            m.nxn_pairid,
            d.geom_xpos,
            d.geom_xmat,
            d.body_awake,
            d.body_awake if awake_prev is None else awake_prev,
            d.naconmax,
        ],
        outputs=[d.ncollision, ctx.collision_pair, ctx.collision_pairid, ctx.collision_worldid],
    )


def serves(m: Any) -> bool:
    """Whether `awake_broadphase` finds all pairs of a model."""
    return bool(m.opt.enableflags & types.EnableBit.SLEEP and m.npair == 0 and m.nsensorcollision == 0)
