"""The columns of `SceneTables` that describe agents: their bodies, joints, actuators, hands and fingers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from ig2mj.scene.manifest import AgentEntry

Find = Callable[[str, str, str], int]
"""(kind of MJCF element, its name, the manifest's element) -> id."""


def agent_columns(model: mujoco.MjModel, agents: list[AgentEntry], find: Find) -> dict[str, Any]:
    """The columns `agent_*`, `body_agent`, `body_hand`, `actuator_agent`, `hand_*` and `finger_*` of `SceneTables`.

    Args:
      model: the scene with its agents, compiled.
      agents: the manifest's.
      find: looks names up; raises ManifestError where the model has no such element.
    """
    base, camera, hands, fingers = [], [], [], []
    for number, entry in enumerate(agents):
        element = f"agent '{entry.name}'"
        base.append(find("body", entry.body, element))
        camera.append(-1 if entry.camera is None else find("camera", entry.camera, element))
        hands += [(find("body", name, element), number) for name in entry.hands]
        fingers += [(find("body", name, element), number) for name in entry.fingers]
    hand_table, finger_table = (np.array(rows, int).reshape(-1, 2) for rows in (hands, fingers))
    body_agent = _agent_of_bodies(model, np.array(base, int), [*hands, *fingers])
    body_hand, finger_hand = _hand_of_bodies(model, hand_table, finger_table)
    return {
        "agent_names": tuple(entry.name for entry in agents),
        "agent_body": np.array(base, int),
        "agent_camera": np.array(camera, int),
        "agent_fovy": np.array([0.0 if c < 0 else np.deg2rad(model.cam_fovy[c]) for c in camera], np.float64),
        "body_agent": body_agent,
        "body_hand": body_hand,
        "actuator_agent": _agent_of_actuators(model, body_agent),
        "hand_body": hand_table[:, 0],
        "hand_agent": hand_table[:, 1],
        "finger_body": finger_table[:, 0],
        "finger_agent": finger_table[:, 1],
        "finger_hand": finger_hand,
        **_joint_columns(model, body_agent),
    }


def _agent_of_bodies(model: mujoco.MjModel, base: np.ndarray, parts: list[tuple[int, int]]) -> np.ndarray:
    """Agent of each body: everything that has the same root as the base, a hand or a finger of it."""
    root = np.asarray(model.body_rootid)
    agent_of_root = np.full(model.nbody, -1)
    for body, agent in [*((int(b), a) for a, b in enumerate(base)), *parts]:
        if root[body] > 0:
            agent_of_root[root[body]] = agent
    return agent_of_root[root]


def _hand_of_bodies(model: mujoco.MjModel, hands: np.ndarray, fingers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hand of each body [B] and of each finger [F].

    A finger that does not hang on a palm belongs to its agent's hand, where the agent has just one.
    """
    body_hand = np.full(model.nbody, -1)
    body_hand[hands[:, 0]] = np.arange(len(hands))
    for body, agent in fingers:
        own = np.flatnonzero(hands[:, 1] == agent)
        if len(own) == 1 and not _hangs_on(model, int(body), hands[:, 0]):
            body_hand[body] = own[0]
    for body in range(1, model.nbody):  # parents come first
        if body_hand[body] < 0:
            body_hand[body] = body_hand[model.body_parentid[body]]
    return body_hand, body_hand[fingers[:, 0]]


def _hangs_on(model: mujoco.MjModel, body: int, others: np.ndarray) -> bool:
    while body > 0:
        if body in others:
            return True
        body = int(model.body_parentid[body])
    return False


def _joint_columns(model: mujoco.MjModel, body_agent: np.ndarray) -> dict[str, Any]:
    agent = body_agent[model.jnt_bodyid]
    scalar = np.isin(model.jnt_type, [mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE])
    joints = np.flatnonzero(scalar & (agent >= 0))
    joints = joints[np.argsort(agent[joints], kind="stable")]
    return {
        "agent_joint_names": tuple(model.joint(int(j)).name for j in joints),
        "agent_joint_agent": agent[joints],
        "agent_joint_qposadr": np.array(model.jnt_qposadr[joints], int),
        "agent_joint_dofadr": np.array(model.jnt_dofadr[joints], int),
    }


def _agent_of_actuators(model: mujoco.MjModel, body_agent: np.ndarray) -> np.ndarray:
    return np.array([body_agent[_moved_body(model, actuator)] for actuator in range(model.nu)], int)


def _moved_body(model: mujoco.MjModel, actuator: int) -> int:
    """A body that the actuator acts on; 0, the world, if unknown."""
    kind, target = mujoco.mjtTrn(int(model.actuator_trntype[actuator])), int(model.actuator_trnid[actuator, 0])
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        return int(model.jnt_bodyid[target])
    if kind == mujoco.mjtTrn.mjTRN_TENDON:
        wraps = model.tendon_adr[target] + np.arange(model.tendon_num[target])
        for wrap in wraps:
            owner = {
                mujoco.mjtWrap.mjWRAP_JOINT: model.jnt_bodyid,
                mujoco.mjtWrap.mjWRAP_SITE: model.site_bodyid,
            }.get(mujoco.mjtWrap(int(model.wrap_type[wrap])))
            if owner is not None:
                return int(owner[model.wrap_objid[wrap]])
        return 0
    if kind in (mujoco.mjtTrn.mjTRN_SITE, mujoco.mjtTrn.mjTRN_SLIDERCRANK):
        return int(model.site_bodyid[target])
    return target if kind == mujoco.mjtTrn.mjTRN_BODY else 0
