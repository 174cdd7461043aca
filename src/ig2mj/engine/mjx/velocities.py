"""Velocities of bodies from the joints that they hang on. Pure JAX, all worlds at once.

MJX's `cvel` is that of the beginning of the last physics step; positions, joint anchors and axes are renewed at the end
of a control step, so velocities are made from those. The bodies asked for are few: bases and hands of agents.

Axes: N bodies, S slots (the most degrees of freedom that one of them hangs on).
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import quat_to_matrix


class Moved(NamedTuple):
    """Positions and velocities: arrays of MJX data of the same names, kinematics up to date."""

    qpos: Float[Array, "W nq"]
    qvel: Float[Array, "W nv"]
    xpos: Float[Array, "W B 3"]
    xquat: Float[Array, "W B 4"]
    xanchor: Float[Array, "W njnt 3"]
    xaxis: Float[Array, "W njnt 3"]


@dataclasses.dataclass(frozen=True, eq=False)
class JointsAbove:
    """Degrees of freedom that bodies hang on.

    Attributes:
      body: [N]. dof, joint, joint_body: [N, S], 0 where padded.
      slides, turns: [N, S, 1] 1 where the degree of freedom moves along, or turns about, its axis.
      straight: [N, S, 3] axis in the world's frame that never changes (the linear ones of free joints), else 0.
      column: [N, S] column of the body's matrix that is the axis (free and ball joints), -1: `xaxis` is.
    """

    body: np.ndarray
    dof: np.ndarray
    joint: np.ndarray
    joint_body: np.ndarray
    slides: np.ndarray
    turns: np.ndarray
    straight: np.ndarray
    column: np.ndarray


def joints_above(model: mujoco.MjModel, bodies: np.ndarray) -> JointsAbove:
    """The joints of bodies [N] and of all their ancestors."""
    rows = [_dofs_above(model, int(body)) for body in bodies]
    shape = (len(rows), max((len(row) for row in rows), default=0))
    dof, joint, joint_body = (np.zeros(shape, int) for _ in range(3))
    slides, turns, column = np.zeros((*shape, 1)), np.zeros((*shape, 1)), np.full(shape, -1)
    straight = np.zeros((*shape, 3))
    for n, row in enumerate(rows):
        for s, d in enumerate(row):
            j = int(model.dof_jntid[d])
            dof[n, s], joint[n, s], joint_body[n, s] = d, j, model.jnt_bodyid[j]
            kind, place = mujoco.mjtJoint(int(model.jnt_type[j])), d - int(model.jnt_dofadr[j])
            if kind == mujoco.mjtJoint.mjJNT_FREE and place < 3:
                straight[n, s, place] = 1.0
            elif kind == mujoco.mjtJoint.mjJNT_SLIDE:
                slides[n, s] = 1.0
            else:
                turns[n, s] = 1.0
                if kind != mujoco.mjtJoint.mjJNT_HINGE:
                    column[n, s] = place % 3
    return JointsAbove(np.asarray(bodies), dof, joint, joint_body, slides, turns, straight, column)


def _dofs_above(model: mujoco.MjModel, body: int) -> list[int]:
    found: list[int] = []
    while body > 0:
        first = int(model.body_dofadr[body])
        found += range(first, first + int(model.body_dofnum[body]))
        body = int(model.body_parentid[body])
    return found


def body_velocities(above: JointsAbove, moved: Moved) -> tuple[Float[Array, "W N 3"], Float[Array, "W N 3"]]:
    """Velocities of the bodies' origins (m/s) and their angular velocities (rad/s), world frame."""
    worlds = moved.qvel.shape[0]
    if not above.dof.size:
        zero = jnp.zeros((worlds, len(above.body), 3), jnp.float32)
        return zero, zero
    axis = moved.xaxis[:, above.joint]
    if (above.column >= 0).any():
        matrix = quat_to_matrix(moved.xquat[:, above.joint_body])  # W N S 3 3
        column = np.maximum(above.column, 0)[None, ..., None, None]
        turning = jnp.take_along_axis(matrix, column, axis=-1)[..., 0]
        axis = jnp.where((above.column >= 0)[..., None], turning, axis)
    speed = moved.qvel[:, above.dof][..., None]
    lever = moved.xpos[:, above.body][:, :, None] - moved.xanchor[:, above.joint]
    turned = above.turns * axis * speed
    linear = (above.slides * axis + above.straight) * speed + jnp.cross(turned, lever)
    return linear.sum(2).astype(jnp.float32), turned.sum(2).astype(jnp.float32)
