"""Forks of batches: of worlds, of watched worlds with a recording each, and of worlds on several devices."""

from __future__ import annotations

import engine_bench
import jax
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.registry import make_engine
from ig2mj.errors import EngineError, StaleStateError
from ig2mj.worlds import Core, Rules, ShardedWorlds
from ig2mj.worlds.debug import DebugWorlds
from ig2mj.worlds.recorder import read_dump


@pytest.fixture(scope="module")
def scene(bench_folder):
    return engine_bench.bench_home(bench_folder, True)


@pytest.fixture(scope="module")
def worlds(scene):
    return ig2mj.Worlds(scene, 2, NativeEngine(scene, 2, threads=2))


def box_moved(scene, height: float) -> Write:
    count = len(scene.object_names)
    mask, pos = np.zeros((2, count), bool), np.zeros((2, count, 3))
    mask[:, scene.object_index("box")] = True
    pos[...] = (0.1, 0.1, height)
    return Write(object_mask=mask, object_pos=pos, object_quat=np.tile([1.0, 0, 0, 0], (2, count, 1)))


def arrays(batch):
    return [np.array(leaf) for leaf in (*jax.tree.leaves(batch.world.view), *jax.tree.leaves(batch.world.states))]


def test_branches_of_worlds_do_not_disturb_each_other(worlds, scene):
    batch, _ = worlds.step(worlds.start(seed=1))
    alone = worlds.fork(batch)
    for _ in range(4):
        alone, _ = worlds.step(alone)
    branches = [worlds.fork(batch), batch, worlds.core.write(worlds.fork(batch), box_moved(scene, 0.9))]
    for _ in range(4):  # in turn, through the memos that one core keeps of the last step
        branches = [worlds.step(branch)[0] for branch in branches]
    for branch in branches[:2]:
        for ours, theirs in zip(arrays(branch), arrays(alone), strict=True):
            assert ours.tobytes() == theirs.tobytes()
    other = np.asarray(branches[2].world.view.object_pos)
    assert np.abs(other - np.asarray(alone.world.view.object_pos)).max() > 0.05


def test_batches_that_were_used_up_are_refused(worlds, scene):
    used = worlds.start(seed=0)
    batch, _ = worlds.step(used)
    core, row = worlds.core, worlds.engine.export(batch.world.physics, 0)
    calls = {
        "step": lambda: worlds.step(used),
        "reset": lambda: worlds.reset(used, np.ones(2, bool)),
        "fork": lambda: worlds.fork(used),
        "write": lambda: core.write(used, Write()),
        "load": lambda: core.load(used, row),
        "rollout": lambda: core.rollout(used, None, lambda batch, carry: (None, carry), 1),
    }
    for call in calls.values():
        with pytest.raises(StaleStateError, match="continue with the state that the last call returned"):
            call()
    nothing = np.zeros(2, bool)
    for change in (lambda b: core.write(b, Write()), lambda b: core.load(b, row), lambda b: worlds.reset(b, nothing)):
        before = worlds.fork(batch)
        change(before)
        with pytest.raises(StaleStateError):
            worlds.step(before)


def test_recordings_of_branches_are_not_mixed(scene, tmp_path):
    core = Core(NativeEngine(scene, 2, threads=1), Rules.of_scene(scene))
    debug = DebugWorlds(core, scene, tmp_path, length=8)
    batch, _ = debug.step(debug.start(seed=0))
    fork = debug.fork(batch)
    for _ in range(3):
        batch, _ = debug.step(batch)
        fork, _ = debug.step(fork)
    for branch in (batch, fork):
        _, recording = debug._branches[debug._branch_of(branch)]
        assert int(recording.written) == 5, "the start and four steps"
    fork = debug.reset(fork, np.array([True, False]))
    batch, _ = debug.step(batch)
    fork, _ = debug.step(fork)
    assert [int(recording.written) for _, recording in debug._branches] == [6, 6]
    fallen = core.engine.write(fork.world.physics, box_moved(scene, -3.0))
    with pytest.raises(EngineError, match="--dump"):
        debug.step(fork.replace(world=fork.world.replace(physics=fallen)))
    (file,) = tmp_path.glob("*.npz")
    physics, _, _ = read_dump(file, scene.name)
    assert len(physics.qpos) == 7, "of the branch that was stepped last"


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("engine", ["warp"])
def test_forks_and_used_shards_of_several_devices(scene, engine):
    rules = Rules.of_scene(scene)
    worlds = ShardedWorlds(lambda count: Core(make_engine(engine, scene, count), rules), 2)
    shards, _ = worlds.step(worlds.start(seed=0))
    fork = worlds.fork(shards)
    ours, _ = worlds.step(shards)
    theirs, _ = worlds.step(fork)
    for a, b in zip(arrays(ours.parts[0]), arrays(theirs.parts[0]), strict=True):
        assert a.tobytes() == b.tobytes()
    for use in (worlds.step, worlds.fork, lambda used: worlds.reset(used, np.ones(2, bool))):
        with pytest.raises(StaleStateError):
            use(shards)
    assert repr(ours) == "Shards(Batch(2 worlds))"


def test_a_goal_asked_of_donated_states_names_the_remedy(worlds, scene):
    """As after a step on a GPU; on the native engine views and states of a used batch stay readable."""
    goal = worlds.core.rules.compiled("(on_top box table)", False)
    world = worlds.start(seed=0).world
    assert goal(world).tolist() == [True, True]
    arrays = jax.tree.map(jax.numpy.array, world.states)
    jax.jit(lambda states: jax.tree.map(lambda a: ~a if a.dtype == bool else a + 1, states), donate_argnums=0)(arrays)
    for ask in (goal, goal.fraction, goal.literals_of, goal.explain):
        with pytest.raises(StaleStateError):
            ask(world.replace(states=arrays))


def test_a_copied_simulation_is_a_fork_and_no_engine_is_pickled(scene, worlds):
    import copy
    import pickle

    one = ig2mj.Simulation(scene)
    one.step()
    for copied in (copy.copy(one), copy.deepcopy(one)):
        before = one.time
        copied.step(count=3)
        assert one.time == before and copied.time > before
        one.step()
    with pytest.raises(EngineError, match=r"sim\.save\(FILE\)"):
        pickle.dumps(one)
    for use in (copy.deepcopy, pickle.dumps):
        with pytest.raises(EngineError, match=r"save\(batch, FILE\)"):
            use(worlds)
