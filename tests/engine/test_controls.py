"""Controls of a wrong shape are refused, wrong numbers are clipped and flagged; on every engine."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.engine.controls import check_shape
from ig2mj.errors import EngineError
from ig2mj.worlds.guards import Flag, check


@pytest.mark.parametrize("shape", [(1, 3), (2, 4)])
def test_engines_refuse_a_wrong_shape(full, shape):
    with pytest.raises(EngineError, match=r"controls have shape .*, this engine takes \(2, 3\)"):
        full.step(full.fresh(), np.zeros(shape, np.float32))


@pytest.mark.parametrize("shape", [(16,), (1, 16), (4, 15), (4, 16, 1)])
def test_the_right_shape_is_named(shape):
    with pytest.raises(EngineError, match=r"this engine takes \(4, 16\): 4 worlds of 16 actuators$"):
        check_shape(np.zeros(shape), 4, 16)
    check_shape(np.zeros((4, 16)), 4, 16)


def test_wrong_numbers_are_clipped_and_flagged(full, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ctrl = np.array([[0.1, 0.0, 0.0]] * 2, np.float32)
    physics, _ = full.run(full.fresh(), 20, ctrl)
    assert not np.asarray(full.engine.health(physics).wrong_controls).any()
    ctrl[1] = [np.nan, 0, 0]
    physics, _ = full.run(physics, 20, ctrl)
    assert np.asarray(full.engine.health(physics).wrong_controls).tolist() == [False, True]
    row = full.engine.snapshot(physics)
    assert np.asarray(row.ctrl) == pytest.approx(np.array([[0.1, 0, 0]] * 2)), "what is not a number changes nothing"
    ctrl[1] = [np.inf, -1e30, 1e7]
    physics, view = full.run(physics, 1, ctrl)
    assert np.asarray(full.engine.snapshot(physics).ctrl)[1].tolist() == [1e6, -1e6, 1e6]
    flags = np.asarray(check(full.engine.health(physics), view.object_com, np.full(len(full.scene.object_names), -9.0)))
    assert (flags & int(Flag.WRONG_CONTROLS)).tolist() == [0, int(Flag.WRONG_CONTROLS)]
    physics = full.load(physics, full.every(full.first))
    assert not np.asarray(full.engine.health(physics).wrong_controls).any()
    assert list(tmp_path.iterdir()) == [], "no MUJOCO_LOG.TXT"


def test_warnings_of_mujoco_go_to_a_logger(full, tmp_path, monkeypatch, caplog):
    import mujoco

    monkeypatch.chdir(tmp_path)
    xml = "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qvel[0] = np.nan
    mujoco.mj_step(model, data)
    assert "Nan" in caplog.text and list(tmp_path.iterdir()) == []
