"""Starts of activities: which conditions are sampled, and rows in which they hold."""

from __future__ import annotations

import dataclasses
import types

import numpy as np
import pytest

from ig2mj.errors import InputError
from ig2mj.sampling.many import make_sampler
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder
from ig2mj.tasks.bddl import start
from ig2mj.tasks.bddl.binding import bind
from ig2mj.tasks.bddl.definitions import load_activity
from ig2mj.tasks.bddl.start import load_bound, row_status, sample_start, start_conditions
from ig2mj.worlds import load_pool, load_pool_scene, save_pool


def bound_in(home: str, name: str):
    return bind(load_activity(name), load_manifest(scene_folder(home)))


def test_a_fixed_car_plays_the_one_on_the_garages_floor_and_is_not_placed():
    binding = bound_in("juniper", "cleaning_a_car")
    assert binding.objects["car.n.01_1"] == "car_0" and "car/car_00" not in binding.additions
    said = [str(c) for c in start_conditions(binding, load_bound(binding))]
    assert "(dusty car_0)" in said and not any("on_floor car_0" in c for c in said)


def test_what_lies_on_something_is_loose():
    binding = bound_in("willow", "cleaning_bedroom")
    assert binding.objects["painting.n.01_1"] in binding.added, "those of the home hang on its walls"


@pytest.fixture(scope="module")
def sampled():
    binding = bound_in("small_home", "cleaning_windows")
    scene = load_bound(binding)
    return binding, scene, sample_start(binding, scene, 2, seed=4)


def test_every_condition_holds_in_every_row_and_the_goal_in_none(sampled):
    binding, scene, done = sampled
    assert done.sampled.complete and done.reached == ()
    status = row_status(binding, scene, done.sampled.pool, 1)
    assert not status.holds and "window 1 is not dusty" in status.missing and "dust particles" in status.explanation
    sampler = make_sampler(scene)
    states = done.sampled.pool.rows(np.array([1])).states
    sampler.query.load(_physics(done.sampled.pool, 1))
    assert sampler.holds(start_conditions(binding, scene), states)


def _physics(pool, row: int):
    import jax

    return jax.tree.map(lambda a: np.asarray(a[row]), pool.physics)


def test_the_scene_of_a_pool_is_built_again_with_its_additions(sampled, tmp_path):
    _, scene, done = sampled
    file = tmp_path / "pool.npz"
    save_pool(done.sampled.pool, file, scene)
    again = load_pool_scene(file)
    assert again.additions == scene.additions and again.additions and again.digest == scene.digest
    assert load_pool(file, again).size == 2
    others = dataclasses.replace(
        scene, additions=tuple(dataclasses.replace(a, sha256="another") for a in scene.additions)
    )
    save_pool(done.sampled.pool, file, others)
    assert load_pool_scene(file).digest == scene.digest, "it looks different, and its physics is the same"
    others.__dict__["digest"] = "another"
    save_pool(done.sampled.pool, file, others)
    with pytest.raises(InputError, match="was made with another"):
        load_pool_scene(file)


def test_homes_are_tried_until_a_start_can_be_sampled_in_one(monkeypatch):
    """What is added may find no room in the home to which least is added."""
    small, large = bound_in("small_home", "cleaning_windows"), bound_in("juniper", "cleaning_windows")
    scene, tried = load_bound(small), []

    def sampled(binding, *_, **__):
        tried.append(binding.home)
        return types.SimpleNamespace(sampled=types.SimpleNamespace(complete=binding is large))

    monkeypatch.setattr(start, "load_bound", lambda binding, home: scene)
    monkeypatch.setattr(start, "sample_start", sampled)
    assert start.first_that_works([small, large])[0] is large and tried == ["small_home", "juniper"]
    assert start.first_that_works([small, small])[0] is small, "where none works, the first"
    tried.clear()
    assert start.first_that_works([small])[0] is small and not tried, "the only one is taken as it is"
