"""Laser scan, lidar and occupancy grid against MuJoCo's rays."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from perceiving import Perceiving, matrix

from ig2mj.agents.fetch import Fetch
from ig2mj.agents.humanoid import Humanoid
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.geometry.poses import quat_rotate
from ig2mj.sensors.images import RayPattern
from ig2mj.sensors.ray_cameras import sectors_of

GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)


@pytest.fixture(scope="module")
def turtlebot(tiny_home_folder):
    return Perceiving(tiny_home_folder, TurtleBot(pos=(0, -1.2, 0), quat=(0.7071068, 0, 0, 0.7071068)))


def cast(world, origin, direction, exclude=-1):
    model, data = world.engine.to_mujoco(world.physics, 0)
    geom = np.zeros(1, np.int32)
    far = mujoco.mj_ray(model, data, np.asarray(origin, float), np.asarray(direction, float), GROUPS, 1, exclude, geom)
    return far, int(geom[0])


def test_the_scan_is_mujocos_rays(turtlebot):
    """From minus half the angle on to the left; the share of the way from nearest to farthest range."""
    scan = turtlebot.see("scan", scan_rays=24, scan_angle=240, scan_far=3.0, scan_near=0.05)["scan"][0, :, 0]
    base = matrix((0.7071068, 0, 0, 0.7071068))
    origin = np.array([0, -1.2, 0]) + base @ (0.16, 0, 0.36)
    for k, share in enumerate(scan):
        angle = np.deg2rad(-120 + 10 * k)
        far, _ = cast(turtlebot, origin, base @ (np.cos(angle), np.sin(angle), 0))
        expected = 1.0 if far < 0 or far > 3 else (far - 0.05) / 2.95
        assert share == pytest.approx(expected, abs=1e-4)
    assert 0 < (scan < 1).sum() < 24


@pytest.mark.parametrize(
    ("robot", "angle"),
    [(TurtleBot(pos=(0, -1.2, 0)), 240), (Fetch(pos=(0, -1.2, 0)), 220), (Humanoid(pos=(0, -1.2, 0.55)), 180)],
)
def test_nothing_of_the_robot_stands_in_its_own_scan(tiny_home_folder, robot, angle):
    world = Perceiving(tiny_home_folder, robot)
    laser = world.scene.manifest.agents[0].laser
    origin = np.asarray(world.engine.view(world.physics).agent.base_pos)[0, 0] + laser
    own = np.flatnonzero(world.scene.tables.body_agent[world.scene.model.geom_bodyid] == 0)
    for direction in np.deg2rad(np.linspace(-angle / 2, angle / 2, 121)):
        _, geom = cast(world, origin, (np.cos(direction), np.sin(direction), 0))
        assert geom not in own, f"{world.scene.model.geom(geom).name} at {np.rad2deg(direction):.0f} degrees"


def test_the_lidar_is_mujocos_rays_beyond_its_nearest_range(tiny_home_folder):
    """The humanoid's own head fills what is behind its eye, nearer than that."""
    world = Perceiving(tiny_home_folder, Humanoid(pos=(0, -1.2, 0.55)))
    points = world.see("lidar", lidar_columns=6, lidar_beams=5)["lidar"][0].astype(float)
    pos, axes = world.eye()
    elevation = np.deg2rad(np.linspace(-15, 15, 5)).repeat(24)
    azimuth = np.tile(np.deg2rad(-45 + 15 * np.arange(24)), 5)
    hits = 0
    for point, up, left in zip(points, elevation, azimuth, strict=True):
        direction = np.array([-np.cos(up) * np.sin(left), np.cos(up) * np.cos(left), np.sin(up)])
        world_direction = axes @ (direction[0], direction[2], -direction[1])
        far, _ = cast(world, pos + 0.25 * world_direction, world_direction)
        expected = np.zeros(3) if far < 0 else direction * (0.25 + far)
        np.testing.assert_allclose(point, expected, atol=1e-4)
        hits += far >= 0
    assert 20 < hits < len(points)
    assert np.linalg.norm(points[points.any(1)], axis=1).min() >= 0.25


@given(st.lists(st.tuples(st.floats(-180, 180), st.floats(-44, 44)), min_size=1, max_size=30))
def test_sectors_have_every_ray_once_and_ahead_of_their_cameras(angles):
    at, up = np.deg2rad(np.array(angles)).T
    directions = np.stack([np.cos(up) * np.cos(at), np.cos(up) * np.sin(at), np.sin(up)], axis=-1)
    sectors = sectors_of([RayPattern("all", directions, 0.1, 5.0)])
    rays = np.concatenate([s.rays for s in sectors])
    assert sorted(rays.tolist()) == list(range(len(directions)))
    for sector in sectors:
        turned = np.asarray(quat_rotate(np.tile(sector.turn, (len(sector.rays), 1)), sector.directions))
        np.testing.assert_allclose(turned, directions[sector.rays], atol=1e-6)
        assert (-sector.directions[:, 2] > 0.5).all()
        depth = 2.0 * -sector.directions[None, :, 2].astype(np.float32)
        np.testing.assert_allclose(np.asarray(sector.distances(depth)), 2.1, rtol=1e-5)
        assert np.isinf(np.asarray(sector.distances(np.zeros_like(depth)))).all()


def test_the_occupancy_grid_is_the_scan_seen_from_above(turtlebot):
    """Free before the hit, an obstacle at it, unknown behind it and behind the robot; free under the robot."""
    options = {"scan_rays": 181, "scan_angle": 180.0, "scan_far": 4.0, "grid_size": 100, "grid_range": 5.0}
    seen = turtlebot.see("occupancy_grid", "scan", **options)
    grid, scan = seen["occupancy_grid"][0, ..., 0], seen["scan"][0, :, 0]
    assert set(np.unique(grid)) == {0.0, 0.5, 1.0}

    def at(x, y):
        return grid[int(50 - y * 20), int(50 + x * 20)]

    found = []
    for k in range(5, 176, 10):
        angle = np.deg2rad(-90 + k * 180 / 181)
        distance = 0.05 + scan[k] * 3.95
        end = np.array([0.16, 0]) + distance * np.array([np.cos(angle), np.sin(angle)])
        near = np.array([0.16, 0]) + 0.6 * distance * np.array([np.cos(angle), np.sin(angle)])
        if scan[k] < 1 and np.abs(end).max() < 2.4 and distance > 0.5:
            assert at(*near) == 1.0
            cells = [at(*(end + 0.05 * np.array(d))) for d in ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1))]
            found.append(0.0 in cells)
    assert len(found) > 3 and np.mean(found) > 0.7, "all but ends that rays beside them pass"
    assert at(0, 0) == 1.0 and at(-0.25, 0) == 1.0
    assert at(-1.0, 0) == 0.5
