"""Describes the non-finite state of a world."""

from __future__ import annotations

import mujoco
import numpy as np

FEW = 6
"""So many bodies are named."""


def why_lost(number: int, model: mujoco.MjModel, data: mujoco.MjData) -> str:
    """One line that names the world and the bodies whose positions or velocities MuJoCo takes for none: NaN, and what
    is beyond `mjMAXVAL`. "" where there is none."""
    bodies = set(model.dof_bodyid[~(np.abs(data.qvel) < mujoco.mjMAXVAL)])
    coordinates = np.flatnonzero(~(np.abs(data.qpos) < mujoco.mjMAXVAL))
    bodies |= set(model.jnt_bodyid[np.searchsorted(model.jnt_qposadr, coordinates, side="right") - 1])
    if not bodies:
        return ""
    names = [f"'{model.body(int(b)).name}'" for b in sorted(bodies)]
    listed = ", ".join(names[:FEW]) + (f" and {len(names) - FEW} more" if len(names) > FEW else "")
    return (
        f"world {number}: position or velocity is not finite at t = {data.time:.3f} s of {listed} "
        "(reset the world; a smaller timestep or weaker controls may fix it)"
    )
