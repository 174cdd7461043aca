"""`SceneQuery` and `Probe`: rays, hypothetical poses, boxes put anywhere, many worlds stepped until they sleep."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.sampling.query import SceneQuery, settle_worlds
from ig2mj.scene.scene import load_scene


@pytest.fixture(scope="module")
def query():
    found = SceneQuery(load_scene("small_home"))
    assert found.settle(10.0)
    return found


def test_rays_meet_the_table_from_above_and_nothing_from_the_sky(query):
    table = query.scene.object_index("breakfast_table_0")
    low, high = query.box(table)
    origin = np.array([*(low + high)[:2] / 2, high[2] + 3.0])
    distance, hit = query.rays(origin, np.array([[0.0, 0.0, -2.0], [0.0, 0.0, 1.0]]))
    assert distance[1] == np.inf and hit[1] == -1
    assert hit[0] >= 0 and distance[0] <= 3.0 + 1e-6
    assert query.scene.object_names[hit[0]] != "floors"


def test_a_probe_touches_what_is_there_and_passes_through_what_is_ignored(query):
    tables = query.scene.tables
    table = query.scene.object_index("breakfast_table_0")
    low, high = query.box(table)
    probe = query.probe(np.array([0.02, 0.02, 0.02]))
    top = np.array([*(low + high)[:2] / 2, high[2] - 0.01])
    assert probe.touches(top)
    assert not probe.touches(np.array([0.0, 0.0, 30.0]))
    assert not probe.touches(top, np.ones(tables.num_objects, bool))
    assert probe.touches(top, np.arange(tables.num_objects) != table)
    distance, hit = probe.rays(np.array([0.0, 0.0, 30.0]), np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]))
    assert hit[0] >= 0 and np.isfinite(distance[0]) and hit[1] == -1


def test_many_worlds_are_stepped_until_they_sleep(query):
    engine = NativeEngine(query.scene, 3, threads=1)
    _, asleep = settle_worlds(engine, engine.reset(), 10.0)
    assert asleep.shape == (3,) and asleep.all()
    _, asleep = settle_worlds(engine, engine.reset(), 0.05)
    assert not asleep.any(), "a start is awake, and comes to rest later than that"
