"""Positions and velocities of resting bodies are not recomputed.

MuJoCo Warp computes the pose of every body and geom, inertias, velocities and bias forces of every world in every step,
though nearly everything sleeps. What depends on positions and velocities alone does not change while a tree sleeps, and
is still in the same arrays in the next step. So the kernels that compute it (`GUARDED`) skip bodies whose kinematic
root has no live tree, by `live` [world, body].

A tree is live when a step begins if it is awake, or if it fell asleep in the last step: then its velocity became zero
and its position changed after the last step's kinematics. `tree_awake` carries this from one step to the next:
`FELL_ASLEEP`, or `REPLACED` where the engine replaced a world's positions (`WarpEngine._replaced`), in which case
everything of that world is computed. Within a step it is 0 or 1, as upstream. A tree that wakes in the course of a step
has not moved.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false, reportPrivateUsage=false

import contextlib
import functools
import inspect
import threading
from collections.abc import Iterator, Sequence
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import forward as forward_module
from mujoco.mjx.third_party.mujoco_warp._src import sleep as sleep_module
from mujoco.mjx.third_party.mujoco_warp._src import smooth, types

from ig2mj.engine.warp.patches.flags import FELL_ASLEEP, REPLACED
from ig2mj.engine.warp.patches.guarded import guarded
from ig2mj.engine.warp.patches.launching import Launch
from ig2mj.engine.warp.patches.replacements import original

AWAKE, ASLEEP, STATIC = (int(getattr(types.SleepState, name)) for name in ("AWAKE", "ASLEEP", "STATIC"))

NEVER, FULLY_AWAKE = int(types.SleepPolicy.AUTO_NEVER), int(sleep_module.K_AWAKE_VAL)

_here = threading.local()


@wp.func
@no_type_check
def _rests(live: wp.array2d[int], world: int, root: int) -> bool:
    return live[world, root] == 0 and live[world, 0] == 0


@wp.func
@no_type_check
def _rests_or_ends(live: wp.array2d[int], world: int, root: int, parent: int) -> bool:
    """Likewise; and sums from roots to the world are left out unless the world's own sum starts from zero."""
    return live[world, 0] == 0 and (live[world, root] == 0 or parent == 0)


def _body(index: str) -> str:
    return f"_rests(live, worldid, live_root[{index}])"


LEAF = "body_branches[body_branch_start[branchid + 1] - 1]"
UPWARD = "_rests_or_ends(live, worldid, live_root[body_tree_[nodeid]], body_parentid[body_tree_[nodeid]])"

GUARDED = {
    "_kinematics_branch": _body(LEAF),
    "_compute_body_matrices": _body("bodyid"),
    "_compute_body_inertial_frames": _body("bodyid"),
    "_geom_local_to_global": _body("geom_bodyid[geomid]"),
    "_site_local_to_global": _body("site_bodyid[siteid]"),
    "_subtree_com_init": _body("bodyid"),
    "_subtree_com_acc": UPWARD,
    "_subtree_div": _body("bodyid"),
    "_cinert": _body("bodyid"),
    "_cdof": _body("jnt_bodyid[jntid]"),
    "_crb_accumulate": UPWARD,
    "_comvel_branch": _body(LEAF),
    "_cacc_branch": _body(LEAF),
    "_cfrc": _body("bodyid"),
    "_cfrc_backward": UPWARD,
    "_qfrc_bias": _body("dof_bodyid[dofid]"),
}
"""Kernels of `smooth`, and where each may return at once."""


@functools.cache
def _guarded_by_kernel() -> dict[wp.Kernel, wp.Kernel]:
    names = {"_rests": _rests, "_rests_or_ends": _rests_or_ends}
    arguments = {"live": wp.array2d[int], "live_root": wp.array[int]}
    kernels = {getattr(smooth, name): condition for name, condition in GUARDED.items()}
    return {
        kernel: guarded(kernel, condition, arguments, names, module=__name__ + ".smooth")
        for kernel, condition in kernels.items()
    }


@no_type_check
def substitute(kernel: wp.Kernel, dim: Any, inputs: Sequence[Any]) -> Launch | None:
    """The guarded kernel with its inputs, in a step that skips resting bodies."""
    flags, awake = getattr(_here, "flags", None), getattr(_here, "awake", None)
    if awake and kernel.key.startswith(SOLVE):
        return _guarded_solve(kernel), dim, [*awake, *inputs]
    if not flags:
        return None
    own = _guarded_by_kernel().get(kernel)
    return None if own is None else (own, dim, [*flags, *inputs])


SOLVE = "_small_cholesky_factorize_solve_block"
"""Makes a kernel that solves for the accelerations of small trees, for their number of degrees of freedom."""

NO_ACCELERATION = """for i in range(wp.static(block_size)):
    x_out[worldid, block_dof[blk] + i] = 0.0
return"""


