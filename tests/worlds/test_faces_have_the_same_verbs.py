"""Every face of worlds has the same verbs: names, arguments and meaning (`ig2mj.worlds.face`)."""

from __future__ import annotations

import inspect

import jax
import numpy as np
import pytest
from tiny_home import write_tiny_home

import ig2mj
from ig2mj.engine.base import Write
from ig2mj.errors import InputError
from ig2mj.worlds import DebugWorlds, ShardedWorlds, Worlds
from ig2mj.worlds.face import VERBS, Face


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return ig2mj.load_scene(write_tiny_home(tmp_path_factory.mktemp("faces") / "home"))


@pytest.mark.parametrize("face", [Worlds, DebugWorlds, ShardedWorlds])
def test_a_face_has_every_verb_with_the_same_arguments(face):
    for verb in VERBS:
        own, common = (list(inspect.signature(getattr(kind, verb)).parameters) for kind in (face, Face))
        assert own == common, f"{face.__name__}.{verb}"


def test_a_simulation_has_the_verbs_of_its_one_world():
    for verb in ("start", "step", "reset", "fork", "save", "load"):
        assert callable(getattr(ig2mj.Simulation, verb))
    assert next(iter(list(inspect.signature(ig2mj.Simulation.start).parameters)[1:])) == "seed"


def fallen(face: Face, batch, steps: int = 5):
    for _ in range(steps):
        batch, _ = face.step(batch)
    return batch


def of_world_1(face: Worlds, height: float) -> Write:
    """The ball of world 1 at a height."""
    ball, count = face.scene.object_index("ball"), len(face.scene.object_names)
    mask, pos, quat = np.zeros((2, count), bool), np.zeros((2, count, 3)), np.zeros((2, count, 4))
    mask[1, ball], pos[..., 2], quat[..., 0] = True, height, 1.0
    return Write(object_mask=mask, object_pos=pos, object_quat=quat)


def test_worlds_of_a_file_go_on_bit_for_bit(scene, tmp_path):
    worlds = Worlds(scene, 2, "native")
    batch = fallen(worlds, worlds.write(worlds.start(3), of_world_1(worlds, 1.5)))
    worlds.save(batch, tmp_path / "batch.npz")
    again = worlds.load(tmp_path / "batch.npz")
    for a, b in ((batch, again), (fallen(worlds, batch), fallen(worlds, again))):
        assert np.array_equal(a.world.view.object_pos, b.world.view.object_pos)
        assert np.array_equal(a.world.states.temperature, b.world.states.temperature)
        assert np.array_equal(a.world.key, b.world.key) and np.array_equal(a.world.step, b.world.step)
        if a is batch:  # compared before it is stepped
            assert np.ptp(np.asarray(a.world.view.object_pos)[:, scene.object_index("ball"), 2]) > 0.1


def test_a_file_of_fewer_worlds_is_refused(scene, tmp_path):
    worlds = Worlds(scene, 2, "native")
    worlds.save(worlds.start(0), tmp_path / "batch.npz")
    with pytest.raises(InputError, match="worlds = '2', here '3'"):
        Worlds(scene, 3, "native").load(tmp_path / "batch.npz")
    worlds.save(worlds.start(0), tmp_path / "batch.npz")
    with np.load(tmp_path / "batch.npz") as file:
        arrays = dict(file)
    arrays["batch.flags"] = arrays["batch.flags"] - 1
    np.savez(tmp_path / "batch.npz", **arrays)
    with pytest.raises(InputError, match="out of range"):
        worlds.load(tmp_path / "batch.npz")


def test_debug_worlds_watch_what_is_written_loaded_and_rolled_out(scene, tmp_path):
    worlds = Worlds(scene, 2, "native")
    debug = DebugWorlds(worlds.core, scene, tmp_path)
    batch = debug.write(debug.start(0), of_world_1(worlds, 1.0))
    batch, carry = debug.rollout(batch, 1, lambda batch, carry: (None, carry + 1), 3)
    assert carry == 4 and np.asarray(batch.world.step).tolist() == [3, 3]
    debug.save(batch, tmp_path / "batch.npz")
    batch = fallen(debug, debug.load(tmp_path / "batch.npz"), 2)
    assert np.asarray(batch.world.step).tolist() == [5, 5] and debug.metrics(batch)["fell"] == 0


def test_a_fork_of_a_simulation_goes_on_alone(scene):
    one = ig2mj.Simulation(scene)
    one.set_object_pose("ball", [0.0, 0.0, 1.5])
    other = one.fork()
    one.step(count=10)
    height = other.object_pose("ball")[0][2]
    assert height == pytest.approx(1.5)
    other.step(count=10)
    assert all(map(np.array_equal, one.object_pose("ball"), other.object_pose("ball")))
    assert all(map(np.array_equal, jax.tree.leaves(one.states), jax.tree.leaves(other.states)))


def test_the_old_name_of_load_still_works(scene, tmp_path):
    one = ig2mj.Simulation(scene)
    one.save(tmp_path / "world.npz")
    with pytest.warns(FutureWarning, match="'Simulation.restore' is now 'Simulation.load'"):
        one.restore(tmp_path / "world.npz")
