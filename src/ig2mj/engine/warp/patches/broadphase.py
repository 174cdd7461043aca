"""A broad phase for homes where nearly everything sleeps: only geoms of awake bodies look for partners.

MuJoCo Warp's two broad phases go through all pairs of geoms, or sort all geoms, of every world in every step, twice; in
a home of 60 objects with 600 colliding geoms that is more than half of its physics. What sleeps or stands meets nothing
new. Here each kinematic tree that is awake gets a box around the bounding spheres of its geoms (`_boxes`); geoms whose
spheres reach into one of a world's boxes become its candidates (`_candidates`); awake geoms and candidates are held
against each other, spheres first, then by MuJoCo Warp's own filter (`_pairs_kernel`). The pairs found are the same, in
another order.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false, reportPrivateUsage=false, reportReturnType=false
# pyright: reportAssignmentType=false

import functools
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import collision_driver, types
from mujoco.mjx.third_party.mujoco_warp._src.math import upper_tri_index

from ig2mj.engine.warp.patches.replacements import original

LANES = 32
"""Threads that share the candidates of one world."""

AWAKE = wp.constant(int(types.SleepState.AWAKE))

TREES, MOVERS, NEAR = wp.constant(0), wp.constant(1), wp.constant(2)
"""Columns of a world's counts: trees that are awake, their geoms, and candidates for their partners."""


@wp.func
@no_type_check
def _newly(body_awake: wp.array2d[int], before: wp.array2d[int], incremental: bool, world: int, body: int) -> bool:
    """Whether a body is awake; in the second pass, whether the first pass woke it."""
    if body_awake[world, body] != AWAKE:
        return False
    return not incremental or before[world, body] != AWAKE


@wp.func
@no_type_check
def _reach(
    rbound: wp.array2d[float], margin: wp.array2d[float], gap: wp.array2d[float], world: int, geom: int
) -> float:
    """Radius of a geom's bounding sphere with what its contacts may be listed ahead; 0 for planes, which have none."""
    bound = rbound[world % rbound.shape[0], geom]
    if bound <= 0.0:
        return 0.0
    return bound + margin[world % margin.shape[0], geom] + gap[world % gap.shape[0], geom]


@wp.kernel(enable_backward=False)
@no_type_check
def _boxes(
    incremental: bool,
    nbody: int,
    tree_dofadr: wp.array[int],
    dof_bodyid: wp.array[int],
    body_treeid: wp.array[int],
    body_geomadr: wp.array[int],
    body_geomnum: wp.array[int],
    geom_contype: wp.array[int],
    geom_conaffinity: wp.array[int],
    geom_rbound: wp.array2d[float],
    geom_margin: wp.array2d[float],
    geom_gap: wp.array2d[float],
    geom_xpos: wp.array2d[wp.vec3],
    body_awake: wp.array2d[int],
    body_awake_before: wp.array2d[int],
    count: wp.array2d[int],
    boxes: wp.array3d[wp.vec3],
):
    """A box for each tree that is awake, in no order: its corners with the lowest and the highest coordinates."""
    world, tree = wp.tid()
    root = dof_bodyid[tree_dofadr[tree]]
    if not _newly(body_awake, body_awake_before, incremental, world, root):
        return
    low = wp.vec3(1.0e10, 1.0e10, 1.0e10)
    high = wp.vec3(-1.0e10, -1.0e10, -1.0e10)
    for body in range(root, nbody):  # a tree's bodies follow each other
        if body_treeid[body] != tree:
            break
        for k in range(body_geomnum[body]):
            geom = body_geomadr[body] + k
            if geom_contype[geom] != 0 or geom_conaffinity[geom] != 0:
                reach = _reach(geom_rbound, geom_margin, geom_gap, world, geom)
                middle = geom_xpos[world, geom]
                corner = wp.vec3(reach, reach, reach)
                low = wp.min(low, middle - corner)
                high = wp.max(high, middle + corner)
    if low[0] <= high[0]:
        place = wp.atomic_add(count, world, TREES, 1)
        boxes[world, place, 0] = low
        boxes[world, place, 1] = high


@wp.kernel(enable_backward=False)
@no_type_check
def _candidates(
    incremental: bool,
    geom_bodyid: wp.array[int],
    geom_contype: wp.array[int],
    geom_conaffinity: wp.array[int],
    geom_rbound: wp.array2d[float],
    geom_margin: wp.array2d[float],
    geom_gap: wp.array2d[float],
    geom_xpos: wp.array2d[wp.vec3],
    body_awake: wp.array2d[int],
    body_awake_before: wp.array2d[int],
    boxes: wp.array3d[wp.vec3],
    count: wp.array2d[int],
    movers: wp.array2d[int],
    near: wp.array2d[int],
):
    """Lists each world's awake geoms, and all that reach into one of its boxes, in no order."""
    world, geom = wp.tid()
    trees = count[world, TREES]
    if trees == 0 or (geom_contype[geom] == 0 and geom_conaffinity[geom] == 0):
        return
    body = geom_bodyid[geom]
    if _newly(body_awake, body_awake_before, incremental, world, body):
        movers[world, wp.atomic_add(count, world, MOVERS, 1)] = geom
    elif incremental and body_awake[world, body] == AWAKE:
        return  # the first pass had its pairs with all that was asleep then
    reach = _reach(geom_rbound, geom_margin, geom_gap, world, geom)
    place = geom_xpos[world, geom]
    found = reach == 0.0  # a plane reaches everywhere
    for k in range(trees):
        if not found:
            low = boxes[world, k, 0]
            high = boxes[world, k, 1]
            apart = place - wp.max(low, wp.min(place, high))
            found = wp.dot(apart, apart) <= reach * reach
    if found:
        near[world, wp.atomic_add(count, world, NEAR, 1)] = geom


