"""A knife is held with the edge of its blade down, however it was taken."""

import numpy as np
import pytest

from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.domain import Domain
from ig2mj.planning.holding import Hold
from ig2mj.planning.treatments import PARTS_OF_BLADE, _edge_down, _part_of_blade, _tip_first
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.scene import load_scene
from ig2mj.scene.tables import LinkKind
from ig2mj.worlds.rules import Rules


@pytest.fixture(scope="module")
def query():
    return SceneQuery(load_scene("small_home"))


class _World:
    """One world of a query: a robot is not needed to turn a knife."""

    world = 0

    def __init__(self, query: SceneQuery):
        self.view, self.domain = query.view, Domain(Rules.of_scene(query.scene).model, 2)

    def grip(self, hand):
        return self.com("carving_knife_0") if self.at is None else self.at

    at = None

    def com(self, name):
        return np.asarray(self.view.object_com)[0, self.domain.index(name)].astype(float)


@pytest.mark.parametrize("seed", range(4))
def test_a_knife_that_was_taken_anyhow_is_turned_until_its_edge_is_below_it(query, seed):
    quat = np.random.default_rng(seed).normal(size=4)
    knife = query.scene.object_index("carving_knife_0")
    query.place(knife, np.array([0.0, 0.0, 3.0]), quat / np.linalg.norm(quat))
    tables = query.scene.tables
    link = int(np.flatnonzero((tables.link_object == knife) & (tables.link_kind == LinkKind.SLICER))[0])
    turn = _edge_down(_World(query), "carving_knife_0", link)
    assert turn is not None
    blade = turn @ matrices_on_host(np.asarray(query.view.link_quat)[0, link].astype(float)[None])[0]
    offset = turn @ (np.asarray(query.view.link_pos)[0, link] - np.asarray(query.view.object_com)[0, knife])
    along = blade[:, int(np.argmax(tables.link_half[link]))]
    assert abs(along[2]) < 1e-6 and offset[2] < -0.01
    across = offset - (offset @ along) * along
    assert np.allclose(across / np.linalg.norm(across), (0.0, 0.0, -1.0), atol=1e-6)


def test_parts_of_a_blade_lie_on_it_farther_from_the_hand_one_after_another(query):
    knife, tables = query.scene.object_index("carving_knife_0"), query.scene.tables
    query.place(knife, np.array([0.0, 0.0, 3.0]), np.array([0.8, 0.0, 0.6, 0.0]))
    world = _World(query)
    link = int(np.flatnonzero((tables.link_object == knife) & (tables.link_kind == LinkKind.SLICER))[0])
    middle = np.asarray(query.view.link_pos)[0, link].astype(float)
    blade = matrices_on_host(np.asarray(query.view.link_quat)[0, link].astype(float)[None])[0]
    for world.at in (middle + 0.2 * blade[:, int(np.argmax(tables.link_half[link]))] * side for side in (1.0, -1.0)):
        parts = [_part_of_blade(world, 0, link, part) for part in range(len(PARTS_OF_BLADE))]
        assert np.allclose(parts[0], middle)
        assert all((np.abs((part - middle) @ blade) <= tables.link_half[link] + 1e-6).all() for part in parts)
        apart = [float(np.linalg.norm(part - world.at)) for part in parts]
        assert apart == sorted(apart) and apart[-1] > apart[0] + 0.01


def test_the_end_of_a_blade_comes_first_where_the_hand_is_in_the_way():
    count = len(PARTS_OF_BLADE)
    holds = [Hold(np.zeros(3), np.zeros(3), np.eye(3), number) for number in range(2 * count)]
    parts = [hold.number % count for hold in _tip_first(lambda: holds)]
    assert parts == sorted(parts, reverse=True)
