"""Pools: made by settling disturbed homes, saved, loaded, refused where they do not belong."""

from __future__ import annotations

import copy
import dataclasses
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj import cli
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.cluster.journal import Journal
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.errors import EngineError, InputError
from ig2mj.sampling import settled
from ig2mj.sampling.settled import make_pool
from ig2mj.sampling.settled_jobs import sample_settled
from ig2mj.worlds import Core, Rules
from ig2mj.worlds.archive import read_header, save_tree
from ig2mj.worlds.pool import FORMAT_VERSION, Pool, load_pool, save_pool


@pytest.fixture(scope="module")
def pool(tiny_home, home_model) -> Pool:
    return make_pool(tiny_home, home_model, 3, seed=5, share=0.4, threads=1)


def same(one: Pool, other: Pool) -> bool:
    return all(
        (np.asarray(a) == np.asarray(b)).all()
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    )


def test_rows_are_asleep_and_differ(pool):
    assert pool.size == 3
    assert (np.asarray(pool.physics.tree_asleep) >= 0).all()
    assert np.abs(np.asarray(pool.physics.qpos)[0] - np.asarray(pool.physics.qpos)[1]).max() > 0.01
    assert (np.asarray(pool.physics.qvel) == 0).all()


def test_the_same_seed_gives_the_same_pool(pool, tiny_home, home_model):
    again = make_pool(tiny_home, home_model, 3, seed=5, share=0.4, threads=2)
    assert same(pool, again), "whatever the number of threads"
    other = make_pool(tiny_home, home_model, 3, seed=6, share=0.4, threads=1)
    assert not same(pool, other)


def test_pieces_of_work_give_the_same_pool(pool, tiny_home, tmp_path):
    with Journal(tmp_path / "pool.npz", {}) as journal:
        found, failed = sample_settled(tiny_home, 3, seed=5, share=0.4, journal=journal)
        turns = sorted(journal.names())
    assert found is not None and not failed and same(pool, found)
    assert turns == [f"turn_{n:06d}" for n in range(len(turns))], "no more turns than it takes"
    with Journal(tmp_path / "pool.npz", {}, resume=True) as journal:
        again, _ = sample_settled(tiny_home, 3, seed=5, share=0.4, journal=journal, progress=lambda *_: pytest.fail())
    assert again is not None and same(pool, again), "of what was kept, nothing is done again"


def test_halves_stay_parked(pool, tiny_home):
    address = tiny_home.model.joint("apple_half_0/free").qposadr[0]
    assert np.asarray(pool.physics.qpos)[:, address] == pytest.approx(30.0, abs=0.05)


def test_progress_counts_the_rows(tiny_home, home_model):
    seen: list[int] = []
    make_pool(tiny_home, home_model, 2, threads=1, progress=lambda *a: seen.append(a[0]))
    assert seen == sorted(seen) and seen[-1] == 2


def test_a_home_that_never_rests_is_an_error(tiny_home, home_model, monkeypatch):
    monkeypatch.setattr(settled, "SECONDS", 0.05)
    with pytest.raises(EngineError, match="only 0 came to rest"):
        make_pool(tiny_home, home_model, 1, share=1.0, threads=1)
    with pytest.raises(EngineError, match="only 0 came to rest"):
        sample_settled(tiny_home, 1, share=1.0)


def test_a_pool_survives_its_file(pool, tiny_home, tmp_path):
    file = tmp_path / "pool.npz"
    save_pool(pool, file, tiny_home, {"seed": 5})
    assert same(load_pool(file, tiny_home), pool) and same(load_pool(file), pool)
    header = read_header(file)
    assert header["seed"] == 5 and header["scene"] == "tiny_home"
    assert [f.name for f in tmp_path.iterdir()] == ["pool.npz"], "no leftovers"


def test_a_pool_of_another_scene_is_refused_whatever_its_shape(pool, tiny_home, home_model, tmp_path):
    file = tmp_path / "pool.npz"
    save_pool(pool, file, tiny_home)
    assert pool.digest == load_pool(file).digest == pool.rows(np.array([1])).digest == tiny_home.digest
    engine = NativeEngine(tiny_home, 1)
    Core(engine, Rules(home_model), pool)
    with pytest.raises(EngineError, match="not of scene 'tiny_home' with its objects as they are now"):
        Core(engine, Rules(home_model), dataclasses.replace(pool, digest="of another scene"))


def test_rows_are_picked_in_order(pool):
    rows = pool.rows(np.array([2, 0]))
    np.testing.assert_array_equal(rows.physics.qpos, np.asarray(pool.physics.qpos)[[2, 0]], "on the host, unrounded")
    rows = pool.rows(jnp.array([2, 0]))
    np.testing.assert_array_equal(rows.physics.qpos, np.asarray(pool.physics.qpos, np.float32)[[2, 0]])


def test_a_pool_of_the_bare_scene_serves_the_scene_with_a_hand(pool, tiny_home, tiny_home_folder, home_model, tmp_path):
    file = tmp_path / "pool.npz"
    save_pool(pool, file, tiny_home)
    with_hand = ig2mj.load_scene(tiny_home_folder, agents=[FloatingHand(pos=(0, 0, 2))])
    engine = NativeEngine(with_hand, 2)
    rows = load_pool(file, with_hand).rows(np.array([1, 0]))
    physics = engine.load(engine.reset(), rows.physics)
    held = engine.snapshot(physics)
    np.testing.assert_allclose(held.scene.qpos, np.asarray(pool.physics.scene.qpos)[[1, 0]], atol=1e-6)
    assert engine.view(physics).agent.base_pos[:, 0] == pytest.approx(np.array([[0, 0, 2]] * 2))