@functools.cache
def _guarded_solve(kernel: wp.Kernel) -> wp.Kernel:
    size = inspect.getclosurevars(kernel.func).nonlocals["block_size"]
    return guarded(
        kernel,
        "tree_awake[worldid, dof_tree[block_dof[blk]]] == 0",
        {"tree_awake": wp.array2d[int], "dof_tree": wp.array[int]},
        {},
        NO_ACCELERATION,
        f"{__name__}.solve_{size}",
    )


def factor_solve_i(m: Any, d: Any, *arguments: Any) -> None:
    """As upstream; sleeping trees are skipped and do not accelerate."""
    _here.awake = [d.tree_awake, m.dof_treeid] if m.opt.enableflags & types.EnableBit.SLEEP else None
    try:
        original(smooth, "factor_solve_i")(m, d, *arguments)
    finally:
        _here.awake = None


@wp.kernel(enable_backward=False)
@no_type_check
def _begin(
    begins: bool,
    steps: bool,
    static_awake: int,
    ntree: int,
    nbody: int,
    body_rootid: wp.array[int],
    body_mocapid: wp.array[int],
    body_treeid: wp.array[int],
    dof_bodyid: wp.array[int],
    tree_dofadr: wp.array[int],
    tree_asleep: wp.array2d[int],
    tree_awake: wp.array2d[int],
    ntree_awake: wp.array[int],
    nbody_awake: wp.array[int],
    body_awake: wp.array2d[int],
    body_awake_ind: wp.array2d[int],
    nv_awake: wp.array[int],
    dof_awake_ind: wp.array2d[int],
    live: wp.array2d[int],
):
    """Threads of a world: its trees, then its bodies, then its degrees of freedom."""
    world, k = wp.tid()
    if k < ntree:
        before = tree_awake[world, k]
        awake = tree_asleep[world, k] < 0
        if awake:
            tree_awake[world, k] = 1
            wp.atomic_add(ntree_awake, world, 1)
        elif begins or before == 0:
            tree_awake[world, k] = 0
        elif before == 1:
            tree_awake[world, k] = wp.static(FELL_ASLEEP)
        if steps:
            if awake or before == wp.static(FELL_ASLEEP):
                live[world, body_rootid[dof_bodyid[tree_dofadr[k]]]] = 1
            if before == wp.static(REPLACED):
                live[world, 0] = 1
    elif k < ntree + nbody:
        body = k - ntree
        tree = body_treeid[body]
        state = int(wp.static(ASLEEP))
        if tree >= 0:
            if tree_asleep[world, tree] < 0:
                state = int(wp.static(AWAKE))
        elif body_mocapid[body_rootid[body]] >= 0:
            state = int(wp.static(AWAKE))
            if steps:
                live[world, body_rootid[body]] = 1
        elif static_awake != 0:
            state = int(wp.static(AWAKE))
        else:
            state = int(wp.static(STATIC))
        body_awake[world, body] = state
        if state != wp.static(ASLEEP):
            body_awake_ind[world, wp.atomic_add(nbody_awake, world, 1)] = body
    else:
        dof = k - ntree - nbody
        tree = body_treeid[dof_bodyid[dof]]
        if tree >= 0 and tree_asleep[world, tree] < 0:
            dof_awake_ind[world, wp.atomic_add(nv_awake, world, 1)] = dof


def update_sleep(m: Any, d: Any, flg_staticawake: int = 0) -> None:
    """What is awake, from `tree_asleep`: two launches in place of upstream's four. At the beginning of a step also what
    is live."""
    begins = getattr(_here, "begins", False)
    steps = begins and getattr(_here, "steps", False) and _serves(m)
    _here.begins = False
    live = wp.zeros((d.nworld, m.nbody), dtype=int) if steps else d.body_awake
    wp.launch(
        sleep_module._zero_sleep_counters,
        dim=d.nworld,
        outputs=[d.ntree_awake, d.nbody_awake, d.nv_awake],
    )
    wp.launch(
        _begin,
        dim=(d.nworld, m.ntree + m.nbody + m.nv),
        inputs=[
            begins,
            steps,
            flg_staticawake,
            m.ntree,
            m.nbody,
            m.body_rootid,
            m.body_mocapid,
            m.body_treeid,
            m.dof_bodyid,
            m.tree_dofadr,
            d.tree_asleep,
        ],
        outputs=[
            d.tree_awake,
            d.ntree_awake,
            d.nbody_awake,
            d.body_awake,
            d.body_awake_ind,
            d.nv_awake,
            d.dof_awake_ind,
            live,
        ],
    )
    if steps:
        _here.flags = [live, m.body_rootid]


def _serves(m: Any) -> bool:
    """Flexible bodies and tendons depend on the positions of several trees."""
    return m.nflex == 0 and m.ntendon == 0


