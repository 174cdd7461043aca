"""The start state at rest: hovering objects are let down onto what is below them, parked ones have settled.

Real scene files leave millimetres to centimetres of air under loose objects, which iGibson lets fall when it loads the
scene (iGibson's dataset format). Here the fall is done once, at conversion, and only where it is nothing but a fall:
an object that slides, tips or rolls keeps the source's pose, and the checks list it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

import mujoco
import numpy as np

#: Seconds that the fall and the rest after it may take.
SETTLING_TIME = 2.0
#: What moves less (m) keeps the source's pose: that is settling of contacts, not hovering.
LEAST_DROP = 0.005
#: Beyond these a motion is no fall onto a support: m down, m sideways, radians turned.
GREATEST_DROP, GREATEST_SHIFT, GREATEST_TURN = 0.25, 0.02, 0.26


@dataclasses.dataclass
class Drop:
    """An object's root body that was let down: how far (m), and its new pose."""

    body: str
    distance: float
    pos: np.ndarray
    quat: np.ndarray


def let_down(model: mujoco.MjModel, key: str, parked: Collection[str], *, hovering: bool = True) -> list[Drop]:
    """Free bodies that do not rest in keyframe `key`, and the poses where they come to rest.

    Args:
      parked: bodies on the parking slab, which may settle however they like.
      hovering: also those that fall straight down elsewhere; False lets them hover.
    """
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    start = data.qpos.copy()
    for _ in range(round(SETTLING_TIME / model.opt.timestep)):
        mujoco.mj_step(model, data)
    if not np.all(np.isfinite(data.qpos)):
        return []
    free = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
    drops = []
    for joint in free:
        body = model.body(model.jnt_bodyid[joint]).name
        if body in parked or hovering:
            drops.append(_drop(model, data, joint, start, body, anyhow=body in parked))
    return [drop for drop in drops if drop is not None]


def _drop(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, start: np.ndarray, body: str, *, anyhow: bool
) -> Drop | None:
    at, speed = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    before, after = start[at : at + 7], data.qpos[at : at + 7]
    moved = after[:3] - before[:3]
    turn = 2 * np.arccos(np.clip(abs(before[3:] @ after[3:]), 0.0, 1.0))
    falls = LEAST_DROP < -moved[2] < GREATEST_DROP
    straight = np.hypot(moved[0], moved[1]) < GREATEST_SHIFT and turn < GREATEST_TURN
    rests = np.abs(data.qvel[speed : speed + 6]).max() < 0.01
    settles = anyhow and moved[2] > -GREATEST_DROP
    if not (rests and (settles or (falls and straight))):
        return None
    return Drop(body, float(-moved[2]), after[:3].copy(), after[3:].copy())