@functools.cache
@no_type_check
def _pairs_kernel(
    rules: int,
    aabbs: int,
    rbounds: int,
    margins: int,
    gaps: int,
    pair_margins: int,
    pair_gaps: int,
    dataids: int,
) -> wp.Kernel:
    """The kernel for a model whose arrays have so many rows (1, or one for each world)."""
    close = collision_driver._broadphase_filter(rules, aabbs, rbounds, margins, gaps, pair_margins, pair_gaps)

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False)
    def awake_pairs(
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
        count: wp.array2d[int],
        movers: wp.array2d[int],
        near: wp.array2d[int],
        naconmax: int,
        ncollision: wp.array[int],
        collision_pair: wp.array[wp.vec2i],
        collision_pairid: wp.array[wp.vec2i],
        collision_worldid: wp.array[int],
    ):
        world, lane = wp.tid()
        for c in range(lane, count[world, wp.static(NEAR)], wp.static(LANES)):
            other = near[world, c]
            awake = body_awake[world, geom_bodyid[other]] == wp.static(AWAKE)
            place = geom_xpos[world, other]
            reach = _reach(geom_rbound, geom_margin, geom_gap, world, other)
            for k in range(count[world, wp.static(MOVERS)]):
                geom = movers[world, k]
                if other <= geom and awake:
                    continue  # a pair of two that are awake is found by its first geom
                if reach > 0.0:
                    apart = geom_xpos[world, geom] - place
                    both = reach + _reach(geom_rbound, geom_margin, geom_gap, world, geom)
                    if wp.dot(apart, apart) > both * both:
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
                meets = close(
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
                if meets or pairid[1] >= 0:
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

    return awake_pairs


def awake_broadphase(m: Any, d: Any, ctx: Any, awake_prev: Any = None) -> None:
    """Finds pairs of geoms that may touch, where at least one is awake.

    Args:
      m, d, ctx: MuJoCo Warp's model, data and collision context. The model must have sleep on, no explicit contact
        pairs (`<pair>`) and no distance sensors: those reach further than bounding spheres say.
      awake_prev: which bodies were awake in the first pass of this step; given in the second pass, which looks for the
        pairs of what that pass woke.
    """
    before = d.body_awake if awake_prev is None else awake_prev
    spheres = [m.geom_rbound, m.geom_margin, m.geom_gap]
    collides = [m.geom_contype, m.geom_conaffinity]
    count = wp.zeros((d.nworld, 3), dtype=int)
    boxes = wp.empty((d.nworld, m.ntree, 2), dtype=wp.vec3)
    # MJX passes on what upstream's functions read, and leaves other fields (`tree_bodynum`) empty
    bodies = [m.nbody, m.tree_dofadr, m.dof_bodyid, m.body_treeid, m.body_geomadr, m.body_geomnum]
    awake = [d.body_awake, before]
    wp.launch(
        _boxes,
        dim=(d.nworld, m.ntree),
        inputs=[awake_prev is not None, *bodies, *collides, *spheres, d.geom_xpos, *awake],
        outputs=[count, boxes],
    )
    movers = wp.empty((d.nworld, m.ngeom), dtype=int)
    near = wp.empty((d.nworld, m.ngeom), dtype=int)
    wp.launch(
        _candidates,
        dim=(d.nworld, m.ngeom),
        inputs=[awake_prev is not None, m.geom_bodyid, *collides, *spheres, d.geom_xpos, *awake, boxes],
        outputs=[count, movers, near],
    )
    arrays = (m.geom_aabb, *spheres, m.pair_margin, m.pair_gap, m.geom_dataid)
    wp.launch(
        _pairs_kernel(m.opt.broadphase_filter, *(a.shape[0] for a in arrays)),
        dim=(d.nworld, LANES),
        inputs=[
            m.ngeom,
            m.geom_type,
            m.geom_bodyid,
            m.geom_dataid,
            m.geom_aabb,
            *spheres,
            m.pair_margin,
            m.pair_gap,
            m.nxn_pairid,
            d.geom_xpos,
            d.geom_xmat,
            d.body_awake,
            count,
            movers,
            near,
            d.naconmax,
        ],
        outputs=[d.ncollision, ctx.collision_pair, ctx.collision_pairid, ctx.collision_worldid],
    )


def serves(m: Any) -> bool:
    """Whether `awake_broadphase` finds all pairs of a model."""
    return bool(m.opt.enableflags & types.EnableBit.SLEEP and m.npair == 0 and m.nsensorcollision == 0)


def choose_broadphase(name: str, m: Any, d: Any, ctx: Any, awake_prev: Any = None) -> None:
    """`awake_broadphase` where it finds all pairs; else `name`, the one that MuJoCo Warp chose."""
    if serves(m):
        awake_broadphase(m, d, ctx, awake_prev)
    else:
        original(collision_driver, name)(m, d, ctx, awake_prev)
