"""What `api_test` takes for the same and what it does not, where steps do not come out the same to the bit."""

from __future__ import annotations

import numpy as np
import pytest
from navigating import small

import ig2mj
from ig2mj.sensors.base import SensorOptions
from ig2mj.testing import Likeness, _host, _same

WITHIN = Likeness(1e-3)


def _seen(rays: int = 400, **changes: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    rng = np.random.default_rng(0)
    lidar = rng.uniform(1, 9, (3, rays, 3)).astype(np.float32)
    obs = {"lidar": lidar, "ins_seg": np.ones((3, 20, 20, 1), np.int32), "task_obs": np.ones((3, 4), np.float32)}
    return {"obs": obs | changes, "info": {"steps": np.arange(3)}}


def _jumped(rays: int, count: int, world: int = 1) -> np.ndarray:
    lidar = _seen(rays)["obs"]["lidar"].copy()
    lidar[world, :count] += 2.0
    return lidar


def test_some_rays_of_a_world_may_jump_and_no_more():
    _same(_seen(), _seen(lidar=_jumped(400, 4)), "a hundredth", WITHIN)
    _same(_seen(30), _seen(30, lidar=_jumped(30, 1)), "one of few", WITHIN)
    for rays, count in ((400, 5), (30, 2)):
        with pytest.raises(AssertionError, match=r"\['obs'\]\['lidar'\] differs"):
            _same(_seen(rays), _seen(rays, lidar=_jumped(rays, count)), "more", WITHIN)
    with pytest.raises(AssertionError, match="lidar"):
        _same(_seen(), _seen(lidar=_jumped(400, 1)), "to the bit", Likeness())


def test_of_a_picture_of_numbers_a_hundredth_of_the_pixels_may_be_another_object():
    picture = np.ones((3, 20, 20, 1), np.int32)
    picture[2, 0, :4] = 7
    _same(_seen(), _seen(ins_seg=picture), "an edge", WITHIN)
    picture[2, 1, 0] = 7
    with pytest.raises(AssertionError, match="ins_seg"):
        _same(_seen(), _seen(ins_seg=picture), "an object", WITHIN)


def test_nothing_else_may_jump():
    other = np.ones((3, 4), np.float32)
    other[0, 0] += 0.01
    with pytest.raises(AssertionError, match="task_obs"):
        _same(_seen(), _seen(task_obs=other), "one number", WITHIN)


def test_no_more_worlds_than_are_said_to_may_go_astray():
    other = np.ones((3, 4), np.float32)
    other[0] = 5.0
    jumped = _jumped(400, 400, world=0)
    _same(_seen(), _seen(task_obs=other, lidar=jumped), "one of three", Likeness(1e-3, 0.34))
    for like in (Likeness(1e-3, 0.33), Likeness(0.0, 0.34)):
        with pytest.raises(AssertionError, match=r"lidar.*task_obs.* differs in 1 of 3 worlds"):
            _same(_seen(), _seen(task_obs=other, lidar=jumped), "one of three", like)
    with pytest.raises(AssertionError, match="differs in 2 of 3 worlds"):
        _same(_seen(), _seen(task_obs=other, lidar=_jumped(400, 400)), "two of three", Likeness(1e-3, 0.34))


@pytest.mark.slow
def test_other_worlds_are_told_apart_by_their_rays_alone():
    """Another seed, and a robot that was given half a step more."""
    task = small("PointNavigation", target_dist=(1.0, 4.0))
    names, sensors = ("scan", "lidar"), SensorOptions(scan_rays=61, lidar_columns=20)
    env = ig2mj.make(task, worlds=2, engine="native", pool_size=4, observations=names, sensors=sensors)
    ahead = np.full((2, 2), (1.0, 0.0), np.float32)
    seen = {what: _host(env.step(env.reset(seed), share * ahead))["obs"] for what, seed, share in (
        ("here", 1, 1.0), ("again", 1, 1.0), ("seed", 2, 1.0), ("slower", 1, 0.5)
    )}  # fmt: skip
    _same(seen["here"], seen["again"], "the same", WITHIN)
    for what in ("seed", "slower"):
        for name in names:
            with pytest.raises(AssertionError, match=name):
                _same({name: seen["here"][name]}, {name: seen[what][name]}, what, WITHIN)
