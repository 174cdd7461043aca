"""Objects neither move nor turn faster than their limits after a physics step, on every engine; robots have none."""

from __future__ import annotations

import jax.numpy as jnp
import mujoco
import numpy as np

from ig2mj.engine.speed_limits import TOP_ANGULAR, TOP_LINEAR, SpeedLimits

MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><worldbody>
    <body name="free"><freejoint/><geom size="0.1"/></body>
    <body name="ball"><joint type="ball"/><geom size="0.1"/></body>
    <body name="door"><joint axis="0 0 1"/><geom size="0.1"/></body>
    <body name="drawer"><joint type="slide"/><geom size="0.1"/></body>
    <body name="robot"><joint axis="0 0 1"/><geom size="0.1"/></body>
    </worldbody></mujoco>"""
)
LIMITS = SpeedLimits(MODEL, np.array([-1, -1, -1, -1, -1, 0]))


def test_each_vector_keeps_its_direction_and_what_is_slower_stays_to_the_bit():
    fast = np.array([300.0, 0, 400, 0.1, 0.2, 0.3, 0, -600, 800, -500, 70, 900])
    slow = np.random.default_rng(0).normal(0, 10, 12)
    for xp in (np, jnp):
        limited = np.asarray(LIMITS.limited(xp.asarray(np.array([fast, slow]), xp.float32)))
        expected = [18, 0, 24, 0.1, 0.2, 0.3, 0, -36, 48, -60, 30, 900]
        np.testing.assert_allclose(limited[0], expected, rtol=1e-6)
        assert (limited[1] == slow.astype(np.float32)).all()
    held = fast.copy()
    LIMITS.hold(held)
    np.testing.assert_allclose(held, expected)


def test_what_is_no_number_stays_none():
    lost = np.zeros(12)
    lost[0], lost[10] = np.nan, np.inf
    with np.errstate(invalid="ignore"):
        limited = LIMITS.limited(lost)
    assert np.isnan(limited[0]) and np.isnan(limited[10]) and (limited[3:9] == 0).all()
    LIMITS.hold(all_lost := np.full(12, np.nan))
    assert np.isnan(all_lost).all()
    LIMITS.hold(infinite := np.full(12, np.inf))
    assert np.isinf(infinite).all()


def test_a_model_without_joints_has_none():
    nothing = SpeedLimits(mujoco.MjModel.from_xml_string("<mujoco/>"), np.array([-1]))
    assert nothing.limited(np.zeros(0)).shape == (0,)


def test_they_hold_on_every_engine(small):
    engine = small.engine
    snapshot = engine.snapshot(engine.reset())
    qvel = np.array(snapshot.whole("qvel"))
    free = int(engine.layout.object_dofadr[engine.layout.object_dofadr >= 0][0])
    qvel[:, free : free + 6] = [0, 0, 200, 0, 0, 500]
    physics = engine.load(engine.reset(), snapshot.with_whole(qvel=qvel))
    physics, _ = engine.step(physics)
    after = np.asarray(engine.snapshot(physics).whole("qvel"))[:, free : free + 6]
    for part, limit in ((after[:, :3], TOP_LINEAR), (after[:, 3:], TOP_ANGULAR)):
        speed = np.linalg.norm(part, axis=1)  # gravity slows it between limits
        assert (speed < limit * (1 + 1e-5)).all() and (speed > 0.98 * limit).all()
    assert (after[:, 2] > 29).all()


def test_they_hold_between_the_physics_steps_of_a_control_step(small):
    """Only the first physics step moves at a speed beyond the limit."""
    engine = small.engine
    assert engine.substeps > 1
    snapshot = engine.snapshot(engine.reset())
    qpos, qvel = np.array(snapshot.whole("qpos")), np.array(snapshot.whole("qvel"))
    first = np.flatnonzero(engine.layout.object_dofadr >= 0)[0]
    height, free = int(engine.layout.object_qposadr[first]) + 2, int(engine.layout.object_dofadr[first])
    qpos[:, height], qvel[:, free : free + 6] = 50.0, [0, 0, 200, 0, 0, 0]
    physics = engine.load(engine.reset(), snapshot.with_whole(qpos=qpos, qvel=qvel))
    physics, _ = engine.step(physics)
    risen = np.asarray(engine.snapshot(physics).whole("qpos"))[:, height] - 50.0
    expected = (200.0 + (engine.substeps - 1) * TOP_LINEAR) * engine.timestep
    assert np.allclose(risen, expected, rtol=0.02)
