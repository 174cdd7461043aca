"""A world of the native engine whose numbers are not finite any more: it alone is lost, and flagged, until a reset."""

from __future__ import annotations

import engine_bench
import jax
import numpy as np
import pytest

from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine, NativePhysics
from ig2mj.errors import EngineError, LostWorldError
from ig2mj.states.model import StateModel
from ig2mj.worlds.core import Core
from ig2mj.worlds.debug import DebugWorlds
from ig2mj.worlds.guards import Flag
from ig2mj.worlds.rules import Rules

WORLDS, LOST = 3, 1
OTHERS = [0, 2]
FIELDS = ("qpos", "qvel", "time")


@pytest.fixture(scope="module")
def scene(bench_folder):
    return engine_bench.bench_home(bench_folder, False)


@pytest.fixture(scope="module", params=[1, 2], ids=["one thread", "two threads"])
def core(request, scene) -> Core:
    rules = Rules(StateModel.of_manifest(scene.tables, scene.manifest))
    return Core(NativeEngine(scene, WORLDS, threads=request.param), rules)


def lose(physics: NativePhysics, speed: float = np.nan) -> None:
    """The box of one world gets a speed, m/s or rad/s."""
    world = physics.worlds[LOST]
    world.data.qvel[world.model.joint("box/free").dofadr] = speed


def numbers(core: Core, physics: NativePhysics, worlds: list[int]) -> list[bytes]:
    rows = [core.engine.export(physics, w) for w in worlds]
    return [np.asarray(getattr(row, name)).tobytes() for row in rows for name in FIELDS]


def test_the_other_worlds_are_stepped_as_if_nothing_were(core):
    """And the lost one, whose view stays finite, is flagged and counted once."""
    ctrl = np.tile(np.array([0.3, 0.1, 0.0], np.float32), (WORLDS, 1))
    alone, batch = core.start(seed=0), core.start(seed=0)
    for step in range(8):
        alone, _ = core.step(alone, ctrl)
        if step == 2:
            lose(batch.world.physics)
            before = np.array(batch.world.view.body_pos)[LOST]
        batch, _ = core.step(batch, ctrl)
    assert np.asarray(batch.flags).tolist() == [0, int(Flag.NOT_FINITE), 0]
    assert core.metrics(batch)["not_finite"] == 1 and core.metrics(alone)["not_finite"] == 0
    assert numbers(core, batch.world.physics, OTHERS) == numbers(core, alone.world.physics, OTHERS)
    for now, expected in zip(jax.tree.leaves(batch.world.view), jax.tree.leaves(alone.world.view), strict=True):
        np.testing.assert_array_equal(np.asarray(now)[OTHERS], np.asarray(expected)[OTHERS])
    np.testing.assert_array_equal(np.asarray(batch.world.view.body_pos)[LOST], before)
    batch, _ = core.step(core.reset(batch, batch.flags != 0), ctrl)
    new, _ = core.step(core.start(seed=0), ctrl)
    assert not np.asarray(batch.flags).any(), "a reset replaces all that was not a number"
    assert numbers(core, batch.world.physics, [LOST]) == numbers(core, new.world.physics, [LOST])


def test_an_engine_says_so_in_every_step_until_the_world_is_loaded(core, scene):
    engine = core.engine
    physics = engine.reset()
    row = engine.export(physics, LOST)
    lose(physics)
    for step in (1, 2):
        with pytest.raises(LostWorldError, match=r"world 1: position or velocity is not finite at t = 0\.033 s of "):
            engine.step(physics)
        assert engine.time(physics).tolist() == pytest.approx([step / 30, 1 / 30, step / 30])
        assert np.asarray(engine.health(physics).finite).tolist() == [True, False, True]
    here = np.array(engine.view(physics).object_pos)
    there = here + np.array([0, 0, 0.2])
    quat = np.tile([1.0, 0, 0, 0], (*here.shape[:2], 1))
    moved = np.asarray(scene.tables.object_names) == "box"
    physics = engine.write(physics, Write(object_mask=np.tile(moved, (WORLDS, 1)), object_pos=there, object_quat=quat))
    rise = np.asarray(engine.view(physics).object_pos)[:, moved, 2] - here[:, moved, 2]
    np.testing.assert_allclose(rise[:, 0], [0.2, 0.0, 0.2], atol=1e-6)
    physics, view = engine.step(engine.load(physics, row, np.arange(WORLDS) == LOST))
    assert np.isfinite(np.asarray(view.body_pos)).all() and np.asarray(engine.health(physics).finite).all()


@pytest.mark.parametrize("speed", [np.nan, 1e12])
def test_debug_mode_names_what_is_not_finite(core, scene, tmp_path, speed):
    """A number beyond MuJoCo's limit of 1e10 is none either."""
    debug = DebugWorlds(core, scene, tmp_path, length=2)
    batch, _ = debug.step(debug.start(seed=0))
    lose(batch.world.physics, speed)
    said = r"world 1: not_finite: body '.+' has no finite position or velocity; step 2; .*--dump .*world1_step2.npz"
    with pytest.raises(EngineError, match=said):
        debug.step(batch)
