"""Gravity compensation, launched for every (world, body) instead of every (world, body, degree of freedom).

A body's force acts on the degrees of freedom that move it: its own and those of its ancestors, each naming the one
before it.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportAssignmentType=false, reportReturnType=false, reportOperatorIssue=false
# pyright: reportPrivateUsage=false

import dataclasses
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import passive, support, types

from ig2mj.engine.warp.patches.replacements import original


@wp.kernel(enable_backward=False)
@no_type_check
def _gravity_compensation(
    gravity: wp.array[wp.vec3],
    body_parentid: wp.array[int],
    body_rootid: wp.array[int],
    body_mass: wp.array2d[float],
    body_gravcomp: wp.array2d[float],
    body_dofadr: wp.array[int],
    body_dofnum: wp.array[int],
    dof_parentid: wp.array[int],
    dof_bodyid: wp.array[int],
    body_isdofancestor: wp.array2d[int],
    xipos: wp.array2d[wp.vec3],
    subtree_com: wp.array2d[wp.vec3],
    cdof: wp.array2d[wp.spatial_vector],
    jnt_actgravcomp: wp.array[int],
    dof_jntid: wp.array[int],
    qfrc_gravcomp: wp.array2d[float],
    qfrc_passive: wp.array2d[float],
):
    world, body = wp.tid()
    body += 1
    share = body_gravcomp[world % body_gravcomp.shape[0], body]
    if share == 0.0:
        return
    force = -gravity[world % gravity.shape[0]] * body_mass[world % body_mass.shape[0], body] * share
    place = xipos[world, body]
    mover = int(body)  # the nearest with degrees of freedom
    while mover > 0 and body_dofnum[mover] == 0:
        mover = body_parentid[mover]
    dof = body_dofadr[mover] + body_dofnum[mover] - 1
    while mover > 0 and dof >= 0:
        along, _turn = support.jac_dof(
            body_parentid, body_rootid, dof_bodyid, body_isdofancestor, subtree_com, cdof, place, body, dof, world
        )
        wp.atomic_add(qfrc_gravcomp[world], dof, wp.dot(along, force))
        if jnt_actgravcomp[dof_jntid[dof]] == 0:  # else the actuators carry it
            wp.atomic_add(qfrc_passive[world], dof, wp.dot(along, force))
        dof = dof_parentid[dof]


def passive_forces(m: Any, d: Any) -> None:
    """Passive forces without gravity compensation, as upstream; then that."""
    gravity = types.DisableBit.GRAVITY
    if m.opt.disableflags & gravity or m.callback.passive:
        original(passive, "passive")(m, d)
        return
    opt = dataclasses.replace(m.opt, disableflags=m.opt.disableflags | gravity)
    original(passive, "passive")(dataclasses.replace(m, opt=opt), d)
    wp.launch(
        _gravity_compensation,
        dim=(d.nworld, m.nbody - 1),
        inputs=[
            m.opt.gravity,
            m.body_parentid,
            m.body_rootid,
            m.body_mass,
            m.body_gravcomp,
            m.body_dofadr,
            m.body_dofnum,
            m.dof_parentid,
            m.dof_bodyid,
            m.body_isdofancestor,
            d.xipos,
            d.subtree_com,
            d.cdof,
            m.jnt_actgravcomp,
            m.dof_jntid,
        ],
        outputs=[d.qfrc_gravcomp, d.qfrc_passive],
    )
