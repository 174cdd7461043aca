"""Forks, deep copies, pickles and files of an environment's state; what is refused; short reprs."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
import random
import zipfile

import jax
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.native.physics import NativePhysics
from ig2mj.envs.arrays import NumpyEnv
from ig2mj.envs.gymnasium import GymVectorEnv
from ig2mj.errors import EngineError, InputError, StaleStateError
from ig2mj.worlds.guards import Flag

STEPS = 3


@pytest.fixture(scope="module")
def env(cooking_meat):
    return cooking_meat


@pytest.fixture(scope="module")
def actions(env):
    rng = np.random.default_rng(0)
    return [rng.uniform(-1, 1, (2, *env.action_space.shape)).astype(np.float32) for _ in range(2 * STEPS)]


@pytest.fixture
def state(env, actions):
    state = env.reset(0)
    for action in actions[:STEPS]:
        state = env.step_autoreset(state, action)
    return state


@pytest.fixture
def file(env, state, tmp_path):
    env.save(state, tmp_path / "state.npz")
    return tmp_path / "state.npz"


def differing(one, other):
    """Paths of arrays that are not the same to the last bit."""
    pairs = zip(jax.tree_util.tree_leaves_with_path(one), jax.tree_util.tree_leaves_with_path(other), strict=True)
    return [
        jax.tree_util.keystr(path)
        for (path, a), (_, b) in pairs
        if not isinstance(a, NativePhysics) and np.asarray(a).tobytes() != np.asarray(b).tobytes()
    ]


@pytest.mark.slow
def test_the_same_step_from_a_used_state_is_refused_on_the_native_engine(env, actions):
    """It gave another result: the base moved 7.7 mm, then 30.2 mm."""
    state = env.reset(0)
    env.step(state, actions[0])
    for again in (env.step, env.step_autoreset):
        with pytest.raises(StaleStateError, match=r"is stale.*fork\(state\)"):
            again(state, actions[0])
    for use in (env.reset, env.fork, copy.deepcopy, pickle.dumps, lambda s: env.save(s, "never.npz")):
        with pytest.raises(StaleStateError):
            use(state)
    assert "stale" in repr(state)


def test_copies_go_on_to_the_last_bit(env, state, actions, file):
    copies = {
        "a fork": env.fork(state),
        "a deep copy": copy.deepcopy(state),
        "a pickle": pickle.loads(pickle.dumps(state)),
        "a file": env.load(file),
    }
    for what, one in copies.items():
        assert not differing(state, one), what
    for action in actions[STEPS:]:
        state = env.step_autoreset(state, action)
        for what, one in copies.items():
            copies[what] = env.step_autoreset(one, action)
            assert not differing(state, copies[what]), what
    mask = np.array([True, False])
    state = env.reset(state, mask)
    for what, one in copies.items():
        assert not differing(state, env.reset(one, mask)), f"{what}, after a reset of one world"


def test_a_fork_shares_no_array_that_a_user_may_write_to(env, state):
    fork = env.fork(state)
    for name, array in state.obs.items():
        if isinstance(array, np.ndarray) and array.flags.writeable:
            array[:] = 7
            assert not (fork.obs[name] == 7).all()
    assert fork.batch.world.physics is not state.batch.world.physics


def test_faces_begin_new_episodes_after_a_step_that_did_not_return(env, actions, monkeypatch):
    """Ctrl-C in a notebook, between physics and observations."""
    for make in (lambda: NumpyEnv(env), lambda: gym_vector(env)):
        face = make()
        face.reset(seed=0)
        with monkeypatch.context() as patch:
            patch.setattr(env, "_evaluate", interrupted)
            with pytest.raises(KeyboardInterrupt):
                face.step(actions[0])
        with pytest.raises(StaleStateError):
            face.step(actions[0])
        _, info = face.reset()
        assert np.asarray(info["steps"]).tolist() == [0, 0]
        face.step(actions[0])


def interrupted(*_):
    raise KeyboardInterrupt


def gym_vector(env):
    face = GymVectorEnv.__new__(GymVectorEnv)
    face.env, face.state, face.num_envs = env, None, 2
    face.autoreset_mode = None
    return face


# Files.


def test_a_lost_world_is_saved_as_lost(env, actions, tmp_path):
    state = env.reset(0)
    world = state.batch.world.physics.worlds[1]
    world.data.qvel[0] = np.nan
    state = env.step(state, actions[0])
    env.save(state, tmp_path / "lost.npz")
    loaded = env.load(tmp_path / "lost.npz")
    assert np.asarray(loaded.batch.flags)[1] & int(Flag.NOT_FINITE)
    state, loaded = env.step(state, actions[1]), env.step(loaded, actions[1])
    assert not [path for path in differing(state.obs, loaded.obs)] or np.asarray(loaded.truncated)[1]
    again = env.reset(loaded, np.array([False, True]))
    assert np.asarray(again.batch.flags).tolist() == [0, 0]


def test_a_file_of_another_environment_names_the_pair_and_the_fix(env, file, tmp_path):
    header, arrays = parts_of(file)
    assert header["task"] == "CookingMeat"
    for name, value, said in (
        ("scene", "other_home", r"scene = 'other_home', here '.*make the environment in that home"),
        ("task", "SoakingTowel", r"task = 'SoakingTowel', here 'CookingMeat'"),
        ("robot", "fetch", r"robot = 'fetch', here 'humanoid' \(make it with robot="),
        ("worlds", 4, r"worlds = '4', here '2' \(make it with worlds="),
        ("layout", "other", "have changed since"),
        ("version", 0, "holds no environment state of format 1"),
        ("kind", "pool", "holds no environment state of format 1"),
    ):
        write(tmp_path / "other.npz", {**header, name: value}, arrays)
        with pytest.raises(InputError, match=said):
            env.load(tmp_path / "other.npz")


def parts_of(file):
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    return json.loads(arrays.pop("header").tobytes()), arrays


def write(file, header, arrays):
    np.savez(file, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **arrays)


@pytest.mark.parametrize(
    "damage, said",
    [
        (lambda a: a.pop("physics.snapshot.scene.qpos"), "qpos: is missing"),
        (
            lambda a: a.update({"state.reward": np.zeros(3, np.float32)}),
            r"has shape \(3,\), and \(2,\) is needed",
        ),
        (lambda a: a.update({"state.reward": np.array(["a", "b"])}), "is of type <U1, and float32 is needed"),
        (lambda a: a["physics.snapshot.scene.qpos"].__setitem__((0, 0), np.nan), "qpos: .*not finite"),
        (lambda a: a["physics.snapshot.scene.qpos"].__setitem__((0, 0), 1e30), "qpos: .*not finite"),
        (lambda a: a["physics.view.object_pos"].__setitem__((1, 0), np.inf), "object_pos: .*not finite"),
        (lambda a: a["state.reward"].__setitem__(0, np.nan), "reward: .*not finite"),
        (lambda a: a["physics.snapshot.scene.tree_asleep"].__setitem__((0, 0), 10**6), "tree_asleep: .*out of range"),
        (lambda a: a["batch.flags"].__setitem__(0, 1 << 20), "flags: .*out of range"),
        (lambda a: a["batch.episode"].__setitem__(0, -5), "episode: .*out of range"),
        (lambda a: a.update({"batch.step": np.array([0, 1 << 40])}), "step: .*out of range"),
        (lambda a: a.update({"batch.step": np.array([None, None], object)}), "step: "),
    ],
)
def test_numbers_that_no_state_has_are_refused(env, file, tmp_path, damage, said):
    header, arrays = parts_of(file)
    damage(arrays)
    write(tmp_path / "bad.npz", header, arrays)
    with pytest.raises(InputError, match=said):
        env.load(tmp_path / "bad.npz")


def test_declared_sizes_are_looked_at_before_anything_is_unpacked(env, file, tmp_path):
    """An array of 64 MiB that says that it is of two numbers, and one that says that it has 2**40."""
    header, arrays = parts_of(file)
    arrays.pop("state.reward")
    for count, body in ((2, bytes(64 << 20)), (1 << 40, b"")):
        bomb = tmp_path / f"bomb{count}.npz"
        write(bomb, header, arrays)
        with (
            zipfile.ZipFile(bomb, "a", zipfile.ZIP_DEFLATED) as archive,
            archive.open("state.reward.npy", "w") as entry,
        ):
            np.lib.format.write_array_header_1_0(entry, {"descr": "<f4", "fortran_order": False, "shape": (count,)})
            entry.write(body)
        with pytest.raises(InputError, match=rf"state\.reward: claims the shape \({count},\)"):
            env.load(bomb)


@pytest.mark.slow
def test_no_damage_raises_anything_but_an_input_error(env, file, tmp_path):
    """Mutations of 200 seeds: cuts, flipped bytes, bytes that are taken out."""
    whole, refused = file.read_bytes(), 0
    for seed in range(200):
        rng, data = random.Random(seed), bytearray(whole)
        kind = seed % 4
        if kind == 0:
            del data[rng.randrange(len(data)) :]
        elif kind == 1:
            for _ in range(rng.randint(1, 20)):
                data[rng.randrange(len(data))] = rng.randrange(256)
        elif kind == 2:
            at = rng.randrange(len(data))
            del data[at : at + rng.randint(1, 100)]
        else:  # in the list of entries at the end
            data[-rng.randint(1, 4000)] = rng.randrange(256)
        (tmp_path / "mutated.npz").write_bytes(data)
        try:
            env.load(tmp_path / "mutated.npz")
        except InputError as error:
            refused += 1
            assert "mutated.npz" in str(error) and "\n" not in str(error)
    assert refused > 120


def test_what_is_no_file_is_refused(env, tmp_path):
    for path, said in ((tmp_path / "none.npz", "no such file"), (tmp_path, "is a folder")):
        with pytest.raises(InputError, match=said):
            env.load(path)
    with pytest.raises(InputError, match="cannot be written"):
        env.save(env.reset(0), tmp_path / "nowhere" / "state.npz")


# Short reprs.


def test_reprs_fit_a_line_and_say_how_many(env, state):
    world = state.batch.world
    for thing, said in (
        (state, "EnvState(2 worlds; obs: "),
        (state.batch, "Batch(2 worlds)"),
        (world, "WorldState(2 worlds)"),
        (world.view, "PhysicsView(2 worlds, "),
        (world.view.agent, "AgentView("),
        (world.states, "ExtendedStates(2 worlds, "),
        (world.physics, "NativePhysics(2 worlds, "),
        (env.core.engine.snapshot(world.physics), "Snapshot(2 worlds, "),
        (env.core.engine.saved(world.physics), "SavedPhysics(2 worlds)"),
        (env.core.starts.pool, "Pool(4 rows)"),
    ):
        assert repr(thing).startswith(said) and len(repr(thing)) < 400, repr(thing)[:200]
    fields = [field.name for field in dataclasses.fields(state)]
    nothing = object.__new__(type(state))  # as where JAX puts its own marks in the place of arrays
    nothing.__dict__.update(dict.fromkeys(fields))
    assert repr(nothing).startswith("EnvState(")


# Engines with donated states.


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_every_promise_of_copies_is_kept_on_warp(tmp_path):
    from navigating import small

    from ig2mj.testing import Likeness, _copies

    task = small("PointNavigation", target_dist=(1.0, 4.0))
    env = ig2mj.make(task, worlds=2, engine="warp", pool_size=4)
    rng = np.random.default_rng(0)
    actions = [rng.uniform(-1, 1, (2, *env.action_space.shape)).astype(np.float32) for _ in range(2)]
    _copies(env, 0, actions, Likeness())
    with pytest.raises(EngineError, match=r"env\.fork\(state\)"):
        copy.deepcopy(env.reset(0))
    native = ig2mj.make(task, worlds=2, engine="native", pool_size=4)
    state = native.step(native.reset(3), actions[0])
    native.save(state, tmp_path / "native.npz")
    loaded = env.load(tmp_path / "native.npz")
    assert not differing(state.obs, loaded.obs)
    ours, theirs = env.step(loaded, actions[1]), native.step(state, actions[1])
    assert np.asarray(ours.info["steps"]).tolist() == [2, 2]
    pos = [np.asarray(s.batch.world.view.agent.base_pos) for s in (ours, theirs)]
    np.testing.assert_allclose(pos[0], pos[1], atol=5e-3)
    env.save(ours, tmp_path / "warp.npz")
    assert not differing(ours.obs, native.load(tmp_path / "warp.npz").obs)
