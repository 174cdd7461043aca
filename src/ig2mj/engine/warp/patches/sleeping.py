"""Trees are put to sleep with a thread for each tree, where MuJoCo Warp has one for each world.

Its last kernel goes through all trees of a world, once for each island that may sleep, in a single thread. The trees of
an island that falls asleep form a ring, each naming the next; here each tree finds its next one by itself.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false, reportGeneralTypeIssues=false
# pyright: reportPrivateUsage=false

from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import sleep as upstream


@wp.kernel(enable_backward=False)
@no_type_check
def _fall_asleep(
    ntree: int,
    tree_dofadr: wp.array[int],
    tree_dofnum: wp.array[int],
    nisland: wp.array[int],
    tree_island: wp.array2d[int],
    island_can_sleep: wp.array2d[int],
    tree_asleep: wp.array2d[int],
    qvel: wp.array2d[float],
    qacc: wp.array2d[float],
):
    world, tree = wp.tid()
    island = tree_island[world, tree]
    if island >= 0 and island < nisland[world]:
        if island_can_sleep[world, island] == 0:
            return
        following = (tree + 1) % ntree  # the last tree's next is the first; alone, it is its own
        while tree_island[world, following] != island:
            following = (following + 1) % ntree
        tree_asleep[world, tree] = following
    elif tree_asleep[world, tree] == -1:
        tree_asleep[world, tree] = tree
    if tree_asleep[world, tree] >= 0:
        for dof in range(tree_dofadr[tree], tree_dofadr[tree] + tree_dofnum[tree]):
            qvel[world, dof] = 0.0
            qacc[world, dof] = 0.0


def sleep(m: Any, d: Any) -> None:
    """Puts trees to sleep whose islands have been slow for long enough."""
    size = (d.nworld, m.ntree)
    wp.launch(
        upstream._sweep_awake_trees,
        dim=size,
        inputs=[
            m.nbody,
            m.body_treeid,
            m.dof_length,
            m.tree_dofadr,
            m.tree_dofnum,
            m.tree_sleep_policy,
            d.qvel,
            d.qfrc_applied,
            d.xfrc_applied,
            m.opt.sleep_tolerance,
        ],
        outputs=[d.tree_asleep],
    )
    can_sleep = wp.ones(size, dtype=int)
    wp.launch(
        upstream._check_island_can_sleep,
        dim=size,
        inputs=[m.ntree, d.nisland, d.tree_asleep, d.tree_island],
        outputs=[can_sleep],
    )
    wp.launch(
        _fall_asleep,
        dim=size,
        inputs=[m.ntree, m.tree_dofadr, m.tree_dofnum, d.nisland, d.tree_island, can_sleep],
        outputs=[d.tree_asleep, d.qvel, d.qacc],
    )
