"""Scenes in which nothing moves: there are no kinematic trees, and so nothing that could sleep."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.sleep import restore_sleep
from ig2mj.scene import manifest as mf

SHELF = '<body name="shelf"><geom name="shelf/collision_0" type="box" size="1 1 0.1" group="3"/></body>'


def model_of(bodies: str) -> mujoco.MjModel:
    text = f'<mujoco><option><flag sleep="enable"/></option><worldbody>{bodies}</worldbody></mujoco>'
    return mujoco.MjModel.from_xml_string(text)


@pytest.mark.parametrize(
    "bodies",
    [
        SHELF,
        f'{SHELF}<body name="led" mocap="true"><geom size="0.1"/></body>',
        f'{SHELF}<body name="can" pos="0 0 0.3"><freejoint/><geom size="0.1"/></body><body mocap="true"/>',
    ],
    ids=["static", "static and mocap", "all three kinds"],
)
def test_a_restored_sleep_state_is_what_mujoco_itself_makes_of_it(bodies):
    model = model_of(bodies)
    expected, data = mujoco.MjData(model), mujoco.MjData(model)
    for _ in range(3):
        mujoco.mj_step(model, expected)
    mujoco.mj_copyState(model, expected, data, mujoco.mjtState.mjSTATE_INTEGRATION)
    mujoco.mj_forward(model, data)
    data.body_awake[:] = -7
    restore_sleep(model, data, expected.tree_asleep)
    for name in ("tree_asleep", "tree_awake", "body_awake"):
        np.testing.assert_array_equal(getattr(data, name), getattr(expected, name), err_msg=name)
    for count, ids in (
        ("nbody_awake", "body_awake_ind"),
        ("nparent_awake", "parent_awake_ind"),
        ("nv_awake", "dof_awake_ind"),
    ):
        number = getattr(expected, count)
        assert getattr(data, count) == number, count
        np.testing.assert_array_equal(getattr(data, ids)[:number], getattr(expected, ids)[:number], err_msg=ids)


def test_a_scene_without_anything_that_moves_is_reset_saved_loaded_and_stepped(tmp_path):
    (tmp_path / "scene.xml").write_text(
        f'<mujoco><option timestep="{1 / 120!r}"><flag sleep="enable"/></option><worldbody>{SHELF}</worldbody></mujoco>'
    )
    shelf = mf.ObjectEntry("shelf", "shelf", "made", ["shelf"], True, (2, 2, 0.2), 1.0)
    mf.save_manifest(mf.Manifest(mf.FORMAT_VERSION, "bare", [shelf]), tmp_path / "manifest.json")
    engine = NativeEngine(ig2mj.load_scene(tmp_path), 2, threads=1)
    physics = engine.load(engine.reset(), engine.export(engine.reset(), 0))
    physics, view = engine.step(physics)
    np.testing.assert_array_equal(view.object_pos[:, 0], np.zeros((2, 3)))
    assert view.awake.tolist() == [[False], [False]]