def broken(pool: Pool, file, kind: str, scene: ig2mj.Scene) -> str:
    """Makes a broken file; returns what the error says of it."""
    save_pool(pool, file, scene)
    data = file.read_bytes()
    if kind == "absent":
        file.unlink()
        return "there is no such file"
    if kind == "text":
        file.write_text("pool")
        return "is not an npz archive"
    if kind == "cut":
        file.write_bytes(data[: len(data) // 2])
        return "is not an npz archive"
    if kind == "damaged":
        file.write_bytes(bytes(b ^ 0x55 if 400 < k < 900 else b for k, b in enumerate(data)))
        return "damaged"
    if kind == "array":
        with file.open("wb") as out:
            np.save(out, np.zeros(3))
        return "is not an npz archive"
    if kind == "foreign":
        np.savez(file, a=np.zeros(3))
        return "is not an archive of this project"
    if kind == "version":
        save_tree(file, pool, {"kind": "pool", "format_version": 99, "scene": "tiny_home"})
        return "is not a pool of format"
    if kind == "dump":
        save_tree(file, pool, {"kind": "dump", "format_version": 1, "scene": "tiny_home"})
        return "is not a pool of format"
    if kind == "scene":
        manifest = copy.copy(scene.manifest)
        manifest.name = "palace"
        tables = dataclasses.replace(scene.tables, object_names=(*scene.object_names[:-1], "vase"))
        save_pool(pool, file, dataclasses.replace(scene, manifest=manifest, tables=tables))
        return "is a pool of scene 'palace', not of 'tiny_home'"
    if kind == "digest":
        tables = dataclasses.replace(scene.tables, object_names=(*scene.object_names[:-1], "vase"))
        save_pool(pool, file, dataclasses.replace(scene, tables=tables))
        return "was made with another version of the physics of 'tiny_home'"
    if kind == "lengths":
        short = jax.tree.map(lambda a: np.asarray(a)[:-1], pool.states)
        save_pool(dataclasses.replace(pool, states=short), file, scene)
        return "has arrays of different lengths"
    if kind == "absence":
        header = {"kind": "pool", "format_version": FORMAT_VERSION, "scene": scene.name, "digest": scene.digest}
        save_tree(file, {"physics": pool.physics}, header)
        return "is missing"
    assert kind == "empty"
    save_pool(jax.tree.map(lambda a: np.asarray(a)[:0], pool), file, scene)
    return "has no rows"


@pytest.mark.parametrize(
    "kind",
    [
        "absent",
        "text",
        "cut",
        "damaged",
        "array",
        "foreign",
        "version",
        "dump",
        "scene",
        "digest",
        "lengths",
        "absence",
        "empty",
    ],
)
def test_a_file_that_is_no_pool_of_the_scene_is_named(pool, tiny_home, tmp_path, kind):
    file = tmp_path / "pool.npz"
    says = broken(pool, file, kind, tiny_home)
    with pytest.raises(InputError) as caught:
        load_pool(file, tiny_home)
    assert says in str(caught.value) and str(file) in str(caught.value) and "\n" not in str(caught.value)


def test_the_command_makes_a_pool(tiny_home_folder, tiny_home, pool, tmp_path, capsys):
    file = tmp_path / "some.npz"
    options = ["--disturb", "--count", "2", "--out", str(file), "--seed", "3"]
    assert cli.call(["sample", str(tiny_home_folder), *options]) == 0
    assert "2 settled states of tiny_home" in capsys.readouterr().out
    assert load_pool(file, tiny_home).size == 2


@pytest.mark.parametrize(("options", "says"), [(["--count", "0"], "at least one row"), (["--share", "1.5"], "between")])
def test_the_command_refuses_senseless_numbers(tiny_home_folder, capsys, options, says):
    assert cli.call(["sample", str(tiny_home_folder), "--disturb", *options]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("physics.scene.qpos", lambda a: np.full_like(a, np.nan), "holds numbers that are not finite"),
        ("physics.time", lambda a: np.full_like(a, np.inf), "holds numbers that are not finite"),
        ("states.temperature", lambda a: np.full_like(a, np.nan), "holds numbers that are not finite"),
        ("states.max_temperature", lambda a: np.full_like(a, np.inf), "holds numbers that are not finite"),
        ("physics.scene.qpos", lambda a: a.astype(str), "is of type <U"),
        ("physics.scene.qpos", lambda a: a[:, :-1], "has shape"),
        ("physics.scene.touching", lambda a: a[:, :-1], "has shape"),
        ("states.temperature", lambda a: a[:, :-1], "has shape"),
        ("states.dust.body", lambda a: np.full_like(a, 10**6), "names number 1000000 of"),
        ("physics.scene.tree_asleep", lambda a: np.full_like(a, 10**6), "names number 1000000 of"),
        ("states.toggled_on", lambda a: a.astype(np.float64), "is of type float64"),
    ],
)
def test_arrays_that_no_world_can_start_with_are_refused(pool, tiny_home, tmp_path, name, change, says):
    file = tmp_path / "pool.npz"
    save_pool(pool, file, tiny_home)
    with np.load(file) as archive:
        arrays = dict(archive)
    np.savez(file, **(arrays | {name: change(arrays[name])}))
    with pytest.raises(InputError, match=f"{re.escape(name)}: {says}"):
        load_pool(file, tiny_home)
