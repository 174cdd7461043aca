"""Fetch's inverse kinematics beside those of `mink`, a library for MuJoCo that solves a quadratic program a step."""

from __future__ import annotations

import mink
import mujoco
import numpy as np
import pytest

from ig2mj.agents.fetch import Fetch
from ig2mj.agents.fetch.figures import CHAIN, CHAIN_JOINTS, JOINTS, start_positions
from ig2mj.agents.kinematics import forward, inverse
from ig2mj.geometry.poses import rotation_angle

REST = start_positions("diagonal30")[CHAIN_JOINTS].astype(np.float32)

STEPS = 60


def goals(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses of the gripper that some posture near the start has."""
    q = np.clip(np.random.default_rng(3).normal(REST, 0.25, (count, 8)), CHAIN.lower, CHAIN.upper)
    pos, quat, _ = forward(CHAIN, q.astype(np.float32))
    return np.asarray(pos), np.asarray(quat)


def by_mink(pos: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """Trunk and arm [8] after `STEPS` steps of mink from the start; the base is frozen."""
    spec = mujoco.MjSpec.from_string("<mujoco/>")
    Fetch().attach(spec)
    model = spec.compile()
    configuration = mink.Configuration(model, model.key_qpos[0] if model.nkey else None)
    gripper = mink.FrameTask("fetch_gripper_link", "body", position_cost=1.0, orientation_cost=1.0, lm_damping=1e-3)
    gripper.set_target(mink.SE3(np.concatenate([quat, pos]).astype(float)))
    posture = mink.PostureTask(model, cost=1e-3)
    posture.set_target_from_configuration(configuration)
    own = [model.joint(f"fetch_{JOINTS[k].name}") for k in CHAIN_JOINTS]
    frozen = sorted(set(range(model.nv)) - {int(j.dofadr[0]) for j in own})
    still = mink.DofFreezingTask(model, frozen)
    limits = [mink.ConfigurationLimit(model)]
    for _ in range(STEPS):
        velocity = mink.solve_ik(
            configuration, [gripper, posture], 0.1, "daqp", limits=limits, constraints=[still], damping=1e-6
        )
        configuration.integrate_inplace(velocity, 0.1)
    return np.array([configuration.q[int(j.qposadr[0])] for j in own], np.float32)


@pytest.mark.slow
def test_ours_and_minks_bring_the_gripper_to_the_same_pose():
    pos, quat = goals(8)
    ours = np.asarray(inverse(CHAIN, np.tile(REST, (len(pos), 1)), pos, quat, REST, iterations=STEPS))
    theirs = np.stack([by_mink(p, q) for p, q in zip(pos, quat, strict=True)])
    reached = {}
    for name, q in {"ours": ours, "mink": theirs}.items():
        tip, turned, _ = forward(CHAIN, q)
        reached[name] = np.linalg.norm(tip - pos, axis=1), np.asarray(rotation_angle(turned, quat))
        assert (q >= CHAIN.lower - 1e-5).all() and (q <= CHAIN.upper + 1e-5).all()
    for (place, turn), name in zip(reached.values(), reached, strict=True):
        assert np.median(place) < 1e-3 and np.median(turn) < 1e-2, name
    assert np.median(reached["ours"][0]) < np.median(reached["mink"][0]) + 0.01
    same = (reached["ours"][0] < 0.01) & (reached["mink"][0] < 0.01)
    assert same.sum() >= 4
    assert np.abs(ours - theirs)[same].max() < 0.5, "and by much the same posture, since both keep near the rest"