@wp.kernel(enable_backward=False)
@no_type_check
def _wake(
    nbody: int,
    ntree: int,
    body_treeid: wp.array[int],
    dof_bodyid: wp.array[int],
    tree_dofadr: wp.array[int],
    tree_dofnum: wp.array[int],
    tree_sleep_policy: wp.array[int],
    qvel: wp.array2d[float],
    qfrc_applied: wp.array2d[float],
    xfrc_applied: wp.array2d[wp.spatial_vector],
    tree_awake: wp.array2d[int],
    tree_asleep: wp.array2d[int],
):
    world, tree = wp.tid()
    if tree_asleep[world, tree] < 0:
        return
    wakes = tree_awake[world, tree] == 1 or tree_sleep_policy[tree] == wp.static(NEVER)
    first = tree_dofadr[tree]
    for dof in range(first, first + tree_dofnum[tree]):
        if qvel[world, dof] != 0.0 or qfrc_applied[world, dof] != 0.0:
            wakes = True
    for body in range(dof_bodyid[first], nbody):  # a tree's bodies follow each other
        if body_treeid[body] != tree:
            break
        force = xfrc_applied[world, body]
        if wp.dot(force, force) != 0.0:
            wakes = True
    if wakes:
        sleep_module._wake_tree(ntree, world, tree, wp.static(FULLY_AWAKE), tree_asleep)


def wake(m: Any, d: Any) -> None:
    """As upstream, where a thread goes through all bodies for those of its tree; a forward pass begins with it."""
    trees, forces = [m.tree_dofadr, m.tree_dofnum, m.tree_sleep_policy], [d.qvel, d.qfrc_applied, d.xfrc_applied]
    wp.launch(
        _wake,
        dim=(d.nworld, m.ntree),
        inputs=[m.nbody, m.ntree, m.body_treeid, m.dof_bodyid, *trees, *forces, d.tree_awake],
        outputs=[d.tree_asleep],
    )
    _here.begins = True


@contextlib.contextmanager
def noted() -> Iterator[None]:
    """Inside the block this thread's steps skip resting bodies. Their data's `tree_awake` must be `REPLACED` where the
    arrays that depend on positions and velocities were not computed by a step or a forward pass."""
    before = getattr(_here, "noted", False)
    _here.noted = True
    try:
        yield
    finally:
        _here.noted = before


def forward(m: Any, d: Any) -> None:
    """The forward pass of a step. A forward pass outside of a step computes everything."""
    _here.steps = getattr(_here, "noted", False)
    try:
        original(forward_module, "forward")(m, d)
    finally:
        _here.steps, _here.flags = False, None


@wp.kernel(enable_backward=False)
@no_type_check
def _begin_composite(
    live: wp.array2d[int], live_root: wp.array[int], cinert: wp.array2d[types.vec10], crb: wp.array2d[types.vec10]
):
    world, body = wp.tid()
    if not _rests(live, world, live_root[body]):
        crb[world, body] = cinert[world, body]


@wp.kernel(enable_backward=False)
@no_type_check
def _inertia(
    live: wp.array2d[int],
    live_root: wp.array[int],
    dof_bodyid: wp.array[int],
    dof_parentid: wp.array[int],
    dof_armature: wp.array2d[float],
    M_rownnz: wp.array[int],
    M_rowadr: wp.array[int],
    cdof: wp.array2d[wp.spatial_vector],
    crb: wp.array2d[types.vec10],
    inertia: wp.array2d[float],
):
    """The row of a degree of freedom: its ancestors' entries from the last one, which is its own, backward."""
    world, dof = wp.tid()
    body = dof_bodyid[dof]
    if _rests(live, world, live_root[body]):
        return
    first = M_rowadr[dof]
    place = first + M_rownnz[dof] - 1
    momentum = smooth.math.inert_vec(crb[world, body], cdof[world, dof])
    own = dof_armature[world % dof_armature.shape[0], dof]
    ancestor = dof
    while ancestor >= 0 and place >= first:  # of a free body about its centre of mass only the diagonal is stored
        inertia[world, place] = own + wp.dot(cdof[world, ancestor], momentum)
        own = 0.0
        place -= 1
        ancestor = dof_parentid[ancestor]
    while place >= first:
        inertia[world, place] = 0.0
        place -= 1


def crb(m: Any, d: Any) -> None:
    """Inertias of subtrees and the inertia matrix, of what is live; as upstream outside of steps."""
    flags = getattr(_here, "flags", None)
    if not flags:
        original(smooth, "crb")(m, d)
        return
    wp.launch(_begin_composite, dim=(d.nworld, m.nbody), inputs=[*flags, d.cinert], outputs=[d.crb])
    for bodies in reversed(m.body_tree):
        wp.launch(
            smooth._crb_accumulate,
            dim=(d.nworld, bodies.size),
            inputs=[m.body_parentid, d.crb, bodies],
            outputs=[d.crb],
        )
    dofs = [m.dof_bodyid, m.dof_parentid, m.dof_armature, m.M_rownnz, m.M_rowadr]
    wp.launch(_inertia, dim=(d.nworld, m.nv), inputs=[*flags, *dofs, d.cdof, d.crb], outputs=[d.M])
