"""The agents' rows of the view, from a world's MjData.

An agent is awake in every step, so what these rows cost is paid by a home in which all else sleeps: poses of all bases,
hands and fingers are gathered at once into one array, of which the view's fields are slices.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.scene.tables import SceneTables

_PARTS = ("base", "hand", "finger")
_XBODY = int(mujoco.mjtObj.mjOBJ_XBODY)
_AWAKE = int(mujoco.mjtSleepState.mjS_AWAKE)


@dataclasses.dataclass(frozen=True, eq=False)
class AgentPlan:
    """What to gather.

    Attributes:
      bodies: bases, hands, fingers, in this order.
      moving: (body, prefix of its fields, row) of what has velocities in the view.
      eyes: (agent, camera) of agents with a camera. eyeless: agents without, and their bases.
      qposadr, dofadr: of scalar joints.
    """

    model: mujoco.MjModel
    bodies: np.ndarray
    moving: tuple[tuple[int, str, int], ...]
    eyes: tuple[tuple[int, int], ...]
    eyeless: np.ndarray
    eyeless_bodies: np.ndarray
    qposadr: np.ndarray
    dofadr: np.ndarray

    @classmethod
    def build(cls, model: mujoco.MjModel, tables: SceneTables) -> AgentPlan:
        """`model`: any copy of the engine's; only what never changes is read."""
        eyeless = np.flatnonzero(tables.agent_camera < 0)
        return cls(
            model=model,
            bodies=np.concatenate([tables.agent_body, tables.hand_body, tables.finger_body]),
            moving=tuple(
                (int(body), f"agent.{part}", row)
                for part, bodies in (("base", tables.agent_body), ("hand", tables.hand_body))
                for row, body in enumerate(bodies)
            ),
            eyes=tuple((agent, int(camera)) for agent, camera in enumerate(tables.agent_camera) if camera >= 0),
            eyeless=eyeless,
            eyeless_bodies=tables.agent_body[eyeless],
            qposadr=tables.agent_joint_qposadr,
            dofadr=tables.agent_joint_dofadr,
        )


def pose_arrays(num_worlds: int, tables: SceneTables) -> dict[str, np.ndarray]:
    """Working arrays of the poses of bases, hands and fingers, by field of the view: slices of two packed arrays, which
    are there too, as "agent.pos" and "agent.quat"."""
    counts = (len(tables.agent_body), len(tables.hand_body), len(tables.finger_body))
    arrays: dict[str, np.ndarray] = {}
    for suffix, width in (("pos", 3), ("quat", 4)):
        packed = arrays[f"agent.{suffix}"] = np.zeros((num_worlds, sum(counts), width), np.float32)
        for part, rows in zip(_PARTS, np.split(packed, np.cumsum(counts)[:-1], axis=1), strict=True):
            arrays[f"agent.{part}_{suffix}"] = rows
    return arrays


def write_agents(plan: AgentPlan, data: mujoco.MjData, rows: dict[str, np.ndarray]) -> None:
    """Writes one world's rows of all agents, but for touching and forces."""
    rows["agent.pos"][:] = data.xpos[plan.bodies]
    rows["agent.quat"][:] = data.xquat[plan.bodies]
    if len(plan.qposadr):
        rows["agent.joint_pos"][:] = data.qpos[plan.qposadr]
        rows["agent.joint_vel"][:] = data.qvel[plan.dofadr]
    velocity = np.zeros(6)
    for body, prefix, row in plan.moving:
        if data.body_awake[body] == _AWAKE:
            mujoco.mj_objectVelocity(plan.model, data, _XBODY, body, velocity, 0)
        else:
            velocity[:] = 0.0  # MuJoCo leaves old velocities where a body sleeps
        rows[f"{prefix}_linvel"][row] = velocity[3:]
        rows[f"{prefix}_angvel"][row] = velocity[:3]
    quat = np.zeros(4)
    for agent, camera in plan.eyes:
        rows["agent.eye_pos"][agent] = data.cam_xpos[camera]
        mujoco.mju_mat2Quat(quat, data.cam_xmat[camera])
        rows["agent.eye_quat"][agent] = quat
    if len(plan.eyeless):
        rows["agent.eye_pos"][plan.eyeless] = data.xpos[plan.eyeless_bodies]
        rows["agent.eye_quat"][plan.eyeless] = data.xquat[plan.eyeless_bodies]
