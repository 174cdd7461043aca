"""Start states that are mixed from others (`ig2mj.tasks.mixing`)."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.errors import EngineError
from ig2mj.tasks import mixing
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.pools import bare_scene, pool_of

NAMES = ["apple_0", "carving_knife_0"]


@pytest.mark.slow
def test_objects_lie_where_they_do_in_one_state_turned_as_in_another():
    task = ACTIVITIES["SlicingFruit"]
    env = ig2mj.make("SlicingFruit", "humanoid", 2, "native", pool_size=4, augment_starts=200)
    mixed, pool, scene = env.core.starts.pool, pool_of(task, "train", 4), bare_scene(task)
    assert isinstance(mixed, mixing.MixedPool) and mixed.size == 200
    own, rows = (np.asarray(p.physics.scene.qpos) for p in (pool, mixed.rows(np.arange(200))))
    assert np.array_equal(rows[:4], own)
    columns = list(mixed.columns)
    rest = np.setdiff1d(np.arange(own.shape[1]), columns)
    assert np.array_equal(rows[:, rest], np.repeat(own[:1, rest], 200, axis=0))
    new = rows[4:, columns].reshape(196, 2, 7)
    assert len(np.unique(new[:, 1], axis=0)) > 8, "of four knives"
    for k, name in enumerate(NAMES):
        poses = own[:, columns].reshape(4, 2, 7)[:, k]
        mass = scene.model.body_ipos[scene.tables.object_root[scene.object_index(name)]]
        places = poses[:, :3] + mixing.matrices_on_host(poses[:, 3:]) @ mass
        found = new[:, k, :3] + mixing.matrices_on_host(new[:, k, 3:]) @ mass
        near = np.linalg.norm(found[:, None, :2] - places[None, :, :2], axis=-1).min(1)
        assert near.max() < 1e-6
        assert (new[:, k, None, 2:] == poses[None, :, 2:]).all(-1).any(1).all(), "height and turn"
    state = env.start_from(np.array([150, 199]), 0)
    knife = np.asarray(state.batch.world.view.object_pos)[:, scene.object_index("carving_knife_0")]
    assert np.allclose(knife, rows[[150, 199]][:, columns[7:10]], atol=1e-6)
    assert env.config.augment_starts == 200 and env.config.pool_size == 4


def test_boxes_meet_seen_from_above():
    def box(x, y, yaw):
        c, s = np.cos(yaw), np.sin(yaw)
        return np.array([[x, y, 0.0]]), np.array([[[c, -s, 0], [s, c, 0], [0, 0, 1]]]), np.array([0.2, 0.02, 0.02])

    still = box(0, 0, 0)
    assert mixing._meet(still, box(0.3, 0, 0)).all() and not mixing._meet(still, box(0.3, 0.05, 0)).any()
    assert mixing._meet(still, box(0.1, 0.2, np.pi / 2)).all(), "the end of one at the side of the other"
    assert not mixing._meet(still, box(0.1, 0.23, np.pi / 2)).any()
    assert not mixing._meet(box(0, 0, np.pi / 4), box(0.1, 0, np.pi / 4)).any(), "side by side, though neither is level"


def test_only_what_lies_on_one_thing_is_mixed():
    for name in ("CookingMeat", "PointNavigation"):
        with pytest.raises(EngineError, match="augment"):
            ig2mj.make(name, worlds=1, engine="native", pool_size=1, augment_starts=8)
