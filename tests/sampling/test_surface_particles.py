"""Dust and stains lie where they can be seen and wiped: on top of floors, on the outside of what is shut."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.engine.registry import make_engine
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.sampling.sight import Sight
from ig2mj.sampling.surface_particles import sample_places


@pytest.fixture(scope="module")
def home():
    scene = ig2mj.load_scene("small_home")
    engine = make_engine("native", scene, 1)
    return scene, engine.view(engine.reset())


def normals(home, name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Places and normals of an object's particles, in its body's frame, which is not turned."""
    scene, view = home
    places = sample_places(scene.tables, view, scene.object_index(name), np.random.default_rng(seed))
    assert places.valid.all()
    return places.pos[0], places.normal[0]


@pytest.mark.parametrize("seed", range(3))
def test_floors_are_dusty_on_top_and_not_on_their_deep_sides(home, seed):
    pos, normal = normals(home, "floors", seed)
    assert np.abs(pos[:, 2]).max() < 1e-6
    assert np.allclose(normal, [0, 0, 1])


def test_sides_of_furniture_are_dusty_too(home):
    _, normal = normals(home, "fridge_0", 0)
    assert (np.abs(normal[:, 2]) < 0.1).any()


def test_the_inside_of_a_shut_fridge_stays_clean(home):
    scene, view = home
    obj = scene.object_index("fridge_0")
    low, high = (np.asarray(corner)[0, obj] for corner in (view.aabb_low, view.aabb_high))
    places = sample_places(scene.tables, view, obj, np.random.default_rng(0))
    body = places.body[0]
    frame = matrices_on_host(np.asarray(view.body_quat)[0, body])
    pos = np.einsum("nij,nj->ni", frame, places.pos[0]) + np.asarray(view.body_pos)[0, body]
    assert np.minimum(pos - low, high - pos).min(axis=1).max() < 0.1  # all are near a side of its box
    sight = Sight(scene.tables, view, obj)
    main = int(body[0])
    own = np.linalg.inv(frame[0])
    middle = own @ ((low + high) / 2 - np.asarray(view.body_pos)[0, main])
    above = own @ (np.array([*(low + high)[:2] / 2, high[2]]) - np.asarray(view.body_pos)[0, main])
    up = own @ np.array([0.0, 0.0, 1.0])
    assert not sight.reaches(main, middle, up)
    assert sight.reaches(main, above, up)
